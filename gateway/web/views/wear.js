// Tool wear: as the source's figure has it, the limit of the cutting power in red against the measured power in green,
// part by part; how worn the edge is, and how many parts are left.
import uPlot from "/web/uplot.js";
import { ask, card, colour, fill, make, row, say, table } from "/web/parts.js";
import { dateTime, folder, number, quantity } from "/web/format.js";
import { box, own, t } from "/web/words.js";

const PARTS = 400;
const READ_EVERY_MS = 15000;
/** Parts above the limit that make an alarm, as the script has it unless somebody has set it otherwise. */
const LIMIT_PARTS = 3;
/** From here on the filter says that the edge is worn. */
const WORN_PROBABILITY = 0.5;
/** A point of the figure at which nothing is drawn. */
const NO_VALUES = { cutting_power_w: null, limit_w: null, wear_mm: null };
/** The box counts no further. */
const PARTS_MOST = 9999;
/** The tool of an edge: `T1` of `T1-2`, as the box has it; a longer number is part of the name. */
const toolOf = (edge) => edge.replace(/(?<=.)-\d{1,4}$/, "");
const edgeOf = (use) => use.edge || use.tool;
const parts = (count) => (count >= PARTS_MOST ? t("many") : number(Math.round(count)));

export function mount(root, context) {
  const state = { tool: null, parts: [], models: [] };
  const lamp = make("p", "lamp", " ");
  const facts = make("div", "");
  const tools = make("select", "", null, { "aria-label": t("tool") });
  const figure = make("div", "plot-box wear-figure");
  const below = make("p", "note", " ");
  const models = make("div", "");
  const variance = make("div", "");
  tools.addEventListener("change", () => {
    state.tool = tools.value;
    draw();
  });
  root.append(
    make("div", "columns", [card(t("edge_now"), [lamp, facts], "ages"), card(t("wear_models"), models)]),
    card("", [make("div", "head", [make("h2", "", t("wear_figure")), tools]), legend(), figure, below]),
    card(t("anova"), variance),
  );
  let plot = null;
  const draw = () => {
    plot?.destroy();
    plot = drawFigure(figure, below, state, context);
  };
  const read = async () => {
    try {
      const [parts, library] = await Promise.all([
        ask(`/api/v1/parts?from=1990-01-01&limit=${PARTS}`),
        ask("/api/v1/wear"),
      ]);
      [state.parts, state.models] = [parts.rows.filter((p) => p.tools), library.models];
      const known = [...new Set(state.parts.flatMap((p) => p.tools.map((u) => u.tool)))].filter(Boolean).sort();
      if (!known.includes(state.tool)) state.tool = toolOf(context.quantity("tool")?.value ?? "");
      if (!known.includes(state.tool)) state.tool = known[0] ?? null;
      fill(
        tools,
        known.map((tool) => make("option", "", tool, { value: tool, selected: tool === state.tool })),
      );
      tools.hidden = !known.length;
      drawModels(models, state.models);
      draw();
    } catch (error) {
      say(below, error.message);
    }
  };
  read();
  drawVariance(variance);
  const timer = setInterval(read, READ_EVERY_MS);
  return {
    update: (status) => drawEdge(lamp, facts, status, context),
    leave() {
      clearInterval(timer);
      plot?.destroy();
    },
  };
}

function legend() {
  return make(
    "div",
    "legend",
    [
      ["bad", "wear_limit"],
      ["good", "measured_power"],
      ["line-d", "flank_wear"],
    ].map(([name, key]) => {
      const mark = make("i");
      mark.style.background = `var(--${name})`;
      return make("span", "", [mark, t(key)]);
    }),
  );
}

/** Is the edge known to be good? By its wear, or, in a cut that shows none, by the filter over the parts before. */
function knownGood(wear, context) {
  const probability = context.quantity("tool_worn_probability");
  const judged = probability && !probability.missing && probability.value < WORN_PROBABILITY;
  return wear?.flank_wear_mm != null || Boolean(judged);
}

