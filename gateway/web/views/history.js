// History: minutes to years in one drag. The address holds what is looked at, so that it can be sent.
import { ask, card, fill, make, say } from "/web/parts.js";
import { clock, dateTime, duration } from "/web/format.js";
import { t } from "/web/words.js";
import { AXIS_PX, Movement, RIGHT_PX } from "/web/plot.js";
import { StateRibbon } from "/web/ribbon.js";
import { HistoryData, columns, csv, download } from "/web/history-data.js";
import { marksTable, partsTable, stateLegend, useTable } from "/web/history-tables.js";
import { drawChooser, drawPlots, drawRibbon, readOut } from "/web/history-charts.js";
import { FactsTab } from "/web/history-facts.js";
import { drawOverview, drawWhole, drawWindow } from "/web/history-overview.js";

const USUAL = ["spindle_power_w", "cutting_power_w", "spindle_speed_rpm", "feed_mm_min", "feed_override_pct"];
const RANGES = [
  ["min", 600],
  ["min", 3600],
  ["h", 28800],
  ["h", 86400],
  ["d", 604800],
  ["d", 2592000],
  ["d", 31536000],
];
const SHORTEST_S = 5;
/** With the newest moment in sight the view goes on with the machine. */
const FOLLOW_EVERY_MS = 2000;

export function mount(root, context) {
  const view = new HistoryView(root, context);
  view.begin();
  return { update: (status) => view.follow(status), leave: () => view.leave() };
}

/** Seconds since 1970 as a field of date and time takes them, in the time of this computer. */
function localMoment(s) {
  const ms = Math.floor(s) * 1000;
  return new Date(ms - new Date(ms).getTimezoneOffset() * 60000).toISOString().slice(0, 19);
}

class HistoryView {
  constructor(root, context) {
    Object.assign(this, { root, context, data: new HistoryData(), plots: [], found: null, tab: "parts", by: "day" });
    this.move = new Movement({
      get: () => [this.from, this.to],
      set: (from, to) => this.look(from, to),
      limits: () => [this.least(), this.edge(), SHORTEST_S, Math.max(60, (this.edge() - this.least()) * 1.02)],
    });
    this.build();
  }

