// Now: what a machinist reads in three seconds. Everything is built once; only texts change, so nothing jumps.
import { make, say } from "/web/parts.js";
import { duration, number, plainName, quantity, when } from "/web/format.js";
import { box, t } from "/web/words.js";
import { absentCard, alarmCard } from "/web/now-alarms.js";
import { gauges, temperatures } from "/web/now-values.js";
import { feedCard } from "/web/now-feed.js";
import { strip, trend } from "/web/now-power.js";

const JOB = ["program", "operation", "tool", "part"];

export function mount(root, context) {
  root.classList.add("now-view");
  const parts = {
    state: stateCard(),
    alarms: alarmCard(context),
    gauges: gauges(),
    strip: strip(),
    feed: feedCard(context),
    trend: trend(context),
    absent: absentCard(),
    temperature: temperatures(),
  };
  root.append(
    parts.state.box,
    parts.alarms.box,
    parts.gauges.box,
    parts.feed.box,
    parts.strip.box,
    parts.trend.box,
    parts.absent.box,
    parts.temperature.box,
  );
  return {
    update(status) {
      for (const part of Object.values(parts)) part.update(status, context);
    },
    session() {
      parts.feed.session?.(context);
    },
    leave() {
      root.classList.remove("now-view");
      parts.trend.leave();
    },
  };
}

function stateCard() {
  const word = make("p", "word", "–", { id: "state", "aria-live": "polite" });
  const since = make("p", "since", " ");
  const demo = make("p", "demo-note", "", { hidden: true });
  const job = make("dl", "job");
  const values = Object.fromEntries(
    JOB.map((key) => {
      const value = make("dd", "", "–");
      job.append(make("div", "", [make("dt", "", t(key)), value]));
      return [key, value];
    }),
  );
  const box = make("section", "card state ages", [make("div", "big", [word, since]), job, demo], {
    "aria-label": t("machine_state"),
  });
  const update = (status, context) => {
    const silent = silentControl(context);
    say(word, silent ?? context.state(status.state.word));
    word.dataset.word = status.state.word;
    word.dataset.ms = status.at_ms;
    const why = status.state.why ? ` · ${box_(status.state.why)}` : "";
    say(
      since,
      `${t("since_clock", when(status.state.since_ms, status.at_ms))} · ${duration(status.state.seconds)}${why}`,
    );
    for (const key of JOB) {
      const found = context.quantity(key);
      const count = context.quantity("part_count");
      const none = !found || found.missing || found.value === "";
      // Where nobody names the part, how many were finished says more than a dash.
      const text = !none
        ? plainName(String(found.value))
        : key === "part" && count && !count.missing
          ? t("finished_count", number(count.value))
          : "–";
      say(values[key], text);
      values[key].title = text;
    }
    demo.hidden = !status.simulated;
    const short = status.sources.some((source) => source.name.includes("day=short"));
    if (status.simulated)
      say(
        demo,
        short ? t("demo_note") : status.speed === 1 ? t("simulated_note") : t("demo_fast", status.speed ?? "∞"),
      );
  };
  return { box, update };
}
/** Above this power a machine is not switched off, W: the supplies of a control alone take more. */
const DRAWS_W = 50;
/** A control that is silent while the machine draws power is not off: the head says so, in the place of a state that
    nobody knows. */
function silentControl(context) {
  const control = ["execution", "mode"].map((key) => context.quantity(key)).find((it) => it);
  if (!control?.missing || ["not_provided", "not_yet", "unsupported"].includes(control.missing)) return null;
  const power = ["total_power_w", "spindle_power_w"].map((key) => context.quantity(key));
  const measured = power.find((it) => it && !it.missing && Math.abs(it.value) > DRAWS_W);
  return measured ? t("machine_draws", quantity(measured.value, measured.unit)) : null;
}
const box_ = (text) => box(text);
