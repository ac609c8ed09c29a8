// The live page: one stream of status documents, and the history for the chart. Shows nothing it was not told.
import { Chart } from "./chart.js";
import { bytes, clock, current, dateTime, duration, number, own, setLanguage, text } from "./words.js";

const TILES = ["spindle_speed_rpm", "feed_mm_min", "spindle_power_w", "cutting_power_w", "no_load_power_w",
  "feed_override_pct", "total_power_w", "bearing_temperature_c"];
const JOB = ["program", "operation", "tool", "part"];
const CONDITIONS = { running: "good", waiting: "warn", reverted: "bad", suspended: "bad", refused: "bad" };
const RANGES = [[2, "min"], [10, "min"], [60, "min"], [8, "h"]];

const at = (id) => document.getElementById(id);
const chart = new Chart(at("plot"), at("hover"));
const trail = [];
let vocabulary = null;
let status = null;
let minutes = Number(localStorage.getItem("minutes")) || 10;
let past = { lines: {}, states: [], from: 0, until: 0 };

function make(tag, className, content) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (content !== undefined) element.textContent = content;
  return element;
}

function row(what, num, more, { dot, bad } = {}) {
  const line = make("div", "row");
  line.append(make("span", `what${dot ? ` dot ${dot}` : ""}`, what), make("span", "num", num ?? ""));
  if (more) line.append(make("span", `more${bad ? " bad-text" : ""}`, more));
  return line;
}

/** The short name on a tile; the full one is its tooltip. */
const brief = (quantity) => (text(quantity) === quantity ? name(quantity) : text(quantity));
const name = (quantity) => own(vocabulary?.quantities[quantity]) || quantity;
const reason = (word) => own(vocabulary?.absences[word]) || word;
const stateName = (word) => own(vocabulary?.states[word]) || word;

/** A channel or an estimate by its name. */
function quantity(wanted) {
  return status.channels.find((c) => c.name === wanted) ?? status.estimates.find((e) => e.name === wanted);
}

function tile(wanted) {
  const found = quantity(wanted);
  if (!found) return null;
  const estimated = !status.channels.includes(found);
  const box = make("div", `tile${estimated ? " estimate" : ""}${found.missing ? " missing" : ""}`);
  box.dataset.quantity = wanted;
  const title = make("span", "name", brief(wanted));
  title.title = name(wanted);
  const value = make("span", "value", found.missing ? reason(found.missing) : number(found.value));
  if (!found.missing) {
    value.dataset.value = found.value;
    value.append(make("small", "", found.unit === "1" ? "" : found.unit));
  }
  const note = make("span", "note", noteOf(found, estimated));
  note.title = found.why ?? note.textContent;
  box.append(title, value, note);
  return box;
}

function noteOf(found, estimated) {
  if (found.missing) return estimated && found.why !== reason(found.missing) ? found.why : "";
  if (estimated) return `± ${number(found.uncertainty)} ${found.unit} · ${text("estimate")}`;
  return `${text("age")} ${found.age_s < 10 ? found.age_s.toFixed(2) : Math.round(found.age_s)} s`;
}

function showNow() {
  document.body.dataset.state = status.state.word;
  at("state").textContent = stateName(status.state.word);
  at("state").dataset.word = status.state.word;
  const why = status.state.why ? ` · ${status.state.why}` : "";
  at("state-for").textContent = `${text("for")} ${duration(status.state.seconds)}${why}`;
  const job = JOB.map((key) => [key, quantity(key)]).filter(([, found]) => found && !found.missing && found.value !== "");
  at("job").replaceChildren(...job.flatMap(([key, found]) => [make("dt", "", text(key)), make("dd", "", found.value)]));
  at("tiles").replaceChildren(...TILES.map(tile).filter(Boolean));
  at("clock").textContent = dateTime(status.at_ms);
  at("clock").dataset.ms = status.at_ms;
  at("machine").textContent = status.machine;
  document.title = `${stateName(status.state.word)} · ${status.machine}`;
}

