// Thermal error: what was measured, what the law predicts, what is left; the temperatures it is made of; offsets
// proposed and written.
import { ask, card, fill, keyOf, make, row, say, table } from "/web/parts.js";
import { duration, folder, number, quantity } from "/web/format.js";
import { t } from "/web/words.js";
import { LINES, TimePlot } from "/web/plot.js";
import { columns, resolutionFor } from "/web/history-data.js";

const TEMPERATURE = /(_temperature_c|^temperature_\d+_c)$/;
const SPAN_S = 8 * 3600;
/** A figure is no narrower than this. */
const SPAN_LEAST_S = 60;
/** A figure of fewer seconds is a dot. Until then it is read anew every second or so, afterwards every twenty. */
const FIGURE_S = 10;
const [READ_MS, READ_EARLY_MS] = [20000, 1500];

export function mount(root, context) {
  const now = make("div", "");
  const offsets = make("div", "");
  const error = make("div", "plot-box");
  const warmth = make("div", "plot-box");
  const note = make("p", "note", " ");
  const span = make("span", "note", " ");
  const collecting = make("p", "note", "", { hidden: true });
  const [errorKey, list] = [make("div", "legend"), make("div", "legend")];
  const points = make("div", "");
  root.append(
    make("div", "columns", [card(t("thermal_now"), now, "ages"), card(t("thermal_offsets"), offsets, "ages")]),
    card("", [
      make("div", "head", [make("h2", "", t("thermal_error_figure")), span]),
      make("p", "note", t("thermal_words")),
      collecting,
      errorKey,
      error,
      note,
    ]),
    card("", [make("h2", "", t("temperatures")), list, warmth]),
    card(t("thermal_points"), points),
  );
  drawPoints(points, context);
  let plots = [];
  let early = true;
  const read = async () => {
    const status = context.status();
    if (!status) return;
    try {
      const stored = await ask("/api/v1/series");
      const known = stored.series.map((s) => s.name);
      const wanted = known.filter((n) => TEMPERATURE.test(n) && context.quantity(n)).slice(0, 6);
      const [measured, predicted] = ["thermal_error_um", "thermal_predicted_um"].map((n) =>
        known.includes(n) ? n : null,
      );
      const names = [...wanted, measured, predicted].filter(Boolean);
      const [from, to] = [new Date(status.at_ms - SPAN_S * 1000).toISOString(), new Date(status.at_ms).toISOString()];
      // A history of seconds has no whole minute yet.
      const there = Math.min(SPAN_S, Math.max(0, (status.at_ms - stored.first_ms) / 1000));
      const resolution = Number.isFinite(there) ? resolutionFor(there) : 0;
      early = !(there >= FIGURE_S);
      collecting.hidden = !early;
      if (early) say(collecting, t("thermal_collecting", Math.floor(there || 0), FIGURE_S));
      const found = await ask(
        `/api/v1/samples?from=${from}&to=${to}&channels=${names.join(",")}&resolution_s=${resolution}`,
      );
      // A young history fills its chart, and the words say how much it is.
      const seen = Math.max(SPAN_LEAST_S, there || 0);
      say(span, there < SPAN_S ? t("all_recorded_so_far", duration(there || 0)) : t("last_eight_hours"));
      draw(found, [wanted, measured, predicted], status.at_ms / 1000, seen);
    } catch (problem) {
      say(note, problem.message);
    }
  };
  const draw = ({ series, resolution_s: width }, [wanted, measured, predicted], to, seen) => {
    plots.forEach((plot) => plot.destroy());
    plots = [];
    const drawn = [to - seen, to];
    const recorded = { from: to - SPAN_S, to, width };
    const of = (name) => series.find((s) => s.channel === name)?.points ?? [];
    const last = (name) => of(name).findLast?.((p) => typeof p[1] === "number")?.[1] ?? null;
    const any = [measured, predicted].some((name) => name && last(name) !== null);
    if (any) {
      const names = [measured, predicted].filter(Boolean);
      const data = columns(series, names);
      const [m, p] = [names.indexOf(measured), names.indexOf(predicted)];
      const lines = names.map((name, at) => ({
        label: t(name === measured ? "thermal_measured" : "thermal_predicted"),
        unit: "um",
        line: at ? "line-b" : "line-a",
      }));
      if (m >= 0 && p >= 0) {
        const left = data[0].map((_, i) =>
          data[1 + 3 * m][i] === null || data[1 + 3 * p][i] === null ? null : data[1 + 3 * m][i] - data[1 + 3 * p][i],
        );
        data.push(
          left,
          left.map(() => null),
          left.map(() => null),
        );
        lines.push({ label: t("thermal_left"), unit: "um", line: "line-c" });
      }
      const plot = new TimePlot(error, {
        series: lines,
        height: 240,
        label: t("thermal_error_figure"),
        low: 0,
        sync: "thermal",
      });
      plot.give(data, recorded);
      plot.show(...drawn);
      plots.push(plot);
      fill(
        errorKey,
        lines.map(({ label, line }) => keyOf(line, label)),
      );
      say(note, "");
    } else {
      fill(errorKey, []);
      say(note, t("no_thermal"));
    }
    const warmths = wanted.map((name, at) => ({ label: context.name(name), unit: "°C", line: LINES[at] }));
    const plot = new TimePlot(warmth, {
      series: warmths,
      height: 240,
      label: t("temperatures"),
      sync: "thermal",
    });
    const warm = columns(series, wanted);
    plot.give(warm, recorded);
    plot.show(...drawn);
    plots.push(plot);
    // Without values: the newest of the history are older than those above.
    fill(
      list,
      warmths.map(({ label, line }) => keyOf(line, label)),
    );
  };
  let timer = null;
  const again = async () => {
    await read();
    if (timer !== false) timer = setTimeout(again, early ? READ_EARLY_MS : READ_MS);
  };
  let begun = false;
  return {
    update(status) {
      if (!begun) {
        begun = true;
        again();
      }
      fill(
        now,
        status.channels
          .filter((c) => TEMPERATURE.test(c.name) || c.name === "thermal_error_um")
          .map((c) => row(context.name(c.name), c.missing ? context.reason(c.missing) : quantity(c.value, c.unit))),
      );
      const offset = status.gate.offset;
      fill(
        offsets,
        offset
          ? [
              row(t("offset_mode"), t(offset.mode === "armed" ? "armed_short" : "only_noted")),
              ...offset.axes.map((a) =>
                row(
                  a.axis.toUpperCase(),
                  `${number(a.shift_um, "um")} µm`,
                  a.wanted_um === null ? t("no_proposal") : t("proposed", quantity(a.wanted_um, "um")),
                ),
              ),
            ]
          : [make("p", "empty", t("no_offsets"))],
      );
    },
    leave() {
      clearTimeout(timer);
      timer = false;
      plots.forEach((plot) => plot.destroy());
    },
  };
}

/** Which points of measurement the law uses and why, from the answer of `identify thermal`. */
async function drawPoints(root, context) {
  const found = await ask("/api/v1/identified/thermal").catch((error) => ({ error: error.message }));
  const selection = found.identified?.learned?.selection;
  if (!selection) return fill(root, [make("p", "empty", found.error ?? t("no_thermal_points", folder(found.file)))]);
  const cell = (value, unit) => ({ num: value === null || value === undefined ? "–" : quantity(value, unit) });
  const rows = selection.sensors.map((s) => [
    context.name(s.sensor),
    t(s.chosen ? "chosen" : "not_chosen"),
    s.reason,
    cell(s.correlation),
    cell(s.grade_initial_image),
    cell(s.variance_inflation),
    cell(s.held_out_rms_um, "um"),
  ]);
  const head = [
    t("temperatures"),
    "",
    t("why"),
    ...["correlation", "grade", "inflation", "held_out_error"].map((key) => ({ num: t(key) })),
  ];
  fill(root, [
    table(head, rows, { caption: t("thermal_points") }),
    make("p", "note", found.identified.learned.reason ?? ""),
  ]);
}
