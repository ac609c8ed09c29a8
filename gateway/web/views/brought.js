// Files that a person brings: dropped on the view of the twin, shown as understood, mapped by a click, diagnosed,
// compared with earlier ones. Three examples show what comes of it; their truth is told afterwards.
import { ask, card, fill, make, say, send, table } from "/web/parts.js";
import { dateTime, duration, number, quantity } from "/web/format.js";
import { language, own, t } from "/web/words.js";
import { drawDiagnoses, summaryOf, verdictOf } from "/web/diagnosis.js";
import { Sending, checkSize, makeDropZone } from "/web/brought-sending.js";

const STAGES = ["waiting", "reading", "comparing", "writing"];
const AXES = ["", "x", "y", "z"];

export class Brought {
  constructor(context) {
    Object.assign(this, { context, file: null, run: null, known: null });
    this.note = make("p", "note", " ", { role: "status" });
    this.bar = make("progress", "progress", null, { max: "1", hidden: true, "aria-label": t("diagnosing") });
    this.sending = new Sending(this.note);
    this.input = make("input", "", null, {
      type: "file",
      hidden: true,
      onchange: () => this.take(this.input.files[0]),
    });
    this.choose = make("button", "", t("choose_file"), { type: "button", onclick: () => this.input.click() });
    this.zone = makeDropZone([make("p", "", t("drop_file")), this.choose, this.input], (file) => this.take(file));
    this.kept = make("div", "buttons");
    this.examples = make("div", "buttons");
    this.understood = make("div", "brought");
    this.latest = make("div", "");
    this.past = make("div", "");
    const words = make("p", "note", t("brought_words"));
    this.box = card(t("brought_title"), [
      words,
      this.zone,
      this.sending.box,
      this.kept,
      this.understood,
      this.bar,
      this.note,
      this.latest,
      this.past,
      make("h3", "", t("gallery")),
      make("p", "note", t("gallery_words")),
      this.examples,
    ]);
    this.timer = setInterval(() => this.look(), 2000);
    // Until it is known who is signed in, nothing can be brought.
    this.update();
    this.reload();
    this.look();
  }

  may() {
    return Boolean(this.context.session?.may?.edit);
  }

  update() {
    for (const button of this.box.querySelectorAll("[data-changes]"))
      button.disabled = !this.may() || this.run?.state === "running";
    this.choose.disabled = !this.may();
    if (!this.may() && this.context.session && !this.told) {
      this.told = true;
      say(this.note, t("sign_in_to_diagnose"));
    }
  }

  async act(what) {
    try {
      await what();
    } catch (error) {
      say(this.note, error.message);
    }
    this.update();
  }

  async reload() {
    const known = await ask("/api/v1/files").catch(() => null);
    if (!known) return;
    this.known = known;
    const open = (file) =>
      make("button", "", file.name, { type: "button", onclick: () => this.act(() => this.open(file.key)) });
    fill(this.kept, known.files.map(open));
    const begin = (it) =>
      make("button", "", own(it), {
        type: "button",
        "data-changes": "yes",
        onclick: () => this.act(() => this.example(it.name)),
      });
    fill(this.examples, known.examples.map(begin));
    this.drawResults();
    this.update();
  }

  drawResults() {
    const all = this.known.diagnoses;
    const ticks = { has: () => false, add() {}, delete() {}, [Symbol.iterator]: [][Symbol.iterator] };
    // The answer of another file is no answer to the one that is open: it stands among the earlier ones.
    const newest = all[0] && (!this.file || this.file.name === all[0].file) ? all[0] : null;
    if (newest) {
      drawDiagnoses(this.latest, make("div"), [newest], this.context, ticks);
      this.latest.prepend(make("h3", "", newest.file));
      if (newest.truth) this.latest.append(this.truth(newest.truth));
    } else fill(this.latest, []);
    const fit = (d, which) =>
      quantity(
        d.diagnosis?.fit?.[which]?.held_out_rmse ?? d.diagnosis?.fit?.[which]?.rmse ?? null,
        d.diagnosis?.unit ?? "",
      );
    const link = (d) =>
      make("a", "", t("open_report"), { href: `${d.page}?lang=${language()}`, target: "_blank", rel: "noopener" });
    const rows = all.map((d) => [
      d.file,
      dateTime(d.at_ms),
      verdictOf(d),
      summaryOf(d),
      fit(d, "before"),
      fit(d, "after"),
      { text: link(d) },
    ]);
    const head = [
      t("file"),
      t("time"),
      t("verdict"),
      t("what"),
      t("error_before_fit"),
      t("error_after_fit"),
      t("report"),
    ];
    fill(
      this.past,
      rows.length > (newest ? 1 : 0)
        ? [make("h3", "", t("compared")), table(head, rows, { caption: t("compared") })]
        : [],
    );
  }

