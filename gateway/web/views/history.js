// History: minutes to years in one drag. The address holds what is looked at, so that it can be sent.
import { ask, card, colour, fill, make, say } from "/web/parts.js";
import { clock, dateTime, duration, quantity, unitName } from "/web/format.js";
import { language, t } from "/web/words.js";
import { AXIS_PX, LINES, Movement, RIGHT_PX, TimePlot } from "/web/plot.js";
import { StateRibbon, STATE_ORDER } from "/web/ribbon.js";
import { HistoryData, columns, csv, download } from "/web/history-data.js";
import { marksTable, partsTable, stateLegend, useTable } from "/web/history-tables.js";

const USUAL = ["spindle_power_w", "cutting_power_w", "spindle_speed_rpm", "feed_mm_min", "feed_override_pct"];
const RANGES = [["min", 600], ["min", 3600], ["h", 28800], ["h", 86400], ["d", 604800], ["d", 2592000], ["d", 31536000]];
const SHORTEST_S = 5;
/** With the newest moment in sight the view goes on with the machine. */
const FOLLOW_EVERY_MS = 2000;

export function mount(root, context) {
  const view = new HistoryView(root, context);
  view.begin();
  return { update: (status) => view.follow(status), leave: () => view.leave() };
}

class HistoryView {
  constructor(root, context) {
    Object.assign(this, { root, context, data: new HistoryData(), plots: [], found: null, tab: "parts", by: "day" });
    this.move = new Movement({ get: () => [this.from, this.to], set: (from, to) => this.look(from, to), limits: () => [this.first, this.edge(), SHORTEST_S, Math.max(60, (this.edge() - this.first) * 1.02)] });
    this.build();
  }

  build() {
    this.text = make("span", "range-text", " ");
    this.busy = make("span", "busy", t("loading"), { role: "status" });
    const ranges = RANGES.map(([unit, s]) => make("button", "", `${s / { min: 60, h: 3600, d: 86400 }[unit]} ${t(unit)}`, { type: "button", onclick: () => this.last(s), "data-range": s }));
    ranges.push(make("button", "", t("all"), { type: "button", onclick: () => this.look(this.first, this.edge(), true) }));
    const step = (text, label, act) => make("button", "", text, { type: "button", "aria-label": label, title: label, onclick: act });
    this.ranges = ranges;
    const tools = make("div", "head", [make("div", "buttons", ranges), make("div", "buttons", [step("◀", t("earlier"), () => this.move.pan(-0.5)), step("▶", t("later"), () => this.move.pan(0.5)), step("+", t("zoom_in"), () => this.move.zoom(0.5)), step("−", t("zoom_out"), () => this.move.zoom(2))]), this.text, this.busy, make("a", "button-link grow", t("diagnose_seen"), { href: "/twin", "data-view": "twin", onclick: (event) => { event.currentTarget.href = `/twin?from=${new Date(this.from * 1000).toISOString()}&to=${new Date(this.to * 1000).toISOString()}`; } }), make("button", "", t("export_seen"), { type: "button", onclick: () => this.save() })]);
    this.ribbonBox = make("div", "ribbon-box");
    this.readout = make("div", "readout", null, { "aria-live": "off" });
    this.charts = make("div", "charts");
    this.note = make("p", "note bad", "", { role: "alert" });
    this.overview = make("div", "overview", null, { role: "slider", tabindex: "0", "aria-label": t("whole_history"), "aria-valuemin": "0", "aria-valuemax": "100", "aria-valuenow": "0" });
    this.overviewBox = make("div", "");
    this.chooser = make("details", "choose", [make("summary", "", t("choose_channels")), make("div", "chooser")]);
    const pane = make("section", "card", [tools, this.readout, this.ribbonBox, this.charts, this.note, this.overview, this.overviewBox, stateLegend(this.context), this.chooser], { tabindex: "-1" });
    pane.addEventListener("keydown", (event) => this.move.keys(event));
    this.tabs = make("div", "tabs");
    this.body = make("div", "tab-body");
    this.root.append(pane, card("", [this.tabs, this.body]));
    this.move.attach(this.ribbonBox, { left: AXIS_PX, right: RIGHT_PX });
    this.drawTabs();
    fill(this.body, [make("p", "empty", t("loading"))]);
  }

