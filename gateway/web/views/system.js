// Of the view Box: sources with their doctor, receivers, the configuration in force, the recipe as a table,
// backup and help from afar.
import { ask, card, fill, make, row, say, table } from "/web/parts.js";
import { duration } from "/web/format.js";
import { box, own, t } from "/web/words.js";
import { careCard } from "/web/system-care.js";
import { doctorCard } from "/web/system-doctor.js";
import { recipeCard } from "/web/system-recipe.js";

export function systemView(context) {
  const sinks = sinksCard();
  const doctor = doctorCard(context);
  const recipe = recipeCard(context);
  const configuration = configurationCard();
  const care = careCard(context);
  const known = ask("/api/v1/configuration")
    .then((it) => {
      configuration.give(it);
      doctor.give(it);
      recipe.give(it);
    })
    .catch((error) => configuration.fail(error));
  return {
    parts: [make("div", "columns", [doctor.box, sinks.box, care.box]), recipe.box, configuration.box],
    update(status) {
      sinks.update(status);
    },
    session() {
      known.then(() => {
        doctor.may();
        recipe.may();
        care.may();
      });
    },
  };
}

/** Receivers in words: connected or not, how far behind, what went wrong. */
function sinksCard() {
  const list = make("div", "");
  const update = (status) => {
    const all = status.sinks ?? [];
    if (!all.length) return fill(list, [make("p", "empty", t("no_sinks"))]);
    fill(
      list,
      all.map((s) => {
        const behind =
          s.behind_items === 0
            ? t("nothing_waits")
            : t("behind_by", s.behind_items.toLocaleString(), s.behind_s === null ? "–" : duration(s.behind_s));
        const more = [behind, t("delivered", s.delivered.toLocaleString())];
        if (s.dropped) more.push(t("dropped", s.dropped.toLocaleString()));
        if (s.outage_fits_h !== null) more.push(t("outage_fits", duration(s.outage_fits_h * 3600)));
        if (s.error) more.push(`${t("error_now")} ${box(s.error)}`);
        if (s.refusal) more.push(`${t("left_out")} ${box(s.refusal)}`);
        return row(s.name, t(`sink_${s.state}`), more.join(" · "), {
          dot: s.failing ? "bad" : s.state === "connected" ? "good" : "warn",
          tone: s.failing ? "bad" : "",
        });
      }),
    );
  };
  return { box: card(t("sinks"), list, "ages"), update };
}

/** Every key with its value and where that comes from: what somebody has written, and below it what is built in. */
function configurationCard() {
  const written = make("div", "");
  const builtIn = make("div", "");
  const [summary, builtInTitle] = [make("h3", ""), make("summary", "")];
  const fold = make("details", "choose", [builtInTitle, builtIn]);
  const file = make("p", "note", " ");
  const search = make("input", "", null, { type: "search", placeholder: t("search"), "aria-label": t("search") });
  let keys = [];
  const line = (k) => [
    { text: make("code", "", k.key) },
    k.value === null ? t("not_set") : { text: make("code", "", k.value) },
    t(`from_${k.from}`),
    own(k),
  ];
  const drawInto = (place, title, key, rows) => {
    say(title, t(key, rows.length));
    const head = [t("key"), t("value"), t("from_where"), t("what")];
    fill(place, [
      rows.length ? table(head, rows.map(line), { caption: t(key, rows.length) }) : make("p", "empty", t("no_match")),
    ]);
  };
  const draw = () => {
    const text = search.value.toLowerCase();
    const found = keys.filter((k) => !text || JSON.stringify(k).toLowerCase().includes(text));
    const isBuiltIn = (k) => k.from === "default";
    drawInto(
      written,
      summary,
      "written_values",
      found.filter((k) => !isBuiltIn(k)),
    );
    drawInto(builtIn, builtInTitle, "built_in_values", found.filter(isBuiltIn));
    // Whoever looks for a key finds it wherever it stands.
    if (text) fold.open = true;
  };
  search.addEventListener("input", draw);
  return {
    box: card("", [make("div", "head", [make("h2", "", t("configuration")), search]), file, summary, written, fold]),
    give(known) {
      keys = known.keys;
      say(file, known.file ? t("configuration_of", known.file) : t("configuration_built_in"));
      draw();
    },
    fail(error) {
      say(file, error.message);
    },
  };
}
