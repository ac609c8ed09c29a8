// One field of the form of settings.
import { make, say, send } from "/web/parts.js";
import { box, own, t } from "/web/words.js";
import { name, shown, takes, unit } from "/web/settings-texts.js";

/** A value in one place. */
export class SettingField {
  constructor(line, at) {
    Object.assign(this, { line, at, fresh: Boolean(at.fresh), began: at.written });
    const it = line.setting;
    const [per] = Object.keys(at.place);
    const label = per ? `${t(`per_${per}`)} ${at.place[per]}` : t("per_machine");
    const id = `value-${it.script}-${it.name}-${at.key}`.replace(/\s/g, "_");
    this.error = make("p", "setting-error", "", { role: "alert", id: `${id}-error` });
    const common = { id, "aria-label": `${own(it) || it.name}, ${label}`, "aria-describedby": `${id}-error` };
    this.input = it.one_of.length
      ? make(
          "select",
          "",
          it.one_of.map((word) => make("option", "", word, { value: word })),
          common,
        )
      : make("input", "", null, {
          ...common,
          type: "text",
          inputmode: it.least === null ? null : "decimal",
          autocomplete: "off",
        });
    this.input.value = shown(at.value);
    this.input.addEventListener("input", () => {
      this.wrong("");
      this.enable(this.line.form.may());
    });
    this.set = make("button", "", t("set_value"), {
      type: "submit",
      "aria-label": `${t("set_value")}: ${own(it) || it.name}, ${label}`,
    });
    this.reset = make("button", "", t(per ? "as_machine" : "to_default"), {
      type: "button",
      "aria-label": `${t(per ? "as_machine" : "to_default")}: ${own(it) || it.name}, ${label}`,
      onclick: () => this.send(null),
    });
    this.box = make(
      "form",
      "setting-field",
      [
        make("label", "", label, { for: id }),
        make("span", "setting-input", [this.input, make("span", "note", unit(it))]),
        this.set,
        this.reset,
        this.error,
      ],
      {
        novalidate: true,
        onsubmit: (event) => {
          event.preventDefault();
          this.submit();
        },
      },
    );
  }

  changed() {
    return this.fresh || this.input.value !== shown(this.at.value);
  }

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
    if (text) this.input.setAttribute("aria-invalid", "true");
    else this.input.removeAttribute("aria-invalid");
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

  refused(text) {
    this.wrong(text);
    this.input.focus();
  }

  async send(value) {
    const { line, at } = this;
    const it = line.setting;
    // A value that was typed and never set is taken back without asking the box.
    if (value === null && !this.began) return this.takeBack();
    this.busy = true;
    this.enable(line.form.may());
    try {
      const done = await send(
        "/api/v1/settings",
        { script: it.script, name: it.name, value, ...at.place, began_from: this.began },
        "PUT",
      );
      this.wrong("");
      this.input.value = value === null ? this.input.value : shown(value);
      this.settled(done.settings);
      say(line.form.note, t("setting_done", own(it) || it.name));
    } catch (error) {
      await this.failed(error);
    }
    this.busy = false;
    line.form.enable();
  }

  /** Everything as the box has it now, and this field, too. */
  settled(settings) {
    this.fresh = false;
    const mine = settings.find((it) => name(it) === name(this.line.setting));
    const [per] = Object.keys(this.at.place);
    const now = per ? mine?.special.find((row) => row[per] === this.at.place[per]) : mine;
    if (now) {
      this.at = { ...this.at, value: now.value, written: now.written };
      this.began = now.written;
      this.input.value = shown(now.value);
    } else this.at = { ...this.at, value: this.input.value };
    this.line.form.draw(settings);
  }

  takeBack() {
    this.wrong("");
    if (this.at.key && !this.at.written) {
      this.box.remove();
      this.line.fields.delete(this.at.key);
      return;
    }
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
    this.refused(
      t(
        "setting_meanwhile",
        who === "the file settings.toml" ? t("by_the_file") : who,
        this.at.written ? [shown(this.at.value), unit(this.line.setting)].filter(Boolean).join(" ") : t("setting_free"),
      ),
    );
  }
}