  async begin() {
    try {
      const known = await ask("/api/v1/series");
      this.known = known.series;
      [this.first, this.newest] = [known.first_ms / 1000, known.last_ms / 1000];
    } catch (error) { say(this.note, error.message); return; }
    if (!Number.isFinite(this.first) || this.known.length === 0) { say(this.note, t("no_history_yet")); return; }
    const asked = new URLSearchParams(location.search);
    const time = (key) => { const ms = Date.parse(asked.get(key) ?? ""); return Number.isNaN(ms) ? null : ms / 1000; };
    const names = this.known.filter((s) => s.kind === "number").map((s) => s.name);
    this.channels = (asked.get("channels")?.split(",") ?? USUAL).filter((name) => names.includes(name));
    if (!this.channels.length) this.channels = names.slice(0, 3);
    // The question is on its way while the charts are made.
    const [from, to] = [time("from"), time("to")];
    if (from !== null && to !== null && from < to) this.look(from, to, true);
    else this.last(3600);
    this.drawChooser();
    this.ribbon = new StateRibbon(this.ribbonBox, this.context);
    this.drawPlots();
    for (const plot of this.plots) plot.show(this.from, this.to);
    this.drawRibbon();
    this.drawOverview();
    this.drawWindow();
  }

  edge() {
    return Math.max(this.newest, (this.context.status()?.at_ms ?? 0) / 1000);
  }

  last(seconds) {
    const to = this.edge();
    this.look(Math.max(this.first, to - seconds), to, true);
  }

  /** Looks at another time: at once with what is there, then with what the history says. */
  look(from, to, now = false) {
    [this.from, this.to] = [from, Math.max(to, from + SHORTEST_S)];
    this.following = this.to >= this.edge() - Math.max(3, 0.01 * (this.to - this.from));
    for (const plot of this.plots) plot.show(this.from, this.to);
    this.drawRibbon();
    this.drawFrame();
    clearTimeout(this.timer);
    if (now) this.read();
    else this.timer = setTimeout(() => this.read(), 90);
  }

  async read() {
    this.busy.classList.add("on");
    const began = performance.now();
    try {
      const found = await this.data.read(this.from, this.to, this.channels, { first: this.first, last: this.edge() }, (early) => this.drawCharts(early, began));
      if (!found) return;
      this.found = found;
      this.drawRibbon();
      this.drawTab();
      if (!this.whole) this.drawWhole();
    } catch (error) { say(this.note, error.message); }
    this.busy.classList.remove("on");
  }

  /** The charts, as soon as their samples are there. */
  drawCharts({ series, resolution }, began) {
    const empty = series.every((s) => !s.points.some((p) => typeof p[1] === "number"));
    say(this.note, empty ? t("nothing_in_range") : "");
    for (const plot of this.plots) plot.give(columns(series, plot.names));
    this.read_out(null, null);
    this.address();
    this.root.dataset.drawnMs = String(Math.round(performance.now() - began));
    this.root.dataset.resolution = String(resolution);
  }

  address() {
    const query = new URLSearchParams(location.search);
    for (const [key, s] of [["from", this.from], ["to", this.to]]) query.set(key, new Date(s * 1000).toISOString());
    query.set("channels", this.channels.join(","));
    if (location.pathname === "/history") history.replaceState(null, "", `/history?${query.toString().replaceAll("%2C", ",").replaceAll("%3A", ":")}`);
  }

  follow(status) {
    if (this.from === undefined || !this.following || document.hidden) return;
    const now = performance.now();
    if (now - (this.followed ?? 0) < FOLLOW_EVERY_MS) return;
    this.followed = now;
    const width = this.to - this.from;
    const to = status.at_ms / 1000;
    if (width < 7200 && to > this.to && this.move.pointers.size === 0) this.look(Math.max(this.first, to - width), to);
  }

  drawFrame() {
    const width = this.to - this.from;
    say(this.text, `${dateTime(this.from * 1000)} – ${width < 86400 ? clock(this.to * 1000) : dateTime(this.to * 1000)} (${duration(width)})`);
    for (const button of this.ranges) button.setAttribute("aria-pressed", String(Math.abs(Number(button.dataset.range ?? -1) - width) < 1 && this.following));
    this.drawWindow();
  }

