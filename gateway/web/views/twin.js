// Twin: the machine beside its simulation. What is watched, what differs, what the latest diagnosis says, what to try
// next.
import { ask, card, fill, keyOf, make, row, say } from "/web/parts.js";
import { clock, number, printed, quantity, when } from "/web/format.js";
import { box, own, t } from "/web/words.js";
import { TimePlot } from "/web/plot.js";
import { columns } from "/web/history-data.js";
import { Brought } from "/web/brought.js";
import { Asking } from "/web/diagnosis-asking.js";
import { drawDiagnoses, drawModelBefore, ticked } from "/web/diagnosis.js";

const SPANS = [3600, 6 * 3600, 86400, 7 * 86400];

export function mount(root, context) {
  const state = { span: 3600, read: 0, plots: [], done: ticked() };
  const verdict = make("p", "verdict", " ");
  const facts = make("div", "");
  const before = make("div", "buttons");
  const regimes = make("div", "");
  const figure = make("div", "plot-box");
  const left = make("div", "plot-box");
  const note = make("p", "note", " ");
  const latest = make("div", "");
  const past = make("div", "");
  const ranges = make(
    "div",
    "buttons",
    SPANS.map((s) =>
      make("button", "", s < 86400 ? `${s / 3600} ${t("h")}` : `${s / 86400} ${t("d")}`, {
        type: "button",
        "data-span": s,
        onclick: () => {
          state.span = s;
          press();
          read();
        },
      }),
    ),
  );
  const press = () => {
    for (const b of ranges.children) b.setAttribute("aria-pressed", String(Number(b.dataset.span) === state.span));
  };
  press();
  const asking = new Asking(context, () => setTimeout(() => read(), 1500));
  const brought = new Brought(context);
  root.append(
    make("div", "columns", [
      card(t("twin_now"), [verdict, facts, before], "ages"),
      card(t("twin_watched"), regimes, "ages"),
    ]),
    card("", [
      make("div", "head", [make("h2", "", t("twin_figure")), ranges]),
      make(
        "div",
        "legend",
        [
          ["line-a", "recorded_value"],
          ["line-c", "simulated_value"],
        ].map(([name, key]) => keyOf(name, t(key))),
      ),
      figure,
      make("h3", "", t("twin_residual")),
      left,
      note,
    ]),
    card(t("latest_diagnosis"), latest),
    brought.box,
    asking.box,
    card(t("past_diagnoses"), past),
  );
  const read = async () => {
    const status = context.status();
    if (!status) return;
    const twin = await ask("/api/v1/twin?limit=20").catch(() => ({ diagnoses: [] }));
    drawDiagnoses(latest, past, twin.diagnoses, context, state.done);
    drawModelBefore(before, twin.model_before, context, () => read());
    figure.closest(".card").hidden = regimes.closest(".card").hidden = !status.twin;
    for (const it of [latest, past]) it.closest(".card").hidden = !status.twin && !twin.diagnoses.length;
    if (!status.twin) return;
    try {
      const known = (await ask("/api/v1/series")).series.map((s) => s.name);
      const suffix = status.twin.output.split("_").at(-1);
      const names = [`twin_expected_${suffix}`, `twin_residual_${suffix}`];
      if (!names.every((name) => known.includes(name))) return;
      const [from, to] = [status.at_ms / 1000 - state.span, status.at_ms / 1000];
      const utc = (s) => new Date(s * 1000).toISOString();
      const resolution = state.span > 50000 ? 600 : state.span > 10000 ? 60 : 4;
      const found = await ask(
        `/api/v1/samples?from=${utc(from)}&to=${utc(to)}&channels=${names.join(",")}&resolution_s=${resolution}`,
      );
      state.plots.forEach((plot) => plot.destroy());
      const unit = status.twin.unit;
      const both = new TimePlot(figure, {
        height: 230,
        low: 0,
        sync: "twin",
        label: t("twin_figure"),
        series: [
          { label: t("recorded_value"), unit, line: "line-a" },
          { label: t("simulated_value"), unit, line: "line-c" },
        ],
      });
      const rest = new TimePlot(left, {
        height: 150,
        sync: "twin",
        label: t("twin_residual"),
        series: [{ label: t("twin_residual"), unit, line: "line-d" }],
      });
      // What is compared is the mean of a second: recorded is simulated plus difference, so that the three add up at
      // every point.
      const [simulated, difference] = [columns(found.series, names.slice(0, 1)), columns(found.series, names.slice(1))];
      const sum = (a, b) => a.map((v, at) => (v === null || b[at] === null || b[at] === undefined ? null : v + b[at]));
      const pair = [
        simulated[0],
        sum(simulated[1], difference[1]),
        simulated[2].map(() => null),
        simulated[3].map(() => null),
        ...simulated.slice(1),
      ];
      const recorded = { from, to, width: resolution };
      both.give(pair, recorded);
      both.show(from, to);
      rest.give(difference, recorded);
      rest.show(from, to);
      state.plots = [both, rest];
    } catch (error) {
      say(note, error.message);
    }
  };
  const timer = setInterval(read, 15000);
  let begun = false;
  return {
    update(status) {
      if (!begun) {
        begun = true;
        read();
      }
      drawNow(verdict, facts, regimes, status, context);
      asking.update(status);
      brought.update();
    },
    session: () => read(),
    leave() {
      clearInterval(timer);
      asking.leave();
      brought.leave();
      state.plots.forEach((plot) => plot.destroy());
    },
  };
}

