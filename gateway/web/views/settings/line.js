// One line of the form of settings.
import { fill, make, say } from "/web/parts.js";
import { dateTime } from "/web/format.js";
import { own, t } from "/web/words.js";
import { SettingField } from "/web/settings-field.js";
import { PLACES, placeWords, shown, takes, unit, valueWords } from "/web/settings-texts.js";

/** One declared setting: its words, a field for the machine, and one for each tool or operation with a value of its
    own. */
export class SettingLine {
  constructor(form, it) {
    Object.assign(this, { form, setting: it, fields: new Map() });
    this.values = make("div", "setting-values");
    this.who = make("p", "note setting-who", " ");
    const id = `setting-${it.script}-${it.name}`;
    const facts = `${t("setting_takes", takes(it))} · ${t("setting_default", shown(it.default) === "" ? t("setting_empty") : [shown(it.default), unit(it)].filter(Boolean).join(" "))}`;
    const words = make("div", "", [
      make("strong", "", own(it) || it.name),
      make("code", "", it.name),
      make("p", "note", facts),
    ]);
    this.box = make("div", "setting", [words, this.values, this.who], {
      id,
      role: "group",
      "aria-label": own(it) || it.name,
    });
    this.add = it.per.length ? this.adder() : null;
    if (this.add) this.values.append(this.add.box);
  }

  give(it) {
    this.setting = it;
    const wanted = [{ key: "", value: it.value, written: it.written, place: {} }];
    for (const row of it.special)
      for (const per of PLACES)
        if (row[per])
          wanted.push({
            key: `${per} ${row[per]}`,
            value: row.value,
            written: row.written,
            place: { [per]: row[per] },
          });
    const there = it.special.length > 0;
    for (const at of wanted) {
      if (!this.fields.has(at.key)) {
        const field = new SettingField(this, at);
        this.fields.set(at.key, field);
        this.values.insertBefore(field.box, this.add?.box ?? null);
      }
      this.fields.get(at.key).give(at);
    }
    for (const [key, field] of this.fields)
      if (!wanted.some((at) => at.key === key) && !field.changed()) {
        field.box.remove();
        this.fields.delete(key);
      }
    this.box.classList.toggle("chosen", it.chosen || there);
    const last = it.changes[0];
    const place = last && last.place !== "this machine" ? ` (${placeWords(last.place)})` : "";
    say(
      this.who,
      last
        ? t(
            "setting_changed",
            last.by === "the file settings.toml" ? t("by_the_file") : last.by,
            dateTime(last.at_ms),
            `${valueWords(last.before)} → ${valueWords(last.after)} ${unit(it)}`.trim() + place,
          )
        : t(it.chosen || there ? "setting_by_file" : "setting_never"),
    );
  }

  /** A tool or an operation gets a value of its own. */
  adder() {
    const { setting: it, form } = this;
    const per = make(
      "select",
      "",
      it.per.map((word) => make("option", "", t(`per_${word}`), { value: word })),
      { "aria-label": `${own(it)}: ${t("per_what")}` },
    );
    const which = make("input", "", null, {
      type: "text",
      list: `known-${it.script}-${it.name}`,
      autocomplete: "off",
      "aria-label": `${own(it)}: ${t("per_name")}`,
      placeholder: t("per_name"),
    });
    const names = make("datalist", "", null, { id: `known-${it.script}-${it.name}` });
    const error = make("p", "setting-error", "", { role: "alert", id: `error-${it.script}-${it.name}-new` });
    const offer = () =>
      fill(
        names,
        [...form.known[per.value]].sort().map((known) => make("option", "", null, { value: known })),
      );
    which.addEventListener("focus", offer);
    which.addEventListener("input", () => {
      say(error, "");
      which.removeAttribute("aria-invalid");
      this.told = null;
    });
    which.setAttribute("aria-describedby", error.id);
    const button = make("button", "", t("add_value"), {
      type: "submit",
      "aria-label": `${own(it)}: ${t("add_value")}`,
    });
    const wrong = (text) => {
      say(error, text);
      which.setAttribute("aria-invalid", "true");
      which.focus();
    };
    const submit = (event) => {
      event.preventDefault();
      const wanted = which.value.trim();
      const key = `${per.value} ${wanted}`;
      if (!wanted) return wrong(t("per_name_missing"));
      if (this.fields.has(key)) return this.fields.get(key).input.focus();
      // A tool that never came is most likely a slip of the pen. It may be one that comes tomorrow.
      if (!form.known[per.value].has(wanted) && this.told !== key) {
        this.told = key;
        return wrong(t(`unknown_${per.value}`, wanted, [...form.known[per.value]].sort().join(", ") || "–"));
      }
      const field = new SettingField(this, {
        key,
        value: this.setting.value,
        written: "",
        place: { [per.value]: wanted },
        fresh: true,
      });
      this.fields.set(key, field);
      this.values.insertBefore(field.box, box_);
      field.enable(form.may());
      field.input.focus();
      [which.value, this.told] = ["", null];
      say(error, "");
    };
    const box_ = make("form", "setting-add", [per, which, names, button, error], {
      onsubmit: submit,
      novalidate: true,
    });
    return { box: box_, all: [per, which, button] };
  }

  enable(may) {
    for (const field of this.fields.values()) field.enable(may);
    if (this.add) this.add.box.hidden = !may;
  }
}
