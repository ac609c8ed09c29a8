// The settings that the scripts declare, as a form below the editor: what is in force, for the machine and for single tools or
// operations, who changed it last. What is typed counts when "Set" is pressed; whoever comes second is told, and keeps what he typed.
import { ask, card, fill, make, say, send } from "/web/parts.js";
import { dateTime, plainName, unitName } from "/web/format.js";
import { box, own, t } from "/web/words.js";

/** The form is read again so often while it is looked at: another person may change something. */
const AGAIN_MS = 5000;
const PLACES = ["tool", "operation"];
const script = (it) => `${it.script}.rhai`;
const name = (it) => `${it.script}.${it.name}`;
/** A value as the document gives it: a number as it is written, a text as it is. */
const shown = (value) => (typeof value === "string" ? value : String(value));
const unit = (it) => unitName(it.unit);
const takes = (it) => (it.one_of.length ? it.one_of.join(", ") : it.least === null ? t("setting_text") : [`${it.least} … ${it.greatest}`, unit(it), it.whole ? t("setting_whole") : ""].filter(Boolean).join(" "));

export class SettingsForm {
  constructor(context) {
    Object.assign(this, { context, groups: new Map(), lines: new Map(), known: { tool: new Set(), operation: new Set() } });
    this.search = make("input", "", null, { type: "search", placeholder: t("search"), "aria-label": t("search_settings") });
    this.search.addEventListener("input", () => this.filter());
    this.note = make("p", "note", " ", { role: "status" });
    this.body = make("div", "settings-groups");
    this.box = card("", [make("div", "head", [make("h2", "", t("settings_title")), this.search]), make("p", "note", t("settings_words")), this.note, this.body], "settings");
    this.read();
    this.timer = setInterval(() => { if (!document.hidden) this.read(); }, AGAIN_MS);
  }

  may() { return Boolean(this.context.session?.may?.edit); }

  async read() {
    try {
      this.draw((await ask("/api/v1/settings")).settings);
      this.learnNames();
    } catch (error) { say(this.note, error.message); }
  }

  /** Tools and operations that this machine is known to have: of the newest states and the newest sample, of values already given. */
  async learnNames() {
    if (!this.asked) {
      this.asked = true;
      const past = await ask("/api/v1/states?from=1990-01-01&limit=2000").catch(() => ({ rows: [] }));
      for (const it of past.rows) if (it.tool) this.known.tool.add(plainName(it.tool));
    }
    for (const per of PLACES) { const now = this.context.quantity(per)?.value; if (now) this.known[per].add(plainName(String(now))); }
  }

  draw(settings) {
    for (const it of settings) {
      if (!this.groups.has(it.script)) this.group(it.script);
      if (!this.lines.has(name(it))) {
        const line = new SettingLine(this, it);
        this.lines.set(name(it), line);
        this.groups.get(it.script).list.append(line.box);
      }
      this.lines.get(name(it)).give(it);
      for (const place of it.special) for (const per of PLACES) if (place[per]) this.known[per].add(place[per]);
    }
    const gone = [...this.lines].filter(([key]) => !settings.some((it) => name(it) === key));
    for (const [key, line] of gone) { line.box.remove(); this.lines.delete(key); }
    for (const [key, group] of this.groups) {
      const all = settings.filter((it) => it.script === key);
      if (!all.length) { group.box.remove(); this.groups.delete(key); continue; }
      const chosen = all.filter((it) => it.chosen || it.special.length).length;
      say(group.count, `${t("settings_count", all.length)}${chosen ? ` · ${t("settings_chosen", chosen)}` : ""}`);
    }
    if (!settings.length) say(this.note, t("no_settings"));
    this.enable();
  }

  group(key) {
    const list = make("div", "");
    const count = make("span", "note", "");
    const group = make("details", "", [make("summary", "", [make("span", "", `${key}.rhai`), count]), list]);
    this.groups.set(key, { box: group, list, count });
    if (this.current === `${key}.rhai`) group.open = true;
    this.body.append(group);
  }

  /** The settings of the script in the editor are open. */
  open(file) {
    this.current = file;
    for (const [key, group] of this.groups) group.box.open = `${key}.rhai` === file;
  }

  filter() {
    const wanted = this.search.value.trim().toLowerCase();
    for (const [key, group] of this.groups) {
      const lines = [...this.lines.values()].filter((line) => line.setting.script === key);
      for (const line of lines) line.box.hidden = Boolean(wanted) && !`${name(line.setting)} ${line.setting.en} ${line.setting.zh}`.toLowerCase().includes(wanted);
      group.box.hidden = lines.every((line) => line.box.hidden);
      group.box.open = wanted ? !group.box.hidden : `${key}.rhai` === this.current;
    }
  }

  enable() {
    const may = this.may();
    if (!may && this.context.session) say(this.note, t("sign_in_to_set"));
    else if (this.note.textContent === t("sign_in_to_set")) say(this.note, " ");
    for (const line of this.lines.values()) line.enable(may);
  }

  leave() { clearInterval(this.timer); }
}

