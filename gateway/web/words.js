// The words of the page in the language of the reader. Names of channels, states and reasons come from the box itself.
import { WORDS } from "./word-table.js";
import { PHRASES } from "./box-texts.js";
import { scriptSentence, sentence } from "./box-sentences.js";

const asked = new URLSearchParams(location.search).get("lang");
const stored = () => {
  try {
    return localStorage.getItem("language");
  } catch {
    return null;
  }
};
const known = (it) => (it === "zh" || it === "en" ? it : null);
/** `?lang=zh` goes before what was chosen here, that before the configuration of the box, that before the browser. */
let chosen =
  known(asked) ??
  known(stored()) ??
  known(document.documentElement.dataset.opens) ??
  (navigator.language?.startsWith("zh") ? "zh" : "en");

export const language = () => chosen;

/** A text of the page; `{0}` and so on are filled in. */
export function t(key, ...values) {
  const row = WORDS[key];
  const text = row ? row[chosen === "zh" ? 1 : 0] : key;
  return values.length ? text.replace(/\{(\d)\}/g, (_, at) => values[Number(at)] ?? "") : text;
}

/** Is there such a text? */
export const has = (key) => key in WORDS;

/** A moment that the box has written in UTC, by the clock of the reader: two kinds of time on one page are read as one.
 */
const MOMENT = /(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d(?::\d\d)?)(?:\.\d+)?(?:Z| UTC)/g;
export const localTimes = (text) =>
  text?.replace(MOMENT, (_, day, time) =>
    new Date(`${day}T${time}Z`).toLocaleString(chosen === "zh" ? "zh-CN" : "en-GB", {
      year: "numeric",
      month: "short",
      day: "numeric",
      hour: "2-digit",
      minute: "2-digit",
    }),
  ) ?? "";

/** The text of something that carries `en` and `zh` itself. */
export const own = (thing) => localTimes(thing?.[chosen] ?? thing?.en ?? "");

/** A change in the audit: the request, its answer, and what was done. */
const CHANGE = /^([A-Z]+ \/\S+(?: from \S+)?(?: \(\d+\))?): (.+)$/s;

/** Several sentences with semicolons between them; nothing where one of them is none. */
function sentences(text) {
  const parts = text.split("; ");
  const all = parts.length > 1 ? parts.map(sentence) : [null];
  return all.every(Boolean) ? all.join("；") : null;
}

/** What the box says in English, in Chinese where that is read: a whole sentence, or one of the gate, which is put together from
    known phrases. */
export function box(text) {
  if (chosen !== "zh" || !text) return localTimes(text);
  const [, request, words] = CHANGE.exec(text) ?? [];
  if (request) return `${request}：${box(words)}`;
  const known = sentence(text) ?? sentences(text);
  if (known) return localTimes(known);
  const ranges = localTimes(text).replace(/(\d) to (-?\d)/g, "$1 至 $2");
  return PHRASES.reduce((done, [en, zh]) => done.split(en).join(zh), ranges);
}

/** A problem of a script as the box writes it: its place, what is wrong, and below it what to do. */
const SCRIPT_PROBLEM = /^((?:\S+?(?::\d+){0,2}: )?)(.+?)(?:\n {4}(.+))?$/s;

/** What is said of a script, in Chinese where that is read; the names in it stay as they are written in the script. */
export function scriptWords(text) {
  if (chosen !== "zh" || !text) return text ?? "";
  const whole = scriptSentence(text);
  if (whole) return whole;
  const [, place, what, next] = SCRIPT_PROBLEM.exec(text) ?? [];
  if (!what) return text;
  const words = scriptSentence(what) ?? what;
  return `${place}${words}${next ? `\n    ${scriptSentence(next) ?? next}` : ""}`;
}

export function setLanguage(next) {
  chosen = next;
  document.documentElement.lang = next === "zh" ? "zh-CN" : "en";
  const url = new URL(location.href);
  if (url.searchParams.has("lang")) {
    url.searchParams.set("lang", next);
    history.replaceState(history.state, "", url);
  }
  try {
    localStorage.setItem("language", next);
  } catch {
    /* a browser that keeps nothing forgets the choice */
  }
}
document.documentElement.lang = chosen === "zh" ? "zh-CN" : "en";
