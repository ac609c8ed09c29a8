// The form of "Set up": a device by what is known of it, and name and language of the box.
import { fill, make, row, say, send } from "/web/parts.js";
import { quantity } from "/web/format.js";
import { box, t } from "/web/words.js";

/** What a person knows of a device, and the address that comes of it. */
const DEVICES = [
  ["fanuc", (host) => `fanuc://${host}`, "192.168.1.10:8193"],
  ["nclink", (host) => `nclink://${host}`, "192.168.1.5:1883/SERIAL"],
  ["mtconnect", (host) => `mtconnect://${host}`, "192.168.1.30:5000/DEVICE"],
  ["modbus_tcp", (host) => `modbus-tcp://${host}`, "192.168.1.20:502?profile=sdm630&unit=1"],
  ["modbus_rtu", (host) => `modbus-rtu://${host}`, "/dev/ttyUSB0?profile=sdm630&unit=1&baud=9600"],
  ["simulated", (host) => `simulated://${host}`, "lathe"],
  ["other", (host) => host, "scheme://..."],
];

/** A device by what is known of it: tried first, then a section of the configuration. */
export function deviceForm(add, note) {
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
  const name = make("input", "", null, {
    type: "text",
    placeholder: t("device_name"),
    "aria-label": t("device_name"),
    size: "32",
  });
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
  return {
    box: make("div", "", [make("div", "buttons", [kind, where, name, look, put]), out]),
    /** A device can be tried without a file; adding it needs one. */
    may(tries, adds) {
      for (const it of [kind, where, look]) it.disabled = !tries;
      for (const it of [name, put]) it.disabled = !adds;
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

/** A text key of the section [gateway], as it stands in the file; empty where it does not. */
function gatewayKey(text, key) {
  const section = /^\[gateway\][^\n]*\n((?:(?!\[)[^\n]*\n?)*)/m.exec(text)?.[1] ?? "";
  return new RegExp(`^${key}\\s*=\\s*"([^"]*)"`, "m").exec(section)?.[1] ?? "";
}

/** The text with this key of [gateway] set, or taken out where nothing is wanted. */
function withGatewayKey(text, key, value) {
  const line = value ? `${key} = ${JSON.stringify(value)}\n` : "";
  const found = /^\[gateway\][^\n]*\n((?:(?!\[)[^\n]*\n?)*)/m.exec(text);
  if (!found) return `[gateway]\n${line}\n${text}`;
  const without = found[1].replace(new RegExp(`^${key}\\s*=[^\\n]*\\n?`, "m"), "");
  const head = found[0].slice(0, found[0].length - found[1].length);
  return text.slice(0, found.index) + head + line + without + text.slice(found.index + found[0].length);
}

/** Name and language: what stands in the file is shown, what is taken over is written into it. */
export function boxForm(text, change) {
  const name = make("input", "", null, { type: "text", name: "name" });
  const languages = [
    ["", t("as_delivered")],
    ["en", "English"],
    ["zh", "中文"],
  ];
  const language = make(
    "select",
    "",
    languages.map(([value, words]) => make("option", "", words, { value })),
    { name: "language" },
  );
  const take = make("button", "", t("take_over"), {
    type: "button",
    onclick: () =>
      change(withGatewayKey(withGatewayKey(text(), "language", language.value), "name", name.value.trim())),
  });
  const all = [name, language, take];
  return {
    box: make("div", "buttons", [
      make("label", "", [t("set_up_name"), name]),
      make("label", "", [t("set_up_language"), language]),
      take,
    ]),
    show() {
      name.value = gatewayKey(text(), "name");
      language.value = gatewayKey(text(), "language");
    },
    may(may) {
      all.forEach((it) => {
        it.disabled = !may;
      });
    },
  };
}
