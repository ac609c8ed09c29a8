//! Every view of the page in a real browser, with live data and a history: no fault in the console, no request off the box,
//! nothing wider than the window, no text that is cut, no English on a Chinese page, nothing that axe calls a serious barrier, both
//! languages, narrow and wide, light and dark.

use super::browser::{self, Browser};
use super::reading::{cut_texts, english_words, unfold};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use testkit::process::{Gateway, get, wait_for};

/// Every view, with an expression that is true when it has drawn what it shows.
const VIEWS: [(&str, &str); 10] = [
    ("now", "document.querySelector('.trend .uplot canvas')"),
    ("history", "document.getElementById('main').dataset.drawnMs"),
    ("wear", "document.querySelector('.lamp')?.textContent.length > 2"),
    ("thermal", "document.querySelector('.uplot canvas')"),
    ("twin", "document.querySelector('.verdict')?.textContent.length > 2"),
    ("rules", "document.querySelector('.editor-host')?.shadowRoot?.querySelector('.cm-line')"),
    ("audit", "document.querySelector('main table, main .empty')"),
    ("box", "document.querySelectorAll('main .card .row').length > 3"),
    ("setup", "document.querySelector('main .card')?.textContent.length > 20"),
    ("help", "document.querySelector('.handbook h1')"),
];

/// The script of axe-core: by `CNC_GATEWAY_AXE`, or of the package that npm has installed for everybody.
pub(super) fn axe() -> Option<String> {
    let global = || {
        let root = Command::new("npm").args(["root", "-g"]).output().ok()?;
        Some(PathBuf::from(String::from_utf8_lossy(&root.stdout).trim()).join("axe-core/axe.min.js"))
    };
    let path = std::env::var_os("CNC_GATEWAY_AXE").map(PathBuf::from).or_else(global);
    let text = path.and_then(|path| std::fs::read_to_string(path).ok());
    assert!(text.is_some() || std::env::var_os("CNC_GATEWAY_CI").is_none(), "no axe-core: npm install -g axe-core");
    if text.is_none() {
        eprintln!("SKIPPED: no axe-core here; `npm install -g axe-core` to look for barriers");
    }
    text
}

/// What axe finds serious or critical, with the element.
pub(super) fn barriers(browser: &mut Browser, axe: &str) -> Vec<String> {
    browser.value(&format!("{axe};0"));
    let found = browser.value(
        "axe.run(document, { runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa'], resultTypes: ['violations'] })
            .then((found) => found.violations.filter((it) => ['serious', 'critical'].includes(it.impact))
                .flatMap((it) => it.nodes.slice(0, 3).map((node) => `${it.id}: ${node.html.slice(0, 160)} ${node.failureSummary.slice(0, 240)}`)))",
    );
    found.as_array().into_iter().flatten().filter_map(Value::as_str).map(str::to_owned).collect()
}

/// Words on the page that no reader should see.
const STRAY: [&str; 5] = ["undefined", "NaN", "[object", "null", "Infinity"];

pub(super) fn base64(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => Some(c - b'A'),
        b'a'..=b'z' => Some(c - b'a' + 26),
        b'0'..=b'9' => Some(c - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let sixes: Vec<u32> = text.bytes().filter_map(value).map(u32::from).collect();
    let mut bytes = Vec::with_capacity(sixes.len() * 3 / 4);
    for four in sixes.chunks(4) {
        let all = four.iter().fold(0, |sum, six| sum << 6 | six) << (6 * (4 - four.len()));
        bytes.extend(all.to_be_bytes()[1..].iter().take(four.len() - 1));
    }
    bytes
}

/// Writes a picture where `CNC_GATEWAY_PICTURES` names a folder.
pub(super) fn picture(browser: &mut Browser, name: &str) {
    let Some(folder) = std::env::var_os("CNC_GATEWAY_PICTURES").map(PathBuf::from) else { return };
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join(format!("{name}.png")), base64(&browser.picture())).expect("written");
}

/// A box with a history of some hours, at sixty times real time.
fn started(directory: &Path) -> (Gateway, String) {
    let mut gateway = Gateway::start(&directory.join("data"), &["--speed", "60"]);
    let address = gateway.address();
    wait_for("a finished part", Duration::from_secs(60), || {
        let parts = get(&address, "/api/v1/parts?from=1990-01-01").json();
        (parts["rows"].as_array().is_some_and(|rows| rows.len() > 1)).then_some(())
    });
    (gateway, address)
}