function showBadges() {
  const badges = [];
  if (status.simulated) badges.push(make("span", "badge", text("simulated")));
  if (status.speed !== 1) badges.push(make("span", "badge", status.speed ? `${status.speed} ${text("times")}` : text("maxSpeed")));
  badges.push(make("span", `badge${status.gate.mode === "armed" ? " warn" : ""}`, text(status.gate.mode)));
  for (const problem of status.problems) {
    const badge = make("span", "badge warn", problem.what);
    badge.title = problem.next;
    badges.push(badge);
  }
  at("badges").replaceChildren(...badges);
}

function filled(id, rows, empty) {
  at(id).replaceChildren(...(rows.length ? rows : [make("p", "empty", empty)]));
}

function showCards() {
  filled("alarms", status.alarms.map((alarm) =>
    row(alarm.text, `${text("since")} ${clock(alarm.since_ms)}`, alarm.code, { dot: alarm.severity === "critical" ? "bad" : "warn" })), text("noAlarm"));
  const gate = status.gate;
  const percent = (value) => (value === null ? text("nothing") : `${value} %`);
  const gateRows = [row(text("wanted"), percent(gate.wanted_pct), gate.reason), row(text("permitted"), percent(gate.permitted_pct), gate.held),
    row(text("written"), percent(gate.written_pct), text(gate.mode))];
  for (const axis of gate.offset?.axes ?? []) {
    const proposed = axis.wanted_um === null ? text("noProposal") : `${text("proposed")} ${number(axis.wanted_um)} µm`;
    gateRows.push(row(`${text("offset")} ${axis.axis.toUpperCase()}`, `${number(axis.shift_um)} µm`, `${proposed} · ${text(gate.offset.mode)}`));
  }
  if (gate.armed_by) gateRows.push(row(text("armedBy"), gate.armed_by, `${text("until")} ${clock(gate.armed_until_ms)}`));
  if (gate.recent.length > 0) gateRows.push(recent(gate.recent));
  filled("gate", gateRows, "");
  filled("sources", status.sources.map((source) => {
    const figures = [`${source.readings.toLocaleString()} ${text("readings")}`];
    if (source.jitter_p99_ms !== null) figures.push(`${text("jitter")} ${number(source.jitter_p99_ms)} ms`);
    if (source.round_trip_p50_ms !== null) figures.push(`${text("trip")} ${number(source.round_trip_p50_ms)} ms`);
    if (source.failures) figures.push(`${source.failures} ${text("failures")}`);
    const line = row(source.name, `${text("period")} ${number(source.period_s)} s`, source.error ?? figures.join(" · "), { dot: source.error ? "bad" : "good", bad: Boolean(source.error) });
    line.title = (source.facts ?? []).map((fact) => `${fact.name}: ${typeof fact.value === "number" ? number(fact.value) : fact.value}`).join("\n");
    return line;
  }).concat(status.alignment.map((pair) => {
    const milliseconds = (seconds) => number(Math.round(seconds * 1000));
    const shown = pair.missing ? reason(pair.missing) : `${milliseconds(pair.lag_s)} ± ${milliseconds(pair.uncertainty_s)} ms`;
    const more = pair.missing ? pair.why : `${text("window")} ${milliseconds(pair.window_s)} ms` + (pair.drift_ppm === null ? "" : ` · ${text("drift")} ${number(pair.drift_ppm)} ± ${number(pair.drift_uncertainty_ppm)} ppm`);
    const used = pair.use === "merge" ? ` · ${text("putBack")} ${milliseconds(pair.applied_s)} ms` : "";
    const line = row(text("meterLag"), shown, `${name(pair.power).split(/[,，]/)[0]} · ${more}${used}`);
    line.title = `${pair.controller} → ${pair.meter}`;
    return line;
  })), text("none"));
  filled("scripts", status.scripts.map((script) => {
    const line = row(script.file, script.version, text(script.condition), { dot: CONDITIONS[script.condition] ?? "warn", bad: CONDITIONS[script.condition] === "bad" });
    if (script.error) line.append(make("pre", script.condition === "waiting" ? "error soft" : "error", script.error));
    return line;
  }), text("none"));
  showHistory();
  showTwin();
  filled("channels", status.channels.concat(status.estimates).map((c) => {
    const unit = !c.unit || c.unit === "1" ? "" : ` ${c.unit}`;
    const shown = c.missing ? reason(c.missing) : typeof c.value === "number" ? `${number(c.value)}${unit}` : c.value;
    const line = row(name(c.name), shown);
    if (c.missing) line.querySelector(".num").classList.add("missing");
    line.title = c.name;
    return line;
  }), text("none"));
}

