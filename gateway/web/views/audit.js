// Audit: what was asked for, let through, refused and written, who armed; a ramp of the override is one line.
import { ask, card, fill, make, say, table } from "/web/parts.js";
import { clock, dateTime, quantity, when } from "/web/format.js";
import { box, has, t } from "/web/words.js";
import { armDialog, disarm } from "/web/now-feed.js";

const KINDS = [
  "",
  "all",
  "write",
  "request",
  "armed",
  "disarmed",
  "change",
  "login",
  "persons",
  "request_refused",
  "stop",
  "feed_hold",
  "acknowledged",
  "reaction",
  "started",
];
const PAGE = 1000;
/** Lines that are shown at first: what stands below the list must be found. */
const LINES = 25;
/** Rows of the same kind, script and outcome that follow each other within this time are one line. */
const RAMP_S = 10;

export function mount(root, context) {
  const state = { kind: "", text: "", rows: [], timer: null, open: new Set(), most: LINES };
  const gate = gateCard(context);
  const list = make("div", "");
  const note = make("p", "note", " ", { role: "status" });
  const select = make(
    "select",
    "",
    KINDS.map((kind) =>
      make("option", "", kind === "all" ? t("every_kind") : kind ? t(`kind_${kind}`) : t("what_matters"), {
        value: kind,
      }),
    ),
    { "aria-label": t("kind") },
  );
  select.addEventListener("change", () => {
    state.kind = select.value;
    draw();
  });
  const search = make("input", "", null, { type: "search", placeholder: t("search"), "aria-label": t("search") });
  search.addEventListener("input", () => {
    state.text = search.value.toLowerCase();
    draw();
  });
  const verify = make("button", "", t("verify"), {
    type: "button",
    onclick: async () => {
      verify.disabled = true;
      say(note, await verified());
      verify.disabled = false;
    },
  });
  const draw = () => drawRows(list, state, context);
  const read = async () => {
    try {
      const found = await ask(`/api/v1/audit?limit=${PAGE}`);
      const key = found.rows.at(-1)?.number ?? 0;
      if (key === state.last && state.drawn) return;
      [state.rows, state.last, state.drawn] = [found.rows, key, true];
      draw();
    } catch (error) {
      fill(list, [make("p", "note bad", error.message)]);
    }
  };
  root.append(
    gate.box,
    card("", [
      make("div", "head", [make("h2", "", t("audit_title")), select, search, verify]),
      make("p", "note", t("audit_words")),
      note,
      list,
    ]),
  );
  read();
  state.timer = setInterval(read, 3000);
  return {
    update(status) {
      gate.update(status);
    },
    session: () => gate.update(context.status()),
    leave: () => clearInterval(state.timer),
  };
}

async function verified() {
  try {
    const found = await ask("/api/v1/audit/verify");
    return found.broken
      ? t("audit_broken", found.broken.number, found.broken.what)
      : t("audit_whole", found.rows, found.last, found.head.slice(0, 16));
  } catch (error) {
    return error.message;
  }
}

/** Rows that belong together: an override that is followed step by step is one line from its first to its last value.
 */
export function grouped(rows) {
  const groups = [];
  for (const entry of rows) {
    const last = groups.at(-1);
    const same =
      last &&
      last.kind === entry.kind &&
      last.outcome === entry.outcome &&
      last.script === entry.script &&
      last.person === entry.person &&
      last.unit === entry.unit &&
      ["request", "write", "reaction"].includes(entry.kind) &&
      (entry.at_ns - last.rows.at(-1).at_ns) / 1e9 <= RAMP_S;
    if (same) last.rows.push(entry);
    else groups.push({ ...entry, rows: [entry] });
  }
  return groups;
}

/** A word of the box; one that the page does not know stands as it is. */
const word = (what, key) => (has(`${what}_${key}`) ? t(`${what}_${key}`) : key.replaceAll("_", " "));

