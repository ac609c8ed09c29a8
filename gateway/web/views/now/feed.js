// Now: the override of the feed, who asks for it, and arming.
import { make, say, send } from "/web/parts.js";
import { clock, quantity as shown } from "/web/format.js";
import { box, t } from "/web/words.js";
import { show } from "/web/now-values.js";

export function feedCard(context) {
  const force = make("span", "value", "–", { "data-quantity": "feed_override_pct" });
  const percent = make("span", "unit", "%");
  const armed = make("p", "armed-words", " ");
  const facts = ["in_force", "dial", "asked", "let_through"];
  const cells = Object.fromEntries(facts.map((key) => [key, make("dd", "", "–")]));
  const names = Object.fromEntries(facts.map((key) => [key, make("dt", "", t(`override_${key}`))]));
  const lines = Object.fromEntries(facts.map((key) => [key, make("div", "", [names[key], cells[key]])]));
  const list = make(
    "dl",
    "facts",
    facts.map((key) => lines[key]),
  );
  const why = make("p", "note why", " ");
  const actions = make("div", "buttons");
  const section = make("section", "card feed ages", [
    make("h2", "", t("short_feed_override_pct")),
    make("div", "feed-body", [make("p", "reading", [force, percent]), list]),
    armed,
    why,
    actions,
  ]);
  const back = make("button", "danger", t("back_to_dial"), {
    type: "button",
    hidden: true,
    onclick: () => disarm(back, context),
  });
  const arm = make("button", "", t("arm"), { type: "button", hidden: true, onclick: () => armDialog(context) });
  actions.append(arm, back);
  const pct = (value) => (value === null || value === undefined ? t("nothing") : shown(value, "%"));
  const update = (status) => {
    const gate = status.gate;
    const found = context.quantity("feed_override_pct");
    show(force, found, context);
    say(percent, found && !found.missing ? "%" : "");
    const dial = context.quantity("feed_override_dial_pct");
    say(cells.dial, dial && !dial.missing ? pct(dial.value) : "–");
    say(cells.asked, pct(gate.wanted_pct));
    say(cells.let_through, gate.wanted_pct === null ? "–" : pct(gate.permitted_pct));
    say(cells.in_force, found && !found.missing ? pct(found.value) : "–");
    // Where nothing is written, what rules and gate would do is no order: it is named so, and only shown where it
    // differs.
    const writes = gate.mode === "armed";
    say(names.asked, t(writes ? "override_asked" : "override_would_ask"));
    say(names.let_through, t(writes ? "override_let_through" : "override_would_pass"));
    for (const key of ["asked", "let_through"]) {
      lines[key].classList.toggle("would", !writes);
      lines[key].hidden = !writes && gate.wanted_pct === null;
    }
    const words = writes
      ? t("gate_armed", gate.armed_by, gate.armed_until_ms ? clock(gate.armed_until_ms) : "–")
      : t(gate.mode === "off" ? "gate_off" : "gate_shadow");
    say(armed, words);
    armed.classList.toggle("warn-text", writes);
    const reason = gate.reason ? `${t("because")}: ${box(gate.reason)}${gate.held ? ` · ${box(gate.held)}` : ""}` : "";
    say(
      why,
      writes
        ? reason || " "
        : [gate.reason ? t("override_nothing_written") : "", reason].filter(Boolean).join(" ") || " ",
    );
    back.hidden = !writes;
    arm.hidden = writes || !(context.session?.arming_allowed && context.session?.may?.arm);
  };
  const session = () => carryOutDisarm(back, context);
  if (context.session) session();
  return { box: section, update, session };
}

/** The address that carries the press on: whoever has to sign in first finds it done afterwards. */
const DISARM = "disarm";

export async function disarm(button, context) {
  button.disabled = true;
  try {
    await send("/api/v1/disarm");
  } catch (error) {
    if (error.status === 401) {
      location.href = `/sign-in?next=${encodeURIComponent(`/now?${DISARM}`)}`;
      return;
    }
    button.after(make("span", "note bad", error.message));
  }
  button.disabled = false;
}

/** What was pressed before signing in is carried out after it, once. */
export function carryOutDisarm(button, context) {
  if (!new URLSearchParams(location.search).has(DISARM) || !context.session?.person) return;
  context.go("/now", { replace: true });
  disarm(button, context);
}

/** Arming always asks for the token again. */
export function armDialog(context) {
  if (!context.session?.person) {
    location.href = `/sign-in?next=${encodeURIComponent(location.pathname)}`;
    return;
  }
  const token = make("input", "", null, { type: "password", autocomplete: "off", required: true, name: "token" });
  const minutes = make(
    "select",
    "",
    [5, 15, 30, 60].map((m) => make("option", "", `${m} ${t("min")}`, { value: m * 60, selected: m === 30 })),
    { name: "for_s" },
  );
  const said = make("p", "note bad", "", { role: "alert" });
  const dialog = make("dialog", "");
  const form = make("form", "", [
    make("h2", "", t("arm_title")),
    make("p", "note", t("arm_words")),
    make("label", "", [t("token"), token]),
    make("label", "", [t("arm_for"), minutes]),
    said,
    make("div", "buttons", [
      make("button", "primary", t("arm"), { type: "submit" }),
      make("button", "", t("cancel"), { type: "button", onclick: () => dialog.close() }),
    ]),
  ]);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      await send("/api/v1/arm", { token: token.value, for_s: Number(minutes.value) });
      dialog.close();
    } catch (error) {
      say(said, error.message);
      token.value = "";
      token.focus();
    }
  });
  dialog.append(form);
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
