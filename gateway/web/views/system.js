// The lower half of Audit: sources with their doctor, receivers, the configuration in force, the recipe as a table, backup and help
// from afar.
import { ask, card, fill, make, row, say, send, table } from "/web/parts.js";
import { duration, quantity } from "/web/format.js";
import { box, own, t } from "/web/words.js";
import { sourceName } from "/web/now.js";
import { configurationFileCard } from "/web/configuration.js";

const RECIPE = [["program", "text"], ["blocks", "text"], ["name", "text"], ["depth_of_cut_mm", "number"], ["width_of_cut_mm", "number"], ["diameter_mm", "number"], ["teeth", "number"], ["tool", "text"], ["work_material", "text"]];

export function systemView(context) {
  const sinks = sinksCard();
  const doctor = doctorCard(context);
  const recipe = recipeCard(context);
  const configuration = configurationCard();
  const care = careCard(context);
  const setUp = configurationFileCard(context);
  const known = ask("/api/v1/configuration").then((it) => { configuration.give(it); doctor.give(it); recipe.give(it); }).catch((error) => configuration.fail(error));
  return {
    parts: [make("div", "columns", [doctor.box, sinks.box, care.box]), recipe.box, setUp.box, configuration.box],
    update(status) { sinks.update(status); },
    session() { known.then(() => { doctor.may(); recipe.may(); care.may(); setUp.may(); }); },
  };
}

/** Receivers in words: connected or not, how far behind, what went wrong. */
function sinksCard() {
  const list = make("div", "");
  const update = (status) => {
    const all = status.sinks ?? [];
    if (!all.length) return fill(list, [make("p", "empty", t("no_sinks"))]);
    fill(list, all.map((s) => {
      const behind = s.behind_items === 0 ? t("nothing_waits") : t("behind_by", s.behind_items.toLocaleString(), s.behind_s === null ? "–" : duration(s.behind_s));
      const more = [behind, t("delivered", s.delivered.toLocaleString())];
      if (s.dropped) more.push(t("dropped", s.dropped.toLocaleString()));
      if (s.outage_fits_h !== null) more.push(t("outage_fits", duration(s.outage_fits_h * 3600)));
      if (s.error) more.push(`${t("error_now")} ${box(s.error)}`);
      if (s.refusal) more.push(`${t("left_out")} ${box(s.refusal)}`);
      return row(s.name, t(`sink_${s.state}`), more.join(" · "), { dot: s.failing ? "bad" : s.state === "connected" ? "good" : "warn", tone: s.failing ? "bad" : "" });
    }));
  };
  return { box: card(t("sinks"), list, "ages"), update };
}

/** Doctor: a second connection, who answers, what is wrong and what to do. */
function doctorCard(context) {
  const list = make("div", "");
  const out = make("div", "", null, { role: "status" });
  const buttons = [];
  const look = async (button, source) => {
    buttons.forEach((it) => { it.disabled = true; });
    fill(out, [make("p", "note", t("looking_at", sourceName(source)))]);
    try { fill(out, told(await send("/api/v1/doctor", { source }), context)); } catch (error) { fill(out, [make("p", "note bad", error.message)]); }
    may();
  };
  const may = () => buttons.forEach((it) => { it.disabled = !context.session?.may?.edit; });
  const give = (known) => {
    fill(list, known.sources.map((source) => {
      const button = make("button", "", t("look_at_source"), { type: "button", onclick: () => look(button, source) });
      buttons.push(button);
      return make("div", "head", [make("span", "", sourceName(source)), make("span", "grow", button)]);
    }));
    may();
  };
  return { box: card(t("doctor"), [make("p", "note", t("doctor_words")), list, out]), give, may };
}