  build() {
    this.text = make("span", "range-text", " ");
    this.busy = make("span", "busy", t("loading"), { role: "status" });
    const ranges = RANGES.map(([unit, s]) =>
      make("button", "", `${s / { min: 60, h: 3600, d: 86400 }[unit]} ${t(unit)}`, {
        type: "button",
        onclick: () => this.last(s),
        "data-range": s,
      }),
    );
    ranges.push(
      make("button", "", t("all"), { type: "button", onclick: () => this.look(this.first, this.edge(), true) }),
    );
    const step = (text, label, act) =>
      make("button", "", text, { type: "button", "aria-label": label, title: label, onclick: act });
    this.ranges = ranges;
    const moment = (key) =>
      make("input", "", null, {
        type: "datetime-local",
        step: "1",
        "aria-label": t(key),
        onchange: () => this.typed(),
      });
    [this.fromField, this.toField] = [moment("from"), moment("to")];
    const tools = make("div", "head", [
      make("div", "buttons", ranges),
      make("div", "buttons", [
        make("label", "field", [t("from"), this.fromField]),
        make("label", "field", [t("to"), this.toField]),
      ]),
      make("div", "buttons", [
        step("◀", t("earlier"), () => this.move.pan(-0.5)),
        step("▶", t("later"), () => this.move.pan(0.5)),
        step("+", t("zoom_in"), () => this.move.zoom(0.5)),
        step("−", t("zoom_out"), () => this.move.zoom(2)),
      ]),
      this.text,
      this.busy,
      make("a", "button-link grow", t("diagnose_seen"), {
        href: "/twin",
        "data-view": "twin",
        onclick: (event) => {
          event.currentTarget.href = `/twin?from=${new Date(this.from * 1000).toISOString()}&to=${new Date(this.to * 1000).toISOString()}`;
        },
      }),
      make("button", "", t("export_seen"), { type: "button", onclick: () => this.save() }),
    ]);
    this.ribbonBox = make("div", "ribbon-box");
    this.readout = make("div", "readout", null, { "aria-live": "off" });
    this.charts = make("div", "charts");
    this.note = make("p", "note bad", "", { role: "alert" });
    this.overview = make("div", "overview", null, {
      role: "slider",
      tabindex: "0",
      "aria-label": t("whole_history"),
      "aria-valuemin": "0",
      "aria-valuemax": "100",
      "aria-valuenow": "0",
    });
    this.overviewBox = make("div", "");
    this.chooser = make("details", "choose", [make("summary", "", t("choose_channels")), make("div", "chooser")]);
    const pane = make(
      "section",
      "card",
      [
        tools,
        this.readout,
        this.ribbonBox,
        this.charts,
        this.note,
        this.overview,
        this.overviewBox,
        stateLegend(this.context),
        this.chooser,
      ],
      { tabindex: "-1" },
    );
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
    } catch (error) {
      say(this.note, error.message);
      return;
    }
    if (!Number.isFinite(this.first) || this.known.length === 0) {
      say(this.note, t("no_history_yet"));
      return;
    }
    const asked = new URLSearchParams(location.search);
    const time = (key) => {
      const ms = Date.parse(asked.get(key) ?? "");
      return Number.isNaN(ms) ? null : ms / 1000;
    };
    const names = this.known.filter((s) => s.kind === "number").map((s) => s.name);
    this.channels = (asked.get("channels")?.split(",") ?? USUAL).filter((name) => names.includes(name));
    if (!this.channels.length) this.channels = names.slice(0, 3);
    // The question is on its way while the charts are made.
    const [from, to] = [time("from"), time("to")];
    if (from !== null && to !== null && from < to) this.look(from, to, true);
    else this.last(3600);
    drawChooser(this);
    this.ribbon = new StateRibbon(this.ribbonBox, this.context);
    drawPlots(this);
    for (const plot of this.plots) plot.show(this.from, this.to);
    drawRibbon(this);
    drawOverview(this);
    drawWindow(this);
  }

  edge() {
    return Math.max(this.newest, (this.context.status()?.at_ms ?? 0) / 1000);
  }

  /** The earliest time that can be looked at: where the history begins, or earlier where somebody has asked for that. */
  least() {
    return Math.min(this.first, this.lowest ?? this.first);
  }

  last(seconds) {
    const to = this.edge();
    this.look(to - seconds, to, true);
  }

  /** The time that was typed, in the time of this computer. */
  typed() {
    const [from, to] = [this.fromField, this.toField].map((field) => Date.parse(field.value) / 1000);
    if (!Number.isFinite(from) || !Number.isFinite(to)) return;
    if (from < to) this.look(from, to, true);
    else say(this.note, t("from_before_to"));
  }

  /** Looks at another time: at once with what is there, then with what the history says. */
  look(from, to, now = false) {
    [this.from, this.to] = [from, Math.max(to, from + SHORTEST_S)];
    this.lowest = Math.min(this.lowest ?? from, from);
    this.following = this.to >= this.edge() - Math.max(3, 0.01 * (this.to - this.from));
    for (const plot of this.plots) plot.show(this.from, this.to);
    drawRibbon(this);
    this.drawFrame();
    clearTimeout(this.timer);
    if (now) this.read();
    else this.timer = setTimeout(() => this.read(), 90);
  }

  async read() {
    this.busy.classList.add("on");
    const began = performance.now();
    try {
      const found = await this.data.read(
        this.from,
        this.to,
        this.channels,
        { first: this.first, last: this.edge() },
        (early) => this.drawCharts(early, began),
      );
      if (!found) return;
      this.found = found;
      drawRibbon(this);
      this.drawTab();
      if (!this.whole) drawWhole(this);
    } catch (error) {
      say(this.note, error.message);
    }
    this.busy.classList.remove("on");
  }

  /** The charts, as soon as their samples are there. */
  drawCharts({ series, resolution, range: [begin, end] }, began) {
    const empty = series.every((s) => !s.points.some((p) => typeof p[1] === "number"));
    say(this.note, empty ? t("nothing_in_range") : "");
    // Before its first row the history knows of nothing, however early is asked for.
    const known = { from: begin <= this.first ? Math.min(begin, this.from) : begin, to: Math.min(end, this.edge()) };
    for (const plot of this.plots) plot.give(columns(series, plot.names), { ...known, width: resolution });
    readOut(this, null, null);
    this.address();
    this.root.dataset.drawnMs = String(Math.round(performance.now() - began));
    this.root.dataset.resolution = String(resolution);
  }

  address() {
    const query = new URLSearchParams(location.search);
    for (const [key, s] of [
      ["from", this.from],
      ["to", this.to],
    ])
      query.set(key, new Date(s * 1000).toISOString());
    query.set("channels", this.channels.join(","));
    if (location.pathname === "/history")
      history.replaceState(null, "", `/history?${query.toString().replaceAll("%2C", ",").replaceAll("%3A", ":")}`);
  }

  follow(status) {
    if (this.from === undefined || !this.following || document.hidden) return;
    const now = performance.now();
    if (now - (this.followed ?? 0) < FOLLOW_EVERY_MS) return;
    this.followed = now;
    const width = this.to - this.from;
    const to = status.at_ms / 1000;
    if (width < 7200 && to > this.to && this.move.pointers.size === 0) this.look(to - width, to);
  }

  drawFrame() {
    const width = this.to - this.from;
    // The length between the seconds that are printed.
    const length = duration(Math.floor(this.to) - Math.floor(this.from));
    say(
      this.text,
      `${dateTime(this.from * 1000)} – ${width < 86400 ? clock(this.to * 1000) : dateTime(this.to * 1000)} (${length})`,
    );
    // What a person is typing is not overwritten.
    for (const [field, s] of [
      [this.fromField, this.from],
      [this.toField, this.to],
    ])
      if (document.activeElement !== field) field.value = localMoment(s);
    for (const button of this.ranges)
      button.setAttribute(
        "aria-pressed",
        String(Math.abs(Number(button.dataset.range ?? -1) - width) < 1 && this.following),
      );
    drawWindow(this);
  }

  drawTabs() {
    fill(
      this.tabs,
      ["parts", "use", "marks", "facts"].map((word) =>
        make("button", "", t(`tab_${word}`), {
          type: "button",
          "aria-pressed": String(word === this.tab),
          onclick: () => {
            this.tab = word;
            this.drawTabs();
            this.drawTab();
          },
        }),
      ),
    );
  }

  drawTab() {
    if (!this.found) return;
    const range = [this.from, this.to];
    const go = (from, to) => {
      this.look(from, to, true);
      scrollTo({ top: 0 });
    };
    if (this.tab === "parts") partsTable(this.body, this.found, range, this.context, go);
    else if (this.tab === "marks") marksTable(this.body, this.found, range, go);
    else if (this.tab === "facts") (this.facts ??= new FactsTab(this.context)).show(this.body, range);
    else
      useTable(this.body, range, this.context, this.by, (by) => {
        this.by = by;
        this.drawTab();
      }).catch((error) => fill(this.body, [make("p", "note bad", error.message)]));
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
