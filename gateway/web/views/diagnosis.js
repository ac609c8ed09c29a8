// Diagnoses in the view of the twin: the latest in words; earlier ones; its report, its model to take over, and the experiment it
// asks for as a list to tick off.
import { ask, card, fill, make, row, say, send, table } from "/web/parts.js";
import { dateTime, number, quantity, unitName } from "/web/format.js";
import { language, own, t } from "/web/words.js";

/** Steps of an experiment that stand open; the others unfold. */
const STEPS_IN_SIGHT = 5;

export const summaryOf = (found) => own({ en: found.summary, zh: found.summary_zh ?? found.summary });
/** A model that fits only with other parameters does not agree: the word says so. */
const moved = (found) => found.verdict === "no_mismatch" && found.beside?.some((one) => one.of_parameters);
export const verdictOf = (found) => t(moved(found) ? "verdict_parameter" : `verdict_${found.verdict}`);
const report = (found) => `${found.page}?lang=${language()}`;

/** The latest one in words, the earlier ones as a table. */
export function drawDiagnoses(latest, past, diagnoses, context, done) {
  const newest = diagnoses[0];
  fill(latest, newest ? [told(newest, context, done)] : [make("p", "empty", t("no_diagnosis"))]);
  const link = (d) => ({
    text: d.page ? make("a", "", t("open_report"), { href: report(d), target: "_blank", rel: "noopener" }) : "–",
  });
  const rows = diagnoses
    .slice(1)
    .map((d) => [
      dateTime(d.at_ms),
      verdictOf(d),
      summaryOf(d),
      `${dateTime(d.from_ms)} – ${dateTime(d.to_ms)}`,
      link(d),
    ]);
  fill(
    past,
    rows.length
      ? [
          table([t("time"), t("verdict"), t("what"), t("examined"), t("report")], rows, {
            caption: t("past_diagnoses"),
          }),
        ]
      : [make("p", "empty", t("no_past_diagnosis"))],
  );
}

/** What the catalogue says of an effect, in the language of the page. */
function effectText(found, kind, which, otherwise) {
  const texts = found.effects?.[kind]?.[which];
  return texts ? own(texts) : kind?.startsWith("unknown") ? t("unknown_effect") : (otherwise ?? kind);
}

/** Errors before and after; where no run was left out, those of the fitted rows, and named so. */
function fitWords({ fit, unit }) {
  const held = fit.before.held_out_rmse ?? null;
  const of = (quality) =>
    (held === null ? quality?.rmse : quality?.held_out_rmse) ?? (held === null ? fit.before.rmse : held);
  const words = t(
    held === null ? "fit_words_all" : "fit_words",
    quantity(of(fit.before), unit),
    quantity(of(fit.after), unit),
    quantity(fit.noise_floor, unit),
  );
  return fit.ceiling ? `${words} ${t("ceiling_words", quantity(of(fit.ceiling), unit))}` : words;
}

/** The time that was examined; a file has none that is told. */
const examinedTime = ({ from_ms, to_ms }) =>
  from_ms === to_ms ? "" : `${t("examined")} ${dateTime(from_ms)} – ${dateTime(to_ms)}`;

function told(found, context, done) {
  const d = found.diagnosis ?? {};
  const parts = [
    make("p", "summary", summaryOf(found)),
    make("p", "note", [verdictOf(found), examinedTime(found), dateTime(found.at_ms)].filter(Boolean).join(" · ")),
  ];
  for (const doubt of d.unit_doubts ?? []) parts.push(make("p", "warn-text", own(doubt)));
  if (d.simulated)
    parts.push(
      make(
        "p",
        "",
        t(
          "series_words",
          quantity(d.simulated.as_given_rmse, d.unit),
          quantity(d.simulated.refitted_rmse, d.unit),
          number(d.simulated.gain),
          quantity(d.simulated.offset, d.unit),
        ),
      ),
    );
  if (d.fit?.before) parts.push(make("p", "", fitWords(d)));
  if (found.beside?.length) {
    const amount = (v) => `${v > 0 ? "+" : ""}${quantity(v, d.unit ?? "")}`;
    const effects = (one) => one.by_effects.reduce((sum, it) => sum + it.difference, 0);
    parts.push(
      make("h3", "", t("beside_watch")),
      ...found.beside.map((one) =>
        row(
          t(`regime_${one.regime}`),
          amount(one.difference),
          `${own({ en: one.text, zh: one.zh })} · ${t("beside_of", amount(one.by_parameters), amount(effects(one)), amount(one.left))}`,
          { dot: one.differs ? "bad" : "good" },
        ),
      ),
    );
  }
  for (const it of d.missing ?? []) {
    const numbers = (it.parameters ?? []).map(
      (p) =>
        `${p.name} = ${number(p.value)}${p.low == null ? "" : ` (${number(p.low)} … ${number(p.high)})`} ${unitName(p.unit)}`,
    );
    const name = effectText(found, it.effect, "name");
    parts.push(
      row(
        effectText(found, it.effect, "statement", it.statement ?? it.effect),
        name,
        [it.equation ? make("code", "", it.equation) : null, numbers.map((one) => ` · ${one}`).join("")].filter(
          Boolean,
        ),
        { dot: "bad" },
      ),
    );
  }
  if (d.alternatives?.length)
    parts.push(
      make("h3", "", t("alternatives")),
      ...d.alternatives.map((a) =>
        row(
          effectText(found, a.effect, "name"),
          t("instead_of", effectText(found, a.instead_of, "name")),
          effectText(found, a.effect, "experiment", a.separating_experiment),
        ),
      ),
    );
  parts.push(...experiment(found, d, done), buttons(found, context));
  return make("div", "diagnosis", parts);
}

