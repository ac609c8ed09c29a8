// Now: what a machinist reads in three seconds. Everything is built once; only texts change, so nothing jumps.
import { ask, card, fill, make, row, say, send } from "/web/parts.js";
import { clock, duration, number, plainName, quantity as shown, unitName, when } from "/web/format.js";
import { box, language, localTimes, t } from "/web/words.js";
import { TimePlot, drawnFrom } from "/web/plot.js";
import { StateRibbon } from "/web/ribbon.js";

const JOB = ["program", "operation", "tool", "part"];
/** The trend behind the big numbers. */
const TREND_S = 600;
/** Power that flows back is called braking from here on: more than the noise of a power meter about zero. Too low, a standing spindle is
    said to brake. */
const BRAKING_W = 20;
/** A value that is older than this is marked as old on its own. */
const OLD_S = 2;
/** Not worth a line in "absent": nobody expects them on every machine. */
const SILENT = new Set(["not_provided", "no_model", "cut_unknown", "not_recorded"]);

export function mount(root, context) {
  root.classList.add("now-view");
  const parts = { state: stateCard(), alarms: alarmCard(context), gauges: gauges(), strip: strip(), feed: feedCard(context), trend: trend(context), absent: absentCard(), temperature: temperatures() };
  root.append(parts.state.box, parts.alarms.box, parts.gauges.box, parts.feed.box, parts.strip.box, parts.trend.box, parts.absent.box, parts.temperature.box);
  return {
    update(status) { for (const part of Object.values(parts)) part.update(status, context); },
    session() { parts.feed.session?.(context); },
    leave() { root.classList.remove("now-view"); parts.trend.leave(); },
  };
}

function stateCard() {
  const word = make("p", "word", "–", { id: "state", "aria-live": "polite" });
  const since = make("p", "since", " ");
  const demo = make("p", "demo-note", "", { hidden: true });
  const job = make("dl", "job");
  const values = Object.fromEntries(JOB.map((key) => {
    const value = make("dd", "", "–");
    job.append(make("div", "", [make("dt", "", t(key)), value]));
    return [key, value];
  }));
  const box = make("section", "card state ages", [make("div", "big", [word, since]), job, demo], { "aria-label": t("machine_state") });
  const update = (status, context) => {
    say(word, context.state(status.state.word));
    word.dataset.word = status.state.word;
    word.dataset.ms = status.at_ms;
    const why = status.state.why ? ` · ${box_(status.state.why)}` : "";
    say(since, `${t("since_clock", when(status.state.since_ms, status.at_ms))} · ${duration(status.state.seconds)}${why}`);
    for (const key of JOB) {
      const found = context.quantity(key);
      const count = context.quantity("part_count");
      const none = !found || found.missing || found.value === "";
      // Where nobody names the part, how many were finished says more than a dash.
      const text = !none ? plainName(String(found.value)) : key === "part" && count && !count.missing ? t("finished_count", number(count.value)) : "–";
      say(values[key], text);
      values[key].title = text;
    }
    demo.hidden = !status.simulated;
    const short = status.sources.some((source) => source.name.includes("day=short"));
    if (status.simulated) say(demo, short ? t("demo_note") : status.speed === 1 ? t("simulated_note") : t("demo_fast", status.speed ?? "∞"));
  };
  return { box, update };
}
const box_ = (text) => box(text);

function alarmCard(context) {
  const list = make("div", "alarm-list");
  const section = make("section", "card alarms ages", [make("h2", "", t("alarms")), list], { role: "region", "aria-label": t("alarms") });
  let drawn = "";
  const update = (status) => {
    const key = JSON.stringify([status.alarms, status.acknowledged, status.problems, language(), Boolean(context.session?.person)]);
    if (key === drawn) return;
    drawn = key;
    section.dataset.worst = status.alarms.some((a) => a.severity === "critical") ? "bad" : status.alarms.some((a) => a.severity === "warning") ? "warn" : "";
    const lines = status.alarms.map((alarm) => alarmLine(alarm, status, context));
    const troubles = status.problems.map(troubleLine);
    fill(list, lines.length + troubles.length ? [...lines, ...troubles] : [make("p", "no-alarm", t("no_alarm"))]);
  };
  return { box: section, update };
}