function drawRows(list, state, context) {
  // That nothing is asked for between two cuts is only of interest to whoever asks for everything.
  const quiet = (e) => !state.kind && e.kind === "request" && e.asked === null;
  const groups = grouped(state.rows.filter((e) => !quiet(e)))
    .filter(
      (g) =>
        (["", "all"].includes(state.kind) || g.kind === state.kind) &&
        (!state.text || JSON.stringify(g).toLowerCase().includes(state.text)),
    )
    .reverse();
  if (!groups.length) return fill(list, [make("p", "empty", state.rows.length ? t("no_match") : t("no_audit"))]);
  const now = context.status()?.at_ms ?? 0;
  const value = (v, unit) => (v === null ? "–" : quantity(v, unit));
  const rows = groups.slice(0, state.most).flatMap((g) => {
    const [first, last] = [g.rows[0], g.rows.at(-1)];
    const ramp = g.rows.length > 1;
    const figures = g.unit
      ? ramp
        ? `${value(first.asked, g.unit)} … ${value(last.asked, g.unit)} → ${value(last.after, g.unit)}`
        : g.asked === null && g.after === null
          ? ""
          : `${value(g.asked, g.unit)} → ${value(g.after, g.unit)}`
      : "";
    const time = ramp ? `${when(first.at_ns / 1e6, now)} – ${clock(last.at_ns / 1e6)}` : when(first.at_ns / 1e6, now);
    const words = ramp ? `${t("steps", g.rows.length)} · ${box(last.reason)}` : box(g.reason);
    const tone = ["failed", "refused"].includes(g.outcome) ? "bad" : g.kind === "armed" ? "warn" : "";
    const line = [
      time,
      { text: make("span", tone ? `${tone}-text` : "", `${word("kind", g.kind)} · ${word("outcome", g.outcome)}`) },
      figures,
      words,
      [g.script, box(g.person)].filter(Boolean).join(" · ") || "–",
    ];
    if (!ramp) return [line];
    const opened = state.open.has(first.number);
    line[0] = {
      text: make("button", "link-button", `${opened ? "▾" : "▸"} ${time}`, {
        type: "button",
        "aria-expanded": String(opened),
        onclick: () => {
          if (!state.open.delete(first.number)) state.open.add(first.number);
          drawRows(list, state, context);
        },
      }),
    };
    return opened
      ? [
          line,
          ...g.rows
            .slice()
            .reverse()
            .slice(0, 50)
            .map((e) => [
              `   ${clock(e.at_ns / 1e6)}`,
              "",
              `${value(e.asked, e.unit)} → ${value(e.after, e.unit)}`,
              box(e.reason),
              "",
            ]),
        ]
      : [line];
  });
  fill(list, [
    table([t("time"), t("what"), t("asked_let"), t("why"), t("who")], rows, { caption: t("audit_title") }),
    groups.length > state.most
      ? make("button", "", t("show_more", groups.length - state.most), {
          type: "button",
          onclick: () => {
            state.most += 300;
            drawRows(list, state, context);
          },
        })
      : null,
  ]);
}

function gateCard(context) {
  const words = make("p", "armed-words", " ");
  const note = make("p", "note", " ");
  const arm = make("button", "", t("arm"), { type: "button", hidden: true, onclick: () => armDialog(context) });
  const back = make("button", "danger", t("back_to_dial"), {
    type: "button",
    hidden: true,
    onclick: () => disarm(back, context),
  });
  // Whether the configuration lets the box be armed at all; null until it is known.
  let armable = null;
  ask("/api/v1/configuration")
    .then((found) => {
      armable = found.armed;
      update(context.status());
    })
    .catch(() => {});
  const box_ = make("section", "card ages", [
    make("div", "head", [make("h2", "", t("gate_title")), make("div", "buttons grow", [arm, back])]),
    words,
    note,
  ]);
  const update = (status) => {
    if (!status) return;
    const gate = status.gate;
    say(
      words,
      gate.mode === "armed"
        ? t("gate_armed", gate.armed_by, gate.armed_until_ms ? clock(gate.armed_until_ms) : "–")
        : t(gate.mode === "off" ? "gate_off" : "gate_shadow"),
    );
    words.classList.toggle("warn-text", gate.mode === "armed");
    const here = context.session?.arming_allowed;
    const how = armable ? t(here ? "arm_here" : "arm_at_box") : armable === false ? t("arm_not_configured") : " ";
    if (gate.mode !== "armed") say(note, how);
    back.hidden = gate.mode !== "armed";
    arm.hidden = gate.mode === "armed" || armable === false || !(here && context.session?.may?.arm);
  };
  return { box: box_, update };
}

export const auditTime = dateTime;
