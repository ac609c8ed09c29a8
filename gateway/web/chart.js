// Power over the last minutes, with the machine state as a coloured band below. Draws only what it is given: where there
// is no value the line has a gap.
import { clock, number } from "./words.js";

const BAND = 16;
const PAD = { left: 52, right: 10, top: 22, bottom: 40 };

export class Chart {
  constructor(canvas, hover) {
    this.canvas = canvas;
    this.hover = hover;
    this.lines = [];
    this.states = [];
    this.from = 0;
    this.to = 1;
    canvas.addEventListener("pointermove", (event) => this.point(event.offsetX));
    canvas.addEventListener("pointerleave", () => this.point(null));
    new ResizeObserver(() => this.draw()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  /** `lines`: [{label, unit, colour, dash, points: [[ms, value|null, min?, max?]]}], `states`: [{from, to, word, label}] in ms. */
  show(from, to, lines, states) {
    Object.assign(this, { from, to, lines, states });
    this.draw();
  }

  colour(name) {
    return getComputedStyle(document.body).getPropertyValue(`--${name}`).trim() || "#888";
  }

  x(ms) {
    return PAD.left + ((ms - this.from) / (this.to - this.from)) * (this.width - PAD.left - PAD.right);
  }

  y(value) {
    const bottom = this.height - PAD.bottom;
    return bottom - ((value - this.low) / (this.high - this.low)) * (bottom - PAD.top);
  }

  scale() {
    let low = 0;
    let high = 100;
    for (const line of this.lines)
      for (const [ms, value] of line.points) {
        if (value === null || ms < this.from) continue;
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    const step = niceStep((high - low) / 5);
    this.low = Math.floor(low / step) * step;
    this.high = Math.ceil((high * 1.15) / step) * step;
    this.step = step;
  }

  draw() {
    const ratio = window.devicePixelRatio || 1;
    this.width = this.canvas.clientWidth;
    this.height = this.canvas.clientHeight;
    if (this.width < 50) return;
    this.canvas.width = this.width * ratio;
    this.canvas.height = this.height * ratio;
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.font = "12px system-ui, sans-serif";
    this.scale();
    this.grid(pen);
    this.band(pen);
    pen.save();
    pen.beginPath();
    pen.rect(PAD.left, 0, this.width - PAD.left - PAD.right, this.height - PAD.bottom + 1);
    pen.clip();
    for (const line of this.lines) this.line(pen, line);
    pen.restore();
    if (this.pointer !== undefined && this.pointer !== null) this.crosshair(pen);
  }

  grid(pen) {
    pen.strokeStyle = this.colour("grid");
    pen.fillStyle = this.colour("faint");
    pen.lineWidth = 1;
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (let value = this.low; value <= this.high + this.step / 2; value += this.step) {
      const y = Math.round(this.y(value)) + 0.5;
      stroke(pen, PAD.left, y, this.width - PAD.right, y);
      pen.fillText(number(value), PAD.left - 8, y);
    }
    pen.save();
    pen.textAlign = "left";
    pen.fillText("W", PAD.left - 8 - pen.measureText("W").width, PAD.top - 14);
    pen.restore();
    pen.textAlign = "center";
    const step = timeStep((this.to - this.from) / Math.max(3, this.width / 130));
    for (let ms = Math.ceil(this.from / step) * step; ms <= this.to; ms += step) {
      const x = Math.round(this.x(ms)) + 0.5;
      if (x > PAD.left + 24 && x < this.width - 30) pen.fillText(clock(ms), x, this.height - 7);
      stroke(pen, x, PAD.top, x, this.height - PAD.bottom);
    }
  }

  band(pen) {
    const top = this.height - PAD.bottom + 5;
    for (const { from, to, word } of this.states) {
      const left = Math.max(PAD.left, this.x(from));
      const right = Math.min(this.width - PAD.right, this.x(to));
      if (right <= left) continue;
      pen.fillStyle = this.colour(word);
      pen.fillRect(left, top, Math.max(right - left, 0.75), BAND - 4);
    }
  }

  line(pen, { points, colour, dash, fill }) {
    pen.strokeStyle = this.colour(colour);
    if (points.some((point) => point.length > 3)) this.spread(pen, points, colour);
    pen.lineWidth = dash ? 1.5 : 1.8;
    pen.setLineDash(dash ? [5, 4] : []);
    pen.lineJoin = "round";
    pen.beginPath();
    let down = false;
    for (const [ms, value] of points) {
      if (value === null) { down = false; continue; }
      const [x, y] = [this.x(ms), this.y(value)];
      if (down) pen.lineTo(x, y); else pen.moveTo(x, y);
      down = true;
    }
    pen.stroke();
    pen.setLineDash([]);
  }

  /** Between the least and the greatest value of each bucket. */
  spread(pen, points, colour) {
    pen.save();
    pen.globalAlpha = 0.22;
    pen.fillStyle = this.colour(colour);
    for (let i = 0; i + 1 < points.length; i += 1) {
      const [a, b] = [points[i], points[i + 1]];
      if (a[1] === null || b[1] === null || a.length < 4 || b.length < 4) continue;
      pen.beginPath();
      pen.moveTo(this.x(a[0]), this.y(a[3]));
      pen.lineTo(this.x(b[0]), this.y(b[3]));
      pen.lineTo(this.x(b[0]), this.y(b[2]));
      pen.lineTo(this.x(a[0]), this.y(a[2]));
      pen.fill();
    }
    pen.restore();
  }

  point(offset) {
    this.pointer = offset !== null && offset > PAD.left && offset < this.width - PAD.right ? offset : null;
    this.hover.hidden = this.pointer === null;
    this.draw();
  }

  crosshair(pen) {
    const ms = this.from + ((this.pointer - PAD.left) / (this.width - PAD.left - PAD.right)) * (this.to - this.from);
    pen.strokeStyle = this.colour("faint");
    stroke(pen, this.pointer, PAD.top, this.pointer, this.height - PAD.bottom + BAND);
    const rows = this.lines.map((line) => [line.label, nearest(line.points, ms), line.unit]);
    const state = this.states.find((span) => span.from <= ms && ms < span.to);
    this.hover.replaceChildren(element("b", `${clock(ms)}${state ? ` · ${state.label}` : ""}`));
    for (const [label, value, unit] of rows)
      this.hover.append(element("div", `${label} ${value === null ? "–" : `${number(value)} ${unit}`}`));
    const right = this.pointer > this.width / 2;
    this.hover.style.left = right ? "auto" : `${this.pointer + 14}px`;
    this.hover.style.right = right ? `${this.width - this.pointer + 14}px` : "auto";
  }
}

function element(tag, content) {
  const made = document.createElement(tag);
  made.textContent = content;
  return made;
}

function nearest(points, ms) {
  let best = null;
  let distance = Infinity;
  for (const [at, value] of points)
    if (Math.abs(at - ms) < distance) { distance = Math.abs(at - ms); best = value; }
  return best;
}

function stroke(pen, x0, y0, x1, y1) {
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}

function niceStep(raw) {
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 2.5, 5, 10].map((n) => n * power).find((step) => step >= raw);
}

function timeStep(raw) {
  const steps = [5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 21600, 43200, 86400];
  return 1000 * (steps.find((step) => step * 1000 >= raw) ?? 86400);
}
