// Below the charts: the parts of what is seen, the use of the machine by shift, day and week, alarms and writes.
import { ask, fill, keyOf, make, table } from "./parts.js";
import {
  clock,
  clockMinute,
  dateTime,
  duration,
  energy,
  number,
  plainName,
  quantity,
  weekday,
  when,
} from "./format.js";
import { box, language, own, t } from "./words.js";
import { STATE_ORDER } from "./ribbon.js";
import { download } from "./history-data.js";

/** More rows than this are not drawn at once. */
const ROWS_MAX = 300;

/** Shares of time as one bar. */
export function shareBar(seconds, context) {
  const total = Object.values(seconds).reduce((sum, s) => sum + s, 0) || 1;
  const words = STATE_ORDER.filter((word) => seconds[word] > 0);
  const bar = make(
    "div",
    "bar",
    words.map((word) => {
      const piece = make("span", word);
      piece.style.width = `${(100 * seconds[word]) / total}%`;
      return piece;
    }),
    { role: "img", "aria-label": words.map((word) => `${context.state(word)} ${duration(seconds[word])}`).join(", ") },
  );
  bar.title = bar.getAttribute("aria-label");
  return bar;
}

export function stateLegend(context) {
  return make(
    "div",
    "legend",
    STATE_ORDER.map((word) => keyOf(word, context.state(word))),
  );
}

export function partsTable(root, found, range, context, go) {
  const [from, to] = range.map((s) => s * 1000);
  const seen = found.parts.filter((p) => p.to_ms >= from && p.from_ms <= to).reverse();
  if (!seen.length) return fill(root, [make("p", "empty", t("no_parts"))]);
  const head = [
    t("finished"),
    t("program"),
    t("part"),
    { num: t("pieces") },
    { num: t("duration") },
    t("time_per_state"),
    { num: t("cutting_time") },
    { num: t("energy") },
    { num: t("peak_power") },
  ];
  // A machine whose parts have no names needs no column for them.
  const named = seen.some((p) => p.part);
  if (!named) head.splice(2, 1);
  const rows = seen.slice(0, ROWS_MAX).map((p) => [
    {
      text: make("button", "link-button", when(p.to_ms, to), {
        type: "button",
        onclick: () => go(p.from_ms / 1000, p.to_ms / 1000),
      }),
    },
    p.program ?? "–",
    ...(named ? [p.part ? plainName(p.part) : "–"] : []),
    { num: String(p.count) },
    { num: duration((p.to_ms - p.from_ms) / 1000) },
    { text: p.seconds ? shareBar(p.seconds, context) : "–" },
    { num: p.cutting_s === null ? "–" : duration(p.cutting_s) },
    { num: energy(p.energy_j) },
    { num: p.peak_power_w == null ? "–" : quantity(p.peak_power_w, "W") },
  ]);
  const total = seen.reduce(
    (sum, p) => ({
      count: sum.count + p.count,
      energy: sum.energy + (p.energy_j ?? 0),
      cutting: sum.cutting + (p.cutting_s ?? 0),
    }),
    { count: 0, energy: 0, cutting: 0 },
  );
  const words = t(
    "parts_sum",
    total.count,
    duration(total.cutting),
    energy(total.energy),
    total.count ? energy(total.energy / total.count) : "–",
  );
  const save = make("button", "", t("export_table"), {
    type: "button",
    onclick: () => download("parts.csv", partsCsv(seen)),
  });
  fill(root, [
    make(
      "div",
      "head",
      [
        make("span", "note", words),
        seen.length > ROWS_MAX || found.partsCut
          ? make("span", "note", t("newest_only", Math.min(seen.length, ROWS_MAX)))
          : null,
        save,
      ].filter(Boolean),
    ),
    table(head, rows, { caption: t("parts_title") }),
  ]);
}