/** The simulation beside the machine, where a model is configured. */
function showTwin() {
  const twin = status.twin;
  at("twin-card").hidden = !twin;
  if (!twin) return;
  const value = (x) => (x === null ? text("nothing") : `${number(x)} ${twin.unit}`);
  const rows = [row(text("expected"), value(twin.twin_expected), `${twin.model} · ${name(twin.output)}`),
    row(text("residual"), twin.missing ? reason(twin.missing) : value(twin.twin_residual), twin.missing ? twin.why : "")];
  for (const regime of twin.regimes) {
    const share = regime.learned ? `${regime.learned[0]} / ${regime.learned[1]}` : regime.usual === undefined ? value(regime.difference) : `± ${value(regime.usual)}`;
    rows.push(row(`${text(`regime_${regime.regime}`)}: ${text(regime.stage)}`, share, regime.text, { dot: { watching: "good", differing: "warn" }[regime.stage] ?? "" }));
  }
  if (twin.diagnosing_since_ms) rows.push(row(text("diagnosing"), `${text("since")} ${clock(twin.diagnosing_since_ms)}`));
  if (twin.diagnosis) rows.push(row(text("diagnosis"), clock(twin.diagnosis.at_ms), twin.diagnosis.summary));
  if (twin.problem) rows.push(row(text("refused"), "", twin.problem, { dot: "bad", bad: true }));
  filled("twin", rows, "");
}

/** The latest changes on small lines. */
function recent(changes) {
  const box = make("div", "recent");
  for (const change of changes) box.append(make("span", "", change.text), make("time", "", clock(change.at_ms)));
  return box;
}

/** The newest rows of the audit, as the gate wrote them. */
async function showAudit() {
  const answer = await fetch("/api/v1/audit?limit=6").catch(() => null);
  if (!answer?.ok) return;
  const { rows } = await answer.json();
  const value = (x) => (x === null ? "–" : number(x));
  filled("audit", rows.reverse().map((entry) => {
    const figures = entry.unit ? `${value(entry.before)} → ${value(entry.asked)} → ${value(entry.after)} ${entry.unit}` : entry.person;
    return row(`${clock(entry.at_ns / 1e6)} ${entry.kind} · ${entry.outcome}`, figures, entry.reason, { bad: entry.outcome === "failed" });
  }), text("noAudit"));
}

function showHistory() {
  const kept = status.history;
  const rows = [row(text("rows"), kept.rows.toLocaleString(), kept.error, { dot: kept.error ? "bad" : "good", bad: Boolean(kept.error) }),
    row(text("size"), bytes(kept.bytes), kept.path)];
  if (kept.lasts_days !== null) rows.push(row(text("lasts"), `${number(kept.lasts_days)} ${text("days")}`));
  rows.push(row(text("parts"), String(status.parts)));
  rows.push(row(text("ticks"), status.tick.count.toLocaleString(),
    `${text("lateness")} ${number(status.tick.late_p99_ms)} ms · ${status.tick.skipped} ${text("skipped")}`));
  filled("history", rows, "");
}

/** Adds the newest status to the trail behind the chart. */
function follow() {
  const value = (wanted) => { const found = quantity(wanted); return found && !found.missing ? found.value : null; };
  trail.push({ ms: status.at_ms, spindle_power_w: value("spindle_power_w"), no_load_power_w: value("no_load_power_w"), word: status.state.word });
  while (trail.length > 0 && trail[0].ms < past.until) trail.shift();
  if (trail.length > 5000) trail.splice(0, 1000);
}

