// Of the view "Tool wear": the limit of the cutting power against the measured power, part by part, and the edges one by one.
import uPlot from "/web/uplot.js";
import { colour, fill, keyOf, make, say, table } from "/web/parts.js";
import { dateTime, number, quantity } from "/web/format.js";
import { t } from "/web/words.js";

/** A point of the figure at which nothing is drawn. */
const NO_VALUES = { cutting_power_w: null, limit_w: null, power_at_limit_w: null, wear_mm: null };
/** A part that begins so much later than the one before it has ended is behind a time that was not recorded, ms. */
const APART_MS = 5000;
/** The lines: colour, words, dashes. The measured power of cuts with a limit is held against it; that of other cuts is not. */
const LINES = {
  limit: ["bad", "wear_limit", null],
  beside: ["good", "measured_power", null],
  without: ["soft", "measured_without_limit", null],
  wear: ["line-d", "flank_wear", [4, 4]],
};

export const edgeOf = (use) => use.edge || use.tool;

/** Every use of a tool, part by part. Where another edge of it begins, or behind a time that was not recorded, there is a point without
    values, so that no line goes across. */
export function usesOf(parts, tool) {
  const uses = [];
  let apart = false;
  parts.forEach((part, i) => {
    apart ||= i > 0 && part.from_ms - parts[i - 1].to_ms > APART_MS;
    for (const use of (part.tools ?? []).filter((u) => u.tool === tool)) {
      const last = uses.at(-1);
      const at = i + 1;
      const begins = last && edgeOf(last.tool) !== edgeOf(use) ? edgeOf(use) : null;
      if (last && (begins || apart))
        uses.push({ at: (last.at + at) / 2, begins: begins ?? t("not_recorded"), tool: NO_VALUES });
      uses.push({ at, part, tool: use });
      apart = false;
    }
  });
  return uses;
}

/** The uses of each edge, in the order in which they were put in. */
export function edgesOf(uses) {
  const edges = [];
  for (const use of uses.filter((it) => it.part)) {
    const name = edgeOf(use.tool);
    if (edges.at(-1)?.name !== name) edges.push({ name, uses: [] });
    edges.at(-1).uses.push(use);
  }
  return edges;
}

function columnsOf(uses) {
  const of = (value) => uses.map((use) => value(use.tool) ?? null);
  return {
    limit: of((it) => it.limit_w),
    beside: of((it) => (it.limit_w === null ? null : it.power_at_limit_w)),
    without: of((it) => (it.limit_w === null ? it.cutting_power_w : null)),
    wear: of((it) => it.wear_mm),
  };
}

/** A dashed line where another edge begins, with its name. */
function markEdges(u, uses) {
  const pen = u.ctx;
  const ratio = devicePixelRatio || 1;
  pen.save();
  pen.strokeStyle = pen.fillStyle = colour("soft");
  pen.lineWidth = ratio;
  pen.setLineDash([3 * ratio, 3 * ratio]);
  pen.font = `${12 * ratio}px system-ui, sans-serif`;
  pen.textBaseline = "top";
  pen.textAlign = "left";
  for (const { at, begins } of uses.filter((it) => it.begins)) {
    const x = Math.round(u.valToPos(at, "x", true));
    pen.beginPath();
    pen.moveTo(x, u.bbox.top);
    pen.lineTo(x, u.bbox.top + u.bbox.height);
    pen.stroke();
    pen.fillText(begins, x + 4 * ratio, u.bbox.top + 2 * ratio);
  }
  pen.restore();
}

/** Each line that has a value, as it is drawn. */
function legend(columns) {
  const drawn = Object.keys(LINES).filter((name) => columns[name].some((value) => value !== null));
  const marks = drawn.map((name) => {
    const [line, key, dash] = LINES[name];
    return keyOf(line, t(key), dash ? "dashed" : "");
  });
  return columns.limit.some((value) => value !== null) ? marks : [...marks, make("span", "", t("no_limit_in_figure"))];
}

/** Draws figure, legend, the words below and the list of the edges; gives the plot, or nothing where there are no parts. */
export function drawFigure({ figure, key, below, edges }, { parts, tool, thresholds }) {
  figure.replaceChildren();
  const uses = usesOf(parts, tool);
  if (!uses.length) {
    fill(figure, [make("p", "empty", t("no_wear_parts"))]);
    fill(key, []);
    fill(edges, []);
    say(below, "");
    return null;
  }
  const columns = columnsOf(uses);
  fill(key, legend(columns));
  fill(edges, [edgesTable(edgesOf(uses))]);
  const tell = (use) => say(below, told(use, thresholds.parts));
  const plot = plotOf(figure, uses, columns, tell);
  tell(uses.at(-1));
  return plot;
}

