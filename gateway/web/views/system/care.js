// Backup, restore, and the archive for support.
import { ask, card, make, say } from "/web/parts.js";
import { t } from "/web/words.js";

/** Backup, its way back with a warning, and the archive for whoever helps. */
export function careCard(context) {
  const note = make("p", "note", " ", { role: "status" });
  const save = (path, needs) => {
    const button = make("button", "", t(path), {
      type: "button",
      "data-needs": needs,
      onclick: async () => {
        try {
          const answer = await fetch(`/api/v1/${path}`);
          if (!answer.ok) throw new Error((await answer.json()).title);
          const name =
            /filename="([^"]+)"/.exec(answer.headers.get("content-disposition") ?? "")?.[1] ?? `${path}.tar.gz`;
          const link = make("a", "", "", { href: URL.createObjectURL(await answer.blob()), download: name });
          link.click();
          setTimeout(() => URL.revokeObjectURL(link.href), 10000);
          say(note, t("saved_as", name));
        } catch (error) {
          say(note, error.message);
        }
      },
    });
    return button;
  };
  const chosen = make("input", "", null, {
    type: "file",
    accept: ".gz,.tgz,application/gzip",
    "aria-label": t("backup_file"),
    "data-needs": "manage",
  });
  const restore = make("button", "", t("restore"), {
    type: "button",
    "data-needs": "manage",
    onclick: () => {
      if (chosen.files.length) warned(chosen.files[0], note);
      else say(note, t("choose_backup"));
    },
  });
  const all = [save("backup", "manage"), save("support", "edit"), chosen, restore];
  const may = () =>
    all.forEach((it) => {
      it.disabled = !context.session?.may?.[it.dataset.needs];
    });
  may();
  return {
    box: card(t("care"), [
      make("p", "note", t("backup_words")),
      make("div", "buttons", [all[0], all[1]]),
      make("p", "note", t("restore_words")),
      make("div", "buttons", [chosen, restore]),
      note,
    ]),
    may,
  };
}

/** Sends the archive; one of another box is sent again when the person says that it is meant. */
async function restored(file, note, fromAnotherBox) {
  try {
    const answer = await ask(`/api/v1/restore${fromAnotherBox ? "?from_another_box=true" : ""}`, {
      method: "POST",
      headers: { "content-type": "application/octet-stream" },
      body: file,
    });
    say(note, answer.text);
  } catch (error) {
    const isOfAnother = error.status === 409 && !fromAnotherBox;
    if (isOfAnother && confirm(t("restore_other", error.document.title))) await restored(file, note, true);
    else say(note, error.message);
  }
}

function warned(file, note) {
  const dialog = make(
    "dialog",
    "",
    make(
      "form",
      "",
      [
        make("h2", "bad-text", t("restore_title")),
        make("p", "", t("restore_warning", file.name)),
        make("div", "buttons", [
          make("button", "danger", t("restore"), { value: "yes" }),
          make("button", "", t("cancel"), { value: "no" }),
        ]),
      ],
      { method: "dialog" },
    ),
  );
  dialog.addEventListener("close", async () => {
    dialog.remove();
    if (dialog.returnValue === "yes") await restored(file, note, false);
  });
  document.body.append(dialog);
  dialog.showModal();
}