function experiment(found, d, done) {
  const steps = (found.steps ?? []).map(own);
  const statement =
    d.next_experiment &&
    (language() === "zh"
      ? (d.next_experiment.statement_zh ??
        effectText(found, d.next_experiment.effect, "experiment", d.next_experiment.statement))
      : d.next_experiment.statement);
  const minutes = d.next_experiment?.minutes;
  if (!statement && !steps.length) return [];
  const title = minutes ? `${t("experiment")} (${t("about", `${number(minutes)} ${t("min")}`)})` : t("experiment");
  const list = steps.length ? steps : [statement];
  const tick = list.map((text, at) => step(`${found.key}#${at}`, text, done));
  const listed = (all, start) =>
    make(
      "ol",
      "steps",
      all.map((it) => make("li", "", it)),
      { start },
    );
  const rest = tick.slice(STEPS_IN_SIGHT);
  return [
    make("h3", "", title),
    statement && steps.length ? make("p", "", statement) : null,
    listed(tick.slice(0, STEPS_IN_SIGHT), 1),
    rest.length
      ? make("details", "", [make("summary", "", t("more_steps", rest.length)), listed(rest, STEPS_IN_SIGHT + 1)])
      : null,
  ].filter(Boolean);
}

function buttons(found, context) {
  const note = make("span", "note", "", { role: "status" });
  const link = (path, text, more = {}) => make("a", "button-link", text, { href: path, ...more });
  const all = [];
  if (found.page) all.push(link(report(found), t("open_report"), { target: "_blank", rel: "noopener" }));
  if (found.steps?.length) all.push(link(`/api/v1/diagnoses/${found.key}/plan?lang=${language()}`, t("plan_csv")));
  if (found.model) all.push(link(`/api/v1/diagnoses/${found.key}/model`, t("download_model")));
  // What the machine cannot feed, and the model of an example, is refused here, with the reason, and not after a click.
  if (found.model && context.status()?.twin && !found.refused && !found.truth) {
    const accept = make("button", "", t("accept_model"), {
      type: "button",
      onclick: () => confirmed(accept, found, note),
    });
    accept.disabled = !context.session?.may?.edit;
    all.push(accept);
  }
  const refused = found.model && found.refused ? [make("p", "warn-text", own(found.refused))] : [];
  return make("div", "", [...refused, make("div", "buttons", [...all, note])]);
}

/** Once more: what is watched from now on is learned anew. */
function confirmed(button, found, note) {
  const dialog = make(
    "dialog",
    "",
    make(
      "form",
      "",
      [
        make("h2", "", t("accept_title")),
        make("p", "", t("accept_words")),
        make("div", "buttons", [
          make("button", "primary", t("accept_model"), { value: "yes" }),
          make("button", "", t("cancel"), { value: "no" }),
        ]),
      ],
      { method: "dialog" },
    ),
  );
  dialog.addEventListener("close", async () => {
    dialog.remove();
    if (dialog.returnValue !== "yes") return;
    try {
      say(note, (await send("/api/v1/twin/model", { key: found.key })).text && t("accepted"));
      button.disabled = true;
    } catch (error) {
      say(note, error.message);
    }
  });
  document.body.append(dialog);
  dialog.showModal();
}

/** Where a model was taken over: the one before it takes its place again, with one click. */
export function drawModelBefore(place, name, context, changed) {
  const note = make("span", "note", "", { role: "status" });
  const back = make("button", "", t("restore_model"), {
    type: "button",
    onclick: async () => {
      back.disabled = true;
      try {
        await ask("/api/v1/twin/model", { method: "DELETE" });
        say(note, t("accepted"));
        setTimeout(changed, 2500);
      } catch (error) {
        say(note, error.message);
      }
    },
  });
  back.disabled = !context.session?.may?.edit;
  fill(place, name ? [make("span", "note", t("model_before", name)), back, note] : []);
}

/** A step to tick off; what is ticked is remembered by this browser. */
function step(key, text, done) {
  const tick = make("input", "", null, { type: "checkbox" });
  tick.checked = done.has(key);
  tick.addEventListener("change", () => {
    if (tick.checked) done.add(key);
    else done.delete(key);
    remember(done);
  });
  return make("label", "step", [tick, text]);
}

const NAME = "experiment";
function remember(done) {
  try {
    localStorage.setItem(NAME, JSON.stringify([...done].slice(-200)));
  } catch {
    /* not remembered */
  }
}
export function ticked() {
  try {
    return new Set(JSON.parse(localStorage.getItem(NAME) ?? "[]"));
  } catch {
    return new Set();
  }
}