function plotOf(figure, uses, columns, tell) {
  const font = "12px system-ui, sans-serif";
  const axis = { stroke: colour("soft"), grid: { stroke: colour("grid") }, ticks: { show: false }, font };
  const named = (label, size) => ({ label, labelSize: size, labelFont: font });
  const series = Object.entries(LINES).map(([name, [line, label, dash]]) => ({
    label: t(label),
    stroke: colour(line),
    width: name === "wear" ? 1.5 : 2,
    dash: dash ?? undefined,
    scale: name === "wear" ? "mm" : "y",
    points: { show: true, size: name === "beside" || name === "without" ? 7 : 5 },
  }));
  return new uPlot(
    {
      width: Math.max(200, figure.clientWidth),
      height: 320,
      legend: { show: false },
      cursor: { drag: { x: false, y: false }, y: false },
      scales: {
        x: { time: false, range: (_, a, b) => [Math.min(a, b - 1) - 0.5, Math.max(b, a + 1) + 0.5] },
        y: { range: (_, a, b) => [0, Math.max(100, b * 1.12)] },
        mm: { range: (_, a, b) => [0, Math.max(0.4, (b ?? 0) * 1.2)] },
      },
      axes: [
        { ...axis, incrs: [1, 2, 5, 10, 20, 50, 100], ...named(t("part_number"), 22) },
        { ...axis, size: 64, ...named("W", 18) },
        { ...axis, scale: "mm", side: 1, size: 56, grid: { show: false }, ...named("mm", 18) },
      ],
      series: [{}, ...series],
      hooks: {
        setCursor: [(u) => uses[u.cursor.idx]?.part && tell(uses[u.cursor.idx])],
        draw: [(u) => markEdges(u, uses)],
      },
    },
    [uses.map((use) => use.at), ...Object.keys(LINES).map((name) => columns[name])],
    figure,
  );
}

const wearOf = (tool) =>
  tool.wear_mm === null ? "–" : `${number(tool.wear_mm, "mm")} ± ${quantity(tool.wear_uncertainty_mm ?? 0, "mm")}`;

function told({ part, tool }, limitParts) {
  const head = `${edgeOf(tool)}: `;
  const time = dateTime(part.to_ms);
  if (tool.limit_w === null) {
    const power = tool.cutting_power_w === null ? "–" : quantity(tool.cutting_power_w, "W");
    return head + t("wear_told_no_limit", time, power, wearOf(tool));
  }
  const watts = tool.power_at_limit_w ?? null;
  const share = watts !== null && tool.limit_w > 0 ? ` (${number((100 * watts) / tool.limit_w)} %)` : "";
  const power = watts === null ? "–" : `${quantity(watts, "W")}${share}`;
  const above = watts !== null && watts > tool.limit_w && limitParts !== null;
  return [
    head + t("wear_told", time, power, quantity(tool.limit_w, "W"), wearOf(tool)),
    above ? t("above_limit_words", limitParts) : "",
  ]
    .filter(Boolean)
    .join(". ");
}

/** The edges of the tool one by one, the newest first: how many parts, from when to when, and how each stood at its last part. */
function edgesTable(edges) {
  const rows = edges
    .slice()
    .reverse()
    .map(({ name, uses }) => {
      const [first, last] = [uses[0], uses.at(-1)];
      const { limit_w: limit, power_at_limit_w: beside, cutting_power_w: any } = last.tool;
      const power = limit === null ? any : beside;
      return [
        name,
        { num: String(uses.length) },
        dateTime(first.part.from_ms),
        dateTime(last.part.to_ms),
        { num: power == null ? "–" : quantity(power, "W") },
        { num: limit === null ? t("no_limit") : quantity(limit, "W") },
        { num: wearOf(last.tool) },
      ];
    });
  const head = [
    t("edge"),
    { num: t("pieces") },
    t("from"),
    t("to"),
    { num: t("last_power") },
    { num: t("wear_limit") },
    { num: t("flank_wear") },
  ];
  return table(head, rows, { caption: t("edges_title") });
}