/** Recorded less simulated, as the two are printed; the difference of the box where one of them is missing. */
export function printedDifference(twin) {
  const parts = [twin.twin_recorded, twin.twin_expected];
  if (!parts.every((it) => typeof it === "number")) return twin.twin_residual;
  const [recorded, simulated] = parts.map((it) => printed(it, twin.unit));
  return Number((recorded - simulated).toFixed(3));
}

function drawNow(verdict, facts, regimes, status, context) {
  const twin = status.twin;
  if (!twin) {
    verdict.dataset.tone = "";
    say(verdict, t("no_twin"));
    fill(facts, [make("p", "note", t("no_twin_words"))]);
    return fill(regimes, [make("p", "empty", "–")]);
  }
  const differing = twin.regimes.filter((r) => r.stage === "differing");
  const learning = twin.regimes.filter((r) => r.stage === "learning");
  const tone = differing.length ? "bad" : learning.length || !twin.regimes.length ? "" : "good";
  verdict.dataset.tone = tone;
  say(
    verdict,
    t(differing.length ? "twin_differs" : learning.length || !twin.regimes.length ? "twin_learning" : "twin_agrees"),
  );
  const value = (v) => (v === null || v === undefined ? "–" : quantity(v, twin.unit));
  const second = twin.second_ms ? t("of_second", clock(twin.second_ms)) : null;
  fill(facts, [
    row(t("recorded_value"), value(twin.twin_recorded)),
    row(t("simulated_value"), value(twin.twin_expected)),
    // The difference of what is printed: figures that were rounded one by one are off by one.
    row(t("twin_residual"), value(printedDifference(twin)), twin.missing ? context.reason(twin.missing) : second),
    row(t("model"), make("span", "typed", twin.model), make("code", "", twin.file)),
    twin.problem ? row(t("model_refused"), "", box(twin.problem), { dot: "bad", tone: "bad" }) : null,
    twin.diagnosing_since_ms
      ? row(t("diagnosing"), t("since_clock", clock(twin.diagnosing_since_ms)), null, { dot: "warn" })
      : null,
  ]);
  const line = (r) => {
    const share = r.learned
      ? t("learned_of", r.learned[0], r.learned[1])
      : r.stage === "differing"
        ? `${value(r.difference)}${r.difference_pct == null ? "" : ` (${number(r.difference_pct, "%")} %)`}`
        : `± ${value(r.usual)}`;
    const since = r.since_ms
      ? t(
          "twin_differs_since",
          when(r.since_ms[0], status.at_ms),
          when(r.since_ms[1], status.at_ms),
          when(r.since_ms[2], status.at_ms),
        )
      : t("twin_differs_always");
    return row(
      t(`regime_${r.regime}`),
      share,
      r.text ? `${own({ en: r.text, zh: r.zh ?? r.text })}, ${since}` : t(`stage_${r.stage}`),
      { dot: { watching: "good", differing: "bad" }[r.stage] ?? "" },
    );
  };
  fill(regimes, twin.regimes.length ? twin.regimes.map(line) : [make("p", "empty", t("twin_nothing_yet"))]);
}