function told(report, context) {
  const missing = report.readings.filter((r) => r.missing).length;
  const head = row(t(report.reachable ? "answers" : "does_not_answer"), t("opened_in", quantity(report.timing.open_ms, "ms")), [Object.entries(report.identity).slice(0, 4).map(([k, v]) => `${k}: ${v}`).join(" · "), t("values_missing", report.readings.length, missing)].filter(Boolean).join(" · "), { dot: report.reachable ? "good" : "bad" });
  const wrong = report.problems.map((p) => row(box(p.what), "", box(p.next), { dot: "bad", tone: "bad" }));
  const values = report.readings.map((r) => [context.name(r.channel), r.missing ? context.reason(r.missing) : typeof r.value === "number" ? quantity(r.value, r.unit) : r.value]);
  return [head, ...wrong, make("details", "choose", [make("summary", "", t("all_values")), table([t("what"), t("value")], values, { caption: t("all_values") })])];
}

function configurationCard() {
  const body = make("div", "");
  const file = make("p", "note", " ");
  const search = make("input", "", null, { type: "search", placeholder: t("search"), "aria-label": t("search") });
  const only = make("input", "", null, { type: "checkbox", checked: true });
  let keys = [];
  const draw = () => {
    const text = search.value.toLowerCase();
    const rows = keys.filter((k) => (!only.checked || k.from !== "default") && (!text || JSON.stringify(k).toLowerCase().includes(text)));
    fill(body, rows.length ? [table([t("key"), t("value"), t("from_where"), t("what")], rows.map((k) => [k.key, { text: make("code", "", k.value ?? "–") }, t(`from_${k.from}`), own(k)]), { caption: t("configuration") })] : [make("p", "empty", t("no_match"))]);
  };
  search.addEventListener("input", draw);
  only.addEventListener("change", draw);
  return {
    box: card("", [make("div", "head", [make("h2", "", t("configuration")), search, make("label", "step", [only, t("only_written")])]), file, body]),
    give(known) { keys = known.keys; say(file, known.file ? t("configuration_of", known.file) : t("configuration_built_in")); draw(); },
    fail(error) { say(file, error.message); },
  };
}

/** Backup, its way back with a warning, and the archive for whoever helps. */
function careCard(context) {
  const note = make("p", "note", " ", { role: "status" });
  const save = (path, needs) => {
    const button = make("button", "", t(path), { type: "button", "data-needs": needs, onclick: async () => {
      try {
        const answer = await fetch(`/api/v1/${path}`);
        if (!answer.ok) throw new Error((await answer.json()).title);
        const name = /filename="([^"]+)"/.exec(answer.headers.get("content-disposition") ?? "")?.[1] ?? `${path}.tar.gz`;
        const link = make("a", "", "", { href: URL.createObjectURL(await answer.blob()), download: name });
        link.click();
        setTimeout(() => URL.revokeObjectURL(link.href), 10000);
        say(note, t("saved_as", name));
      } catch (error) { say(note, error.message); }
    } });
    return button;
  };
  const chosen = make("input", "", null, { type: "file", accept: ".gz,.tgz,application/gzip", "aria-label": t("backup_file"), "data-needs": "manage" });
  const restore = make("button", "", t("restore"), { type: "button", "data-needs": "manage", onclick: () => { if (chosen.files.length) warned(chosen.files[0], note); else say(note, t("choose_backup")); } });
  const all = [save("backup", "manage"), save("support", "edit"), chosen, restore];
  const may = () => all.forEach((it) => { it.disabled = !context.session?.may?.[it.dataset.needs]; });
  may();
  return { box: card(t("care"), [make("p", "note", t("backup_words")), make("div", "buttons", [all[0], all[1]]), make("p", "note", t("restore_words")), make("div", "buttons", [chosen, restore]), note]), may };
}