  /** What was hidden in an example, told when asked for. */
  truth(name) {
    const text = make("p", "note", "", { role: "status" });
    const tell = make("button", "", t("tell_truth"), {
      type: "button",
      onclick: () => this.act(async () => say(text, own(await ask(`/api/v1/gallery/${name}/truth`)))),
    });
    return make("div", "buttons", [tell, text]);
  }

  async take(file) {
    if (!file) return;
    await this.act(async () => {
      if (!this.may()) throw new Error(t("sign_in_to_diagnose"));
      this.begin(file.name);
      checkSize(file, this.known);
      const begun = this.file;
      const document = await this.sending.bringFile(file);
      await this.reload();
      await this.showWhenRead(document, begun);
    });
  }

  /** A long file is not read at once: it is asked for until it is, unless another one has been opened meanwhile. */
  async showWhenRead(document, begun) {
    while (document.reading && this.file === begun) {
      say(this.note, t("reading_file", document.name));
      await new Promise((resolve) => setTimeout(resolve, 1000));
      document = await ask(`/api/v1/files/${document.key}`);
    }
    if (this.file !== begun) return;
    say(this.note, " ");
    this.show(document);
  }

  /** A file that is not understood yet: neither the columns nor the answer of another one stand below its name. */
  begin(name) {
    this.file = { key: null, name };
    fill(this.understood, []);
    if (this.known) this.drawResults();
  }

  async open(key) {
    const { name } = this.known.files.find((file) => file.key === key);
    this.begin(name);
    const begun = this.file;
    await this.showWhenRead(await ask(`/api/v1/files/${key}`), begun);
    this.drawResults();
  }

  async example(name) {
    // An example is a file of its own: what was open is not what the answer will be of.
    this.file = null;
    fill(this.understood, []);
    await send(`/api/v1/gallery/${name}`, {});
    await this.look();
  }

  show(file) {
    this.file = file;
    const parts = [make("h3", "", file.name)];
    if (file.error) parts.push(make("p", "trouble bad-text", own(file.error)));
    if (file.statement?.en) parts.push(make("p", "", `${t("understood_as")} ${own(file.statement)}`));
    if (file.rows !== undefined)
      parts.push(make("p", "note", t("rows_read", file.rows.toLocaleString(), file.refused)));
    for (const note of file.notes ?? []) parts.push(make("p", note.doubt ? "warn-text" : "note", own(note)));
    for (const problem of file.problems ?? []) parts.push(make("p", "warn-text", problem));
    if (file.columns.length) parts.push(this.mapping(file));
    if (file.first_rows) parts.push(table(file.head, file.first_rows, { caption: t("first_rows") }));
    if (!file.error) parts.push(this.question());
    fill(this.understood, parts);
    this.update();
  }

  /** Each column with what it becomes; a changed choice is told to the box, which reads the file anew. */
  mapping(file) {
    const ours = [...(this.known?.columns ?? []).map((column) => column.name), ...(this.known?.text_columns ?? [])];
    const list = make(
      "datalist",
      "",
      [...new Set(ours)].map((name) => make("option", "", null, { value: name })),
      { id: "our-columns" },
    );
    const input = (name, value, more = {}) =>
      make("input", "", null, { type: "text", value: value ?? "", "aria-label": name, ...more });
    this.choices = file.columns.map((column) => ({
      column,
      to: input(`${column.from}: ${t("becomes")}`, column.to ?? column.from, { list: "our-columns" }),
      unit: input(`${column.from}: ${t("unit")}`, column.unit, { size: "7" }),
    }));
    const hint = (column) =>
      column.is_time ? t("is_time") : column.asked ? t("may_be", column.candidates.slice(0, 3).join(", ")) : "";
    const rows = this.choices.map(({ column, to, unit }) => [
      column.name === column.from ? column.from : `${column.from} ${column.name}`,
      column.is_time ? t("time") : { text: to },
      column.is_time ? (column.unit ?? "") : { text: unit },
      hint(column),
    ]);
    this.time = make(
      "select",
      "",
      ["", ...file.columns.map((column) => column.from)].map((name) =>
        make("option", "", name || t("as_found"), { value: name }),
      ),
      { "aria-label": t("time_column") },
    );
    this.timeZone = input(t("time_zone"), "", { placeholder: "Europe/Berlin", size: "16" });
    const use = make("button", "", t("use_map"), {
      type: "button",
      "data-changes": "yes",
      onclick: () => this.act(() => this.map()),
    });
    const fields = [
      make("label", "field", [t("time_column"), this.time]),
      make("label", "field", [t("time_zone"), this.timeZone]),
      use,
    ];
    const details = make("details", "", [
      make("summary", "", t("columns_as_understood")),
      list,
      table([t("in_file"), t("becomes"), t("unit"), ""], rows, { caption: t("columns_as_understood") }),
      make("div", "buttons", fields),
    ]);
    details.open = file.columns.some((column) => column.asked) || Boolean(file.error);
    return details;
  }

