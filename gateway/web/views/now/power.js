// Now: where the power of the spindle goes, at this moment and in the last ten minutes.
import { ask, keyOf, make, say } from "/web/parts.js";
import { number, printed, quantity as shown } from "/web/format.js";
import { t } from "/web/words.js";
import { TimePlot } from "/web/plot.js";
import { StateRibbon } from "/web/ribbon.js";
import { show } from "/web/now-values.js";

/** Seconds without a message that are a gap, and the speed of a machine that goes as fast as it can. */
const [WAIT_S, SPEED_MOST] = [2, 1000];
/** The trend behind the big numbers. */
const TREND_S = 600;
/** Power that flows back is called braking from here on: more than the noise of a power meter about zero. Too low, a
    standing spindle is said to brake. */
const BRAKING_W = 20;
/** The parts are of the filtered power: they belong to what is read now where they add up to it within this share, or
    within so many of their deviations. Wider: a change of the power is shown as a split that was never so. */
const SAME_MOMENT_SHARE = 0.03;
const SAME_MOMENT_SD = 2;
const PARTS = ["no_load_power_w", "load_loss_w", "cutting_power_w"];
/** What the load loss of the drive enters. */
const LOSSY = new Set(["load_loss_w", "cutting_power_w"]);

/** The parts of the power, W, and the rest, which add up to the power that is printed; or the word for why they are withheld. */
export function split(quantity) {
  const none = { watts: null, rest: null, why: null };
  const found = PARTS.map((key) => quantity(key));
  const without = found.find((it) => !it || it.missing || typeof it.value !== "number");
  const power = quantity("spindle_power_w");
  if (without !== undefined || !power || power.missing) return none;
  const watts = found.map((it) => Math.round(it.value));
  const rest = Number((printed(power.value, "W") - watts.reduce((sum, it) => sum + it, 0)).toFixed(1));
  const sd = Math.hypot(...found.map((it) => it.uncertainty ?? 0));
  const within = Math.max(SAME_MOMENT_SHARE * Math.abs(power.value), SAME_MOMENT_SD * sd, 5);
  return Math.abs(rest) <= within ? { watts, rest, why: null } : { ...none, why: "parts_of_another_moment" };
}

/** Where the spindle's power goes, as one strip: no-load, loss under load, cutting; what cannot be told apart is one
    colour. */
export function strip() {
  const pieces = [...PARTS, "rest"].map((key) => make("div", `piece ${key}`));
  const bar = make("div", "power-bar", pieces, { role: "img" });
  const labels = PARTS.map((key) => ({ key, value: make("b", "", "–"), note: make("span", "more", "") }));
  const total = make("span", "value", "–", { "data-quantity": "spindle_power_w" });
  const machine = make("span", "grow note", "");
  const list = make(
    "div",
    "power-list",
    labels.map(({ key, value, note }) =>
      make("div", `power-label ${key}`, [make("span", "", t(`short_${key}`)), value, note], { "data-part": key }),
    ),
  );
  const rest = make("b", "", "–");
  list.append(
    make("div", "power-label rest", [make("span", "", t("short_rest_w")), rest, make("span", "more", t("rest_is"))], {
      "data-part": "rest",
    }),
  );
  const section = make("section", "card power ages", [
    make("div", "head", [
      make("h2", "", t("short_spindle_power_w")),
      make("p", "reading small", [total, make("span", "unit", "W")]),
      machine,
    ]),
    bar,
    list,
  ]);
  let greatest = 500;
  const update = (status, context) => {
    const found = context.quantity("spindle_power_w");
    const value = (key) => {
      const it = context.quantity(key);
      return it && !it.missing && typeof it.value === "number" ? it.value : null;
    };
    show(total, found, context);
    const power = Math.max(0, value("spindle_power_w") ?? 0);
    greatest = Math.max(greatest * 0.9995, power, 500);
    const turning = Math.abs(value("spindle_speed_rpm") ?? 0) > 1;
    const { watts: parts, rest: left, why } = split(context.quantity);
    say(rest, left === null ? "–" : shown(left, "W"));
    let used = 0;
    PARTS.forEach((_, at) => {
      const watts = turning && parts ? Math.min(Math.max(0, parts[at]), Math.max(0, power - used)) : 0;
      used += watts;
      pieces[at].style.width = `${(100 * watts) / greatest}%`;
    });
    pieces[3].style.width = `${(100 * Math.max(0, power - used)) / greatest}%`;
    labels.forEach(({ key, value: cell, note }, at) => {
      const it = context.quantity(key);
      const withheld = !it || it.missing || why;
      say(cell, withheld ? "–" : shown(parts ? parts[at] : it.value, it.unit));
      const width = it && !it.missing ? `± ${shown(it.uncertainty, it.unit)}` : "";
      // Without a measured load loss the interval is that of drives of this kind, which a reader has to know.
      const deviation =
        width && LOSSY.has(key) && status.state.load_loss_origin === "not_commissioned"
          ? t("loss_not_commissioned", width)
          : width;
      say(note, it?.missing ? context.reason(it.missing) : why ? t(why) : deviation);
    });
    bar.setAttribute(
      "aria-label",
      t(
        "strip_label",
        number(power, "W"),
        number(value("no_load_power_w") ?? NaN, "W"),
        number(value("cutting_power_w") ?? NaN, "W"),
      ),
    );
    const whole = context.quantity("total_power_w");
    // A braking spindle is a generator: without a word its negative power looks like a fault of the meter.
    const braking = (value("spindle_power_w") ?? 0) < -BRAKING_W ? `${t("braking")} · ` : "";
    say(machine, braking + (whole && !whole.missing ? t("machine_power", shown(whole.value, "W")) : ""));
  };
  return { box: section, update };
}