/** One declared setting: its words, a field for the machine, and one for each tool or operation with a value of its own. */
class SettingLine {
  constructor(form, it) {
    Object.assign(this, { form, setting: it, fields: new Map() });
    this.values = make("div", "setting-values");
    this.who = make("p", "note setting-who", " ");
    const id = `setting-${it.script}-${it.name}`;
    const facts = `${t("setting_takes", takes(it))} · ${t("setting_default", shown(it.default) === "" ? t("setting_empty") : [shown(it.default), unit(it)].filter(Boolean).join(" "))}`;
    const words = make("div", "", [make("strong", "", own(it) || it.name), make("code", "", it.name), make("p", "note", facts)]);
    this.box = make("div", "setting", [words, this.values, this.who], { id, role: "group", "aria-label": own(it) || it.name });
    this.add = it.per.length ? this.adder() : null;
    if (this.add) this.values.append(this.add.box);
  }

  give(it) {
    this.setting = it;
    const wanted = [{ key: "", value: it.value, written: it.written, place: {} }];
    for (const row of it.special) for (const per of PLACES) if (row[per]) wanted.push({ key: `${per} ${row[per]}`, value: row.value, written: row.written, place: { [per]: row[per] } });
    const there = it.special.length > 0;
    for (const at of wanted) {
      if (!this.fields.has(at.key)) { const field = new SettingField(this, at); this.fields.set(at.key, field); this.values.insertBefore(field.box, this.add?.box ?? null); }
      this.fields.get(at.key).give(at);
    }
    for (const [key, field] of this.fields) if (!wanted.some((at) => at.key === key) && !field.changed()) { field.box.remove(); this.fields.delete(key); }
    this.box.classList.toggle("chosen", it.chosen || there);
    const last = it.changes[0];
    const place = last && last.place !== "this machine" ? ` (${placeWords(last.place)})` : "";
    say(this.who, last ? t("setting_changed", last.by === "the file settings.toml" ? t("by_the_file") : last.by, dateTime(last.at_ms), `${valueWords(last.before)} → ${valueWords(last.after)} ${unit(it)}`.trim() + place) : t(it.chosen || there ? "setting_by_file" : "setting_never"));
  }

  /** A tool or an operation gets a value of its own. */
  adder() {
    const { setting: it, form } = this;
    const per = make("select", "", it.per.map((word) => make("option", "", t(`per_${word}`), { value: word })), { "aria-label": `${own(it)}: ${t("per_what")}` });
    const which = make("input", "", null, { type: "text", list: `known-${it.script}-${it.name}`, autocomplete: "off", "aria-label": `${own(it)}: ${t("per_name")}`, placeholder: t("per_name") });
    const names = make("datalist", "", null, { id: `known-${it.script}-${it.name}` });
    const error = make("p", "setting-error", "", { role: "alert", id: `error-${it.script}-${it.name}-new` });
    const offer = () => fill(names, [...form.known[per.value]].sort().map((known) => make("option", "", null, { value: known })));
    which.addEventListener("focus", offer);
    which.addEventListener("input", () => { say(error, ""); which.removeAttribute("aria-invalid"); this.told = null; });
    which.setAttribute("aria-describedby", error.id);
    const button = make("button", "", t("add_value"), { type: "submit", "aria-label": `${own(it)}: ${t("add_value")}` });
    const wrong = (text) => { say(error, text); which.setAttribute("aria-invalid", "true"); which.focus(); };
    const submit = (event) => {
      event.preventDefault();
      const wanted = which.value.trim();
      const key = `${per.value} ${wanted}`;
      if (!wanted) return wrong(t("per_name_missing"));
      if (this.fields.has(key)) return this.fields.get(key).input.focus();
      // A tool that never came is most likely a slip of the pen. It may be one that comes tomorrow.
      if (!form.known[per.value].has(wanted) && this.told !== key) { this.told = key; return wrong(t(`unknown_${per.value}`, wanted, [...form.known[per.value]].sort().join(", ") || "–")); }
      const field = new SettingField(this, { key, value: this.setting.value, written: "", place: { [per.value]: wanted }, fresh: true });
      this.fields.set(key, field);
      this.values.insertBefore(field.box, box_);
      field.enable(form.may());
      field.input.focus();
      [which.value, this.told] = ["", null];
      say(error, "");
    };
    const box_ = make("form", "setting-add", [per, which, names, button, error], { onsubmit: submit, novalidate: true });
    return { box: box_, all: [per, which, button] };
  }

  enable(may) {
    for (const field of this.fields.values()) field.enable(may);
    if (this.add) this.add.box.hidden = !may;
  }
}

const valueWords = (text) => (text === "as the machine" ? t("as_machine") : text.replace(/\.0$/, ""));
const placeWords = (text) => PLACES.reduce((done, per) => (done.startsWith(`${per} `) ? `${t(`per_${per}`)} ${done.slice(per.length + 1)}` : done), text);

