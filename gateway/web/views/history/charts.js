// The charts of the view "History": one for each unit, the values under the cursor, the ribbon of states, the choice of
// channels.
import { fill, make } from "/web/parts.js";
import { dateTime, number, quantity, unitName } from "/web/format.js";
import { language, t } from "/web/words.js";
import { LINES, TimePlot } from "/web/plot.js";
import { reachedMachine } from "/web/history-data.js";

/** One chart for each unit, all over the same time. */
export function drawPlots(view) {
  view.plots.forEach((plot) => plot.destroy());
  const groups = new Map();
  for (const name of view.channels) {
    const unit = view.known.find((s) => s.name === name)?.unit ?? "";
    groups.set(unit, [...(groups.get(unit) ?? []), name]);
  }
  view.charts.replaceChildren();
  view.colours = {};
  let at = 0;
  view.plots = [...groups].map(([unit, names], index) => {
    const box = make("div", "plot-box");
    view.charts.append(box);
    const series = names.map((name) => {
      view.colours[name] = LINES[at++ % LINES.length];
      return { name, label: labelOf(view, name), unit, line: view.colours[name], stepped: name.endsWith("_pct") };
    });
    const last = index === groups.size - 1;
    const plot = new TimePlot(box, {
      series,
      times: last,
      height: (last ? 34 : 8) + (groups.size > 3 ? 118 : 156),
      label: `${names.map((n) => labelOf(view, n)).join(", ")} ${unitName(unit)}`,
      low: unit === "°C" || unit === "V" ? null : 0,
      onCursor: (index) => readOut(view, plot, index),
    });
    plot.names = names;
    plot.move = view.move;
    view.move.attach(plot.u.over);
    return plot;
  });
  readOut(view, null, null);
}

function labelOf(view, name) {
  const known = view.known.find((s) => s.name === name);
  return (known?.[language()] || known?.en || view.context.name(name)).split(/[,，]/)[0];
}

/** The values under the cursor; the newest ones without it. Always the same places, so that nothing moves. */
export function readOut(view, plot, index) {
  const rows = view.channels.map((name) => {
    const owner = view.plots.find((p) => p.names?.includes(name));
    const column = owner ? 1 + owner.names.indexOf(name) * 3 : 0;
    const data = owner?.data;
    const i = index ?? (data ? data[0].length - 1 : null);
    const value = data && i !== null ? data[column]?.[i] : null;
    const [low, high] = data && i !== null ? [data[column + 1]?.[i], data[column + 2]?.[i]] : [null, null];
    const unit = view.known.find((s) => s.name === name)?.unit ?? "";
    const mark = make("i");
    mark.style.background = `var(--${view.colours[name]})`;
    const spread = low == null || high == null || low === high ? "" : ` (${number(low, unit)} … ${number(high, unit)})`;
    return make("span", "", [
      mark,
      `${labelOf(view, name)} `,
      make("b", "", value == null ? "–" : quantity(value, unit)),
      spread,
    ]);
  });
  const at = view.plots[0]?.data?.[0]?.[index];
  fill(view.readout, [make("b", "", index == null || at === undefined ? t("newest") : dateTime(at * 1000)), ...rows]);
}

export function drawRibbon(view) {
  if (!view.ribbon) return;
  const found = view.found ?? { states: [], shares: [], alarms: [], writes: [], parts: [] };
  const marks = [
    ...found.alarms.map((a) => ({ at: a.raised_ms / 1000, tone: a.severity === "critical" ? "bad" : "warn" })),
    ...found.writes.filter(reachedMachine).map((w) => ({ at: w.at_ns / 1e9, tone: "accent" })),
  ];
  const near = view.to - view.from < 12 * 3600 && found.parts.length < 200;
  view.ribbon.show(view.from, view.to, found.states, {
    shares: found.shares,
    marks,
    parts: near ? found.parts.map((p) => p.to_ms / 1000) : [],
    unrecorded: view.plots[0]?.unrecorded ?? [],
  });
}

export function drawChooser(view) {
  const boxes = view.known
    .filter((s) => s.kind === "number")
    .map((s) => {
      const tick = make("input", "", null, { type: "checkbox", value: s.name });
      tick.checked = view.channels.includes(s.name);
      tick.addEventListener("change", () => {
        view.channels = tick.checked ? [...view.channels, s.name] : view.channels.filter((name) => name !== s.name);
        drawPlots(view);
        for (const plot of view.plots) plot.show(view.from, view.to);
        view.read();
      });
      return make("label", "", [
        tick,
        `${labelOf(view, s.name)}${s.unit && s.unit !== "1" ? `, ${unitName(s.unit)}` : ""}`,
      ]);
    });
  fill(view.chooser.lastElementChild, boxes);
}
