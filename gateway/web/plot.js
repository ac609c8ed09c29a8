// Charts over time: uPlot with the colours of the page, bands between least and greatest value, and one way to move
// through time with mouse, wheel, finger and keyboard. Draws only what it is given: where there is no value there is a
// gap.
import uPlot from "/web/uplot.js";
import { colour, make } from "./parts.js";
import { breakAtGaps, findGaps, hatch, unrecorded } from "./gaps.js";
import { clock, clockMinute, dayShort, number, unitName } from "./format.js";

/** Width of the value axis: the same everywhere, so that charts and ribbons stand exactly above each other. */
export const AXIS_PX = 64;
/** Room for half of the last label of the time. */
export const RIGHT_PX = 28;
/** Room for the unit, so that it never lies on the greatest number of the axis. */
const TOP_PX = 20;
export const LINES = ["line-a", "line-b", "line-c", "line-d", "line-e", "line-f"];

const timeSplits = [
  1, 5, 10, 30, 60, 120, 300, 600, 1800, 3600, 7200, 14400, 21600, 43200, 86400, 172800, 604800, 1209600, 2678400,
  7776000, 31536000,
];

function timeLabels(_, splits, __, ___, step) {
  let last = null;
  return splits.map((s) => {
    const ms = s * 1000;
    const dayNow = dayShort(ms);
    if (step >= 86400) return dayNow;
    const text = step >= 60 ? clockMinute(ms) : clock(ms);
    const label = last !== null && dayNow !== last ? `${text}\n${dayNow}` : text;
    last = dayNow;
    return label;
  });
}

/** A nearer look at local midnight: uPlot splits in UTC otherwise. */
const localDate = (ts) => new Date(ts * 1000);

export class TimePlot {
  /** `series`: [{name, label, unit, line (name of a colour), dash, fill}]; `low`: the least value of the axis to be
      shown. */
  constructor(root, { series, height = 190, onCursor, label, low = null, high = null, sync = "time", times = true }) {
    this.root = root;
    this.series = series;
    this.height = height;
    this.box = make("div", "plot", null, { role: "img", "aria-label": label });
    root.append(this.box);
    this.low = low;
    this.times = times;
    this.high = high;
    this.sync = sync;
    this.onCursor = onCursor;
    this.observer = new ResizeObserver(() => this.resize());
    this.make();
    this.observer.observe(root);
  }

  width() {
    return Math.max(120, Math.floor(this.root.clientWidth));
  }

  make() {
    const unit = this.series[0]?.unit ?? "";
    const axis = {
      stroke: colour("soft"),
      grid: { stroke: colour("grid"), width: 1 },
      ticks: { show: false },
      font: "12px system-ui, sans-serif",
    };
    const lines = [];
    const bands = [];
    this.series.forEach((one, at) => {
      const stroke = colour(one.line ?? LINES[at % LINES.length]);
      const base = 1 + at * 3;
      lines.push(
        {
          label: one.label,
          stroke,
          width: 1.6,
          dash: one.dash,
          spanGaps: false,
          points: { show: false },
          paths: one.stepped ? uPlot.paths.stepped({ align: 1 }) : undefined,
          fill: one.fill ? colour(one.fill) : undefined,
        },
        { show: true, stroke: "transparent", width: 0, points: { show: false } },
        { show: true, stroke: "transparent", width: 0, points: { show: false } },
      );
      bands.push({ series: [base + 2, base + 1], fill: `${stroke}38` });
    });
    const { low, high } = this;
    this.u = new uPlot(
      {
        width: this.width(),
        height: this.height,
        padding: [TOP_PX, RIGHT_PX, 0, 0],
        legend: { show: false },
        tzDate: localDate,
        cursor: {
          drag: { x: false, y: false },
          sync: this.sync ? { key: this.sync, setSeries: false } : undefined,
          points: { size: 7 },
          y: false,
        },
        scales: { x: { time: true }, y: { range: (_, least, most) => span(least, most, low, high) } },
        axes: [
          {
            ...axis,
            values: this.times ? timeLabels : (_, splits) => splits.map(() => ""),
            space: 84,
            size: this.times ? 34 : 8,
            incrs: timeSplits,
          },
          {
            ...axis,
            size: AXIS_PX,
            gap: 6,
            space: 34,
            values: (_, splits) => splits.map((v) => number(v, Math.abs(splits.at(-1) - splits[0]) < 4 ? "" : unit)),
          },
        ],
        series: [{}, ...lines],
        bands,
        hooks: { setCursor: [(u) => this.onCursor?.(u.cursor.idx)], drawClear: [(u) => this.hatchUnrecorded(u)] },
      },
      this.data ?? [[]].concat(lines.map(() => [])),
      this.box,
    );
    const name = make("span", "plot-unit", unitName(unit));
    this.box.append(name);
    this.move?.attach(this.u.over);
    if (this.range) this.show(...this.range);
  }