/** The stream comes several times a second of real time; this long after a message, in machine time, there is a gap. */
const longestWait = (status) => WAIT_S * (status.speed ?? SPEED_MOST);

/** What the two lines are, each as it is drawn. */
function lineKey() {
  return make("div", "legend", [
    keyOf("line-a", t("short_spindle_power_w")),
    keyOf("soft", t("short_no_load_power_w"), "dashed"),
  ]);
}

/** Ten minutes of spindle power and state. What is older than the page comes from the history. */
export function trend(context) {
  const ribbonBox = make("div", "ribbon-box");
  const plotBox = make("div", "plot-box");
  const link = make("a", "grow", t("open_history"), { href: "/history", "data-view": "history" });
  const section = make("section", "card trend ages", [
    make("div", "head", [make("h2", "", t("last_ten_minutes")), lineKey(), link]),
    ribbonBox,
    plotBox,
  ]);
  const points = [];
  let [plot, ribbon, asked, states, askedAt, loaded] = [null, null, false, [], 0, false];
  const draw = (status) => {
    const to = status.at_ms / 1000;
    if (!plot) {
      ribbon = new StateRibbon(ribbonBox, context);
      plot = new TimePlot(plotBox, {
        height: 150,
        low: 0,
        sync: null,
        label: t("last_ten_minutes"),
        series: [
          { label: t("short_spindle_power_w"), unit: "W", line: "line-a" },
          { label: t("short_no_load_power_w"), unit: "W", line: "soft", dash: [5, 4] },
        ],
      });
    }
    const x = points.map((p) => p[0]);
    const nothing = points.map(() => null);
    const data = [x, points.map((p) => p[1]), nothing, nothing, points.map((p) => p[2]), nothing, nothing];
    const from = to - TREND_S;
    // Before the history has answered nobody knows what was recorded.
    plot.give(data, { from: loaded ? from : x[0], to, least: longestWait(status) });
    plot.show(from, to);
    ribbon.show(from, to, states, { unrecorded: plot.unrecorded });
  };
  const past = async (status) => {
    const utc = (ms) => new Date(ms).toISOString();
    const span = `from=${utc(status.at_ms - TREND_S * 1000)}&to=${utc(status.at_ms)}`;
    const [samples, found] = await Promise.all([
      ask(`/api/v1/samples?${span}&channels=spindle_power_w,no_load_power_w&resolution_s=1`),
      ask(`/api/v1/states?${span}`),
    ]);
    const [power, idle] = samples.series;
    const old = power.points.map((p, at) => [p[0] / 1000, p[1], idle?.points[at]?.[1] ?? null]);
    const last = old.at(-1)?.[0] ?? 0;
    points.splice(0, points.length, ...old, ...points.filter((p) => p[0] > last));
    loaded = true;
    const known = found.rows.map((s) => ({
      from: s.from_ms / 1000,
      to: (s.to_ms ?? status.at_ms) / 1000,
      word: s.state,
    }));
    const end = known.at(-1)?.from ?? 0;
    states = [...known, ...states.filter((s) => s.from > end)];
  };
  const update = (status) => {
    const value = (key) => {
      const it = context.quantity(key);
      return it && !it.missing ? it.value : null;
    };
    // A page that was not looked at has missed what the history has.
    if (points.length && status.at_ms / 1000 - points.at(-1)[0] > longestWait(status)) asked = false;
    points.push([status.at_ms / 1000, value("spindle_power_w"), value("no_load_power_w")]);
    while (points.length && points[0][0] < status.at_ms / 1000 - TREND_S - 5) points.shift();
    const last = states.at(-1);
    if (last && last.word === status.state.word) last.to = status.at_ms / 1000;
    else states.push({ from: status.state.since_ms / 1000, to: status.at_ms / 1000, word: status.state.word });
    while (states.length > 1 && states[0].to < status.at_ms / 1000 - TREND_S) states.shift();
    // Faster than real time the stream is too coarse: the history is read again.
    if (!asked || (status.speed !== 1 && performance.now() - askedAt > 5000)) {
      [asked, askedAt] = [true, performance.now()];
      past(status).catch(() => {});
    }
    draw(status);
  };
  return {
    box: section,
    update,
    leave: () => {
      plot?.destroy();
      ribbon?.destroy();
    },
  };
}
