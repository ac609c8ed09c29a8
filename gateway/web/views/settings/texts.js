// How settings, their values and their places are written.
import { unitName } from "/web/format.js";
import { t } from "/web/words.js";

export const PLACES = ["tool", "operation"];
export const name = (it) => `${it.script}.${it.name}`;
/** A value as the document gives it: a number as it is written, a text as it is. */
export const shown = (value) => (typeof value === "string" ? value : String(value));
export const unit = (it) => unitName(it.unit);
export const takes = (it) =>
  it.one_of.length
    ? it.one_of.join(", ")
    : it.least === null
      ? t("setting_text")
      : [`${it.least} … ${it.greatest}`, unit(it), it.whole ? t("setting_whole") : ""].filter(Boolean).join(" ");

export const valueWords = (text) => (text === "as the machine" ? t("as_machine") : text.replace(/\.0$/, ""));
export const placeWords = (text) =>
  PLACES.reduce(
    (done, per) => (done.startsWith(`${per} `) ? `${t(`per_${per}`)} ${done.slice(per.length + 1)}` : done),
    text,
  );
