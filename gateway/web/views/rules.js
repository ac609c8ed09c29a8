// Rules: a script is edited as a draft, tried, run over the history, and only then put in charge; every version before
// it is one click away. Nothing that is typed here counts before "Activate".
import { ask, card, fill, make, say, send, table } from "/web/parts.js";
import { dateTime, duration, number } from "/web/format.js";
import { own, scriptWords, t } from "/web/words.js";
import { Editor, vocabulary } from "/web/editor.js";
import { createRule } from "/web/rules-new.js";
import { showBacktest, showTrials } from "/web/rules-results.js";
import { SettingsForm } from "/web/settings.js";

const BACKTESTS = ["1h", "8h", "24h", "7d", "30d"];

export function mount(root, context) {
  const view = new RulesView(root, context);
  view.begin();
  return {
    rules: view,
    update: (status) => view.update(status),
    session: () => {
      view.enable();
      view.settings.enable();
    },
    leave: () => view.leave(),
  };
}

class RulesView {
  constructor(root, context) {
    Object.assign(this, { root, context, files: [], current: null, texts: new Map(), busy: false });
    this.list = make("div", "file-list", null, { role: "group", "aria-label": t("scripts") });
    this.host = make("div", "editor-host");
    this.note = make("p", "note", " ", { role: "status" });
    this.result = make("div", "");
    this.words = make("div", "words-list", null, { tabindex: "0", role: "region", "aria-label": t("words_title") });
    this.versions = make("div", "");
    const button = (key, act, className = "") =>
      make("button", className, t(key), { type: "button", onclick: () => this.run(act) });
    this.since = make(
      "select",
      "",
      BACKTESTS.map((s) =>
        make(
          "option",
          "",
          t(
            "last_span",
            s.replace(/(\d+)([hd])/, (_, n, u) => `${n} ${t(u)}`),
          ),
          { value: s, selected: s === "24h" },
        ),
      ),
      { "aria-label": t("backtest_span") },
    );
    this.actions = {
      save: button("save_draft", () => this.save()),
      trial: button("run_trials", () => this.trial()),
      backtest: button("backtest", () => this.backtest()),
      activate: button("activate", () => this.activate(), "primary"),
      discard: button("discard_draft", () => this.discard()),
      remove: button("remove_rule", () => this.remove()),
    };
    const tools = make("div", "head", [
      make("div", "buttons", [this.actions.save, this.actions.trial]),
      make("div", "buttons", [this.actions.backtest, this.since]),
      make("div", "buttons", [this.actions.activate, this.actions.discard, this.actions.remove]),
    ]);
    this.title = make("h2", "", t("scripts"));
    this.fresh = make("button", "", t("new_rule"), { type: "button", onclick: () => createRule(this) });
    const words = make("input", "", null, {
      type: "search",
      placeholder: t("search_words"),
      "aria-label": t("search_words"),
    });
    words.addEventListener("input", () => this.drawWords(words.value.toLowerCase()));
    root.append(
      make("div", "rules", [
        card(t("scripts"), [this.list, this.fresh, make("p", "note", t("rules_words"))]),
        make("section", "card editing", [
          this.title,
          tools,
          this.note,
          this.host,
          this.result,
          make("h3", "", t("earlier_versions")),
          this.versions,
        ]),
        card(t("words_title"), [words, this.words]),
      ]),
    );
    this.settings = new SettingsForm(context);
    root.append(this.settings.box);
  }

  async begin() {
    try {
      const [found, api] = await Promise.all([ask("/api/v1/rules"), ask("/api/v1/rules/words")]);
      [this.files, this.api] = [found.scripts, api];
      this.editor = new Editor(this.host, {
        words: vocabulary(api),
        label: t("editor"),
        onChange: (text) => this.typed(text),
      });
      this.drawWords("");
      const asked = new URLSearchParams(location.search).get("file");
      const first = this.files.find((f) => f.file === asked) ?? this.files[0];
      if (first) this.open(first.file);
      else say(this.note, t("no_scripts"));
    } catch (error) {
      say(this.note, error.message);
    }
    this.enable();
  }

  file(name = this.current) {
    return this.files.find((f) => f.file === name);
  }
  changed(name = this.current) {
    const f = this.file(name);
    const text = this.texts.get(name);
    return f && text !== undefined && text !== f.text;
  }

  open(name) {
    this.current = name;
    this.settings.open(name);
    const file = this.file(name);
    // A draft goes before the version in charge: somebody has not finished with it.
    if (!this.texts.has(name) && file.draft) this.texts.set(name, file.draft.text);
    this.editor.open(this.texts.get(name) ?? file.text);
    this.context.go(`/rules?file=${encodeURIComponent(name)}`, { replace: true });
    fill(this.result, []);
    say(this.note, file.draft ? t("draft_of", file.draft.by, dateTime(file.draft.at_ms)) : " ");
    this.drawFiles();
    this.drawVersions();
    this.enable();
  }

  typed(text) {
    this.texts.set(this.current, text);
    this.drawFiles();
    this.enable();
    clearTimeout(this.timer);
    if (this.may()) this.timer = setTimeout(() => this.check().catch(() => {}), 700);
  }

  may() {
    return Boolean(this.context.session?.may?.edit);
  }

  enable() {
    const may = this.may();
    for (const [name, button] of Object.entries(this.actions))
      button.disabled =
        !may ||
        this.busy ||
        (name === "save" && !this.changed()) ||
        (name === "remove" && !this.file()?.digest) ||
        (name === "discard" && !this.changed() && !this.file()?.draft) ||
        (name === "activate" && !this.changed() && !this.file()?.draft);
    if (!may && this.context.session) say(this.note, t("sign_in_to_edit"));
  }