function showChart() {
  const to = status.at_ms;
  const from = to - minutes * 60000;
  const points = (wanted) => [...(past.lines[wanted] ?? []), ...trail.map((t) => [t.ms, t[wanted]])];
  const states = past.states.map((span) => ({ ...span, label: stateName(span.word) }));
  trail.forEach((t, i) => states.push({ from: trail[i - 1]?.ms ?? Math.max(past.until, past.from), to: t.ms, word: t.word, label: stateName(t.word) }));
  chart.show(from, to, [
    { label: brief("no_load_power_w"), unit: "W", colour: "soft", dash: true, points: points("no_load_power_w") },
    { label: brief("spindle_power_w"), unit: "W", colour: "accent", points: points("spindle_power_w") },
  ], states);
  at("plot").setAttribute("aria-label", `${name("spindle_power_w")}, ${minutes} ${text("min")}`);
}

/** Reads the chart's range from the history; what is newer comes from the stream. */
async function readPast() {
  if (!status) return;
  const [to, from] = [status.at_ms, status.at_ms - minutes * 60000];
  const utc = (ms) => new Date(ms).toISOString();
  const seconds = Math.max(1, Math.round((minutes * 60) / 900));
  const range = `from=${utc(from)}&to=${utc(to)}`;
  const get = async (path) => { const answer = await fetch(path); if (!answer.ok) throw new Error(await answer.text()); return answer.json(); };
  try {
    const [samples, states] = await Promise.all([
      get(`/api/v1/samples?${range}&channels=spindle_power_w,no_load_power_w&resolution_s=${seconds}`),
      get(`/api/v1/states?${range}`)]);
    const lines = {};
    let until = 0;
    for (const series of samples.series) {
      lines[series.channel] = series.points;
      for (const [ms, value] of series.points) if (value !== null) until = Math.max(until, ms);
    }
    const spans = states.rows.map((s) => ({ from: s.from_ms, to: s.to_ms ?? until, word: s.state }));
    past = { lines, states: spans, from, until };
    while (trail.length > 0 && trail[0].ms < until) trail.shift();
    showChart();
  } catch (error) { console.warn("history:", error); }
}

function showRanges() {
  at("ranges").replaceChildren(...RANGES.map(([count, unit]) => {
    const button = make("button", "", `${count} ${text(unit)}`);
    const wanted = unit === "h" ? count * 60 : count;
    button.setAttribute("aria-pressed", String(wanted === minutes));
    button.onclick = () => { minutes = wanted; localStorage.setItem("minutes", minutes); past.until = 0; showRanges(); readPast(); };
    return button;
  }));
  const entry = (colour, label, kind) => {
    const item = make("span");
    const mark = make("i", kind);
    mark.style.setProperty("--c", `var(--${colour})`);
    item.append(mark, label);
    return item;
  };
  const states = Object.keys(vocabulary?.states ?? {}).map((word) => entry(word, stateName(word), "block"));
  at("legend").replaceChildren(entry("accent", brief("spindle_power_w")), entry("soft", brief("no_load_power_w"), "dash"), ...states);
}

function show() {
  if (!status || !vocabulary) return;
  showNow();
  showBadges();
  showCards();
  showChart();
  at("version").textContent = `cnc-gateway ${status.version}`;
}

function connected(yes) {
  document.body.dataset.connected = String(yes);
  at("link").textContent = yes ? text("connected") : text("lost");
}

function switchLanguage(next) {
  setLanguage(next);
  at("language").textContent = next === "zh" ? "English" : "中文";
  showRanges();
  show();
}

function listen() {
  const stream = new EventSource("/api/v1/live");
  stream.addEventListener("status", (event) => {
    const first = status === null;
    status = JSON.parse(event.data);
    connected(true);
    follow();
    show();
    if (first) readPast();
  });
  stream.onerror = () => connected(false);
}

at("language").onclick = () => {
  const next = current() === "zh" ? "en" : "zh";
  localStorage.setItem("language", next);
  switchLanguage(next);
};
connected(false);
vocabulary = await (await fetch("/api/v1/channels")).json();
switchLanguage(current());
listen();
showAudit();
setInterval(readPast, 5000);
setInterval(showAudit, 5000);