  /** One chart for each unit, all over the same time. */
  drawPlots() {
    this.plots.forEach((plot) => plot.destroy());
    const groups = new Map();
    for (const name of this.channels) {
      const unit = this.known.find((s) => s.name === name)?.unit ?? "";
      groups.set(unit, [...(groups.get(unit) ?? []), name]);
    }
    this.charts.replaceChildren();
    this.colours = {};
    let at = 0;
    this.plots = [...groups].map(([unit, names], index) => {
      const box = make("div", "plot-box");
      this.charts.append(box);
      const series = names.map((name) => { this.colours[name] = LINES[at++ % LINES.length]; return { name, label: this.label(name), unit, line: this.colours[name], stepped: name.endsWith("_pct") }; });
      const last = index === groups.size - 1;
      const plot = new TimePlot(box, { series, times: last, height: (last ? 34 : 8) + (groups.size > 3 ? 118 : 156), label: `${names.map((n) => this.label(n)).join(", ")} ${unitName(unit)}`, low: unit === "°C" || unit === "V" ? null : 0, onCursor: (index) => this.read_out(plot, index) });
      plot.names = names;
      plot.move = this.move;
      this.move.attach(plot.u.over);
      return plot;
    });
    this.read_out(null, null);
  }

  label(name) {
    const known = this.known.find((s) => s.name === name);
    return (known?.[language()] || known?.en || this.context.name(name)).split(/[,，]/)[0];
  }

  /** The values under the cursor; the newest ones without it. Always the same places, so that nothing moves. */
  read_out(plot, index) {
    const rows = this.channels.map((name) => {
      const owner = this.plots.find((p) => p.names?.includes(name));
      const column = owner ? 1 + owner.names.indexOf(name) * 3 : 0;
      const data = owner?.data;
      const i = index ?? (data ? data[0].length - 1 : null);
      const value = data && i !== null ? data[column]?.[i] : null;
      const [low, high] = data && i !== null ? [data[column + 1]?.[i], data[column + 2]?.[i]] : [null, null];
      const unit = this.known.find((s) => s.name === name)?.unit ?? "";
      const mark = make("i");
      mark.style.background = `var(--${this.colours[name]})`;
      const spread = low == null || high == null || low === high ? "" : ` (${quantity(low, "")} … ${quantity(high, "")})`;
      return make("span", "", [mark, `${this.label(name)} `, make("b", "", value == null ? "–" : quantity(value, unit)), spread]);
    });
    const at = this.plots[0]?.data?.[0]?.[index];
    fill(this.readout, [make("b", "", index == null || at === undefined ? t("newest") : dateTime(at * 1000)), ...rows]);
  }

  drawRibbon() {
    if (!this.ribbon) return;
    const found = this.found ?? { states: [], shares: [], alarms: [], writes: [], parts: [] };
    const marks = [...found.alarms.map((a) => ({ at: a.raised_ms / 1000, tone: a.severity === "critical" ? "bad" : "warn" })), ...found.writes.map((w) => ({ at: w.at_ns / 1e9, tone: "accent" }))];
    const near = this.to - this.from < 12 * 3600 && found.parts.length < 200;
    this.ribbon.show(this.from, this.to, found.states, { shares: found.shares, marks, parts: near ? found.parts.map((p) => p.to_ms / 1000) : [] });
  }

  drawChooser() {
    const boxes = this.known.filter((s) => s.kind === "number").map((s) => {
      const tick = make("input", "", null, { type: "checkbox", value: s.name });
      tick.checked = this.channels.includes(s.name);
      tick.addEventListener("change", () => { this.channels = tick.checked ? [...this.channels, s.name] : this.channels.filter((name) => name !== s.name); this.drawPlots(); for (const plot of this.plots) plot.show(this.from, this.to); this.read(); });
      return make("label", "", [tick, `${this.label(s.name)}${s.unit && s.unit !== "1" ? `, ${unitName(s.unit)}` : ""}`]);
    });
    fill(this.chooser.lastElementChild, boxes);
  }

  /** The whole history as a band; what is looked at is a window in it. Dragging in it looks at any time, of any length. */
  drawOverview() {
    this.canvas = make("canvas", "");
    this.window = make("div", "window");
    this.overview.append(this.canvas, this.window);
    fill(this.overviewBox, [make("div", "note whole-words", t("whole_words", dateTime(this.first * 1000), dateTime(this.edge() * 1000)))]);
    new ResizeObserver(() => this.paintOverview()).observe(this.overview);
    const place = (event) => { const b = this.overview.getBoundingClientRect(); return this.first + Math.min(1, Math.max(0, (event.clientX - b.left - AXIS_PX) / (b.width - AXIS_PX - RIGHT_PX))) * (this.edge() - this.first); };
    this.overview.addEventListener("pointerdown", (event) => { this.overview.setPointerCapture(event.pointerId); this.dragged = place(event); this.before = [this.from, this.to]; });
    this.overview.addEventListener("pointermove", (event) => { if (this.dragged !== undefined) { const at = place(event); if (Math.abs(at - this.dragged) > 0.004 * (this.edge() - this.first)) this.look(Math.min(at, this.dragged), Math.max(at, this.dragged)); } });
    this.overview.addEventListener("pointerup", (event) => {
      const at = place(event);
      if (Math.abs(at - this.dragged) <= 0.004 * (this.edge() - this.first)) { const half = (this.before[1] - this.before[0]) / 2; this.move.apply(at - half, at + half); }
      this.dragged = undefined;
    });
  }

