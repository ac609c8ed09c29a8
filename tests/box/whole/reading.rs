//! What a reader of a page meets: texts that are cut, and English words on a Chinese page.

use super::browser::Browser;
use serde_json::Value;

/// Elements that hold more than they show, or whose text lies outside of the window. A chart, the editor and what is hidden on purpose
/// are left out.
const CUT: &str = "(() => {
    const found = new Set();
    const width = document.documentElement.clientWidth;
    const hidden = (e) => { for (let it = e; it; it = it.parentElement) if (getComputedStyle(it).clipPath !== 'none') return true; return false; };
    for (const e of document.querySelectorAll('body *')) {
        const style = getComputedStyle(e);
        const place = e.getBoundingClientRect();
        if (!place.width || !place.height || style.visibility === 'hidden' || e.closest('svg, .uplot, .cm-editor, .editor-host')) continue;
        if (hidden(e)) continue;
        const name = `${e.tagName}.${e.className}: ${e.textContent.slice(0, 80)}`;
        if (style.overflowX !== 'visible' && e.clientWidth && e.scrollWidth > e.clientWidth + 1) found.add(`wider than what is shown: ${name}`);
        if (['hidden', 'clip'].includes(style.overflowY) && e.clientHeight && e.scrollHeight > e.clientHeight + 2) found.add(`higher than what is shown: ${name}`);
        const ownText = [...e.childNodes].some((it) => it.nodeType === 3 && it.textContent.trim());
        if (ownText && (place.right > width + 1 || place.left < -1)) found.add(`outside of the window: ${name}`);
    }
    return [...found];
})()";

/// Three or more English words in a row on a page that is read in Chinese. Left out are what is to be typed as it is and what the box
/// calls so (`code`, `pre`, the editor), what is said to be English (`lang`), and names that a person has given (`.typed`).
const ENGLISH: &str = "(() => {
    const found = new Set();
    const words = /[A-Za-z][A-Za-z'’]*(?:[ ,:;–-]+[A-Za-z][A-Za-z'’]*){2,}/g;
    const names = /^(?:NC-Link|Modbus TCP|OpenAPI|CHUCK PRESSURE LOW)/;
    const look = (text, where) => {
        for (const [all] of text.matchAll(words)) if (!names.test(all)) found.add(`${where}: ${all}`);
    };
    const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (walk.nextNode()) {
        const owner = walk.currentNode.parentElement;
        if (owner.closest('code, pre, script, style, noscript, .typed, .cm-editor, [lang=en]')) continue;
        look(walk.currentNode.textContent, owner.closest('.card')?.querySelector('h2, h3')?.textContent ?? owner.tagName);
    }
    for (const e of document.querySelectorAll('[title], [aria-label], [placeholder]'))
        for (const name of ['title', 'aria-label', 'placeholder'])
            if (e.hasAttribute(name) && !e.closest('[lang=en]')) look(e.getAttribute(name), name);
    return [...found];
})()";

fn list(found: &Value) -> Vec<String> {
    found.as_array().into_iter().flatten().filter_map(Value::as_str).map(str::to_owned).collect()
}

/// Unfolds everything: what stands in a fold is read too.
pub(super) fn unfold(browser: &mut Browser) {
    browser.value("document.querySelectorAll('main details').forEach((it) => { it.open = true; })");
}

/// Texts of the page that nobody can read to their end.
pub(super) fn cut_texts(browser: &mut Browser) -> Vec<String> {
    list(&browser.value(CUT))
}

/// English on a Chinese page.
pub(super) fn english_words(browser: &mut Browser) -> Vec<String> {
    list(&browser.value(ENGLISH))
}
