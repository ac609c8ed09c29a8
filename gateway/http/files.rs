//! The files of the page, part of the binary: nothing is loaded from elsewhere, and no build step makes them.

const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const SVG: &str = "image/svg+xml";

/// Name below `/web/`, type, content.
pub(super) struct WebFile {
    pub(super) name: &'static str,
    pub(super) kind: &'static str,
    pub(super) content: &'static str,
}

macro_rules! files {
    ($($kind:ident $name:literal from $path:literal,)*) => {
        &[$(WebFile { name: $name, kind: $kind, content: include_str!(concat!("../web/", $path)) },)*]
    };
}

/// The one document; every view is this with another address.
pub(super) const INDEX: &str = include_str!("../web/index.html");

/// Every file that is served below `/web/`.
pub(super) static FILES: &[WebFile] = files! {
    SVG "icon.svg" from "icon.svg",
    CSS "theme.css" from "theme.css",
    CSS "page.css" from "page.css",
    CSS "views.css" from "views.css",
    SCRIPT "page.js" from "page.js",
    SCRIPT "live.js" from "live.js",
    SCRIPT "parts.js" from "parts.js",
    SCRIPT "format.js" from "format.js",
    SCRIPT "words.js" from "words.js",
    SCRIPT "word-table.js" from "word-table.js",
    SCRIPT "words-frame.js" from "words/frame.js",
    SCRIPT "words-now.js" from "words/now.js",
    SCRIPT "words-history.js" from "words/history.js",
    SCRIPT "words-wear.js" from "words/wear.js",
    SCRIPT "words-thermal.js" from "words/thermal.js",
    SCRIPT "words-twin.js" from "words/twin.js",
    SCRIPT "words-rules.js" from "words/rules.js",
    SCRIPT "words-audit.js" from "words/audit.js",
    SCRIPT "words-system.js" from "words/system.js",
    SCRIPT "box-texts.js" from "box-texts.js",
    SCRIPT "box-sentences.js" from "box-sentences.js",
    SCRIPT "device-sentences.js" from "device-sentences.js",
    SCRIPT "script-sentences.js" from "script-sentences.js",
    SCRIPT "gaps.js" from "gaps.js",
    SCRIPT "plot.js" from "plot.js",
    SCRIPT "ribbon.js" from "ribbon.js",
    SCRIPT "history-data.js" from "history-data.js",
    SCRIPT "history-tables.js" from "history-tables.js",
    SCRIPT "editor.js" from "editor.js",
    SCRIPT "now.js" from "views/now.js",
    SCRIPT "now-alarms.js" from "views/now/alarms.js",
    SCRIPT "now-values.js" from "views/now/values.js",
    SCRIPT "now-feed.js" from "views/now/feed.js",
    SCRIPT "now-power.js" from "views/now/power.js",
    SCRIPT "history.js" from "views/history.js",
    SCRIPT "history-charts.js" from "views/history/charts.js",
    SCRIPT "history-overview.js" from "views/history/overview.js",
    SCRIPT "history-facts.js" from "views/history/facts.js",
    SCRIPT "wear.js" from "views/wear.js",
    SCRIPT "wear-edge.js" from "views/wear/edge.js",
    SCRIPT "wear-figure.js" from "views/wear/figure.js",
    SCRIPT "thermal.js" from "views/thermal.js",
    SCRIPT "twin.js" from "views/twin.js",
    SCRIPT "diagnosis.js" from "views/diagnosis.js",
    SCRIPT "diagnosis-asking.js" from "views/diagnosis/asking.js",
    SCRIPT "brought.js" from "views/brought.js",
    SCRIPT "brought-sending.js" from "views/brought/sending.js",
    SCRIPT "system.js" from "views/system.js",
    SCRIPT "system-care.js" from "views/system/care.js",
    SCRIPT "system-doctor.js" from "views/system/doctor.js",
    SCRIPT "system-recipe.js" from "views/system/recipe.js",
    SCRIPT "system-persons.js" from "views/system/persons.js",
    SCRIPT "setup.js" from "views/setup.js",
    SCRIPT "setup-form.js" from "views/setup/form.js",
    SCRIPT "box.js" from "views/box.js",
    SCRIPT "rules.js" from "views/rules.js",
    SCRIPT "rules-new.js" from "views/rules/new.js",
    SCRIPT "rules-results.js" from "views/rules/results.js",
    SCRIPT "settings.js" from "views/settings.js",
    SCRIPT "settings-line.js" from "views/settings/line.js",
    SCRIPT "settings-field.js" from "views/settings/field.js",
    SCRIPT "settings-texts.js" from "views/settings/texts.js",
    SCRIPT "audit.js" from "views/audit.js",
    SCRIPT "help.js" from "views/help.js",
    CSS "uplot.css" from "vendor/uplot.min.css",
    SCRIPT "uplot.js" from "vendor/uplot.min.js",
    SCRIPT "codemirror.js" from "vendor/codemirror.min.js",
    SCRIPT "marked.js" from "vendor/marked.min.js",
};