/// One page: opened, waited for, and looked at in every way.
fn look(browser: &mut Browser, address: &str, axe: Option<&str>, (view, drawn): (&str, &str), how: (&str, u32, &str)) {
    let (language, width, scheme) = how;
    let name = format!("{view}-{language}-{width}-{scheme}");
    browser.size(width, if width < 600 { 844 } else { 1080 });
    browser.scheme(scheme);
    browser.open(&format!("http://{address}/{view}?lang={language}"));
    browser.wait_until("document.body?.dataset.fresh === 'yes'");
    browser.wait_until(&format!("document.body.dataset.view === '{view}' && Boolean({drawn})"));
    // What fades in has its colours only at the end of that.
    browser.wait_until("document.getAnimations().every(fade => fade.playState !== 'running')");
    let told = browser.value(
        "({ lang: document.documentElement.lang, wide: document.documentElement.scrollWidth - innerWidth,
            nav: document.querySelector('nav a').textContent, text: document.body.innerText })",
    );
    assert_eq!(told["lang"], if language == "zh" { "zh-CN" } else { "en" }, "{name}");
    assert_eq!(told["nav"], if language == "zh" { "实时" } else { "Now" }, "{name}");
    assert!(
        told["wide"].as_i64().is_some_and(|pixels| pixels <= 0),
        "{name} is wider than the window: {}",
        told["wide"]
    );
    let text = told["text"].as_str().expect("text");
    // A handbook and a script may say what they like.
    if !["help", "rules"].contains(&view) {
        let stray = STRAY.iter().find(|word| text.split_whitespace().any(|seen| seen.contains(**word)));
        assert_eq!(stray, None, "{name} says:\n{text}");
    }
    if let Some(axe) = axe {
        let found = barriers(browser, axe);
        assert!(found.is_empty(), "{name}:\n{}", found.join("\n"));
    }
    picture(browser, &name);
    unfold(browser);
    let cut = cut_texts(browser);
    assert!(cut.is_empty(), "{name}:\n{}", cut.join("\n"));
    if language == "zh" {
        let english = english_words(browser);
        assert!(english.is_empty(), "{name} is English here:\n{}", english.join("\n"));
    }
    let faults = browser.faults(address);
    assert!(faults.is_empty(), "{name}:\n{}", faults.join("\n"));
}

/// Each view narrow in both languages, and wide in Chinese.
#[test]
fn every_view_is_whole_narrow_and_wide() {
    every_view(&[("en", 390, "dark"), ("zh", 390, "light"), ("zh", 1920, "light")]);
}

/// `CNC_GATEWAY_PICTURES=/tmp/pictures cargo test --test box every_view_in_every -- --ignored`
#[test]
#[ignore = "8 minutes: every view in two languages, two widths, light and dark"]
fn every_view_in_every_way() {
    let mut ways = Vec::new();
    for language in ["en", "zh"] {
        for width in [390, 1920] {
            ways.extend(["light", "dark"].map(|scheme| (language, width, scheme)));
        }
    }
    every_view(&ways);
}

/// `CNC_GATEWAY_PICTURES=/tmp/pictures cargo test --test box forty_pictures -- --ignored`
#[test]
#[ignore = "4 minutes: forty pictures of the demonstration at its own pace, for a person to look at"]
fn forty_pictures_of_the_demonstration() {
    if !browser::is_there() {
        return;
    }
    let mut ways = Vec::new();
    for language in ["en", "zh"] {
        ways.extend([390, 1440].map(|width| (language, width, "light")));
    }
    let directory = tempfile::tempdir().expect("a directory");
    let mut gateway = Gateway::start(&directory.path().join("data"), &[]);
    let address = gateway.address();
    wait_for("the worn edge", Duration::from_secs(120), || {
        let alarms = get(&address, "/api/v1/status").json()["alarms"].to_string();
        alarms.contains("tool_worn").then_some(())
    });
    look_at_all(&ways, directory.path(), &address);
    gateway.stop();
}

fn every_view(ways: &[(&str, u32, &str)]) {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let (gateway, address) = started(directory.path());
    look_at_all(ways, directory.path(), &address);
    gateway.stop();
}