// Something that is wrong and is no alarm of the machine: the whole sentence, and what to do next.
function troubleLine(problem) {
  const line = make("div", "alarm warning");
  line.append(make("strong", "", box(problem.what)), make("span", "more", box(problem.next)));
  return line;
}

function alarmLine(alarm, status, context) {
  const line = make("div", `alarm ${alarm.severity}`);
  const words = localTimes(language() === "zh" && alarm.zh ? alarm.zh : alarm.text);
  line.append(make("strong", "", words), make("span", "more", `${t(`severity_${alarm.severity}`)} · ${t("since_clock", alarm.since_ms ? when(alarm.since_ms, status.at_ms) : "–")}`));
  const seen = status.acknowledged?.find((it) => it.code === alarm.code)?.by;
  if (seen) line.append(make("span", "more", t("seen_by", seen)));
  else line.append(make("button", "", t("acknowledge"), { type: "button", onclick: (event) => acknowledge(event.currentTarget, alarm, context) }));
  return line;
}

async function acknowledge(button, alarm, context) {
  if (!context.session?.person) { location.href = `/sign-in?next=${encodeURIComponent("/now")}`; return; }
  button.disabled = true;
  try { await send("/api/v1/alarms/acknowledge", { code: alarm.code }); say(button, t("acknowledged")); }
  catch (error) { button.disabled = false; button.after(make("span", "note bad", error.message)); }
}

/** Speed and feed with what was programmed, in the size in which they are read from two metres. */
function gauges() {
  const rows = [["spindle_speed_rpm", "spindle_programmed_rpm"], ["feed_mm_min", "feed_programmed_mm_min"]].map(([actual, programmed]) => {
    const value = make("span", "value", "–", { "data-quantity": actual });
    const unit = make("span", "unit", "");
    const note = make("p", "gauge-note", " ");
    const box = make("section", "card gauge ages", [make("h2", "", t(`short_${actual}`)), make("p", "reading", [value, unit]), note]);
    return { actual, programmed, value, unit, note, box };
  });
  const update = (_, context) => rows.forEach((one) => {
    const found = context.quantity(one.actual);
    const old = show(one.value, found, context);
    say(one.unit, found && !found.missing ? unitName(found.unit) : "");
    const planned = context.quantity(one.programmed);
    const note = old ?? (planned && !planned.missing ? t("programmed", shown(planned.value, planned.unit)) : " ");
    say(one.note, note);
  });
  return { box: make("div", "gauges", rows.map((one) => one.box)), update };
}

/** Writes a value or the reason for none; gives a note where the value is old. */
function show(element, found, context) {
  const missing = !found || found.missing;
  element.classList.toggle("missing", Boolean(missing));
  say(element, missing ? context.reason(found?.missing ?? "not_provided") : number(found.value, found.unit));
  if (missing) delete element.dataset.value; else element.dataset.value = found.value;
  const old = !missing && found.age_s > OLD_S;
  element.classList.toggle("old", Boolean(old));
  return old ? t("value_age", duration(found.age_s)) : null;
}