function warned(file, note) {
  const dialog = make("dialog", "", make("form", "", [make("h2", "bad-text", t("restore_title")), make("p", "", t("restore_warning", file.name)), make("div", "buttons", [make("button", "danger", t("restore"), { value: "yes" }), make("button", "", t("cancel"), { value: "no" })])], { method: "dialog" }));
  dialog.addEventListener("close", async () => {
    dialog.remove();
    if (dialog.returnValue !== "yes") return;
    try { say(note, (await ask("/api/v1/restore", { method: "POST", headers: { "content-type": "application/octet-stream" }, body: file })).text); } catch (error) { say(note, error.message); }
  });
  document.body.append(dialog);
  dialog.showModal();
}

/** The recipe as a table. What is stored is the file; comments in it are lost by an edit here, and it says so. */
function recipeCard(context) {
  const body = make("div", "scroll", null, { tabindex: "0", role: "region", "aria-label": t("recipe") });
  const note = make("p", "note", " ", { role: "status" });
  const state = { rows: [], digest: "", there: false };
  const save = make("button", "primary", t("save_recipe"), { type: "button", onclick: () => store() });
  const add = make("button", "", t("add_row"), { type: "button", onclick: () => { state.rows.push({}); draw(); } });
  const words = make("p", "note", t("recipe_words"));
  const draw = () => {
    const editable = Boolean(context.session?.may?.edit);
    const cell = (line, [key, kind]) => {
      const value = key === "blocks" ? line.blocks?.join?.("–") ?? line.blocks ?? "" : line[key] ?? "";
      const input = make("input", "cell", null, { type: "text", inputmode: kind === "number" ? "decimal" : null, value: String(value), "aria-label": t(`recipe_${key}`), readonly: !editable });
      input.addEventListener("input", () => { line[key] = input.value; });
      return make("td", "", input);
    };
    const lines = state.rows.map((line, at) => make("tr", "", [...RECIPE.map((column) => cell(line, column)), make("td", "", make("button", "", "×", { type: "button", "aria-label": t("remove_row", at + 1), disabled: !editable, onclick: () => { state.rows.splice(at, 1); draw(); } }))]));
    fill(body, [make("table", "recipe", [make("thead", "", make("tr", "", [...RECIPE.map(([key]) => make("th", "", t(`recipe_${key}`), { scope: "col" })), make("td", "")])), make("tbody", "", lines)])]);
    save.disabled = add.disabled = !editable;
  };
  const load = async () => {
    try {
      const found = await ask("/api/v1/operations");
      Object.assign(state, { rows: found.rows, digest: found.digest });
      say(note, found.problems.length ? `${t("recipe_refused")} ${found.problems.join(" ")}` : found.path);
      draw();
    } catch (error) { say(note, error.message); }
  };
  const store = async () => {
    try {
      const done = await send("/api/v1/operations", { text: written(state.rows), digest: state.digest }, "PUT");
      await load();
      say(note, `${t("recipe_saved")} ${done.text}`);
    } catch (error) { say(note, error.message); }
  };
  const box_ = card(t("recipe"), [words, body, make("div", "buttons", [add, save]), note]);
  box_.hidden = true;
  return { box: box_, give(known) { if (known.operations) { box_.hidden = false; load(); } }, may: draw };
}

/** The table as the file that the box reads. */
export function written(rows) {
  const text = (value) => JSON.stringify(String(value));
  const numeric = (value) => (/^\s*-?\d+([.,]\d+)?\s*$/.test(value) ? String(value).trim().replace(",", ".") : text(value));
  const lines = ['schema = "operations/1"'];
  for (const it of rows) {
    lines.push("", "[[operation]]");
    for (const [key, kind] of RECIPE) {
      const value = it[key];
      if (value === undefined || value === null || value === "" || value.length === 0) continue;
      if (key === "blocks") {
        const ends = Array.isArray(value) ? value : String(value).split(/\s*[–,-]\s*/);
        lines.push(`blocks = [${ends.map((end) => (/^\d+$/.test(end) ? end : text(end))).join(", ")}]`);
      } else lines.push(`${key} = ${kind === "number" ? numeric(value) : text(value)}`);
    }
  }
  return lines.join("\n") + "\n";
}
