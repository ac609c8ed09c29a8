// Now: speed and feed in large figures, and what else is measured.
import { make, row, say } from "/web/parts.js";
import { duration, number, quantity as shown, unitName } from "/web/format.js";
import { t } from "/web/words.js";

/** A value that is older than this is marked as old on its own. */
const OLD_S = 2;

/** Speed and feed with what was programmed, in the size in which they are read from two metres. */
export function gauges() {
  const rows = [
    ["spindle_speed_rpm", "spindle_programmed_rpm"],
    ["feed_mm_min", "feed_programmed_mm_min"],
  ].map(([actual, programmed]) => {
    const value = make("span", "value", "–", { "data-quantity": actual });
    const unit = make("span", "unit", "");
    const note = make("p", "gauge-note", " ");
    const box = make("section", "card gauge ages", [
      make("h2", "", t(`short_${actual}`)),
      make("p", "reading", [value, unit]),
      note,
    ]);
    return { actual, programmed, value, unit, note, box };
  });
  const update = (_, context) =>
    rows.forEach((one) => {
      const found = context.quantity(one.actual);
      const old = show(one.value, found, context);
      say(one.unit, found && !found.missing ? unitName(found.unit) : "");
      const planned = context.quantity(one.programmed);
      const note = old ?? (planned && !planned.missing ? t("programmed", shown(planned.value, planned.unit)) : " ");
      say(one.note, note);
    });
  return {
    box: make(
      "div",
      "gauges",
      rows.map((one) => one.box),
    ),
    update,
  };
}

/** Writes a value or the reason for none; gives a note where the value is old. */
export function show(element, found, context) {
  const missing = !found || found.missing;
  element.classList.toggle("missing", Boolean(missing));
  say(element, missing ? context.reason(found?.missing ?? "not_provided") : number(found.value, found.unit));
  if (missing) delete element.dataset.value;
  else element.dataset.value = found.value;
  const old = !missing && found.age_s > OLD_S;
  element.classList.toggle("old", Boolean(old));
  return old ? t("value_age", duration(found.age_s)) : null;
}

export function temperatures() {
  const list = make("div", "");
  const section = make("section", "card temperatures ages", [make("h2", "", t("also_measured")), list]);
  const WANTED = [
    "spindle_load_pct",
    "spindle_current_a",
    "bearing_temperature_c",
    "motor_temperature_c",
    "ambient_temperature_c",
    "supply_voltage_v",
    "part_count",
  ];
  const lines = new Map();
  const update = (_, context) => {
    for (const key of WANTED) {
      const found = context.quantity(key);
      if (!found) continue;
      if (!lines.has(key)) {
        const line = row(context.name(key).split(/[,，]/)[0], "");
        lines.set(key, line);
        list.append(line);
      }
      say(
        lines.get(key).querySelector(".num"),
        found.missing ? context.reason(found.missing) : shown(found.value, found.unit),
      );
    }
  };
  return { box: section, update };
}
