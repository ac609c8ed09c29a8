// A file on its way to the box: how far it is, and how it is held back.
import { bring, fill, make, say } from "/web/parts.js";
import { t } from "/web/words.js";

/** Refuses a file that the box would refuse, before a byte of it is sent; `known` is what the box has told of files. */
export function checkSize(file, known) {
  const inMegabytes = (bytes) => Math.floor(bytes / 1048576);
  if (known && file.size > known.bytes_max) throw new Error(t("file_too_long", inMegabytes(known.bytes_max)));
  if (known && file.size > (known.bytes_free ?? Infinity))
    throw new Error(t("no_room_for_file", inMegabytes(known.bytes_free)));
}

/** Where a file is dropped; `take` gets it. */
export function makeDropZone(parts, take) {
  const zone = make("div", "drop-zone", parts, { tabindex: "0" });
  for (const name of ["dragenter", "dragover"])
    zone.addEventListener(name, (event) => {
      event.preventDefault();
      zone.dataset.over = "yes";
    });
  zone.addEventListener("dragleave", () => delete zone.dataset.over);
  zone.addEventListener("drop", (event) => {
    event.preventDefault();
    delete zone.dataset.over;
    take(event.dataTransfer.files[0]);
  });
  return zone;
}

export class Sending {
  /** `note`: where the page says what happens. */
  constructor(note) {
    this.note = note;
    this.bar = make("progress", "progress", null, { max: "1", value: "0", "aria-label": t("sending_bar") });
    this.words = make("span", "note", "");
    this.cancel = make("button", "", t("end_sending"), { type: "button", onclick: () => this.end() });
    this.box = make("div", "buttons sending", null, { hidden: true });
  }

  /** The bytes go to the box; how far they are is told, and they can be held back. */
  async bringFile(file) {
    this.end();
    const order = new AbortController();
    this.order = order;
    this.showParts([this.bar, this.words, this.cancel]);
    const told = (share) => {
      this.bar.value = share;
      say(this.words, t("sending", file.name, Math.floor(100 * share)));
      if (share >= 1) say(this.note, t("reading_file", file.name));
    };
    told(0);
    say(this.note, " ");
    try {
      const words = { broken: t("sending_broken"), ended: t("sending_ended") };
      const path = `/api/v1/files?name=${encodeURIComponent(file.name)}`;
      return await bring(path, file, { told, signal: order.signal, ...words });
    } finally {
      if (this.order === order) this.showParts([]);
    }
  }

  end() {
    this.order?.abort();
  }

  /** Nothing of it stands on the page while no file is sent. */
  showParts(parts) {
    fill(this.box, parts);
    this.box.hidden = !parts.length;
  }
}