  async map() {
    const columns = this.choices
      .filter(({ column }) => !column.is_time && column.from !== this.time.value)
      .map(({ column, to, unit }) => ({
        from: column.from,
        to: to.value.trim(),
        unit: unit.value.trim() === (column.unit ?? "") ? "" : unit.value.trim(),
      }));
    const begun = this.file;
    const said = { columns, time: this.time.value, zone: this.timeZone.value.trim() };
    await this.showWhenRead(await send(`/api/v1/files/${begun.key}/map`, said, "PUT"), begun);
  }

  /** What the file is compared with. */
  question() {
    const option = (value, text) => make("option", "", text, { value });
    const kinds = (this.known?.kinds ?? []).map((it) => option(it.kind, own(it)));
    const kind = make(
      "select",
      "",
      [
        ...kinds,
        option("toml", t("model_from_file")),
        this.context.status()?.twin ? option("active_model", t("model_in_charge")) : null,
      ].filter(Boolean),
      { "aria-label": t("model") },
    );
    const material = make(
      "select",
      "",
      (this.known?.materials ?? []).map((name) => option(name, name)),
      { "aria-label": t("material") },
    );
    const axis = make(
      "select",
      "",
      AXES.map((name) => option(name, name || t("only_axis"))),
      { "aria-label": t("axis") },
    );
    const model = make("input", "", null, { type: "file", accept: ".toml", "aria-label": t("model_from_file") });
    const series = make(
      "select",
      "",
      [option("", t("no_series")), ...(this.known?.files ?? []).map((file) => option(file.key, file.name))],
      { "aria-label": t("series_file") },
    );
    const column = make("input", "", null, {
      type: "text",
      placeholder: t("series_column"),
      "aria-label": t("series_column"),
    });
    const draw = () => {
      material.parentElement.hidden = !["lathe", "mill", "drill"].includes(kind.value);
      axis.parentElement.hidden = kind.value !== "axis";
      model.parentElement.hidden = kind.value !== "toml";
      column.parentElement.hidden = !series.value;
    };
    kind.addEventListener("change", draw);
    series.addEventListener("change", draw);
    const begin = make("button", "primary", t("diagnose"), {
      type: "button",
      "data-changes": "yes",
      onclick: () =>
        this.act(async () => {
          const asked = { simulated: series.value ? { key: series.value, column: column.value.trim() } : null };
          if (kind.value === "toml") asked.toml = await model.files[0]?.text();
          else if (kind.value === "active_model") asked.active_model = true;
          else Object.assign(asked, { kind: kind.value, material: material.value, axis: axis.value });
          await send(`/api/v1/files/${this.file.key}/diagnosis`, asked);
          await this.look();
        }),
    });
    this.end = make("button", "", t("end_diagnosis"), {
      type: "button",
      onclick: () => this.act(() => ask("/api/v1/files-diagnosis", { method: "DELETE" })),
    });
    const field = (name, input) => make("label", "field", [name, input]);
    const fields = [
      field(t("compare_with"), kind),
      field(t("material"), material),
      field(t("axis"), axis),
      field(t("model_from_file"), model),
      field(t("series_file"), series),
      field(t("series_column"), column),
      begin,
      this.end,
    ];
    const form = make("div", "buttons", fields);
    draw();
    return form;
  }

  async look() {
    const run = await ask("/api/v1/files-diagnosis").catch(() => null);
    if (!run) return;
    const before = this.run;
    this.run = run;
    const running = run.state === "running";
    this.bar.hidden = !running;
    if (this.end) this.end.hidden = !running;
    if (running) {
      if (run.about_s) this.bar.value = Math.min(0.97, run.seconds / run.about_s);
      else this.bar.removeAttribute("value");
      const stage = STAGES.indexOf(run.stage);
      const rows = run.rows ? t("rows_compared", number(run.rows)) : "";
      say(
        this.note,
        [
          t("stage_of", stage + 1, STAGES.length, t(`file_stage_${run.stage}`)),
          rows,
          t("running_for", duration(run.seconds)),
        ]
          .filter(Boolean)
          .join(" · "),
      );
    } else if (before?.state === "running") {
      say(
        this.note,
        run.state === "failed"
          ? t("diagnosis_failed", run.what)
          : run.state === "cancelled"
            ? t("diagnosis_ended", run.by)
            : t("file_diagnosis_done", duration(run.seconds)),
      );
      await this.reload();
    }
    this.update();
  }

  leave() {
    this.sending.end();
    clearInterval(this.timer);
  }
}