function partsCsv(parts) {
  const states = STATE_ORDER;
  const line = (p) =>
    [
      new Date(p.from_ms).toISOString(),
      new Date(p.to_ms).toISOString(),
      p.program ?? "",
      p.part ?? "",
      p.count,
      p.cutting_s ?? "",
      p.energy_j ?? "",
      p.peak_power_w ?? "",
      ...states.map((word) => p.seconds?.[word] ?? ""),
    ].join(",");
  return (
    [
      [
        "began_utc",
        "ended_utc",
        "program",
        "part",
        "count",
        "cutting_s",
        "energy_j",
        "peak_power_w",
        ...states.map((word) => `${word}_s`),
      ].join(","),
      ...parts.map(line),
    ].join("\n") + "\n"
  );
}

/** Use of the machine: what share of the time it was switched on did it cut? */
export async function useTable(root, [from, to], context, by, chosen) {
  const utc = (s) => new Date(s * 1000).toISOString();
  const offset = -new Date(to * 1000).getTimezoneOffset();
  const found = await ask(`/api/v1/utilisation?from=${utc(from)}&to=${utc(to)}&by=${by}&offset_min=${offset}`);
  const buttons = ["hour", "shift", "day", "week"].map((word) =>
    make("button", "", t(`by_${word}`), {
      type: "button",
      "aria-pressed": String(word === by),
      onclick: () => chosen(word),
    }),
  );
  const rows = found.rows
    .slice()
    .reverse()
    .slice(0, ROWS_MAX)
    .map((r) => {
      const [cutting, off] = [r.seconds.cutting ?? 0, r.seconds.off ?? 0];
      const on = r.total_s - off;
      const name =
        by === "week"
          ? t("week_of", weekday(r.from_ms))
          : by === "day"
            ? weekday(r.from_ms)
            : `${weekday(r.from_ms)} ${clockMinute(r.from_ms)}`;
      return [
        name,
        { text: shareBar(r.seconds, context) },
        { num: duration(r.total_s) },
        { num: duration(on) },
        { num: duration(cutting) },
        { num: on > 0 ? `${number((100 * cutting) / on, "%")} %` : "–" },
      ];
    });
  const head = [
    t(`by_${by}`),
    t("time_per_state"),
    { num: t("recorded") },
    { num: t("switched_on") },
    { num: t("cutting_time") },
    { num: t("cutting_share") },
  ];
  fill(root, [
    make("div", "head", [
      make("div", "buttons", buttons),
      make("span", "note", t("use_words", found.shifts.join(", "))),
    ]),
    rows.length ? table(head, rows, { caption: t("use_title") }) : make("p", "empty", t("no_data_here")),
  ]);
}

export function marksTable(root, found, range, go) {
  const [from, to] = range.map((s) => s * 1000);
  const alarms = found.alarms
    .filter((a) => (a.cleared_ms ?? to) >= from && a.raised_ms <= to)
    .map((a) => ({
      at: a.raised_ms,
      until: a.cleared_ms,
      what: own({ en: a.en, zh: a.zh }) || a.code,
      kind: t(`severity_${a.severity}`),
      tone: a.severity === "critical" ? "bad" : "warn",
      count: a.count,
    }));
  const writes = found.writes
    .filter((w) => w.at_ns / 1e6 >= from)
    .map((w) => ({
      at: w.at_ns / 1e6,
      what: `${t(`kind_${w.kind}`)}${w.after === null ? "" : ` → ${quantity(w.after, w.unit)}`} · ${box(w.reason)}`,
      kind: t("override"),
      tone: "",
    }));
  const all = [...alarms, ...writes].filter((m) => m.at <= to).sort((a, b) => b.at - a.at);
  if (!all.length) return fill(root, [make("p", "empty", t("no_marks"))]);
  const rows = all.slice(0, ROWS_MAX).map((m) => [
    {
      text: make("button", "link-button", dateTime(m.at), {
        type: "button",
        onclick: () => go(m.at / 1000 - 60, m.at / 1000 + 60),
      }),
    },
    { text: make("span", `one-line ${m.tone ? `${m.tone}-text` : ""}`.trim(), m.kind) },
    m.what + (m.count > 1 ? ` (${m.count} ×)` : ""),
    m.until === undefined ? "" : m.until === null ? t("still_there") : t("until_clock", clock(m.until)),
  ]);
  fill(root, [table([t("time"), t("kind"), t("what"), ""], rows, { caption: t("marks_title") })]);
}
export const listSeparator = () => (language() === "zh" ? "、" : ", ");
