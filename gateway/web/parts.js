// Small pieces that every view is made of.
export function make(tag, className, content, attributes = {}) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (content instanceof Node) element.append(content);
  else if (Array.isArray(content)) element.append(...content.filter((it) => it !== null && it !== undefined));
  else if (content !== undefined && content !== null) element.textContent = content;
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false)
      element.setAttribute(name, value === true ? "" : value);
  }
  return element;
}

/** Sets a text only where it has changed, so that nothing is laid out again for nothing. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
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

export function table(head, rows, { caption } = {}) {
  const box = make("div", "scroll", null, { tabindex: "0", role: "region", "aria-label": caption });
  const cell = (tag) => (it) =>
    make(tag, it?.num ? "num" : "", it?.num ?? it?.text ?? it, tag === "th" ? { scope: "col" } : {});
  const body = rows.map((cells) => make("tr", "", cells.map(cell("td"))));
  box.append(make("table", "", [make("thead", "", make("tr", "", head.map(cell("th")))), make("tbody", "", body)]));
  return box;
}

/** A question to the box: JSON, or an error in its words. */
export async function ask(path, options) {
  const answer = await fetch(path, options);
  const text = await answer.text();
  let document;
  try {
    document = JSON.parse(text);
  } catch {
    document = { title: text || answer.statusText };
  }
  // A session that is over: the frame asks who is signed in now.
  if (answer.status === 401) dispatchEvent(new Event("signed-out"));
  if (!answer.ok)
    throw Object.assign(new Error([document.title, document.hint].filter(Boolean).join(" – ")), {
      status: answer.status,
      document,
    });
  return document;
}

/** A change: JSON to the box. */
export const send = (path, body, method = "POST") =>
  ask(path, { method, headers: { "content-type": "application/json" }, body: JSON.stringify(body ?? {}) });

/** The colour of a custom property at this moment. */
export const colour = (name) =>
  getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim() || "#888888";
