// Tool wear: as the source's figure has it, the limit of the cutting power in red against the measured power in green,
// part by part; how worn the edge is, and how many parts are left.
import { ask, card, fill, make, say, table } from "/web/parts.js";
import { folder, number, quantity } from "/web/format.js";
import { t } from "/web/words.js";
import { drawEdge, readThresholds, toolOf } from "/web/wear-edge.js";
import { drawFigure } from "/web/wear-figure.js";

const PARTS = 400;
const READ_EVERY_MS = 15000;

export function mount(root, context) {
  const state = { tool: null, parts: [], thresholds: { probability: null, parts: null, life: null } };
  const edge = {
    lamp: make("p", "lamp", " "),
    reason: make("p", "lamp-why", " "),
    others: make("div", ""),
    facts: make("div", ""),
  };
  const tools = make("select", "", null, { "aria-label": t("tool") });
  const drawn = {
    key: make("div", "legend"),
    figure: make("div", "plot-box wear-figure"),
    below: make("p", "note", " "),
    edges: make("div", ""),
  };
  const models = make("div", "");
  const variance = make("div", "");
  tools.addEventListener("change", () => {
    state.tool = tools.value;
    draw();
  });
  root.append(
    make("div", "columns", [
      card(t("edge_now"), [edge.lamp, edge.reason, edge.others, edge.facts], "ages"),
      card(t("wear_models"), [make("p", "note", t("wear_models_words")), models]),
    ]),
    card("", [make("div", "head", [make("h2", "", t("wear_figure")), tools]), drawn.key, drawn.figure, drawn.below]),
    card(t("edges_title"), drawn.edges),
    card(t("anova"), [make("p", "note", t("anova_words")), variance]),
  );
  let plot = null;
  const draw = () => {
    plot?.destroy();
    plot = drawFigure(drawn, state);
  };
  const read = async () => {
    try {
      const [parts, library, thresholds] = await Promise.all([
        ask(`/api/v1/parts?from=1990-01-01&limit=${PARTS}`),
        ask("/api/v1/wear"),
        readThresholds(),
      ]);
      Object.assign(state, { parts: parts.rows, thresholds });
      const known = [...new Set(state.parts.flatMap((p) => (p.tools ?? []).map((u) => u.tool)))].filter(Boolean).sort();
      if (!known.includes(state.tool)) state.tool = toolOf(context.quantity("tool")?.value ?? "");
      if (!known.includes(state.tool)) state.tool = known[0] ?? null;
      fill(
        tools,
        known.map((tool) => make("option", "", tool, { value: tool, selected: tool === state.tool })),
      );
      tools.hidden = !known.length;
      drawModels(models, library.models);
      draw();
      if (context.status()) drawEdge(edge, context.status(), context, thresholds);
    } catch (error) {
      say(drawn.below, error.message);
    }
  };
  read();
  drawVariance(variance);
  const timer = setInterval(read, READ_EVERY_MS);
  return {
    update: (status) => drawEdge(edge, status, context, state.thresholds),
    leave() {
      clearInterval(timer);
      plot?.destroy();
    },
  };
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
