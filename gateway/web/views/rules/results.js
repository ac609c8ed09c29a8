// What trials and a run over the history say about a draft.
import { fill, make, row, say, table } from "/web/parts.js";
import { duration, number } from "/web/format.js";
import { language, localTimes, scriptWords, t } from "/web/words.js";

export function showTrials(view, found) {
  const lines = found.trials.map((r) =>
    row(
      language() === "zh" ? make("code", "", `trial_${r.name.replaceAll(" ", "_")}`) : r.name,
      r.problem ? t("trial_failed") : t("trial_passed"),
      r.problem
        ? `${t("line")} ${r.problem.line}: ${scriptWords(r.problem.what)}`
        : t("trial_words", r.met, number(r.seconds, "s")),
      { dot: r.problem ? "bad" : "good", tone: r.problem ? "bad" : "" },
    ),
  );
  const problems = found.problems.map((p) =>
    row(`${t("line")} ${p.line}`, "", [p.what, p.next].filter(Boolean).map(scriptWords).join(" – "), {
      dot: "bad",
      tone: "bad",
    }),
  );
  say(view.note, found.fine ? t("trials_fine", found.trials.length) : t("trials_failed"));
  fill(view.result, [
    make("h3", "", t("trials")),
    ...problems,
    ...(lines.length ? lines : [make("p", "empty", t("no_trials"))]),
  ]);
}

export function showBacktest(view, found) {
  const head = [t("what"), t("alarm_or_stop"), t("time"), t("why")];
  const rows = ["lost", "gained", "shifted"].flatMap((word) =>
    found[word].map((d) => {
      // What is at another time has two: that of the rules in charge, and that of the edited ones.
      const [is, would] = d.running ? [d.running, d.edited] : [d, null];
      return [
        t(`backtest_${word}`),
        is.name ?? "",
        [is, would]
          .filter(Boolean)
          .map((it) => localTimes(it.from))
          .join(" → "),
        [is.script, is.evidence, is.text].filter(Boolean).map(localTimes).join(" · "),
      ];
    }),
  );
  const states = found.seconds_per_state
    .filter((s) => Math.abs(s.running_s - s.edited_s) > 1)
    .map((s) => row(view.context.state(s.state), `${duration(s.running_s)} → ${duration(s.edited_s)}`));
  fill(view.result, [
    make("h3", "", t("backtest_title")),
    make(
      "p",
      "note",
      t(
        "backtest_sum",
        found.lost.length,
        found.gained.length,
        found.shifted.length,
        duration(found.override_differs_s),
      ),
    ),
    rows.length
      ? table(head, rows.slice(0, 300), { caption: t("backtest_title") })
      : make("p", "empty", t("backtest_same")),
    ...states,
  ]);
}