  async run(act) {
    if (!this.may()) {
      location.href = `/sign-in?next=${encodeURIComponent(location.pathname + location.search)}`;
      return;
    }
    this.busy = true;
    this.enable();
    try {
      await act();
    } catch (error) {
      say(this.note, error.message);
      this.show(error.document);
    }
    this.busy = false;
    this.enable();
  }

  body() {
    return { text: this.editor.text, digest: this.file().draft?.digest ?? this.file().digest };
  }

  async check() {
    const found = await send(`/api/v1/rules/${this.current}/check`, this.body());
    this.editor.problems(found.problems);
    return found;
  }

  async save() {
    await send(`/api/v1/rules/${this.current}/draft`, this.body(), "PUT");
    await this.reload();
    say(this.note, t("draft_saved"));
  }

  async trial() {
    const found = await send(`/api/v1/rules/${this.current}/trials`, this.body());
    this.editor.problems([...found.problems, ...found.trials.map((r) => r.problem).filter(Boolean)]);
    showTrials(this, found);
  }

  async backtest() {
    say(this.note, t("backtest_runs"));
    await send(`/api/v1/rules/${this.current}/backtest`, { ...this.body(), since: this.since.value });
    let run = { state: "running" };
    while (run.state === "running") {
      await new Promise((done) => setTimeout(done, 500));
      run = await ask("/api/v1/backtest");
      say(this.note, t("backtest_seconds", number(Math.round(run.seconds ?? 0))));
      if (!this.host.isConnected) return;
    }
    if (run.state !== "done") throw new Error(run.what ?? run.state);
    const found = run.report;
    say(this.note, t("backtest_done", number(found.rows), duration(found.covered_s), number(found.took_s, "s")));
    showBacktest(this, found);
  }

  async activate() {
    const done = await send(`/api/v1/rules/${this.current}/activate`, this.body());
    await this.reload();
    say(this.note, t("activated", done.version ?? ""));
    this.texts.delete(this.current);
    this.open(this.current);
    say(this.note, t("activated", done.version ?? ""));
  }

  async discard() {
    if (this.file().draft) await send(`/api/v1/rules/${this.current}/draft`, {}, "DELETE");
    this.texts.delete(this.current);
    await this.reload();
    this.open(this.current);
  }

  /** Out of charge; the text stays as a draft, which can be put back or discarded. */
  async remove() {
    const name = this.current;
    await ask(`/api/v1/rules/${name}`, { method: "DELETE" });
    this.texts.delete(name);
    await this.reload();
    this.open(name);
    say(this.note, t("rule_removed", name));
  }

  async reload() {
    this.files = (await ask("/api/v1/rules")).scripts;
    this.drawFiles();
    this.drawVersions();
  }

  show(document) {
    if (document?.problems) this.editor.problems(document.problems);
    if (document?.trials) showTrials(this, document);
  }

  drawFiles() {
    const status = new Map((this.context.status()?.scripts ?? []).map((s) => [s.file, s]));
    const tone = { running: "good", waiting: "warn", reverted: "bad", suspended: "bad", refused: "bad" };
    fill(
      this.list,
      this.files.map((f) => {
        const s = status.get(f.file);
        const state = this.changed(f.file) || f.draft ? t("is_draft") : s ? t(`script_${s.condition}`) : "";
        return make("button", `file dot ${tone[s?.condition] ?? ""}`, [f.file, make("span", "more", state)], {
          type: "button",
          "aria-pressed": String(f.file === this.current),
          onclick: () => this.open(f.file),
        });
      }),
    );
    say(this.title, this.current ?? t("scripts"));
  }

  drawVersions() {
    const versions = this.file()?.versions ?? [];
    const rows = versions.map((v) => [
      dateTime(v.at_ms),
      v.by || "–",
      v.digest.slice(0, 8),
      { text: make("button", "link-button", t("look_at_it"), { type: "button", onclick: () => this.lookAt(v) }) },
    ]);
    fill(
      this.versions,
      rows.length
        ? [table([t("time"), t("who"), t("version"), ""], rows, { caption: t("earlier_versions") })]
        : [make("p", "empty", t("no_versions"))],
    );
  }

  /** An earlier version comes into the editor as a draft; "Activate" puts it back in charge. */
  async lookAt(version) {
    const found = await ask(`/api/v1/rules/${this.current}/versions/${version.digest}`);
    this.editor.open(found.text);
    this.typed(found.text);
    say(this.note, t("version_opened", dateTime(version.at_ms)));
  }

  drawWords(wanted) {
    const entry = (name, detail, text) =>
      make(
        "button",
        "word-entry",
        [make("code", "", name), make("span", "note", ` ${detail}`), make("span", "more", text)],
        { type: "button", onclick: () => this.editor.insert(name) },
      );
    const all = [
      ...this.api.functions.map((f) => [f.signature, "", own(f)]),
      ...this.api.variables.map((v) => [v.name, v.unit === "1" ? "" : v.unit, own(v)]),
      ...this.api.methods.map((m) => [m.signature, `→ ${m.returns}`, own(m)]),
      ...this.api.handlers.map((h) => [h.signature, "", own(h)]),
    ].filter((it) => !wanted || it.join(" ").toLowerCase().includes(wanted));
    fill(
      this.words,
      all.slice(0, 250).map((it) => entry(...it)),
    );
  }

  update(status) {
    const key = JSON.stringify(status.scripts);
    if (key !== this.drawn) {
      this.drawn = key;
      if (this.files.length) this.drawFiles();
    }
    const mine = status.scripts.find((s) => s.file === this.current);
    if (mine?.error && mine.error !== this.told) {
      this.told = mine.error;
      say(this.note, scriptWords(mine.error));
    }
  }

  leave() {
    clearTimeout(this.timer);
    this.settings.leave();
    this.editor?.destroy();
  }
}
