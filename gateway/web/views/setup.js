// Set up: what a box needs to know, as a form, with its file as a second tab. Control and meters are tried and added, the file
// is edited, checked, stored, and the box started anew. What may write to the machine is changed at the box only; the box
// itself refuses it here.
import { ask, card, fill, make, row, say, send } from "/web/parts.js";
import { box, t } from "/web/words.js";
import { boxForm, deviceForm } from "/web/setup-form.js";
import { personsCard } from "/web/system-persons.js";

const PAUSE_MS = 400;
/** The tabs: a form for what is asked most, and the whole file. */
const TABS = ["form", "file"];

export function mount(root, context) {
  const state = { text: "", digest: "", restarts: false, timer: null, loaded: false };
  const note = make("p", "note", " ", { role: "status" });
  const problems = make("div", "");
  const text = make("textarea", "code", null, {
    rows: "18",
    spellcheck: "false",
    "aria-label": t("configuration_text"),
    readonly: true,
  });
  const button = (word, className, onclick) =>
    make("button", className, t(word), { type: "button", disabled: true, onclick });
  const save = button("save_configuration", "primary", () => store());
  const restart = button("restart_box", "", () => startAnew());
  const load = button("load_again", "", () => read());
  const change = (edited) => {
    text.value = edited;
    check();
    text.scrollTop = text.scrollHeight;
  };
  const devices = deviceForm((section) => change(`${text.value.trimEnd()}\n\n${section}`), note);
  const own = boxForm(() => text.value, change);
  const persons = personsCard(context);

  const check = () => {
    clearTimeout(state.timer);
    state.timer = setTimeout(async () => {
      try {
        tell((await send("/api/v1/configuration/check", { text: text.value })).problems);
      } catch (error) {
        say(note, error.message);
      }
    }, PAUSE_MS);
  };
  text.addEventListener("input", check);

  function tell(found) {
    fill(
      problems,
      found.map((it) =>
        row(
          it.line ? t("in_line", it.line) : t("configuration"),
          "",
          [box(it.what), box(it.next)].filter(Boolean).join(" – "),
          { dot: "bad", tone: "bad" },
        ),
      ),
    );
    save.disabled = !mayManage() || found.length > 0 || text.value === state.text;
  }

  async function read() {
    try {
      const found = await ask("/api/v1/configuration/file");
      Object.assign(state, { text: found.text, digest: found.digest, restarts: found.restarts, loaded: true });
      text.value = found.text;
      say(note, found.path);
      own.show();
      tell(found.problems);
      draw();
    } catch (error) {
      say(note, error.message);
    }
  }

  async function store() {
    try {
      const done = await send("/api/v1/configuration/file", { text: text.value, digest: state.digest }, "PUT");
      await read();
      say(note, `${done.text}. ${t(state.restarts ? "restart_now" : "restart_at_box")}`);
    } catch (error) {
      say(note, error.message);
    }
  }

  async function startAnew() {
    try {
      say(note, (await send("/api/v1/restart")).text);
    } catch (error) {
      say(note, error.message);
    }
  }

  const mayManage = () => Boolean(context.session?.may?.manage);
  function draw() {
    const may = mayManage() && state.loaded;
    text.readOnly = !may;
    load.disabled = !mayManage();
    restart.disabled = !(may && state.restarts);
    devices.may(mayManage(), may);
    own.may(may);
  }
  const signIn = make("a", "button", t("sign_in_to_set_up"), {
    href: `/sign-in?next=${encodeURIComponent("/setup")}`,
    hidden: true,
  });
  const panels = {
    form: make("div", "", [make("h3", "", t("set_up_devices")), devices.box, make("h3", "", t("set_up_box")), own.box]),
    file: make("div", "", [text]),
  };
  const tabs = TABS.map((word) =>
    make("button", "tab", t(`tab_${word}`), { type: "button", role: "tab", onclick: () => choose(word) }),
  );
  function choose(word) {
    TABS.forEach((it, place) => {
      tabs[place].setAttribute("aria-selected", String(it === word));
      panels[it].hidden = it !== word;
    });
  }
  choose("form");
  root.append(
    card(t("set_up"), [
      make("p", "note", t("set_up_words")),
      signIn,
      make("div", "buttons", tabs, { role: "tablist" }),
      panels.form,
      panels.file,
      problems,
      make("div", "buttons", [save, restart, load]),
      note,
    ]),
    persons.box,
  );
  const session = () => {
    signIn.hidden = mayManage();
    persons.may();
    draw();
    if (mayManage() && !state.loaded) read();
  };
  if (context.session) session();
  return { session };
}
