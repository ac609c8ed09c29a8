// Help: the handbook of the box, offline.
import { ask, fill, labelCells, make } from "/web/parts.js";
import { language, t } from "/web/words.js";
import { marked } from "/web/marked.js";

export function mount(root, context) {
  const menu = make("nav", "chapters", null, { "aria-label": t("chapters") });
  const text = make("article", "card handbook", null, { tabindex: "-1" });
  const search = make("input", "", null, { type: "search", placeholder: t("search"), "aria-label": t("search") });
  root.append(make("div", "help", [make("div", "card", [search, menu]), text]));
  const chapters = new Map();
  const read = async (name) => {
    if (!chapters.get(name)?.text) {
      const answer = await fetch(`/api/v1/handbook/${name}?lang=${language()}`);
      chapters.get(name).text = answer.ok ? await answer.text() : t("no_chapter");
    }
    return chapters.get(name).text;
  };
  const show = async (name, replace = false) => {
    context.go(`/help?chapter=${name}`, { replace });
    const body = await read(name);
    // The chapters are part of the program; the policy of the page lets nothing in them run.
    text.innerHTML = marked.parse(body);
    text.lang = languageOf(name);
    for (const pre of text.querySelectorAll("pre")) pre.tabIndex = 0;
    for (const wide of text.querySelectorAll("table")) {
      const scroll = make("div", "scroll", null, { tabindex: "0", role: "region", "aria-label": t("table") });
      wide.replaceWith(scroll);
      scroll.append(wide);
      labelCells(wide);
    }
    for (const link of text.querySelectorAll("a[href$='.md']")) {
      const target = link.getAttribute("href").replace(/^.*\//, "").replace(/\.md$/, "");
      if (chapters.has(target)) {
        link.href = `/help?chapter=${target}`;
        link.addEventListener("click", (event) => {
          event.preventDefault();
          show(target);
        });
      }
    }
    for (const link of menu.querySelectorAll("a")) link.toggleAttribute("aria-current", link.dataset.chapter === name);
  };
  // A chapter for developers that is not written in Chinese is told as one in the list.
  const languageOf = (name) => (language() === "zh" && chapters.get(name).zh ? "zh-CN" : "en");
  const english = (name) =>
    language() === "en" || chapters.get(name).zh ? null : make("small", "note", ` · ${t("in_english")}`);
  const list = (names) =>
    fill(
      menu,
      names.length
        ? names.map((name) =>
            make("a", "", [chapters.get(name).title, english(name)], {
              href: `/help?chapter=${name}`,
              "data-chapter": name,
              lang: languageOf(name),
              onclick: (event) => {
                event.preventDefault();
                show(name);
              },
            }),
          )
        : [make("p", "empty", t("no_match"))],
    );
  search.addEventListener("input", async () => {
    const wanted = search.value.toLowerCase();
    const names = [...chapters.keys()];
    await Promise.all(names.map(read));
    list(names.filter((name) => !wanted || chapters.get(name).text.toLowerCase().includes(wanted)));
  });
  ask(`/api/v1/handbook/index?lang=${language()}`)
    .then((found) => {
      for (const { name, title, zh } of found.chapters) chapters.set(name, { title, zh, text: null });
      list([...chapters.keys()]);
      const asked = new URLSearchParams(location.search).get("chapter");
      const first = chapters.has(asked) ? asked : chapters.keys().next().value;
      if (first) show(first, true);
    })
    .catch((error) => fill(text, [make("p", "note bad", error.message)]));
  return {};
}
