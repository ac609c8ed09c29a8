// The whole history as a band below the charts of the view "History".
import { ask, colour, fill, make, say } from "/web/parts.js";
import { dateTime } from "/web/format.js";
import { t } from "/web/words.js";
import { AXIS_PX, RIGHT_PX } from "/web/plot.js";
import { STATE_ORDER } from "/web/ribbon.js";

/** The whole history as a band; what is looked at is a window in it. Dragging in it looks at any time, of any length.
 */
export function drawOverview(view) {
  view.canvas = make("canvas", "");
  view.window = make("div", "window");
  view.wholeWords = make("div", "note whole-words");
  view.overview.append(view.canvas, view.window);
  fill(view.overviewBox, [view.wholeWords]);
  new ResizeObserver(() => paintOverview(view)).observe(view.overview);
  const place = (event) => {
    const b = view.overview.getBoundingClientRect();
    return (
      view.first +
      Math.min(1, Math.max(0, (event.clientX - b.left - AXIS_PX) / (b.width - AXIS_PX - RIGHT_PX))) *
        (view.edge() - view.first)
    );
  };
  view.overview.addEventListener("pointerdown", (event) => {
    view.overview.setPointerCapture(event.pointerId);
    view.dragged = place(event);
    view.before = [view.from, view.to];
  });
  view.overview.addEventListener("pointermove", (event) => {
    if (view.dragged !== undefined) {
      const at = place(event);
      if (Math.abs(at - view.dragged) > 0.004 * (view.edge() - view.first))
        view.look(Math.min(at, view.dragged), Math.max(at, view.dragged));
    }
  });
  view.overview.addEventListener("pointerup", (event) => {
    const at = place(event);
    if (Math.abs(at - view.dragged) <= 0.004 * (view.edge() - view.first)) {
      const half = (view.before[1] - view.before[0]) / 2;
      view.move.apply(at - half, at + half);
    }
    view.dragged = undefined;
  });
}

/** What the band is painted with: sums over the whole history. Asked for after the charts, which are what was opened.
 */
export async function drawWhole(view) {
  view.whole = [];
  const by = view.edge() - view.first > 30 * 86400 ? "day" : "hour";
  const utc = (s) => new Date(s * 1000).toISOString();
  const found = await ask(`/api/v1/utilisation?from=${utc(view.first)}&to=${utc(view.edge())}&by=${by}`).catch(() => ({
    rows: [],
  }));
  view.whole = found.rows.map((r) => ({
    from: r.from_ms / 1000,
    to: r.from_ms / 1000 + (by === "day" ? 86400 : 3600),
    seconds: r.seconds,
  }));
  paintOverview(view);
}

function paintOverview(view) {
  const [width, height, ratio] = [Math.floor(view.overview.clientWidth), 52, devicePixelRatio || 1];
  if (width < 80 || !view.whole) return;
  [view.canvas.width, view.canvas.height] = [width * ratio, height * ratio].map(Math.round);
  [view.canvas.style.width, view.canvas.style.height] = [`${width}px`, `${height}px`];
  const pen = view.canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.fillStyle = colour("grid");
  pen.fillRect(AXIS_PX, 0, width - AXIS_PX - RIGHT_PX, height);
  const x = (s) => AXIS_PX + ((s - view.first) / (view.edge() - view.first)) * (width - AXIS_PX - RIGHT_PX);
  for (const { from, to, seconds } of view.whole) {
    const [left, right] = [Math.max(AXIS_PX, x(from)), Math.min(width - RIGHT_PX, x(to))];
    const total = Math.max(
      Object.values(seconds).reduce((a, b) => a + b, 0),
      1,
    );
    let y = height;
    for (const word of STATE_ORDER) {
      const part = ((seconds[word] ?? 0) / total) * height;
      pen.fillStyle = colour(word);
      pen.fillRect(left, y - part, Math.max(0.6, right - left - 0.4), part);
      y -= part;
    }
  }
  drawWindow(view);
}

export function drawWindow(view) {
  if (!view.window) return;
  say(view.wholeWords, t("whole_words", dateTime(view.first * 1000), dateTime(view.edge() * 1000)));
  const room = view.overview.clientWidth - AXIS_PX - RIGHT_PX;
  const share = (s) => Math.min(1, Math.max(0, (s - view.first) / (view.edge() - view.first || 1)));
  view.window.style.left = `${AXIS_PX + share(view.from) * room}px`;
  view.window.style.width = `${Math.max(8, (share(view.to) - share(view.from)) * room)}px`;
  view.overview.setAttribute("aria-valuenow", String(Math.round(100 * share(view.from))));
  view.overview.setAttribute("aria-valuetext", view.text.textContent);
}
