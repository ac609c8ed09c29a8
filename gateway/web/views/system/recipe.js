// The recipe: how each stretch of a program cuts.
import { ask, card, fill, make, say, send } from "/web/parts.js";
import { t } from "/web/words.js";

const RECIPE = [
  ["program", "text"],
  ["blocks", "text"],
  ["name", "text"],
  ["depth_of_cut_mm", "number"],
  ["width_of_cut_mm", "number"],
  ["diameter_mm", "number"],
  ["teeth", "number"],
  ["tool", "text"],
  ["work_material", "text"],
];

/** The recipe as a table. What is stored is the file; comments in it are lost by an edit here, and it says so. */
export function recipeCard(context) {
  const body = make("div", "scroll", null, { tabindex: "0", role: "region", "aria-label": t("recipe") });
  const note = make("p", "note", " ", { role: "status" });
  const state = { rows: [], digest: "", there: false };
  const save = make("button", "primary", t("save_recipe"), { type: "button", onclick: () => store() });
  const add = make("button", "", t("add_row"), {
    type: "button",
    onclick: () => {
      state.rows.push({});
      draw();
    },
  });
  const words = make("p", "note", t("recipe_words"));
  const draw = () => {
    const editable = Boolean(context.session?.may?.edit);
    const cell = (line, [key, kind]) => {
      const value = key === "blocks" ? (line.blocks?.join?.("–") ?? line.blocks ?? "") : (line[key] ?? "");
      const input = make("input", "cell", null, {
        type: "text",
        inputmode: kind === "number" ? "decimal" : null,
        value: String(value),
        "aria-label": t(`recipe_${key}`),
        readonly: !editable,
      });
      input.addEventListener("input", () => {
        line[key] = input.value;
      });
      return make("td", "", input, { "data-label": t(`recipe_${key}`) });
    };
    const lines = state.rows.map((line, at) =>
      make("tr", "", [
        ...RECIPE.map((column) => cell(line, column)),
        make(
          "td",
          "",
          make("button", "", "×", {
            type: "button",
            "aria-label": t("remove_row", at + 1),
            disabled: !editable,
            onclick: () => {
              state.rows.splice(at, 1);
              draw();
            },
          }),
        ),
      ]),
    );
    fill(body, [
      make("table", "recipe", [
        make(
          "thead",
          "",
          make("tr", "", [
            ...RECIPE.map(([key]) => make("th", "", t(`recipe_${key}`), { scope: "col" })),
            make("td", ""),
          ]),
        ),
        make("tbody", "", lines),
      ]),
    ]);
    save.disabled = add.disabled = !editable;
  };
  const load = async () => {
    try {
      const found = await ask("/api/v1/operations");
      Object.assign(state, { rows: found.rows, digest: found.digest });
      say(note, found.problems.length ? `${t("recipe_refused")} ${found.problems.join(" ")}` : found.path);
      draw();
    } catch (error) {
      say(note, error.message);
    }
  };
  const store = async () => {
    try {
      const done = await send("/api/v1/operations", { text: written(state.rows), digest: state.digest }, "PUT");
      await load();
      say(note, `${t("recipe_saved")} ${done.text}`);
    } catch (error) {
      say(note, error.message);
    }
  };
  const box_ = card(t("recipe"), [words, body, make("div", "buttons", [add, save]), note]);
  box_.hidden = true;
  return {
    box: box_,
    give(known) {
      if (known.operations) {
        box_.hidden = false;
        load();
      }
    },
    may: draw,
  };
}

/** The table as the file that the box reads. */
export function written(rows) {
  const text = (value) => JSON.stringify(String(value));
  const numeric = (value) =>
    /^\s*-?\d+([.,]\d+)?\s*$/.test(value) ? String(value).trim().replace(",", ".") : text(value);
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
