//! The live page in a real browser, against a real box: what it shows is what the history holds.

use super::browser::{self, Browser};
use super::process::{Gateway, run, stdout};
use serde_json::Value;

/// Texts that hold no number the history could know.
const SHOWN: [&str; 3] = ["spindle_power_w", "spindle_speed_rpm", "feed_mm_min"];

#[test]
fn the_page_shows_what_the_history_holds() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &["--speed", "60", "--for", "2400"]);
    let address = gateway.address();
    let mut browser = Browser::start(directory.path());
    browser.open(&format!("http://{address}/"));
    browser.wait_until("document.body?.dataset.connected === 'true'");
    browser.wait_until("document.getElementById('state').dataset.word === 'cutting'");
    languages(&mut browser);
    let shots = shots(&mut browser);
    chart(&mut browser);
    // The machine's forty minutes are over: the box ends by itself, and everything shown must be in the history.
    assert!(gateway.wait().success(), "{}", gateway.said());
    assert!(shots.len() >= 10, "{} different moments were seen", shots.len());
    let database = data.join("history.db");
    for (at_ms, shown) in shots {
        compare(database.to_str().expect("a path"), at_ms, &shown);
    }
    browser.wait_until("document.body.dataset.connected === 'false'");
}

/// Several moments as the page shows them: its own time, state word and numbers.
fn shots(browser: &mut Browser) -> Vec<(i64, Value)> {
    let read = "(() => {
        const tile = (name) => document.querySelector(`[data-quantity=${name}] [data-value]`)?.dataset.value ?? null;
        return { at: Number(document.getElementById('clock').dataset.ms), word: document.getElementById('state').dataset.word,
                 spindle_power_w: tile('spindle_power_w'), spindle_speed_rpm: tile('spindle_speed_rpm'), feed_mm_min: tile('feed_mm_min') };
    })()";
    let mut shots: Vec<(i64, Value)> = Vec::new();
    while shots.len() < 12 {
        let shot = browser.value(read);
        let at_ms = shot["at"].as_i64().expect("a time");
        if shots.last().is_none_or(|(last, _)| *last != at_ms) {
            shots.push((at_ms, shot));
        }
    }
    shots
}

/// One moment against `history query`.
fn compare(database: &str, at_ms: i64, shown: &Value) {
    let utc = |ms: i64| gateway::moment::utc(ms * 1_000_000);
    let (from, to) = (utc(at_ms), utc(at_ms + 1));
    let names = format!("machine_state,{}", SHOWN.join(","));
    let arguments =
        ["history", "query", "--history", database, "--from", &from, "--to", &to, "--channels", &names, "--json"];
    let output = run(&arguments);
    let answer: Value = serde_json::from_str(&stdout(&output)).unwrap_or_else(|error| panic!("{error}: {output:?}"));
    for series in answer["series"].as_array().expect("series") {
        let name = series["channel"].as_str().expect("a name");
        let stored = &series["points"][0][1];
        if name == "machine_state" {
            assert_eq!(stored, &shown["word"], "state at {from}: {answer}");
            continue;
        }
        match shown[name].as_str().map(|text| text.parse::<f64>().expect("a number")) {
            // The history keeps a tenth of these units.
            Some(value) => {
                let stored = stored.as_f64().unwrap_or(f64::NAN);
                assert!((stored - value).abs() <= 0.051, "{name} at {from}: page {value}, history {stored}");
            }
            None => assert!(stored.is_null(), "{name} at {from}: the page has none, the history {stored}"),
        }
    }
}

fn languages(browser: &mut Browser) {
    browser.value("localStorage.setItem('language', 'en'); document.getElementById('language').textContent === '中文' || document.getElementById('language').click()");
    browser.wait_until("document.querySelector('[data-text=state]').textContent === 'Machine state'");
    browser.value("document.getElementById('language').click()");
    browser.wait_until("document.querySelector('[data-text=state]').textContent === '机床状态'");
    browser.value("document.getElementById('language').click()");
}

/// Something was drawn: the line of the spindle power and the band of states in their colours.
fn chart(browser: &mut Browser) {
    browser.wait_until(
        "(() => {
            const canvas = document.getElementById('plot');
            const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
            const colours = new Set();
            for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200) colours.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
            return colours.size > 20;
        })()",
    );
}