  /** Columns: x in seconds, then mean, least and greatest of every series. Each row stands for `width` seconds, of `from` to
      `to` everything is there that was recorded, and waits of up to `least` seconds are none. */
  give(data, { from, to, width = 0, least = 1 }) {
    const gaps = findGaps(data[0], Math.max(least, 1.5 * width));
    this.data = breakAtGaps(data, gaps);
    this.unrecorded = unrecorded(data[0], gaps, { from, to, width });
    this.box.dataset.unrecorded = JSON.stringify(this.unrecorded);
    this.u.setData(this.data, false);
    if (this.range) this.show(...this.range);
  }

  /** The line is broken there; that nothing was recorded is said. */
  hatchUnrecorded(u) {
    const ratio = devicePixelRatio || 1;
    const place = (s) => Math.min(u.bbox.left + u.bbox.width, Math.max(u.bbox.left, u.valToPos(s, "x", true)));
    for (const [from, to] of this.unrecorded ?? []) {
      const [left, right] = [place(from), place(to)];
      hatch(u.ctx, [left, u.bbox.top, right - left, u.bbox.height], ratio);
    }
  }

  /** The time that is looked at, in seconds. */
  show(from, to) {
    this.range = [from, to];
    Object.assign(this.box.dataset, { from, to });
    this.u.batch(() => this.u.setScale("x", { min: from, max: to }));
  }

  resize() {
    if (this.u.width !== this.width()) this.u.setSize({ width: this.width(), height: this.height });
  }

  destroy() {
    this.observer.disconnect();
    this.u.destroy();
    this.box.remove();
  }
}

/** A little room above and below; zero in sight where it is near. */
function span(least, most, low, high) {
  if (least === null || most === null || !Number.isFinite(least)) return [low ?? 0, high ?? 1];
  const from = low === null ? least : Math.min(low, least);
  const to = high === null ? most : Math.max(high, most);
  const room = (to - from || Math.abs(to) || 1) * 0.08;
  return [from === low ? from : from - room, to + room];
}

/** Moving through time: drag pans, wheel and two fingers zoom, double click steps back, keys do the same. */
export class Movement {
  constructor({ get, set, limits }) {
    Object.assign(this, { get, set, limits });
    this.pointers = new Map();
  }

  attach(element, { left = 0, right = 0 } = {}) {
    const place = (event) => {
      const box = element.getBoundingClientRect();
      return Math.min(1, Math.max(0, (event.clientX - box.left - left) / (box.width - left - right)));
    };
    element.classList.add("movable");
    element.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      element.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, place(event));
      this.begin = { range: this.get(), places: new Map(this.pointers) };
    });
    element.addEventListener("pointermove", (event) => {
      if (!this.pointers.has(event.pointerId)) return;
      this.pointers.set(event.pointerId, place(event));
      this.follow();
    });
    for (const end of ["pointerup", "pointercancel"])
      element.addEventListener(end, (event) => {
        this.pointers.delete(event.pointerId);
        this.begin = this.pointers.size ? { range: this.get(), places: new Map(this.pointers) } : null;
      });
    element.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        const sideways = Math.abs(event.deltaX) > Math.abs(event.deltaY);
        if (sideways) this.pan(event.deltaX / element.clientWidth);
        else this.zoom(Math.exp(Math.max(-80, Math.min(80, event.deltaY)) * 0.004), place(event));
      },
      { passive: false },
    );
    element.addEventListener("dblclick", (event) => this.zoom(4, place(event)));
  }

  follow() {
    if (!this.begin) return;
    const {
      range: [from, to],
      places,
    } = this.begin;
    const ids = [...this.pointers.keys()].filter((id) => places.has(id));
    const width = to - from;
    if (ids.length === 1) {
      const moved = this.pointers.get(ids[0]) - places.get(ids[0]);
      return this.apply(from - moved * width, to - moved * width);
    }
    const [a, b] = ids;
    const [a0, b0, a1, b1] = [places.get(a), places.get(b), this.pointers.get(a), this.pointers.get(b)];
    const scale = Math.abs(b0 - a0) / Math.max(0.02, Math.abs(b1 - a1));
    const held = from + ((a0 + b0) / 2) * width;
    this.apply(held - ((a1 + b1) / 2) * width * scale, held + (1 - (a1 + b1) / 2) * width * scale);
  }

  zoom(factor, place = 0.5) {
    const [from, to] = this.get();
    const held = from + place * (to - from);
    this.apply(held - (held - from) * factor, held + (to - held) * factor);
  }

  pan(share) {
    const [from, to] = this.get();
    this.apply(from + share * (to - from), to + share * (to - from));
  }

  apply(from, to) {
    const [first, last, shortest, longest] = this.limits();
    let width = Math.min(Math.max(to - from, shortest), longest);
    let start = from + (to - from - width) / 2;
    if (start + width > last) start = last - width;
    if (start < first) start = first;
    width = Math.min(width, Math.max(last - start, shortest));
    this.set(start, start + width);
  }

  keys(event) {
    const acts = {
      ArrowLeft: () => this.pan(-0.25),
      ArrowRight: () => this.pan(0.25),
      "+": () => this.zoom(0.5),
      "=": () => this.zoom(0.5),
      "-": () => this.zoom(2),
    };
    if (!acts[event.key] || event.target.closest("input, select, textarea")) return;
    event.preventDefault();
    acts[event.key]();
  }
}
