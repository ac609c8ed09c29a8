// What was not recorded: no line is drawn across it, and its place in a chart is hatched.
import { colour } from "./parts.js";
import { t } from "./words.js";

/** A wait between two rows that is longer than so many usual ones is a gap. */
const USUAL_WAITS = 2.5;
/** So many waits tell what is usual. */
const WAITS_MIN = 10;
/** Rows that are younger than this may not be in the store yet, s. */
const ON_THE_WAY_S = 15;
/** Between two lines of the hatching, and room that the words need, px. */
const [HATCH_PX, WORDS_PX] = [7, 96];

/** The usual wait of times that were asked about already: a chart asks for its gaps, then for what is not recorded. */
const usualWaits = new WeakMap();

function usualWait(x) {
  if (x.length <= WAITS_MIN) return 0;
  if (!usualWaits.has(x)) {
    const waits = x.slice(1).map((s, at) => s - x[at]);
    usualWaits.set(x, waits.sort((a, b) => a - b)[waits.length >> 1]);
  }
  return usualWaits.get(x);
}

/** The waits in these times that are gaps, as [last row before, first row after]. `least`: shorter ones never are. */
export function findGaps(x, least) {
  const longest = Math.max(least, USUAL_WAITS * usualWait(x));
  const gaps = [];
  for (let at = 1; at < x.length; at += 1) if (x[at] - x[at - 1] > longest) gaps.push([x[at - 1], x[at]]);
  return gaps;
}

/** Columns with a row without values in every gap, so that a line ends before it and another one begins behind it. */
export function breakAtGaps(data, gaps) {
  if (!gaps.length) return data;
  const begins = new Set(gaps.map(([from]) => from));
  const broken = data.map(() => []);
  data[0].forEach((s, at) => {
    data.forEach((column, of) => broken[of].push(column[at]));
    if (!begins.has(s)) return;
    broken.forEach((column, of) => column.push(of ? null : (s + data[0][at + 1]) / 2));
  });
  return broken;
}

/** The times of `from` to `to` of which there are no rows: before the first, in every gap, behind the last. A row stands for `width` seconds. */
export function unrecorded(x, gaps, { from, to, width = 0 }) {
  if (!x.length) return [[from, to]];
  const all = gaps.map(([last, first]) => [last + width, first]);
  const wait = usualWait(x) * USUAL_WAITS;
  if (x[0] - from > Math.max(wait, width, 1)) all.unshift([from, x[0]]);
  const end = x.at(-1) + width;
  if (to - end > Math.max(wait, ON_THE_WAY_S)) all.push([end, to]);
  return all.filter(([a, b]) => b > a);
}

/** Hatches a place of a canvas; the words stand in it where there is room. All in the units of the pen. */
export function hatch(pen, [left, top, width, height], ratio = 1) {
  if (width <= 0 || height <= 0) return;
  pen.save();
  pen.beginPath();
  pen.rect(left, top, width, height);
  pen.clip();
  pen.strokeStyle = colour("faint");
  pen.globalAlpha = 0.35;
  pen.lineWidth = ratio;
  pen.beginPath();
  for (let x = left - height; x < left + width; x += HATCH_PX * ratio) {
    pen.moveTo(x, top + height);
    pen.lineTo(x + height, top);
  }
  pen.stroke();
  pen.globalAlpha = 1;
  if (width > WORDS_PX * ratio) {
    pen.font = `${12 * ratio}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const words = t("not_recorded");
    const room = pen.measureText(words).width / 2 + 6 * ratio;
    const [x, y] = [left + width / 2, top + height / 2];
    pen.fillStyle = colour("card");
    pen.fillRect(x - room, y - 9 * ratio, 2 * room, 18 * ratio);
    pen.fillStyle = colour("soft");
    pen.fillText(words, x, y);
  }
  pen.restore();
}
