// Numbers, times and durations as people read them: as many digits as the quantity deserves, always with the unit.
import { language, t } from "./words.js";

const locale = () => (language() === "zh" ? "zh-CN" : "en-GB");
/** Decimal places by unit. A meter's noise is larger than what is left out. */
const PLACES = {
  rpm: 0,
  "mm/min": 0,
  "%": 0,
  W: 0,
  A: 1,
  V: 0,
  "°C": 1,
  mm: 3,
  um: 1,
  µm: 1,
  "mm/rev": 3,
  N: 0,
  s: 1,
  ms: 1,
  "cm3/min": 1,
};
const UNITS = { um: "µm", "cm3/min": "cm³/min", rpm: "min⁻¹", degC: "°C", 1: "" };

export const unitName = (unit) => (unit === "rpm" ? t("rpm") : (UNITS[unit] ?? unit ?? ""));

/** Decimal places of a value in this unit. */
function placesOf(value, unit) {
  const size = Math.abs(value);
  if (unit === "W" && size < 10 && size > 0) return 1;
  if (unit === "mm" && size >= 10) return 1;
  return PLACES[unit] ?? (size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3);
}

/** The number that is read where this value is printed: what adds up on the page adds up in these. */
export const printed = (value, unit) => Number(value.toFixed(placesOf(value, unit)));

/** A number without its unit. */
export function number(value, unit) {
  if (typeof value !== "number" || !Number.isFinite(value)) return "–";
  const places = placesOf(value, unit);
  const shown = printed(value, unit);
  return (Object.is(shown, -0) ? 0 : shown).toLocaleString(locale(), {
    maximumFractionDigits: places,
    minimumFractionDigits: Number.isInteger(value) && unit !== "°C" ? 0 : places,
  });
}

/** A number with its unit. */
export function quantity(value, unit) {
  const name = unitName(unit);
  return name ? `${number(value, unit)} ${name}` : number(value, unit);
}

export function energy(joules) {
  if (joules === null || joules === undefined) return "–";
  const wh = joules / 3600;
  return wh >= 1000 ? `${number(wh / 1000)} kWh` : `${number(wh)} Wh`;
}

/** A name that a controller gave as a number: "105.0" is "105". */
export const plainName = (text) => (/^\d+\.0+$/.test(text) ? String(Number(text)) : text);

/** 12 s, 3 min 20 s, 2 h 05 min, 3 d 4 h, each rounded to its last unit: cut off, a sum is more than its parts. */
export function duration(seconds) {
  const all = Math.max(0, seconds);
  const [s, min, h] = [1, 60, 3600].map((unit) => Math.round(all / unit));
  const two = (n) => String(n).padStart(2, "0");
  if (s < 60) return `${s} ${t("s")}`;
  if (s < 3600) return `${Math.floor(s / 60)} ${t("min")} ${two(s % 60)} ${t("s")}`;
  if (min < 2880) return `${Math.floor(min / 60)} ${t("h")} ${two(min % 60)} ${t("min")}`;
  return `${Math.floor(h / 24)} ${t("d")} ${h % 24} ${t("h")}`;
}

export function bytes(count) {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let unit = 0;
  while (count >= 1000 && unit < 4) {
    count /= 1000;
    unit += 1;
  }
  return `${count.toFixed(unit > 0 && count < 100 ? 1 : 0)} ${units[unit]}`;
}

const time = (options) => (ms) => new Date(ms).toLocaleString(locale(), options);
export const clock = (ms) => time({ hour: "2-digit", minute: "2-digit", second: "2-digit" })(ms);
export const clockMinute = (ms) => time({ hour: "2-digit", minute: "2-digit" })(ms);
export const day = (ms) => time({ year: "numeric", month: "short", day: "numeric" })(ms);
export const dayShort = (ms) => time({ month: "short", day: "numeric" })(ms);
export const dateTime = (ms) =>
  time({ year: "numeric", month: "short", day: "numeric", hour: "2-digit", minute: "2-digit", second: "2-digit" })(ms);
export const weekday = (ms) => time({ weekday: "short", month: "short", day: "numeric" })(ms);

/** The clock alone for today (of the box), with the date otherwise. */
export const when = (ms, nowMs) => (day(ms) === day(nowMs) ? clock(ms) : dateTime(ms));

/** The data directory of `DIR/identified/tool-wear.json`. */
export const folder = (file) => file?.replace(/\/identified\/[^/]*$/, "") ?? "";

/** `simulated://lathe?device=meter` is a meter to whoever looks at the page; without a device it is the whole machine. */
export function sourceName(name) {
  if (!name.startsWith("simulated:")) return name;
  const device = /device=(\w+)/.exec(name)?.[1];
  return device ? `${t("simulated")} · ${t(device === "meter" ? "meter" : "controller")}` : t("simulated");
}