function feedCard(context) {
  const force = make("span", "value", "–", { "data-quantity": "feed_override_pct" });
  const percent = make("span", "unit", "%");
  const armed = make("p", "armed-words", " ");
  const facts = ["in_force", "dial", "asked", "let_through"];
  const cells = Object.fromEntries(facts.map((key) => [key, make("dd", "", "–")]));
  const names = Object.fromEntries(facts.map((key) => [key, make("dt", "", t(`override_${key}`))]));
  const lines = Object.fromEntries(facts.map((key) => [key, make("div", "", [names[key], cells[key]])]));
  const list = make("dl", "facts", facts.map((key) => lines[key]));
  const why = make("p", "note why", " ");
  const actions = make("div", "buttons");
  const section = make("section", "card feed ages", [make("h2", "", t("short_feed_override_pct")), make("div", "feed-body", [make("p", "reading", [force, percent]), list]), armed, why, actions]);
  const back = make("button", "danger", t("back_to_dial"), { type: "button", hidden: true, onclick: () => disarm(back, context) });
  const arm = make("button", "", t("arm"), { type: "button", hidden: true, onclick: () => armDialog(context) });
  actions.append(arm, back);
  const pct = (value) => (value === null || value === undefined ? t("nothing") : shown(value, "%"));
  const update = (status) => {
    const gate = status.gate;
    const found = context.quantity("feed_override_pct");
    show(force, found, context);
    say(percent, found && !found.missing ? "%" : "");
    const dial = context.quantity("feed_override_dial_pct");
    say(cells.dial, dial && !dial.missing ? pct(dial.value) : "–");
    say(cells.asked, pct(gate.wanted_pct));
    say(cells.let_through, gate.wanted_pct === null ? "–" : pct(gate.permitted_pct));
    say(cells.in_force, found && !found.missing ? pct(found.value) : "–");
    // Where nothing is written, what rules and gate would do is no order: it is named so, and only shown where it differs.
    const writes = gate.mode === "armed";
    say(names.asked, t(writes ? "override_asked" : "override_would_ask"));
    say(names.let_through, t(writes ? "override_let_through" : "override_would_pass"));
    for (const key of ["asked", "let_through"]) {
      lines[key].classList.toggle("would", !writes);
      lines[key].hidden = !writes && gate.wanted_pct === null;
    }
    const words = writes ? t("gate_armed", gate.armed_by, gate.armed_until_ms ? clock(gate.armed_until_ms) : "–")
      : t(gate.mode === "off" ? "gate_off" : "gate_shadow");
    say(armed, words);
    armed.classList.toggle("warn-text", writes);
    const reason = gate.reason ? `${t("because")}: ${box(gate.reason)}${gate.held ? ` · ${box(gate.held)}` : ""}` : "";
    say(why, writes ? reason || " " : [gate.reason ? t("override_nothing_written") : "", reason].filter(Boolean).join(" ") || " ");
    back.hidden = !writes;
    arm.hidden = writes || !(context.session?.arming_allowed && context.session?.may?.arm);
  };
  return { box: section, update };
}

async function disarm(button, context) {
  if (!context.session?.person) { location.href = `/sign-in?next=${encodeURIComponent("/now")}`; return; }
  button.disabled = true;
  try { await send("/api/v1/disarm"); } catch (error) { button.after(make("span", "note bad", error.message)); }
  button.disabled = false;
}

/** Arming always asks for the token again. */
export function armDialog(context) {
  if (!context.session?.person) { location.href = `/sign-in?next=${encodeURIComponent(location.pathname)}`; return; }
  const token = make("input", "", null, { type: "password", autocomplete: "off", required: true, name: "token" });
  const minutes = make("select", "", [5, 15, 30, 60].map((m) => make("option", "", `${m} ${t("min")}`, { value: m * 60, selected: m === 30 })), { name: "for_s" });
  const said = make("p", "note bad", "", { role: "alert" });
  const dialog = make("dialog", "");
  const form = make("form", "", [make("h2", "", t("arm_title")), make("p", "note", t("arm_words")), make("label", "", [t("token"), token]), make("label", "", [t("arm_for"), minutes]), said,
    make("div", "buttons", [make("button", "primary", t("arm"), { type: "submit" }), make("button", "", t("cancel"), { type: "button", onclick: () => dialog.close() })])]);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try { await send("/api/v1/arm", { token: token.value, for_s: Number(minutes.value) }); dialog.close(); }
    catch (error) { say(said, error.message); token.value = ""; token.focus(); }
  });
  dialog.append(form);
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

