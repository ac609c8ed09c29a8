// Small pieces that every view is made of.
import { box } from "./words.js";

export function make(tag, className, content, attributes = {}) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (content instanceof Node) element.append(content);
  else if (Array.isArray(content)) element.append(...content.filter((it) => it !== null && it !== undefined));
  else if (content !== undefined && content !== null) write(element, String(content));
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false)
      element.setAttribute(name, value === true ? "" : value);
  }
  return element;
}

/** Elements whose text is what it is. */
const VERBATIM = new Set(["CODE", "PRE", "OPTION", "TEXTAREA"]);

/** Writes a text: what stands between two backticks is to be typed as it is, or is a name of the box. */
function write(element, text) {
  const pieces = text.split("`");
  if (pieces.length % 2 === 0 || pieces.length === 1 || VERBATIM.has(element.tagName)) element.textContent = text;
  else element.replaceChildren(...pieces.map((piece, at) => (at % 2 ? make("code", "", piece) : piece)));
}

/** Sets a text only where it has changed, so that nothing is laid out again for nothing. */
export function say(element, text) {
  const wanted = String(text ?? "");
  if (element.textContent !== wanted && element.textContent !== wanted.replaceAll("`", "")) write(element, wanted);
}

/** What a line of a chart is, in a legend: its colour, drawn as the line is, and words. */
export function keyOf(line, words, shape = "") {
  const mark = make("i", shape);
  mark.style.setProperty("--mark", `var(--${line})`);
  return make("span", "", [mark, words]);
}

export function card(title, content, className = "") {
  const box = make("section", `card ${className}`.trim());
  if (title) box.append(make("h2", "", title));
  box.append(...[content].flat().filter(Boolean));
  return box;
}

export function row(what, num, more, { dot, tone } = {}) {
  const line = make("div", "row");
  line.append(make("span", `what${dot ? ` dot ${dot}` : ""}`, what), make("span", "num", num ?? ""));
  if (more) line.append(make("span", `more${tone ? ` ${tone}-text` : ""}`, more));
  return line;
}

export function fill(element, children) {
  element.replaceChildren(...children.filter(Boolean));
}

/** A cell with more characters than this is never as narrow as one of its words, nor as one Chinese character. */
const WORDS_FROM = 8;

/** The class of a cell: a number to the right, a text that needs room for its words. */
function cellClass(it) {
  if (it?.num) return "num";
  const text = it?.text instanceof Node ? it.text.textContent : (it?.text ?? it);
  return String(text ?? "").length > WORDS_FROM ? "words" : "";
}

/** For a table that stands as text: each cell knows the name of its column. */
export function labelCells(table) {
  const names = [...table.querySelectorAll("thead th")].map((it) => it.textContent);
  for (const line of table.querySelectorAll("tbody tr"))
    [...line.cells].forEach((it, at) => it.setAttribute("data-label", names[at] ?? ""));
}

export function table(head, rows, { caption } = {}) {
  const box = make("div", "scroll", null, { tabindex: "0", role: "region", "aria-label": caption });
  const words = (it) => it?.num ?? it?.text ?? it;
  const named = head.map((it) => make("th", cellClass(it), words(it), { scope: "col", role: "columnheader" }));
  // On a narrow screen each cell stands behind the name of its column. The roles hold where the table is drawn as blocks.
  const cell = (it, at) =>
    make("td", cellClass(it), words(it), { "data-label": String(words(head[at]) ?? ""), role: "cell" });
  const line = (cells) => make("tr", "", cells, { role: "row" });
  const body = rows.map((cells) => line(cells.map(cell)));
  box.append(
    make(
      "table",
      "",
      [make("thead", "", line(named), { role: "rowgroup" }), make("tbody", "", body, { role: "rowgroup" })],
      { role: "table" },
    ),
  );
  return box;
}

/** The answer of the box as JSON, or an error in its words. */
function understand(status, text, otherwise) {
  let document;
  try {
    document = JSON.parse(text);
  } catch {
    document = { title: text || otherwise };
  }
  // A session that is over: the frame asks who is signed in now.
  if (status === 401) dispatchEvent(new Event("signed-out"));
  if (status < 200 || status > 299)
    throw Object.assign(new Error([document.title, document.hint].filter(Boolean).map(box).join(" – ")), {
      status,
      document,
    });
  return document;
}

/** A question to the box: JSON, or an error in its words. */
export async function ask(path, options) {
  const answer = await fetch(path, options);
  return understand(answer.status, await answer.text(), answer.statusText);
}

/** Brings a file to the box. `told` hears which share of it has gone; `signal` ends it. `broken` and `ended` are what is said then. */
export const bring = (path, file, { told, signal, broken, ended }) =>
  new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", path);
    request.setRequestHeader("content-type", "application/octet-stream");
    request.upload.addEventListener("progress", (event) => told(event.total ? event.loaded / event.total : 0));
    request.addEventListener("load", () => {
      try {
        resolve(understand(request.status, request.responseText, request.statusText));
      } catch (error) {
        reject(error);
      }
    });
    request.addEventListener("error", () => reject(new Error(broken)));
    request.addEventListener("abort", () => reject(new Error(ended)));
    signal.addEventListener("abort", () => request.abort());
    request.send(file);
  });

/** A change: JSON to the box. */
export const send = (path, body, method = "POST") =>
  ask(path, { method, headers: { "content-type": "application/json" }, body: JSON.stringify(body ?? {}) });

/** The colour of a custom property at this moment. */
export const colour = (name) =>
  getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim() || "#888888";
