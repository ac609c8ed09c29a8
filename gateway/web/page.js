// The frame of the page: one stream, the watchdog, the address of each view.
import { Live } from "./live.js";
import { ask, make, say, send } from "./parts.js";
import { clock, dateTime, duration } from "./format.js";
import { language, own, setLanguage, t } from "./words.js";

/** Address, and the module that draws it. A module is loaded when it is first looked at. */
const VIEWS = ["now", "history", "wear", "thermal", "twin", "rules", "audit", "box", "help"];
/** Views that another one leads to. */
const INNER = { setup: "box" };
const at = (id) => document.getElementById(id);
const live = new Live();
// The view is loaded while the words of the box are asked for.
import(`/web/${viewOf(location.pathname)}.js`).catch(() => {});

/** What every view can use. */
const context = {
  live,
  vocabulary: await ask("/api/v1/channels").catch(() => ({ quantities: {}, states: {}, absences: {} })),
  session: null,
  status: () => live.status,
  /** Name of a channel or an estimate. */
  name: (quantity) => own(context.vocabulary.quantities[quantity]) || t(quantity),
  unit: (quantity) => context.vocabulary.quantities[quantity]?.unit ?? "",
  state: (word) => own(context.vocabulary.states[word]) || word,
  reason: (word) => own(context.vocabulary.absences[word]) || word,
  /** A channel or an estimate of the newest status. */
  quantity: (name) =>
    live.status?.channels.find((c) => c.name === name) ?? live.status?.estimates.find((e) => e.name === name),
  go,
};

let view = null;
let mounted = null;

function viewOf(path) {
  const word = path.split("/")[1] || "now";
  return VIEWS.includes(word) || word in INNER ? word : "now";
}

async function show() {
  const word = viewOf(location.pathname);
  const changed = word !== view;
  view = word;
  document.body.dataset.view = word;
  drawFrame();
  mounted?.leave?.();
  mounted = null;
  const root = at("main");
  if (changed) root.className = "";
  const module = await import(`/web/${word}.js`);
  if (view !== word) return;
  root.replaceChildren(make("h1", "visually-hidden", t(`view_${word}`)));
  mounted = module.mount(root, context) ?? {};
  if (live.status) mounted.update?.(live.status);
  if (changed) scrollTo(0, 0);
}

/** Another address of the page; `replace` where going back should not lead here. */
function go(url, { replace = false } = {}) {
  history[replace ? "replaceState" : "pushState"](null, "", url);
  if (viewOf(location.pathname) !== view) show();
}

function drawFrame() {
  at("views").setAttribute("aria-label", t("views"));
  at("views").replaceChildren(
    ...VIEWS.map((word) =>
      make("a", "", t(`view_${word}`), {
        href: `/${word}`,
        "data-view": word,
        "aria-current": word === (INNER[view] ?? view) ? "page" : null,
      }),
    ),
  );
  // On a narrow screen the row of views is wider than the window.
  at("views").querySelector("[aria-current]").scrollIntoView({ block: "nearest", inline: "center" });
  say(at("language"), language() === "zh" ? "English" : "中文");
  at("language").setAttribute("lang", language() === "zh" ? "en" : "zh-CN");
  const links = [
    ["/api/v1/status", t("status_link")],
    ["/openapi.json", "OpenAPI"],
    ["/metrics", "Prometheus"],
  ];
  at("footer").replaceChildren(
    make("span", "", `cnc-gateway ${live.status?.version ?? ""}`),
    ...links.map(([href, name]) => make("a", "", name, { href })),
  );
  drawPerson();
}

function drawPerson() {
  const link = at("person");
  if (!context.session) return;
  link.hidden = false;
  const person = context.session.person;
  at("sign-out").hidden = !person;
  say(at("sign-out"), t("sign_out"));
  link.replaceChildren(
    ...(person ? [person.name, make("span", "role", ` (${t(`role_${person.role}`)})`)] : [t("sign_in")]),
  );
  link.href = `/sign-in?next=${encodeURIComponent(location.pathname + location.search)}`;
}

function drawStatus(status) {
  const version = at("footer").firstElementChild;
  if (version) say(version, `cnc-gateway ${status.version}`);
  document.body.dataset.state = status.state.word;
  say(at("machine"), status.machine);
  say(at("pill"), context.state(status.state.word));
  say(at("gate-pill"), status.gate.mode === "armed" ? t("armed_short") : "");
  at("gate-pill").className = `pill ${status.gate.mode === "armed" ? "armed" : ""}`;
}

/** The title is what is read in a row of tabs: it must not look alive either. */
function drawTitle(fresh, status) {
  const word = status ? context.state(status.state.word) : "";
  const title = status ? `${fresh === "yes" ? "" : `⚠ ${t("old")} `}${word} · ${status.machine}` : "cnc-gateway";
  if (document.title !== title) document.title = title;
}

/** A view that cannot draw what came would go on showing what came before: then nothing counts as fresh. */
let broken = null;
live.listeners.add((status) => {
  try {
    drawStatus(status);
    mounted?.update?.(status);
    broken = null;
  } catch (error) {
    if (!broken) console.error(error);
    broken = error;
    live.look();
  }
  drawTitle(live.fresh, status);
});
live.broken = () => broken !== null;

live.freshListeners.add((fresh, age) => {
  if (document.body.dataset.fresh !== fresh) document.body.dataset.fresh = fresh;
  say(at("link"), t(fresh === "yes" ? "live" : fresh === "no" ? "not_live" : "connecting"));
  if (fresh === "no") {
    const text = broken
      ? t("page_broken", broken.message)
      : live.status
        ? t("stale_since", duration((age ?? 0) / 1000), clock(live.status.at_ms))
        : t("stale_never");
    say(at("stale-text"), text);
  }
  drawTitle(fresh, live.status);
  mounted?.fresh?.(fresh);
});

document.addEventListener("click", (event) => {
  const link = event.target.closest?.("a[data-view]");
  if (!link || event.ctrlKey || event.metaKey || event.shiftKey || event.button) return;
  event.preventDefault();
  if (link.pathname + link.search !== location.pathname + location.search) {
    history.pushState(null, "", link.href);
    show();
  }
});
addEventListener("popstate", show);
at("language").addEventListener("click", () => {
  setLanguage(language() === "zh" ? "en" : "zh");
  show();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => show());

at("sign-out").addEventListener("click", async () => {
  await send("/api/v1/logout").catch(() => {});
  whoIsHere();
});

/** For tests and for whoever looks closely: when the newest status is from, in the clock of the box. */
globalThis.cncGateway = { live, view: () => mounted, when: () => (live.status ? dateTime(live.status.at_ms) : null) };

show();
live.start();
addEventListener("signed-out", () => {
  if (context.session?.person) whoIsHere();
});
function whoIsHere() {
  return ask("/api/v1/session")
    .then((session) => {
      context.session = session;
      drawPerson();
      mounted?.session?.(session);
    })
    .catch(() => {});
}
whoIsHere();