/** Where the spindle's power goes, as one strip: no-load, loss under load, cutting; what cannot be told apart is one colour. */
function strip() {
  const bands = [["no_load_power_w", "line-a"], ["load_loss_w", "line-c"], ["cutting_power_w", "line-b"], ["rest", "faint"]];
  const pieces = bands.map(([key]) => make("div", `piece ${key}`));
  const bar = make("div", "power-bar", pieces, { role: "img" });
  const labels = bands.slice(0, 3).map(([key]) => ({ key, value: make("b", "", "–"), note: make("span", "more", "") }));
  const total = make("span", "value", "–", { "data-quantity": "spindle_power_w" });
  const machine = make("span", "grow note", "");
  const list = make("div", "power-list", labels.map(({ key, value, note }) => make("div", `power-label ${key}`, [make("span", "", t(`short_${key}`)), value, note])));
  const section = make("section", "card power ages", [make("div", "head", [make("h2", "", t("short_spindle_power_w")), make("p", "reading small", [total, make("span", "unit", "W")]), machine]), bar, list]);
  let greatest = 500;
  const update = (status, context) => {
    const found = context.quantity("spindle_power_w");
    const value = (key) => { const it = context.quantity(key); return it && !it.missing && typeof it.value === "number" ? it.value : null; };
    show(total, found, context);
    const power = Math.max(0, value("spindle_power_w") ?? 0);
    greatest = Math.max(greatest * 0.9995, power, 500);
    const turning = Math.abs(value("spindle_speed_rpm") ?? 0) > 1;
    let used = 0;
    bands.slice(0, 3).forEach(([key], at) => {
      const watts = turning ? Math.min(Math.max(0, value(key) ?? 0), Math.max(0, power - used)) : 0;
      used += watts;
      pieces[at].style.width = `${(100 * watts) / greatest}%`;
    });
    pieces[3].style.width = `${(100 * Math.max(0, power - used)) / greatest}%`;
    for (const { key, value: cell, note } of labels) {
      const it = context.quantity(key);
      say(cell, it && !it.missing ? shown(it.value, it.unit) : "–");
      say(note, it?.missing ? context.reason(it.missing) : it ? `± ${shown(it.uncertainty, it.unit)}` : "");
    }
    bar.setAttribute("aria-label", t("strip_label", number(power, "W"), number(value("no_load_power_w") ?? NaN, "W"), number(value("cutting_power_w") ?? NaN, "W")));
    const whole = context.quantity("total_power_w");
    // A braking spindle is a generator: without a word its negative power looks like a fault of the meter.
    const braking = (value("spindle_power_w") ?? 0) < -BRAKING_W ? `${t("braking")} · ` : "";
    say(machine, braking + (whole && !whole.missing ? t("machine_power", shown(whole.value, "W")) : ""));
  };
  return { box: section, update };
}

