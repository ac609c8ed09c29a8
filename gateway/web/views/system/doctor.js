// The doctor of the sources.
import { card, fill, make, row, send, table } from "/web/parts.js";
import { quantity, sourceName } from "/web/format.js";
import { box, t } from "/web/words.js";

/** Doctor: a second connection, who answers, what is wrong and what to do. */
export function doctorCard(context) {
  const list = make("div", "");
  const out = make("div", "", null, { role: "status" });
  const buttons = [];
  const look = async (button, source) => {
    buttons.forEach((it) => {
      it.disabled = true;
    });
    fill(out, [make("p", "note", t("looking_at", sourceName(source)))]);
    try {
      fill(out, told(await send("/api/v1/doctor", { source }), context));
    } catch (error) {
      fill(out, [make("p", "note bad", error.message)]);
    }
    may();
  };
  const may = () =>
    buttons.forEach((it) => {
      it.disabled = !context.session?.may?.edit;
    });
  const give = (known) => {
    fill(
      list,
      known.sources.map((source) => {
        const button = make("button", "", t("look_at_source"), { type: "button", onclick: () => look(button, source) });
        buttons.push(button);
        return make("div", "head", [make("span", "", sourceName(source)), make("span", "grow", button)]);
      }),
    );
    may();
  };
  return { box: card(t("doctor"), [make("p", "note", t("doctor_words")), list, out]), give, may };
}

function told(report, context) {
  const missing = report.readings.filter((r) => r.missing).length;
  const head = row(
    t(report.reachable ? "answers" : "does_not_answer"),
    t("opened_in", quantity(report.timing.open_ms, "ms")),
    [
      Object.entries(report.identity)
        .slice(0, 4)
        .map(([k, v]) => `${k}: ${v}`)
        .join(" · "),
      t("values_missing", report.readings.length, missing),
    ]
      .filter(Boolean)
      .join(" · "),
    { dot: report.reachable ? "good" : "bad" },
  );
  const wrong = report.problems.map((p) => row(box(p.what), "", box(p.next), { dot: "bad", tone: "bad" }));
  const values = report.readings.map((r) => [
    context.name(r.channel),
    r.missing ? context.reason(r.missing) : typeof r.value === "number" ? quantity(r.value, r.unit) : r.value,
  ]);
  return [
    head,
    ...wrong,
    make("details", "choose", [
      make("summary", "", t("all_values")),
      table([t("what"), t("value")], values, { caption: t("all_values") }),
    ]),
  ];
}
