// The machine's states as a coloured band, exactly above the charts. Zoomed far out, shares of time per hour or day.
import { AXIS_PX, RIGHT_PX } from "./plot.js";
import { hatch } from "./gaps.js";
import { colour, make } from "./parts.js";
import { duration } from "./format.js";

const ORDER = ["cutting", "idle", "rapid", "speed_change", "spindle_start", "standby", "unknown", "off"];

export class StateRibbon {
  constructor(root, context, { height = 26 } = {}) {
    this.context = context;
    this.height = height;
    this.canvas = make("canvas", "ribbon", null, { role: "img" });
    this.hover = make("span", "ribbon-hover note");
    root.append(this.canvas);
    this.root = root;
    this.spans = [];
    this.shares = [];
    this.observer = new ResizeObserver(() => this.draw());
    this.observer.observe(root);
  }

  /** Spans: [{from, to, word}] in seconds; shares: [{from, to, seconds: {word: s}}]; marks: [{at, tone}]; unrecorded: [[from, to]].
   */
  show(from, to, spans = [], { shares = [], marks = [], parts = [], unrecorded = [] } = {}) {
    Object.assign(this, { from, to, spans, shares, marks, parts, unrecorded });
    this.draw();
  }

  x(at) {
    return AXIS_PX + ((at - this.from) / (this.to - this.from)) * (this.width - AXIS_PX - RIGHT_PX);
  }

  draw() {
    this.width = Math.floor(this.root.clientWidth);
    if (this.width < 80 || this.from === undefined) return;
    const ratio = devicePixelRatio || 1;
    const wanted = [this.width * ratio, this.height * ratio].map(Math.round);
    if (this.canvas.width !== wanted[0] || this.canvas.height !== wanted[1])
      [this.canvas.width, this.canvas.height] = wanted;
    this.canvas.style.width = `${this.width}px`;
    this.canvas.style.height = `${this.height}px`;
    const pen = this.canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, this.width, this.height);
    pen.fillStyle = colour("grid");
    pen.fillRect(AXIS_PX, 2, this.width - AXIS_PX - RIGHT_PX, this.height - 4);
    for (const gap of this.unrecorded) {
      const [left, right] = this.clipped(...gap);
      hatch(pen, [left, 2, right - left, this.height - 4]);
    }
    if (this.shares.length) this.drawShares(pen);
    else this.drawSpans(pen);
    this.drawMarks(pen);
    this.describe();
  }

  clipped(from, to) {
    return [Math.max(AXIS_PX, this.x(from)), Math.min(this.width - RIGHT_PX, this.x(to))];
  }

  drawSpans(pen) {
    const colours = {};
    for (const { from, to, word } of this.spans) {
      const [left, right] = this.clipped(from, to);
      if (right <= left) continue;
      pen.fillStyle = colours[word] ??= colour(word);
      pen.fillRect(left, 2, Math.max(0.8, right - left), this.height - 4);
    }
  }

  drawShares(pen) {
    const room = this.height - 4;
    for (const { from, to, seconds } of this.shares) {
      const [left, right] = this.clipped(from, to);
      if (right <= left) continue;
      let y = this.height - 2;
      for (const word of ORDER) {
        const part = ((seconds[word] ?? 0) / (to - from)) * room;
        if (part <= 0) continue;
        pen.fillStyle = colour(word);
        pen.fillRect(left, y - part, Math.max(0.8, right - left - 0.5), part);
        y -= part;
      }
    }
  }

  drawMarks(pen) {
    pen.lineWidth = 1;
    for (const at of this.parts ?? []) {
      const x = Math.round(this.x(at)) + 0.5;
      if (x < AXIS_PX || x > this.width - RIGHT_PX) continue;
      pen.strokeStyle = colour("text");
      pen.beginPath();
      pen.moveTo(x, 0);
      pen.lineTo(x, this.height);
      pen.stroke();
    }
    for (const { at, tone } of this.marks ?? []) {
      const x = this.x(at);
      if (x < AXIS_PX || x > this.width - RIGHT_PX) continue;
      pen.fillStyle = colour(tone);
      pen.strokeStyle = colour("card");
      pen.beginPath();
      pen.moveTo(x, this.height - 9);
      pen.lineTo(x + 6, this.height);
      pen.lineTo(x - 6, this.height);
      pen.closePath();
      pen.fill();
      pen.stroke();
    }
  }

  /** What a person who does not see the band is told. */
  describe() {
    const sums = {};
    for (const { from, to, word } of this.spans) {
      const seconds = Math.min(to, this.to) - Math.max(from, this.from);
      if (seconds > 0) sums[word] = (sums[word] ?? 0) + seconds;
    }
    const words = ORDER.filter((word) => sums[word]).map(
      (word) => `${this.context.state(word)} ${duration(sums[word])}`,
    );
    this.canvas.setAttribute("aria-label", words.join(", ") || "–");
  }

  destroy() {
    this.observer.disconnect();
    this.canvas.remove();
  }
}
export { ORDER as STATE_ORDER };