/** Ten minutes of spindle power and state. What is older than the page comes from the history. */
function trend(context) {
  const ribbonBox = make("div", "ribbon-box");
  const plotBox = make("div", "plot-box");
  const link = make("a", "grow", t("open_history"), { href: "/history", "data-view": "history" });
  const section = make("section", "card trend ages", [make("div", "head", [make("h2", "", t("last_ten_minutes")), link]), ribbonBox, plotBox]);
  const points = [];
  let [plot, ribbon, asked, states, askedAt] = [null, null, false, [], 0];
  const draw = (status) => {
    const to = status.at_ms / 1000;
    if (!plot) {
      ribbon = new StateRibbon(ribbonBox, context);
      plot = new TimePlot(plotBox, { height: 150, low: 0, sync: null, label: t("last_ten_minutes"), series: [{ label: t("short_spindle_power_w"), unit: "W", line: "line-a" }, { label: t("short_no_load_power_w"), unit: "W", line: "soft", dash: [5, 4] }] });
    }
    const x = points.map((p) => p[0]);
    const nothing = points.map(() => null);
    const data = [x, points.map((p) => p[1]), nothing, nothing, points.map((p) => p[2]), nothing, nothing];
    const from = drawnFrom(data, to - TREND_S, to);
    plot.give(data);
    plot.show(from, to);
    ribbon.show(from, to, states);
  };
  const past = async (status) => {
    const utc = (ms) => new Date(ms).toISOString();
    const span = `from=${utc(status.at_ms - TREND_S * 1000)}&to=${utc(status.at_ms)}`;
    const [samples, found] = await Promise.all([ask(`/api/v1/samples?${span}&channels=spindle_power_w,no_load_power_w&resolution_s=1`), ask(`/api/v1/states?${span}`)]);
    const [power, idle] = samples.series;
    const old = power.points.map((p, at) => [p[0] / 1000, p[1], idle?.points[at]?.[1] ?? null]);
    const last = old.at(-1)?.[0] ?? 0;
    points.splice(0, points.length, ...old, ...points.filter((p) => p[0] > last));
    const known = found.rows.map((s) => ({ from: s.from_ms / 1000, to: (s.to_ms ?? status.at_ms) / 1000, word: s.state }));
    const end = known.at(-1)?.from ?? 0;
    states = [...known, ...states.filter((s) => s.from > end)];
  };
  const update = (status) => {
    const value = (key) => { const it = context.quantity(key); return it && !it.missing ? it.value : null; };
    points.push([status.at_ms / 1000, value("spindle_power_w"), value("no_load_power_w")]);
    while (points.length && points[0][0] < status.at_ms / 1000 - TREND_S - 5) points.shift();
    const last = states.at(-1);
    if (last && last.word === status.state.word) last.to = status.at_ms / 1000;
    else states.push({ from: status.state.since_ms / 1000, to: status.at_ms / 1000, word: status.state.word });
    while (states.length > 1 && states[0].to < status.at_ms / 1000 - TREND_S) states.shift();
    // Faster than real time the stream is too coarse: the history is read again.
    if (!asked || (status.speed !== 1 && performance.now() - askedAt > 5000)) { [asked, askedAt] = [true, performance.now()]; past(status).catch(() => {}); }
    draw(status);
  };
  return { box: section, update, leave: () => { plot?.destroy(); ribbon?.destroy(); } };
}

/** What has no value, and why, in one line for each reason. */
function absentCard() {
  const list = make("div", "");
  const section = make("section", "card absent ages", [make("h2", "", t("absent_title")), list]);
  let drawn = "";
  const update = (status, context) => {
    const lines = new Map();
    for (const it of [...status.channels, ...status.estimates]) {
      if (!it.missing || SILENT.has(it.missing)) continue;
      const why = context.reason(it.missing);
      lines.set(why, [...(lines.get(why) ?? []), context.name(it.name).split(/[,，]/)[0]]);
    }
    const silent = status.sources.filter((source) => source.error).map((source) => [source.name, source.error]);
    const key = JSON.stringify([...lines, silent, language()]);
    if (key === drawn) return;
    drawn = key;
    const rows = [...lines].map(([why, names]) => row(why, String(names.length), names.slice(0, 6).join(language() === "zh" ? "、" : ", ") + (names.length > 6 ? " …" : "")));
    const sources = silent.map(([name, error]) => row(sourceName(name), t("silent"), box(error), { dot: "bad" }));
    fill(list, rows.length + sources.length ? [...sources, ...rows] : [make("p", "empty", t("nothing_absent"))]);
  };
  return { box: section, update };
}

/** `simulated://lathe?device=meter` is a meter to whoever looks at the page. */
export const sourceName = (name) => (name.startsWith("simulated:") ? `${t("simulated")} · ${/device=(\w+)/.exec(name)?.[1] === "meter" ? t("meter") : t("controller")}` : name);

function temperatures() {
  const list = make("div", "");
  const section = make("section", "card temperatures ages", [make("h2", "", t("also_measured")), list]);
  const WANTED = ["spindle_load_pct", "spindle_current_a", "bearing_temperature_c", "motor_temperature_c", "ambient_temperature_c", "supply_voltage_v", "part_count"];
  const lines = new Map();
  const update = (_, context) => {
    for (const key of WANTED) {
      const found = context.quantity(key);
      if (!found) continue;
      if (!lines.has(key)) {
        const line = row(context.name(key).split(/[,，]/)[0], "");
        lines.set(key, line);
        list.append(line);
      }
      say(lines.get(key).querySelector(".num"), found.missing ? context.reason(found.missing) : shown(found.value, found.unit));
    }
  };
  return { box: section, update };
}