  /** What the band is painted with: sums over the whole history. Asked for after the charts, which are what was opened. */
  async drawWhole() {
    this.whole = [];
    const by = this.edge() - this.first > 30 * 86400 ? "day" : "hour";
    const utc = (s) => new Date(s * 1000).toISOString();
    const found = await ask(`/api/v1/utilisation?from=${utc(this.first)}&to=${utc(this.edge())}&by=${by}`).catch(() => ({ rows: [] }));
    this.whole = found.rows.map((r) => ({ from: r.from_ms / 1000, to: r.from_ms / 1000 + (by === "day" ? 86400 : 3600), seconds: r.seconds }));
    this.paintOverview();
  }

  paintOverview() {
    const [width, height, ratio] = [Math.floor(this.overview.clientWidth), 52, devicePixelRatio || 1];
    if (width < 80 || !this.whole) return;
    [this.canvas.width, this.canvas.height] = [width * ratio, height * ratio].map(Math.round);
    [this.canvas.style.width, this.canvas.style.height] = [`${width}px`, `${height}px`];
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.fillStyle = colour("grid");
    pen.fillRect(AXIS_PX, 0, width - AXIS_PX - RIGHT_PX, height);
    const x = (s) => AXIS_PX + ((s - this.first) / (this.edge() - this.first)) * (width - AXIS_PX - RIGHT_PX);
    for (const { from, to, seconds } of this.whole) {
      const [left, right] = [Math.max(AXIS_PX, x(from)), Math.min(width - RIGHT_PX, x(to))];
      const total = Math.max(Object.values(seconds).reduce((a, b) => a + b, 0), 1);
      let y = height;
      for (const word of STATE_ORDER) {
        const part = ((seconds[word] ?? 0) / total) * height;
        pen.fillStyle = colour(word);
        pen.fillRect(left, y - part, Math.max(0.6, right - left - 0.4), part);
        y -= part;
      }
    }
    this.drawWindow();
  }

  drawWindow() {
    if (!this.window) return;
    const room = this.overview.clientWidth - AXIS_PX - RIGHT_PX;
    const share = (s) => Math.min(1, Math.max(0, (s - this.first) / (this.edge() - this.first || 1)));
    this.window.style.left = `${AXIS_PX + share(this.from) * room}px`;
    this.window.style.width = `${Math.max(8, (share(this.to) - share(this.from)) * room)}px`;
    this.overview.setAttribute("aria-valuenow", String(Math.round(100 * share(this.from))));
    this.overview.setAttribute("aria-valuetext", this.text.textContent);
  }

  drawTabs() {
    fill(this.tabs, ["parts", "use", "marks"].map((word) => make("button", "", t(`tab_${word}`), { type: "button", "aria-pressed": String(word === this.tab), onclick: () => { this.tab = word; this.drawTabs(); this.drawTab(); } })));
  }

  drawTab() {
    if (!this.found) return;
    const range = [this.from, this.to];
    const go = (from, to) => { this.look(from, to, true); scrollTo({ top: 0 }); };
    if (this.tab === "parts") partsTable(this.body, this.found, range, this.context, go);
    else if (this.tab === "marks") marksTable(this.body, this.found, range, go);
    else useTable(this.body, range, this.context, this.by, (by) => { this.by = by; this.drawTab(); }).catch((error) => fill(this.body, [make("p", "note bad", error.message)]));
  }

  save() {
    if (!this.found) return;
    const stamp = new Date(this.from * 1000).toISOString().slice(0, 19).replaceAll(":", "");
    download(`history-${stamp}.csv`, csv(this.found.series, this.from, this.to));
  }

  leave() {
    clearTimeout(this.timer);
    this.plots.forEach((plot) => plot.destroy());
    this.ribbon?.destroy();
  }
}
