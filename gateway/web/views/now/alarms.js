// Now: alarms and troubles, and what has no value and why.
import { fill, make, row, say, send } from "/web/parts.js";
import { sourceName, when } from "/web/format.js";
import { box, language, localTimes, t } from "/web/words.js";

/** Not worth a line in "absent": nobody expects them on every machine. */
const SILENT = new Set(["not_provided", "no_model", "cut_unknown", "not_recorded"]);

export function alarmCard(context) {
  const list = make("div", "alarm-list");
  const section = make("section", "card alarms ages", [make("h2", "", t("alarms")), list], {
    role: "region",
    "aria-label": t("alarms"),
  });
  let drawn = "";
  const update = (status) => {
    const key = JSON.stringify([
      status.alarms,
      status.acknowledged,
      status.problems,
      language(),
      Boolean(context.session?.person),
    ]);
    if (key === drawn) return;
    drawn = key;
    section.dataset.worst = status.alarms.some((a) => a.severity === "critical")
      ? "bad"
      : status.alarms.some((a) => a.severity === "warning")
        ? "warn"
        : "";
    const lines = status.alarms.map((alarm) => alarmLine(alarm, status, context));
    const troubles = status.problems.map(troubleLine);
    fill(list, lines.length + troubles.length ? [...lines, ...troubles] : [make("p", "no-alarm", t("no_alarm"))]);
  };
  return { box: section, update };
}

// Something that is wrong and is no alarm of the machine: the whole sentence, and what to do next.
function troubleLine(problem) {
  const line = make("div", "alarm warning");
  line.append(make("strong", "", box(problem.what)), make("span", "more", box(problem.next)));
  return line;
}

function alarmLine(alarm, status, context) {
  const line = make("div", `alarm ${alarm.severity}`);
  const words = localTimes(language() === "zh" && alarm.zh ? alarm.zh : alarm.text);
  line.append(
    make("strong", "", words),
    make(
      "span",
      "more",
      `${t(`severity_${alarm.severity}`)} · ${t("since_clock", alarm.since_ms ? when(alarm.since_ms, status.at_ms) : "–")}`,
    ),
  );
  const seen = status.acknowledged?.find((it) => it.code === alarm.code)?.by;
  if (seen) line.append(make("span", "more", t("seen_by", seen)));
  else
    line.append(
      make("button", "", t("acknowledge"), {
        type: "button",
        onclick: (event) => acknowledge(event.currentTarget, alarm, context),
      }),
    );
  return line;
}

async function acknowledge(button, alarm, context) {
  if (!context.session?.person) {
    location.href = `/sign-in?next=${encodeURIComponent("/now")}`;
    return;
  }
  button.disabled = true;
  try {
    await send("/api/v1/alarms/acknowledge", { code: alarm.code });
    say(button, t("acknowledged"));
  } catch (error) {
    button.disabled = false;
    button.after(make("span", "note bad", error.message));
  }
}

/** What has no value, and why, in one line for each reason. */
export function absentCard() {
  const list = make("div", "");
  const section = make("section", "card absent ages", [make("h2", "", t("absent_title")), list]);
  let drawn = "";
  const update = (status, context) => {
    const lines = new Map();
    for (const it of [...status.channels, ...status.estimates]) {
      if (!it.missing || SILENT.has(it.missing)) continue;
      const why = context.reason(it.missing);
      lines.set(why, [...(lines.get(why) ?? []), context.name(it.name).split(/[,，]/)[0]]);
    }
    const silent = status.sources.filter((source) => source.error).map((source) => [source.name, source.error]);
    const key = JSON.stringify([...lines, silent, language()]);
    if (key === drawn) return;
    drawn = key;
    const rows = [...lines].map(([why, names]) =>
      row(
        why,
        String(names.length),
        names.slice(0, 6).join(language() === "zh" ? "、" : ", ") + (names.length > 6 ? " …" : ""),
      ),
    );
    const sources = silent.map(([name, error]) => row(sourceName(name), t("silent"), box(error), { dot: "bad" }));
    fill(list, rows.length + sources.length ? [...sources, ...rows] : [make("p", "empty", t("nothing_absent"))]);
  };
  return { box: section, update };
}