function drawEdge(lamp, facts, status, context) {
  const wear = status.wear;
  const tool = context.quantity("tool");
  const name = tool && !tool.missing ? tool.value : "–";
  // Each worn edge has an alarm of its own, which may be of another edge than the one in use.
  const standing = (code) => status.alarms.filter((a) => a.code.startsWith(code));
  const named = (text) => text.split(/[^\w-]+/).includes(name);
  const [worn, look] = [standing("tool_worn_"), standing("tool_wear")];
  const own_ = worn.some((a) => named(a.text));
  const good = knownGood(wear, context);
  // A lamp that is grey beside a standing alarm is read as a fault: it is red for whichever edge is meant, and says
  // which.
  lamp.dataset.tone = worn.length ? "bad" : look.length ? "warn" : good ? "good" : "";
  const word = t(
    own_ ? "lamp_worn" : look.some((a) => named(a.text)) ? "lamp_look" : good ? "lamp_good" : "lamp_unknown",
  );
  say(
    lamp,
    worn.length && !own_
      ? `${t("other_edges")}: ${own({ en: worn[0].text, zh: worn[0].zh || worn[0].text })}`
      : `${name}: ${word}`,
  );
  const left = wear?.parts_left ?? null;
  const cutting = context.quantity("cutting_power_w");
  // Which model a cut has is no question between the cuts: a standing spindle has neither operation nor material.
  const between = !wear && status.state.word !== "cutting";
  const rows = wear
    ? [
        row(
          t("flank_wear"),
          wear.flank_wear_mm === null
            ? "–"
            : `${number(wear.flank_wear_mm, "mm")} ± ${quantity(wear.flank_wear_uncertainty_mm, "mm")}`,
          wear.why ? box(wear.why) : t("criterion", quantity(wear.criterion_mm, "mm")),
        ),
        row(
          t("wear_limit"),
          wear.limit_w === null ? "–" : `${number(wear.limit_w, "W")} ± ${quantity(wear.limit_uncertainty_w, "W")}`,
          wear.observability === "not_observable_here"
            ? t("not_observable")
            : wear.extrapolated?.length
              ? t("outside_model", wear.extrapolated.join(", "))
              : null,
        ),
        row(t("wear_form"), t(`form_${wear.form}`)),
      ]
    : between
      ? [row(t("no_cut_now"), "", t("no_cut_now_words"))]
      : [row(t("no_wear_model"), "", `${box(status.no_wear_model ?? "")}. ${t("no_wear_model_words")}`)];
  rows.unshift(
    row(
      t("short_cutting_power_w"),
      cutting && !cutting.missing
        ? `${quantity(cutting.value, "W")} ± ${quantity(cutting.uncertainty, "W")}`
        : context.reason(cutting?.missing ?? "not_provided"),
      status.state.load_loss_origin === "not_commissioned"
        ? `${t("loss_not_commissioned", t("wear_judged"))}`
        : t("wear_judged"),
    ),
  );
  if (!between)
    rows.push(
      row(
        t("remaining_parts"),
        left === null ? "–" : parts(left[0]),
        left === null ? t("remaining_unknown") : t("remaining_words", parts(left[1]), parts(left[2])),
      ),
    );
  const found = (key) => {
    const it = context.quantity(key);
    return it && !it.missing ? it : null;
  };
  const [probability, limit, life, material] = [
    "tool_worn_probability",
    "tool_limit_parts",
    "tool_life_share",
    "material_level_pct",
  ].map(found);
  const why = (key) => context.reason(context.quantity(key)?.missing ?? "no_part_yet");
  const pct = (share) => `${number(100 * share)} %`;
  rows.push(
    make("h3", "", t("witnesses")),
    row(
      t("witness_filter"),
      probability ? pct(probability.value) : "–",
      probability ? null : why("tool_worn_probability"),
      { dot: !probability ? "" : probability.value >= WORN_PROBABILITY ? "bad" : "good" },
    ),
    row(
      t("witness_limit"),
      limit ? number(limit.value) : "–",
      limit ? t("witness_limit_words", LIMIT_PARTS) : why("tool_limit_parts"),
      { dot: !limit ? "" : limit.value >= LIMIT_PARTS ? "bad" : limit.value > 0 ? "warn" : "good" },
    ),
    row(t("witness_time"), life ? pct(life.value) : "–", life ? t("witness_time_words") : why("tool_life_share"), {
      dot: !life ? "" : life.value >= 1 ? "warn" : "good",
    }),
    row(
      t("material_level"),
      material ? `${material.value > 0 ? "+" : ""}${number(material.value)} ± ${number(material.uncertainty)} %` : "–",
      t("material_words"),
    ),
  );
  fill(facts, rows);
}

/** Every use of a tool, part by part. Where another edge of it begins there is a point without values, so that the lines
    of two edges are not one. */
