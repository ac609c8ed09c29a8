// What only the plant knows: orders, scrap, why the machine stood, who works, what was planned. A form that adds a fact, and the facts of the
// time that is looked at. A fact is never changed: a wrong count of scrap is put right by a negative one.
import { ask, fill, make, say, table } from "/web/parts.js";
import { when } from "/web/format.js";
import { t } from "/web/words.js";

/** Kinds of facts: is there a value, a count, an end? */
const KINDS = {
  order: ["fact_order_value", "fact_planned_parts", false],
  scrap: ["fact_reason", "fact_scrap_parts", false],
  stop_reason: ["fact_reason", null, true],
  operator: ["fact_name", null, false],
  shift: ["fact_name", null, false],
  planned_time: ["fact_note", null, true],
};
/** The table is read again so often while it is looked at. */
const AGAIN_MS = 5000;

export class FactsTab {
  constructor(context) {
    this.context = context;
    const field = (key, type) => make("input", "", null, { type, "aria-label": t(key), step: "1" });
    this.kind = make(
      "select",
      "",
      Object.keys(KINDS).map((kind) => make("option", "", t(`fact_${kind}`), { value: kind })),
      { "aria-label": t("kind"), onchange: () => this.choose() },
    );
    this.fields = {
      value: field("fact_value", "text"),
      parts: field("fact_parts", "number"),
      at: field("fact_at", "datetime-local"),
      until: field("fact_until", "datetime-local"),
    };
    this.labels = Object.fromEntries(
      Object.entries(this.fields).map(([name, input]) => [
        name,
        make("label", "field", [make("span", "", t(`fact_${name}`)), input]),
      ]),
    );
    this.note = make("p", "note", " ", { role: "status" });
    this.rows = make("div", "");
    const form = make("form", "head facts-form", [
      this.kind,
      ...Object.values(this.labels),
      make("button", "", t("fact_add")),
    ]);
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.add();
    });
    this.box = make("div", "", [make("p", "note", t("facts_words")), form, this.note, this.rows]);
    this.choose();
  }

  choose() {
    const [value, parts, ends] = KINDS[this.kind.value];
    say(this.labels.value.firstChild, t(value));
    if (parts) say(this.labels.parts.firstChild, t(parts));
    this.labels.parts.hidden = !parts;
    this.labels.until.hidden = !ends;
  }

  async add() {
    const [, counts, ends] = KINDS[this.kind.value];
    const moment = (text) => (text ? new Date(text).toISOString() : undefined);
    const { value, parts, at, until } = this.fields;
    const fact = {
      fact: this.kind.value,
      at: moment(at.value),
      until: ends ? moment(until.value) : undefined,
      value: value.value || undefined,
      parts: counts && parts.value ? Number(parts.value) : undefined,
    };
    const headers = { "content-type": "application/json", "x-door": "page" };
    try {
      const taken = await ask("/api/v1/facts", { method: "POST", headers, body: JSON.stringify(fact) });
      say(this.note, taken.stored ? t("fact_stored") : t("fact_known"));
      for (const input of [value, parts]) input.value = "";
      this.read(true);
    } catch (error) {
      say(this.note, error.message);
    }
  }

  /** Shows the facts of this time, seconds since 1970; a fact that was told just now may be younger than what is seen. */
  show(root, range) {
    if (this.box.parentNode !== root) fill(root, [this.box]);
    this.range = range;
    this.read(false);
  }

  async read(now) {
    const key = this.range.map(Math.round).join();
    if (!now && this.key === key && Date.now() - this.at < AGAIN_MS) return;
    [this.key, this.at] = [key, Date.now()];
    const [from, to] = this.range.map((s) => new Date(s * 1000).toISOString());
    // History needs a moment to make it durable.
    if (now) await new Promise((resolve) => setTimeout(resolve, 1500));
    try {
      this.draw((await ask(`/api/v1/facts?from=${from}&to=${to}`)).rows.reverse());
    } catch (error) {
      say(this.note, error.message);
    }
  }

  draw(rows) {
    if (!rows.length) return fill(this.rows, [make("p", "empty", t("no_facts"))]);
    const last = this.range[1] * 1000;
    const cells = rows.map((it) => [
      it.to_ms ? `${when(it.from_ms, last)} – ${when(it.to_ms, last)}` : when(it.from_ms, last),
      t(`fact_${it.fact}`),
      it.value ?? "–",
      { num: it.parts === null ? "–" : String(it.parts) },
      it.author ?? it.way,
    ]);
    const head = [t("time"), t("kind"), t("what"), { num: t("pieces") }, t("fact_author")];
    fill(this.rows, [table(head, cells, { caption: t("tab_facts") })]);
  }
}
