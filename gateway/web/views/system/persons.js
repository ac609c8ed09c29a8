// Who may do more than read: persons with their roles, for an administrator.
import { ask, card, fill, make, row, say, send } from "/web/parts.js";
import { t } from "/web/words.js";

export function personsCard(context) {
  const list = make("div", "");
  const note = make("p", "note", " ", { role: "status" });
  const name = make("input", "", null, { type: "text", "aria-label": t("person_name"), placeholder: t("person_name") });
  const roles = ["viewer", "setter", "armer", "admin"];
  const option = (role) => make("option", "", t(`role_${role}`), { value: role });
  const role = make("select", "", roles.map(option), { "aria-label": t("person_role") });
  const mayManage = () => Boolean(context.session?.may?.manage);

  const act = async (work) => {
    try {
      const done = await work();
      say(note, done?.token ? t("token_of", done.name, done.token) : " ");
      await read();
    } catch (error) {
      say(note, error.message);
    }
  };
  const add = make("button", "", t("add_person"), {
    type: "button",
    onclick: () => act(() => send("/api/v1/persons", { name: name.value.trim(), role: role.value })),
  });
  const path = (it) => `/api/v1/persons/${encodeURIComponent(it.name)}`;
  const line = (it) => {
    const buttons = make("span", "buttons", [
      make("button", "", t("new_token"), {
        type: "button",
        onclick: () => act(() => send(`${path(it)}/token`)),
      }),
      make("button", "", t("remove_person"), {
        type: "button",
        onclick: () => act(() => ask(path(it), { method: "DELETE" })),
      }),
    ]);
    const box = row(it.name, t(`role_${it.role}`));
    box.append(buttons);
    return box;
  };
  async function read() {
    if (!mayManage()) return fill(list, [make("p", "empty", t("persons_for_admin"))]);
    const found = await ask("/api/v1/persons");
    fill(list, [...found.persons.map(line), make("div", "buttons", [name, role, add])]);
  }
  return {
    box: card(t("persons"), [make("p", "note", t("persons_words")), list, note]),
    may: () => read().catch((error) => say(note, error.message)),
  };
}
