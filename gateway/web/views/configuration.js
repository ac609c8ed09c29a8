// The configuration as it is set up from the page: sources, meters and receivers are tried and added, the file is
// edited, checked, stored, and the box started anew. What may write to the machine is changed at the box only; the box
// itself refuses it here.
import { ask, card, fill, make, row, say, send } from "/web/parts.js";
import { quantity } from "/web/format.js";
import { box, t } from "/web/words.js";

const PAUSE_MS = 400;
/** What a person knows of a device, and the address that comes of it. */
const DEVICES = [
  ["fanuc", (host) => `fanuc://${host}`, "192.168.1.10:8193"],
  ["nclink", (host) => `nclink://${host}`, "192.168.1.5:1883/SERIAL"],
  ["modbus_tcp", (host) => `modbus-tcp://${host}`, "192.168.1.20:502?profile=sdm630&unit=1"],
  ["modbus_rtu", (host) => `modbus-rtu://${host}`, "/dev/ttyUSB0?profile=sdm630&unit=1&baud=9600"],
  ["simulated", (host) => `simulated://${host}`, "lathe"],
  ["other", (host) => host, "scheme://..."],
];

export function configurationFileCard(context) {
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
  const devices = deviceForm(
    context,
    (section) => {
      text.value = `${text.value.trimEnd()}\n\n${section}`;
      check();
      text.scrollTop = text.scrollHeight;
    },
    note,
  );

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
    devices.may(may);
  }
  const whole = card(t("set_up"), [
    make("p", "note", t("set_up_words")),
    devices.box,
    text,
    problems,
    make("div", "buttons", [save, restart, load]),
    note,
  ]);
  return {
    box: whole,
    may() {
      draw();
      if (mayManage() && !state.loaded) read();
    },
  };
}

/** A device by what is known of it: tried first, then a section of the configuration. */
function deviceForm(context, add, note) {
  const kind = make(
    "select",
    "",
    DEVICES.map(([word]) => make("option", "", t(`device_${word}`), { value: word })),
    { "aria-label": t("device_kind") },
  );
  const where = make("input", "", null, {
    type: "text",
    placeholder: DEVICES[0][2],
    "aria-label": t("device_where"),
    size: "36",
  });
  const name = make("input", "", null, { type: "text", placeholder: t("device_name"), "aria-label": t("device_name") });
  const out = make("div", "", null, { role: "status" });
  const device = () => DEVICES.find(([word]) => word === kind.value);
  const address = () => device()[1](where.value.trim());
  kind.addEventListener("change", () => {
    where.placeholder = device()[2];
  });
  const look = make("button", "", t("try_device"), {
    type: "button",
    onclick: async () => {
      look.disabled = true;
      fill(out, [make("p", "note", t("looking_at", address()))]);
      try {
        fill(out, describe(await send("/api/v1/doctor/address", { address: address() })));
      } catch (error) {
        fill(out, [make("p", "note bad", error.message)]);
      }
      look.disabled = false;
    },
  });
  const put = make("button", "", t("add_device"), {
    type: "button",
    onclick: () => {
      if (!where.value.trim()) return say(note, t("device_where"));
      add(
        `[[source]]\naddress = ${JSON.stringify(address())}\n${name.value.trim() ? `name = ${JSON.stringify(name.value.trim())}\n` : ""}`,
      );
    },
  });
  const all = [kind, where, name, look, put];
  return {
    box: make("div", "", [make("div", "buttons", [kind, where, name, look, put]), out]),
    may(may) {
      all.forEach((it) => {
        it.disabled = !may;
      });
    },
  };
}

function describe(report) {
  const missing = report.readings.filter((it) => it.missing).length;
  const head = row(
    t(report.reachable ? "answers" : "does_not_answer"),
    quantity(report.timing.open_ms, "ms"),
    t("values_missing", report.readings.length, missing),
    { dot: report.reachable ? "good" : "bad" },
  );
  return [head, ...report.problems.map((it) => row(box(it.what), "", box(it.next), { dot: "bad", tone: "bad" }))];
}