fn look_at_all(ways: &[(&str, u32, &str)], directory: &Path, address: &str) {
    let axe = axe();
    let mut browser = Browser::start(directory);
    for view in VIEWS {
        for way in ways {
            look(&mut browser, address, axe.as_deref(), view, *way);
        }
    }
}

/// What the address says is looked at, in seconds.
fn looked_at(browser: &mut Browser) -> f64 {
    let width = "(() => { const q = new URLSearchParams(location.search); return (Date.parse(q.get('to')) - Date.parse(q.get('from'))) / 1000; })()";
    browser.value(width).as_f64().unwrap_or(f64::NAN)
}

fn settled(browser: &mut Browser, was: f64) -> f64 {
    wait_for("another time", Duration::from_secs(20), || {
        let now = looked_at(browser);
        (now.is_finite() && (now - was).abs() > 0.5).then_some(now)
    })
}

#[test]
fn the_history_is_looked_at_with_wheel_drag_and_band() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let (gateway, address) = started(directory.path());
    let mut browser = Browser::start(directory.path());
    browser.size(1400, 1000);
    browser.open(&format!("http://{address}/history?lang=en"));
    browser.wait_until("document.getElementById('main')?.dataset.drawnMs && location.search.includes('from=')");
    let whole = looked_at(&mut browser);
    let place = browser.value("(() => { const b = document.querySelector('.charts .u-over').getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()");
    let (x, y) = (place[0].as_f64().expect("x"), place[1].as_f64().expect("y"));
    browser.call(
        "Input.dispatchMouseEvent",
        &json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": -300 }),
    );
    let near = settled(&mut browser, whole);
    assert!(near < whole, "the wheel zooms in: {whole} to {near}");
    let from = browser.value("new URLSearchParams(location.search).get('from')");
    mouse(&mut browser, (x, y), (x + 200.0, y));
    wait_for("an earlier time", Duration::from_secs(20), || {
        let now = browser.value("new URLSearchParams(location.search).get('from')");
        (now.as_str() < from.as_str()).then_some(())
    });
    let band = browser.value("(() => { const b = document.querySelector('.overview').getBoundingClientRect(); scrollTo(0, b.top - 100); const c = document.querySelector('.overview').getBoundingClientRect(); return [c.x, c.y + c.height / 2, c.width]; })()");
    let (left, y, wide) =
        (band[0].as_f64().expect("x"), band[1].as_f64().expect("y"), band[2].as_f64().expect("width"));
    let before = looked_at(&mut browser);
    let known = get(&address, "/api/v1/series").json();
    let [first_s, last_s] = ["first_ms", "last_ms"].map(|key| known[key].as_f64().expect("a time") / 1000.0);
    mouse(&mut browser, (left + 80.0, y), (left + wide - 20.0, y));
    let dragged = settled(&mut browser, before);
    let recorded = last_s - first_s;
    assert!(dragged > 0.7 * recorded, "the band looks at a long time in one drag: {dragged} s of {recorded} s");
    browser.value("[...document.querySelectorAll('.tabs button')][1].click()");
    browser.wait_until("document.querySelector('.tab-body table .bar')");
    browser.value("[...document.querySelectorAll('.tabs button')][0].click()");
    browser.wait_until(
        "document.querySelectorAll('.tab-body tbody tr').length > 0 && document.querySelector('.tab-body tbody .bar')",
    );
    let csv = browser.value("import('/web/history-data.js').then((it) => it.csv([{ channel: 'a_w', points: [[1000, 5], [2000, null]] }], 0, 10))");
    assert_eq!(csv, "time_utc,a_w\n1970-01-01T00:00:01.000Z,5\n1970-01-01T00:00:02.000Z,\n");
    assert_eq!(browser.faults(&address), Vec::<String>::new());
    gateway.stop();
}

fn mouse(browser: &mut Browser, from: (f64, f64), to: (f64, f64)) {
    let mut at = |kind: &str, (x, y): (f64, f64)| {
        browser.call(
            "Input.dispatchMouseEvent",
            &json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1 }),
        );
    };
    at("mousePressed", from);
    for step in 1..=8 {
        let share = f64::from(step) / 8.0;
        at("mouseMoved", (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1)));
    }
    at("mouseReleased", to);
}
