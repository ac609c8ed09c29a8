//! The live page in a real browser, against a real box: what it shows is what the history holds.

use super::browser::{self, Browser};
use serde_json::Value;
use std::time::{Duration, Instant};
use testkit::process::{Gateway, get, run, stdout};

/// Texts that hold no number the history could know.
const SHOWN: [&str; 3] = ["spindle_power_w", "spindle_speed_rpm", "feed_mm_min"];

/// The five states of a machine's day.
const FIVE: [&str; 5] = ["off", "standby", "spindle_start", "idle", "cutting"];

#[test]
fn the_page_shows_what_the_history_holds() {
    page_and_history_agree("2400", 12);
}

/// `cargo test --release --test box whole::page -- --ignored --nocapture`
#[test]
#[ignore = "10 minutes: page and history agree after ten accelerated minutes"]
fn after_ten_accelerated_minutes_the_page_shows_what_the_history_holds() {
    page_and_history_agree("36000", 200);
}

/// Runs `for_s` seconds of machine time at sixty times real time and compares `wanted` moments of the page.
fn page_and_history_agree(for_s: &str, wanted: usize) {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let began = Instant::now();
    let mut gateway = Gateway::start(&data, &["--speed", "60", "--for", for_s]);
    let address = gateway.address();
    assert_eq!(get(&address, "/").status, 200);
    println!("first page after {:?}", began.elapsed());
    let mut browser = Browser::start(directory.path());
    browser.open(&format!("http://{address}/"));
    browser.wait_until("document.body?.dataset.fresh === 'yes'");
    browser.wait_until("document.getElementById('state')?.dataset.word === 'cutting'");
    languages(&mut browser);
    let moments = moments(&mut browser, wanted);
    chart(&mut browser);
    // The machine's time is over: the box ends by itself, and everything shown must be in the history.
    assert!(gateway.wait_at_most(Duration::from_secs(900)).success(), "{}", gateway.said());
    let database = data.join("history.db");
    let database = database.to_str().expect("a path");
    for (at_ms, shown) in &moments {
        compare(database, *at_ms, shown);
    }
    let seconds = seconds_per_state(database);
    assert!(FIVE.iter().all(|word| seconds.iter().any(|(state, _)| state == word)), "{seconds:?}");
    println!("{} moments of the page agree with the history; seconds per state: {seconds:?}", moments.len());
    browser.wait_until("document.body.dataset.fresh === 'no'");
}

fn seconds_per_state(database: &str) -> Vec<(String, f64)> {
    let sql = "SELECT state, sum(until_ns - since_ns) / 1e9 AS seconds FROM states GROUP BY state";
    let output = run(&["history", "query", "--history", database, "--json", "--sql", sql]);
    let answer: Value = serde_json::from_str(&stdout(&output)).unwrap_or_else(|error| panic!("{error}: {output:?}"));
    let rows = answer["rows"].as_array().expect("rows");
    rows.iter()
        .map(|row| (row["state"].as_str().expect("a word").to_owned(), row["seconds"].as_f64().expect("s")))
        .collect()
}

/// Several moments as the page shows them: its own time, state word and numbers.
fn moments(browser: &mut Browser, wanted: usize) -> Vec<(i64, Value)> {
    let read = "(() => {
        const tile = (name) => document.querySelector(`[data-quantity=${name}][data-value]`)?.dataset.value ?? null;
        return { at: Number(document.getElementById('state').dataset.ms), word: document.getElementById('state').dataset.word,
                 spindle_power_w: tile('spindle_power_w'), spindle_speed_rpm: tile('spindle_speed_rpm'), feed_mm_min: tile('feed_mm_min') };
    })()";
    let mut moments: Vec<(i64, Value)> = Vec::new();
    while moments.len() < wanted {
        let moment = browser.value(read);
        let at_ms = moment["at"].as_i64().expect("a time");
        if moments.last().is_none_or(|(last, _)| *last != at_ms) {
            moments.push((at_ms, moment));
        }
    }
    moments
}

/// One moment against `history query`.
fn compare(database: &str, at_ms: i64, shown: &Value) {
    let utc = |ms: i64| gateway::moment::format_utc(ms * 1_000_000);
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
    browser.value("document.documentElement.lang === 'en' || document.getElementById('language').click()");
    browser.wait_until("document.querySelector('nav a').textContent === 'Now'");
    browser.value("document.getElementById('language').click()");
    browser.wait_until("document.querySelector('nav a').textContent === '实时'");
    browser.value("document.getElementById('language').click()");
    browser.wait_until("document.querySelector('nav a').textContent === 'Now'");
    browser.wait_until("document.getElementById('state')?.dataset.ms");
}

/// Something was drawn: the line of the spindle power and the band of states in their colours.
fn chart(browser: &mut Browser) {
    for (canvas, colours) in [(".trend .uplot canvas", 8), (".trend canvas.ribbon", 2)] {
        browser.wait_until(&format!(
            "(() => {{
                const canvas = document.querySelector('{canvas}');
                if (!canvas?.width) return false;
                const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
                const colours = new Set();
                for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 100) colours.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
                return colours.size >= {colours};
            }})()"
        ));
    }
}
