// Of the view of the twin: a diagnosis asked for over a chosen time of the history, how much of that is recorded, and how far it is.
import { ask, card, make, say, send } from "/web/parts.js";
import { duration } from "/web/format.js";
import { t } from "/web/words.js";

const SPANS_H = [1, 2, 4, 8];
const STAGES = ["waiting", "reading", "comparing", "writing"];
/** More is recorded while the page is looked at. */
const TELL_EVERY_MS = 20000;
/** Of a longer time the beginning is left out: 28,800 rows of a second. */
const LONGEST_H = 8;

const local = (ms) => new Date(ms - new Date(ms).getTimezoneOffset() * 60000).toISOString().slice(0, 16);

/** The card from which a diagnosis is begun; `changed` is called when another one is finished. */
export class Asking {
  constructor(context, changed) {
    Object.assign(this, { context, changed, run: null });
    const input = (label) => make("input", "", null, { type: "datetime-local", "aria-label": label });
    [this.from, this.to] = [input(t("from")), input(t("to"))];
    const quick = SPANS_H.map((h) =>
      make("button", "", t("last_hours", h), { type: "button", onclick: () => this.last(h) }),
    );
    this.begin = make("button", "primary", t("diagnose"), { type: "button", onclick: () => this.start() });
    this.end = make("button", "", t("end_diagnosis"), {
      type: "button",
      hidden: true,
      onclick: () => this.act(() => ask("/api/v1/diagnosis", { method: "DELETE" })),
    });
    this.note = make("p", "note", " ", { role: "status" });
    this.recorded = make("p", "note", " ", { role: "status" });
    for (const field of [this.from, this.to]) field.addEventListener("change", () => this.tellRecorded());
    this.bar = make("progress", "progress", null, { max: "1", hidden: true, "aria-label": t("diagnosing") });
    this.box = card(t("diagnose_title"), [
      make("p", "note", t("diagnose_words", LONGEST_H)),
      make("div", "buttons", [
        make("label", "field", [t("from"), this.from]),
        make("label", "field", [t("to"), this.to]),
        ...quick,
        this.begin,
        this.end,
      ]),
      this.recorded,
      this.bar,
      this.note,
    ]);
    const asked = new URLSearchParams(location.search);
    if (asked.get("from")) this.choose(Date.parse(asked.get("from")), Date.parse(asked.get("to") ?? "") || Date.now());
    this.timer = setInterval(() => this.look(), 2000);
    this.look();
  }

  /** The newest hours; the box says what time it is. */
  last(hours) {
    const now = this.context.status()?.at_ms;
    if (now) this.choose(now - hours * 3600000, now);
  }

  choose(fromMs, toMs) {
    if (Number.isFinite(fromMs) && Number.isFinite(toMs))
      [this.from.value, this.to.value] = [local(fromMs), local(Math.ceil(toMs / 60000) * 60000)];
    this.tellRecorded();
  }

  /** Before it is begun: how much of the time is recorded, and what it costs where that is little. Nothing is refused. */
  async tellRecorded() {
    const [from, to] = [this.from, this.to].map((field) => Date.parse(field.value));
    const enough = this.run?.enough_s;
    if (!(from < to) || !enough) return say(this.recorded, " ");
    const utc = (ms) => new Date(ms).toISOString();
    const turn = (this.turn = (this.turn ?? 0) + 1);
    const found = await ask(`/api/v1/utilisation?from=${utc(from)}&to=${utc(to)}&by=hour`).catch(() => null);
    if (!found || turn !== this.turn) return;
    const recorded = found.rows.reduce((sum, r) => sum + r.total_s, 0);
    const little = recorded < enough;
    this.recorded.classList.toggle("warn-text", little);
    this.recorded.dataset.recordedS = String(Math.round(recorded));
    say(
      this.recorded,
      little ? t("little_recorded", duration(recorded), duration(enough)) : t("recorded_so_far", duration(recorded)),
    );
  }

  update(status) {
    if (!this.from.value) this.last(1);
    this.box.hidden = !status.twin;
    const may = Boolean(this.context.session?.may?.edit);
    this.begin.disabled = !may || this.run?.state === "running";
    this.end.disabled = !may;
    if (!may && this.context.session && !this.told) {
      this.told = true;
      say(this.note, t("sign_in_to_diagnose"));
    }
  }

  start() {
    const utc = (field) => new Date(field.value).toISOString();
    if (!this.from.value || !this.to.value) return say(this.note, t("choose_times"));
    return this.act(() => send("/api/v1/diagnosis", { from: utc(this.from), to: utc(this.to) }));
  }

  async act(what) {
    try {
      await what();
      await this.look();
    } catch (error) {
      say(this.note, error.message);
    }
  }

  async look() {
    const run = await ask("/api/v1/diagnosis").catch(() => null);
    if (!run) return;
    const before = this.run;
    this.run = run;
    if (!before || performance.now() - this.toldAt > TELL_EVERY_MS) {
      this.toldAt = performance.now();
      this.tellRecorded();
    }
    const running = run.state === "running";
    this.bar.hidden = this.end.hidden = !running;
    if (running) {
      const stage = STAGES.indexOf(run.stage);
      // Fitting takes nearly all of the time; how long is known from the one before.
      if (run.about_s) this.bar.value = Math.min(0.97, run.seconds / run.about_s);
      else this.bar.removeAttribute("value");
      const about = run.about_s ? t("about_in_all", duration(run.about_s)) : "";
      say(
        this.note,
        [
          t("stage_of", stage + 1, STAGES.length, t(`stage_${run.stage}`)),
          run.rows ? t("seconds_examined", run.rows.toLocaleString()) : "",
          t("running_for", duration(run.seconds)),
          about,
          run.by ? t("asked_by", run.by) : t("asked_by_box"),
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
            : t("diagnosis_done", duration(run.seconds)),
      );
      this.changed();
    }
  }

  leave() {
    clearInterval(this.timer);
  }
}
