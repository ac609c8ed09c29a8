// Of the view "Tool wear": the state of the edge in use, in one word with its reason, and the signs that it is judged by.
import { ask, fill, make, row, say } from "/web/parts.js";
import { number, quantity } from "/web/format.js";
import { box, own, t } from "/web/words.js";

/** The box counts no further. */
const PARTS_MOST = 9999;
const parts = (count) => (count >= PARTS_MOST ? t("many") : number(Math.round(count)));
const pct = (share) => `${number(100 * share)} %`;

/** From where on an edge is worn: the settings of the script that decides. The page has no number of its own. */
export async function readThresholds() {
  const { settings } = await ask("/api/v1/settings").catch(() => ({ settings: [] }));
  const of = (name) => settings.find((it) => it.script === "tool_wear" && it.name === name)?.value ?? null;
  return { probability: of("alarm_probability"), parts: of("limit_parts"), life: of("life_share") };
}

/** A quantity of the newest status that has a value. */
function found(context, key) {
  const it = context.quantity(key);
  return it && !it.missing ? it : null;
}

const sentence = (alarm) => own({ en: alarm.text, zh: alarm.zh || alarm.text });
/** The tool of an edge: `T1` of `T1-2`, as the box has it; a longer number is part of the name. */
export const toolOf = (edge) => edge.replace(/(?<=.)-\d{1,4}$/, "");

/** The one state of the edge in use: worn, good, or not judged, with the reason. The alarm of the rule goes before the figures. */
export function judgeEdge(edge, { alarms }, context, thresholds) {
  const of = (code) => alarms.find((alarm) => alarm.code === code);
  const worn = of(`tool_worn_${edge}`);
  if (worn) return { state: "worn", tone: "bad", why: sentence(worn) };
  const unseen = of(`tool_unseen_${toolOf(edge)}`);
  if (unseen) return { state: "unknown", tone: "", why: sentence(unseen) };
  const probability = found(context, "tool_worn_probability");
  if (!probability || thresholds.probability === null) {
    const missing = context.quantity("tool_worn_probability")?.missing ?? "no_part_yet";
    return { state: "unknown", tone: "", why: probability ? t("no_wear_rule") : context.reason(missing) };
  }
  const why = t("why_judged", pct(probability.value), pct(thresholds.probability));
  return probability.value < thresholds.probability
    ? { state: "good", tone: "good", why }
    : { state: "worn", tone: "bad", why };
}

export function drawEdge({ lamp, reason, others, facts }, status, context, thresholds) {
  const tool = found(context, "tool");
  const edge = tool?.value ?? "–";
  const { state, tone, why } = judgeEdge(edge, status, context, thresholds);
  lamp.dataset.tone = tone;
  lamp.dataset.state = state;
  say(lamp, `${edge}: ${t(`lamp_${state}`)}`);
  say(reason, why);
  // Each worn edge has an alarm of its own, which may be of another edge than the one in use.
  const elsewhere = status.alarms.filter(({ code }) => code.startsWith("tool_worn_") && code !== `tool_worn_${edge}`);
  fill(
    others,
    elsewhere.map((alarm) => row(sentence(alarm), "", t("other_edges"), { dot: "bad", tone: "bad" })),
  );
  fill(facts, [
    cuttingRow(status, context),
    ...modelRows(status, context),
    ...signRows(context, thresholds),
    materialRow(context),
  ]);
}

function cuttingRow(status, context) {
  const cutting = context.quantity("cutting_power_w");
  const now =
    cutting && !cutting.missing
      ? `${quantity(cutting.value, "W")} ± ${quantity(cutting.uncertainty, "W")}`
      : context.reason(cutting?.missing ?? "not_provided");
  const uncommissioned = status.state.load_loss_origin === "not_commissioned";
  return row(t("cutting_now"), now, uncommissioned ? t("loss_not_commissioned", t("wear_judged")) : t("wear_judged"));
}

/** What a learned model says of this edge. Which model a cut has is no question between the cuts: a standing spindle has neither
    operation nor material. */
function modelRows(status, context) {
  const wear = status.wear;
  if (!wear && status.state.word !== "cutting") return [row(t("no_cut_now"), "", t("no_cut_now_words"))];
  if (!wear) return [row(t("no_wear_model"), "", `${box(status.no_wear_model ?? "")}. ${t("no_wear_model_words")}`)];
  const wide = (value, half, unit) => `${number(value, unit)} ± ${quantity(half, unit)}`;
  const left = wear.parts_left ?? null;
  return [
    row(
      t("flank_wear"),
      wear.flank_wear_mm === null ? "–" : wide(wear.flank_wear_mm, wear.flank_wear_uncertainty_mm, "mm"),
      [t("criterion", quantity(wear.criterion_mm, "mm")), wear.flank_wear_mm === null ? box(wear.why) : ""]
        .filter(Boolean)
        .join(" · "),
    ),
    row(
      t("wear_limit"),
      wear.limit_w === null ? t("no_limit") : wide(wear.limit_w, wear.limit_uncertainty_w, "W"),
      wear.limit_w === null ? whyNoLimit(wear, context) : t("limit_words"),
    ),
    row(t("wear_form"), t(`form_${wear.form}`)),
    row(
      t("remaining_parts"),
      left === null ? "–" : parts(left[0]),
      left === null ? t("remaining_unknown") : t("remaining_words", parts(left[1]), parts(left[2])),
    ),
  ];
}

function whyNoLimit(wear, context) {
  if (wear.observability === "not_observable_here") return t("not_observable");
  if (wear.extrapolated?.length) return t("outside_model", wear.extrapolated.map(context.name).join(", "));
  return wear.why ? box(wear.why) : t("no_limit_words");
}

/** One of them is enough. Where a figure is missing its reason stands in its place; where no rule decides, it has no colour. */
function signRows(context, thresholds) {
  const sign = (key, title, threshold, { shown, words, early }) => {
    const it = found(context, key);
    const reached = it && threshold !== null && it.value >= threshold;
    const dot = !it || threshold === null ? "" : reached ? "bad" : early?.(it.value) ? "warn" : "good";
    const why = it
      ? threshold === null
        ? t("no_wear_rule")
        : words
      : context.reason(context.quantity(key)?.missing ?? "no_part_yet");
    return row(t(title), it ? shown(it.value) : "–", why, { dot });
  };
  const { probability, parts: limit, life } = thresholds;
  return [
    make("h3", "", t("witnesses")),
    sign("tool_worn_probability", "witness_filter", probability, {
      shown: pct,
      words: probability === null ? "" : t("worn_from", pct(probability)),
    }),
    sign("tool_limit_parts", "witness_limit", limit, {
      shown: number,
      words: t("worn_from_parts", limit),
      early: (value) => value > 0,
    }),
    sign("tool_life_share", "witness_time", life, {
      shown: pct,
      words: life === null ? "" : t("witness_time_words", pct(life)),
    }),
  ];
}

function materialRow(context) {
  const it = found(context, "material_level_pct");
  const level = it ? `${it.value > 0 ? "+" : ""}${number(it.value)} ± ${number(it.uncertainty)} %` : "–";
  return row(t("material_level"), level, t("material_words"));
}