/** A value in one place. */
class SettingField {
  constructor(line, at) {
    Object.assign(this, { line, at, fresh: Boolean(at.fresh), began: at.written });
    const it = line.setting;
    const [per] = Object.keys(at.place);
    const label = per ? `${t(`per_${per}`)} ${at.place[per]}` : t("per_machine");
    const id = `value-${it.script}-${it.name}-${at.key}`.replace(/\s/g, "_");
    this.error = make("p", "setting-error", "", { role: "alert", id: `${id}-error` });
    const common = { id, "aria-label": `${own(it) || it.name}, ${label}`, "aria-describedby": `${id}-error` };
    this.input = it.one_of.length ? make("select", "", it.one_of.map((word) => make("option", "", word, { value: word })), common) : make("input", "", null, { ...common, type: "text", inputmode: it.least === null ? null : "decimal", autocomplete: "off" });
    this.input.value = shown(at.value);
    this.input.addEventListener("input", () => { this.wrong(""); this.enable(this.line.form.may()); });
    this.set = make("button", "", t("set_value"), { type: "submit", "aria-label": `${t("set_value")}: ${own(it) || it.name}, ${label}` });
    this.reset = make("button", "", t(per ? "as_machine" : "to_default"), { type: "button", "aria-label": `${t(per ? "as_machine" : "to_default")}: ${own(it) || it.name}, ${label}`, onclick: () => this.send(null) });
    this.box = make("form", "setting-field", [make("label", "", label, { for: id }), make("span", "setting-input", [this.input, make("span", "note", unit(it))]), this.set, this.reset, this.error], { novalidate: true, onsubmit: (event) => { event.preventDefault(); this.submit(); } });
  }

  changed() { return this.fresh || this.input.value !== shown(this.at.value); }

  /** What the box has now. What somebody is typing stays, and stays begun from what he saw. */
  give(at) {
    const typing = this.changed();
    this.at = at;
    if (at.written) this.fresh = this.fresh && typing && at.written === this.began;
    if (typing && this.input.value !== shown(at.value)) return;
    [this.began, this.fresh] = [at.written, false];
    if (this.input.value !== shown(at.value)) this.input.value = shown(at.value);
  }

  enable(may) {
    this.input.disabled = !may || this.busy;
    this.set.disabled = !may || this.busy || !this.changed();
    this.set.hidden = !may || !this.changed();
    this.set.className = this.changed() ? "primary" : "";
    this.reset.hidden = !may || (!this.at.written && !this.changed());
    this.reset.disabled = Boolean(this.busy);
  }

  wrong(text) {
    say(this.error, text);
    if (text) this.input.setAttribute("aria-invalid", "true"); else this.input.removeAttribute("aria-invalid");
  }

  submit() {
    const it = this.line.setting;
    const typed = this.input.value.trim();
    if (it.least === null) return this.send(typed);
    const value = typed === "" ? NaN : Number(typed.replace(",", "."));
    if (!Number.isFinite(value)) return this.refused(t("setting_no_number", typed));
    if (it.whole && !Number.isInteger(value)) return this.refused(t("setting_not_whole", typed));
    if (value < it.least || value > it.greatest) return this.refused(t("setting_outside", typed, takes(it)));
    return this.send(value);
  }

  refused(text) { this.wrong(text); this.input.focus(); }

  async send(value) {
    const { line, at } = this;
    const it = line.setting;
    // A value that was typed and never set is taken back without asking the box.
    if (value === null && !this.began) return this.takeBack();
    this.busy = true;
    this.enable(line.form.may());
    try {
      const done = await send("/api/v1/settings", { script: it.script, name: it.name, value, ...at.place, began_from: this.began }, "PUT");
      this.wrong("");
      this.input.value = value === null ? this.input.value : shown(value);
      this.settled(done.settings);
      say(line.form.note, t("setting_done", own(it) || it.name));
    } catch (error) { await this.failed(error); }
    this.busy = false;
    line.form.enable();
  }

  /** Everything as the box has it now, and this field, too. */
  settled(settings) {
    this.fresh = false;
    const mine = settings.find((it) => name(it) === name(this.line.setting));
    const [per] = Object.keys(this.at.place);
    const now = per ? mine?.special.find((row) => row[per] === this.at.place[per]) : mine;
    if (now) { this.at = { ...this.at, value: now.value, written: now.written }; this.began = now.written; this.input.value = shown(now.value); } else this.at = { ...this.at, value: this.input.value };
    this.line.form.draw(settings);
  }

  takeBack() {
    this.wrong("");
    if (this.at.key && !this.at.written) { this.box.remove(); this.line.fields.delete(this.at.key); return; }
    [this.input.value, this.began] = [shown(this.at.value), this.at.written];
    this.enable(this.line.form.may());
  }

  async failed(error) {
    if (error.status !== 409) return this.refused(box(error.message));
    const typed = this.input.value;
    await this.line.form.read();
    this.input.value = typed;
    this.began = this.at.written;
    const who = / by (.+): it is /.exec(error.document?.title ?? "")?.[1] ?? "";
    this.refused(t("setting_meanwhile", who === "the file settings.toml" ? t("by_the_file") : who, this.at.written ? [shown(this.at.value), unit(this.line.setting)].filter(Boolean).join(" ") : t("setting_free")));
  }
}
