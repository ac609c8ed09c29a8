// Box: the sources, the store and the scripts, receivers, doctor, recipe, backup, persons, the configuration in force.
import { card, fill, make, row } from "/web/parts.js";
import { bytes, duration, number, quantity, sourceName } from "/web/format.js";
import { box, scriptWords, t } from "/web/words.js";
import { personsCard } from "/web/system-persons.js";
import { systemView } from "/web/system.js";

export function mount(root, context) {
  const cards = systemCards(context);
  const more = systemView(context);
  const persons = personsCard(context);
  const setUp = card(t("set_up"), [
    make("p", "note", t("set_up_words")),
    make("div", "buttons", [make("a", "button", t("open_set_up"), { href: "/setup", "data-view": "setup" })]),
  ]);
  root.append(cards.box, make("div", "columns", [setUp, persons.box]), ...more.parts);
  const session = () => {
    more.session();
    persons.may();
  };
  if (context.session) session();
  return {
    update(status) {
      cards.update(status);
      more.update(status);
    },
    session,
  };
}

function systemCards(context) {
  const [sources, store, scripts] = [make("div", ""), make("div", ""), make("div", "")];
  const columns = make("div", "columns", [
    card(t("sources"), sources),
    card(t("store"), store),
    card(t("scripts"), scripts),
  ]);
  let drawn = 0;
  const update = (status) => {
    // Figures that change at every message are read by nobody: once a second is enough.
    if (performance.now() - drawn < 1000) return;
    drawn = performance.now();
    fill(
      sources,
      status.sources
        .map((s) => {
          const facts = [t("polled_every", quantity(s.period_s, "s")), t("readings", s.readings.toLocaleString())];
          if (s.round_trip_p50_ms !== null) facts.push(t("answers_in", quantity(s.round_trip_p50_ms, "ms")));
          if (s.failures) facts.push(t("failed_polls", s.failures));
          return row(sourceName(s.name), t(`source_${s.state}`), s.error ? box(s.error) : facts.join(" · "), {
            dot: s.error ? "bad" : "good",
            tone: s.error ? "bad" : "",
          });
        })
        .concat(
          status.alignment.map((a) =>
            row(
              t("meter_lag", context.name(a.power).split(/[,，]/)[0]),
              a.missing
                ? context.reason(a.missing)
                : `${number(a.lag_s * 1000, "ms")} ± ${number(a.uncertainty_s * 1000, "ms")} ms`,
              a.use === "merge" ? t("put_back") : t("shown_only"),
            ),
          ),
        ),
    );
    const h = status.history;
    fill(store, [
      row(t("samples_stored"), h.rows.toLocaleString(), h.error ? box(h.error) : h.path, {
        dot: h.error ? "bad" : "good",
      }),
      row(t("size_on_disk"), bytes(h.bytes)),
      h.lasts_days === null ? null : row(t("disk_lasts"), `${number(Math.round(h.lasts_days))} ${t("d")}`),
      row(t("running_since"), duration(status.uptime_s)),
      row(t("parts_finished"), String(status.parts)),
      row(t("box_version"), status.version),
      row(
        t("tick"),
        `${number(status.tick.rate_hz)} Hz`,
        t("tick_words", number(status.tick.late_p99_ms, "ms"), status.tick.skipped),
      ),
    ]);
    const tone = { running: "good", waiting: "warn", reverted: "bad", suspended: "bad", refused: "bad" };
    fill(
      scripts,
      status.scripts.map((s) =>
        row(s.file, t(`script_${s.condition}`), s.error ? scriptWords(s.error) : t("version_of", s.version), {
          dot: tone[s.condition] ?? "warn",
          tone: tone[s.condition] === "bad" ? "bad" : "",
        }),
      ),
    );
  };
  return { box: columns, update };
}
