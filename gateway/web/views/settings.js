// The settings that the scripts declare, as a form below the editor: what is in force, for the machine and for single
// tools or operations, who changed it last. What is typed counts when "Set" is pressed; whoever comes second is told,
// and keeps what he typed.
import { ask, card, make, say } from "/web/parts.js";
import { plainName } from "/web/format.js";
import { t } from "/web/words.js";
import { SettingLine } from "/web/settings-line.js";
import { PLACES, name } from "/web/settings-texts.js";

/** The form is read again so often while it is looked at: another person may change something. */
const AGAIN_MS = 5000;

export class SettingsForm {
  constructor(context) {
    Object.assign(this, {
      context,
      groups: new Map(),
      lines: new Map(),
      known: { tool: new Set(), operation: new Set() },
    });
    this.search = make("input", "", null, {
      type: "search",
      placeholder: t("search"),
      "aria-label": t("search_settings"),
    });
    this.search.addEventListener("input", () => this.filter());
    this.note = make("p", "note", " ", { role: "status" });
    this.body = make("div", "settings-groups");
    this.box = card(
      "",
      [
        make("div", "head", [make("h2", "", t("settings_title")), this.search]),
        make("p", "note", t("settings_words")),
        this.note,
        this.body,
      ],
      "settings",
    );
    this.read();
    this.timer = setInterval(() => {
      if (!document.hidden) this.read();
    }, AGAIN_MS);
  }

  may() {
    return Boolean(this.context.session?.may?.edit);
  }

  async read() {
    try {
      this.draw((await ask("/api/v1/settings")).settings);
      this.learnNames();
    } catch (error) {
      say(this.note, error.message);
    }
  }

  /** Tools and operations that this machine is known to have: of the newest states and the newest sample, of values
      already given. */
  async learnNames() {
    if (!this.asked) {
      this.asked = true;
      const past = await ask("/api/v1/states?from=1990-01-01&limit=2000").catch(() => ({ rows: [] }));
      for (const it of past.rows) if (it.tool) this.known.tool.add(plainName(it.tool));
    }
    for (const per of PLACES) {
      const now = this.context.quantity(per)?.value;
      if (now) this.known[per].add(plainName(String(now)));
    }
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
    for (const [key, line] of gone) {
      line.box.remove();
      this.lines.delete(key);
    }
    for (const [key, group] of this.groups) {
      const all = settings.filter((it) => it.script === key);
      if (!all.length) {
        group.box.remove();
        this.groups.delete(key);
        continue;
      }
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
      for (const line of lines)
        line.box.hidden =
          Boolean(wanted) &&
          !`${name(line.setting)} ${line.setting.en} ${line.setting.zh}`.toLowerCase().includes(wanted);
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

  leave() {
    clearInterval(this.timer);
  }
}
