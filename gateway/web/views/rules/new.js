// A new rule: its name is asked for, and it begins with an example.
import { make, say } from "/web/parts.js";
import { t } from "/web/words.js";

/** What a new rule begins with: one handler and one trial that passes. */
const NEW_RULE = [
  "// What this rule is for. 该规则的用途。",
  "fn on_part_finished(count) {",
  "    if count > 100.0 {",
  '        raise_alarm("many_parts", "info", `Part ${count} is finished`, `工件 ${count} 已完成`);',
  "    }",
  "}",
  "",
].join("\n");

/** A new rule begins as a text of its own; nothing is on the box before it is saved as a draft or activated. */
export function createRule(view) {
  if (!view.may()) {
    location.href = `/sign-in?next=${encodeURIComponent(location.pathname + location.search)}`;
    return;
  }
  const name = make("input", "", null, {
    type: "text",
    pattern: "[a-z0-9_]+",
    required: true,
    maxlength: "40",
    placeholder: "my_rule",
    "aria-label": t("new_rule_name"),
  });
  const answers = make("div", "buttons", [
    make("button", "primary", t("new_rule"), { value: "yes" }),
    make("button", "", t("cancel"), { value: "no", formnovalidate: true }),
  ]);
  const form = make(
    "form",
    "",
    [
      make("h2", "", t("new_rule")),
      make("p", "", t("new_rule_words")),
      make("label", "field", [t("new_rule_name"), name]),
      answers,
    ],
    { method: "dialog" },
  );
  const dialog = make("dialog", "", form);
  dialog.addEventListener("close", () => {
    dialog.remove();
    if (dialog.returnValue !== "yes") return;
    const file = `${name.value}.rhai`;
    if (view.file(file)) {
      view.open(file);
      say(view.note, t("rule_exists", file));
      return;
    }
    view.files.push({ file, digest: "", text: "", draft: null, versions: [] });
    view.texts.set(file, NEW_RULE);
    view.open(file);
  });
  document.body.append(dialog);
  dialog.showModal();
}