function usesOf(parts, tool) {
  const uses = [];
  parts.forEach((part, i) => {
    for (const use of part.tools.filter((u) => u.tool === tool)) {
      const last = uses.at(-1);
      const at = i + 1;
      if (last && edgeOf(last.tool) !== edgeOf(use))
        uses.push({ at: (last.at + at) / 2, begins: edgeOf(use), tool: NO_VALUES });
      uses.push({ at, part, tool: use });
    }
  });
  return uses;
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

function drawFigure(figure, below, state) {
  figure.replaceChildren();
  const use = usesOf(state.parts, state.tool);
  if (!use.length) {
    fill(figure, [make("p", "empty", t("no_wear_parts"))]);
    say(below, "");
    return null;
  }
  const pick = (key) => use.map((u) => u.tool[key]);
  const axis = {
    stroke: colour("soft"),
    grid: { stroke: colour("grid") },
    ticks: { show: false },
    font: "12px system-ui, sans-serif",
  };
  const dots = { show: true, size: 7 };
  const plot = new uPlot(
    {
      width: Math.max(200, figure.clientWidth),
      height: 320,
      legend: { show: false },
      cursor: { drag: { x: false, y: false }, y: false },
      scales: {
        x: { time: false },
        y: { range: (_, a, b) => [0, Math.max(100, b * 1.12)] },
        mm: { range: (_, a, b) => [0, Math.max(0.4, (b ?? 0) * 1.2)] },
      },
      axes: [
        {
          ...axis,
          incrs: [1, 2, 5, 10, 20, 50, 100],
          label: t("part_number"),
          labelSize: 22,
          labelFont: "12px system-ui",
        },
        { ...axis, size: 64, label: "W", labelSize: 18, labelFont: "12px system-ui" },
        {
          ...axis,
          scale: "mm",
          side: 1,
          size: 56,
          grid: { show: false },
          label: "mm",
          labelSize: 18,
          labelFont: "12px system-ui",
        },
      ],
      series: [
        {},
        { label: t("wear_limit"), stroke: colour("bad"), width: 2 },
        { label: t("measured_power"), stroke: colour("good"), width: 2, points: dots },
        { label: t("flank_wear"), scale: "mm", stroke: colour("line-d"), width: 1.5, dash: [4, 4] },
      ],
      hooks: {
        setCursor: [
          (u) => {
            const i = u.cursor.idx;
            if (use[i]?.part) say(below, told(use[i]));
          },
        ],
        draw: [(u) => markEdges(u, use)],
      },
    },
    [use.map((u) => u.at), pick("limit_w"), use.map((u) => powerBesideLimit(u.tool)), pick("wear_mm")],
    figure,
  );
  say(below, told(use.at(-1)));
  return plot;
}

/** The power of the cuts that have the limit, where there is one: other cuts of the part are heavier or lighter. */
function powerBesideLimit(tool) {
  return tool.limit_w === null ? tool.cutting_power_w : (tool.power_at_limit_w ?? null);
}

function told({ part, tool }) {
  const watts = powerBesideLimit(tool);
  const power = watts === null ? "–" : quantity(watts, "W");
  const limit = tool.limit_w === null ? "–" : quantity(tool.limit_w, "W");
  const wear =
    tool.wear_mm === null ? "–" : `${number(tool.wear_mm, "mm")} ± ${quantity(tool.wear_uncertainty_mm ?? 0, "mm")}`;
  const share = watts !== null && tool.limit_w > 0 ? ` (${number((100 * watts) / tool.limit_w)} %)` : "";
  return `${edgeOf(tool)}: ${t("wear_told", dateTime(part.to_ms), `${power}${share}`, limit, wear)}`;
}

/** A share of the variance in percent. What rounds to 100 is not all of it. */
function share(r2) {
  return r2 < 1 && r2 >= 0.9995 ? "> 99.9 %" : `${number(100 * r2)} %`;
}

function drawModels(root, models) {
  if (!models.length) return fill(root, [make("p", "empty", t("no_models_yet"))]);
  const any = (text) => text || t("any");
  const rows = models.map((m) => [
    any(m.machine),
    any(m.tool),
    any(m.work_material),
    any(m.operation),
    t(`form_${m.form}`),
    { num: quantity(m.criterion_mm, "mm") },
    { num: String(m.cuts) },
    { num: `${share(m.r2)}, ± ${quantity(1.96 * m.residual_sd_w, "W")}` },
    m.in_force ? t("in_charge") : t("replaced"),
  ]);
  fill(root, [
    table(
      [
        t("machine"),
        t("tool"),
        t("material"),
        t("operation"),
        t("wear_form"),
        { num: t("criterion_short") },
        { num: t("cuts") },
        { num: "R²" },
        "",
      ],
      rows,
      { caption: t("wear_models") },
    ),
    ...models.filter((m) => m.in_force).map((m) => make("pre", "note", m.formula)),
  ]);
}

/** The table that tells which factors count, from the answer of `identify tool-wear`. */
async function drawVariance(root) {
  const found = await ask("/api/v1/identified/tool-wear").catch((error) => ({ error: error.message }));
  const anova = found.identified?.learned?.surface?.anova;
  const refused = found.identified?.learned?.surface?.refused;
  if (refused)
    return fill(root, [
      make("p", "empty", `${t("anova_refused")}: ${[refused.what, refused.next].filter(Boolean).join("; ")}`),
    ]);
  if (!anova) return fill(root, [make("p", "empty", found.error ?? t("anova_where", folder(found.file)))]);
  const cell = (value) => ({ num: value === null || value === undefined ? "–" : number(value) });
  const percent = (of) => (of === null ? "–" : share(of).replace(" %", ""));
  const rows = anova.sources.map((s) => [
    s.source,
    cell(s.sum_of_squares),
    { num: String(s.degrees_of_freedom) },
    cell(s.mean_square),
    cell(s.f),
    { num: s.p === null || s.p === undefined ? "–" : s.p < 0.0001 ? "< 0.0001" : s.p.toFixed(4) },
  ]);
  const head = [
    t("anova_source"),
    ...["sum_of_squares", "degrees_of_freedom", "mean_square"].map((key) => ({ num: t(key) })),
    { num: "F" },
    { num: "p" },
  ];
  fill(root, [
    table(head, rows, { caption: t("anova") }),
    make("p", "note", t("anova_shares", percent(anova.r2), percent(anova.adjusted_r2), percent(anova.predicted_r2))),
  ]);
}
