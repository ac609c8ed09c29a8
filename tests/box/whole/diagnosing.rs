//! A diagnosis from the page: refused to whoever may not, begun over a chosen time, ended, begun again, its report read, its model
//! taken over. All of it stands in the audit.

use super::browser::{self, Browser};
use super::editing::{ask, person, sign_in};
use super::twin::{MODEL, configure, hours, start};
use serde_json::{Value, json};
use std::time::Duration;
use testkit::process::{get, run, stdout, text, wait_for};

/// The lathe as its integrator wrote it down before anybody had thought of losses under load.
fn without_losses() -> String {
    let (before, after) = MODEL.split_once("[[effect]]\nkind = \"load_loss\"").expect("there");
    let after = after.split_once("[[effect]]\nkind = \"flank_wear\"").expect("there").1;
    format!("{before}[[effect]]\nkind = \"flank_wear\"{after}")
}

fn run_of(address: &str) -> Value {
    get(address, "/api/v1/diagnosis").json()
}

#[test]
fn a_chosen_time_is_diagnosed_ended_read_and_its_model_taken_over() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let place = directory.path();
    configure(place, "", &without_losses());
    hours(place, 2);
    let mut gateway = start(place, &["--speed", "2"]);
    let address = gateway.address();
    let data = place.join("data");
    let token = person(&data, "Li", "setter");
    let mut browser = Browser::start(place);
    browser.open(&format!("http://{address}/twin?lang=en"));
    browser.wait_until("document.body?.dataset.fresh === 'yes' && document.querySelector('.card .primary')");
    asked_and_ended(&mut browser, &address, &token);

    browser.open(&format!("http://{address}/twin?lang=en"));
    browser
        .wait_until("document.querySelector('.card .primary') && !document.querySelector('.card .primary').disabled");
    let press = "(() => { const all = [...document.querySelectorAll('main button')]; all.find((it) => it.textContent === 'last 1 h').click();
                   all.find((it) => it.textContent === 'Diagnose').click(); return all.length; })()";
    browser.value(press);
    browser.wait_until("[...document.querySelectorAll('progress')].some((bar) => !bar.hidden)");
    let done = wait_for("the diagnosis", Duration::from_secs(900), || {
        let run = run_of(&address);
        (run["state"] != "running").then_some(run)
    });
    assert_eq!(done["state"], "done", "{done}");
    println!("a diagnosis of an hour took {} s", done["seconds"]);
    let key = done["key"].as_str().expect("a key").to_owned();
    let found = wait_for("the row", Duration::from_secs(20), || {
        let twin = get(&address, "/api/v1/twin").json();
        (twin["diagnoses"][0]["key"] == json!(key)).then(|| twin["diagnoses"][0].clone())
    });
    assert!(found["summary_zh"].as_str().is_some_and(|words| words.chars().any(|c| c > '\u{4e00}')), "{found}");
    browser.wait_until("document.querySelector('.diagnosis a.button-link')");
    let faults = browser.faults(&address);
    let faults: Vec<&String> =
        faults.iter().filter(|it| !["401", "400", "409"].iter().any(|code| it.contains(code))).collect();
    assert!(faults.is_empty(), "{faults:?}");
    report(&mut browser, &address, &key);
    if found["model"] == true {
        accept(&mut browser, &key, &place.join("model.toml"));
        gateway.wait_said("is compared with the machine");
    } else {
        panic!("the diagnosis names nothing: {found}");
    }
    gateway.stop();
    let database = data.join("history.db");
    let output = run(&[
        "history",
        "query",
        "--history",
        text(&database),
        "--sql",
        "SELECT reason FROM audit WHERE kind = 'change'",
    ]);
    let rows = stdout(&output);
    for words in ["a diagnosis of ", "the diagnosis is ended", "in the place of"] {
        assert!(rows.contains(words), "{rows}");
    }
}

/// Who may ask, for what, how many at once; and the end of what is under way.
fn asked_and_ended(browser: &mut Browser, address: &str, token: &str) {
    let stretch = json!({ "from": "-1h", "to": "-0s" });
    let (status, _) = ask(browser, "POST", "/api/v1/diagnosis", &stretch);
    assert_eq!(status, 401, "nobody is signed in");
    sign_in(browser, "Li", token);
    let (status, told) = ask(browser, "POST", "/api/v1/diagnosis", &json!({ "from": "-10s", "to": "-0s" }));
    assert_eq!(status, 400, "{told}");
    let (status, told) = ask(browser, "POST", "/api/v1/diagnosis", &stretch);
    assert_eq!(status, 200, "{told}");
    let (status, told) = ask(browser, "POST", "/api/v1/diagnosis", &stretch);
    assert_eq!(status, 409, "one at a time: {told}");
    wait_for("the work", Duration::from_secs(60), || (run_of(address)["stage"] == "reading").then_some(()));
    let status = browser.value("fetch('/api/v1/diagnosis', { method: 'DELETE' }).then((answer) => answer.status)");
    assert_eq!(status, 200);
    let ended = wait_for("its end", Duration::from_secs(20), || {
        let run = run_of(address);
        (run["state"] != "running").then_some(run)
    });
    assert_eq!((&ended["state"], &ended["by"]), (&json!("cancelled"), &json!("Li")));
}

/// The report is a page that reads as it was drawn, with nothing that its policy refuses.
fn report(browser: &mut Browser, address: &str, key: &str) {
    for lang in ["en", "zh"] {
        browser.open(&format!("http://{address}/api/v1/diagnoses/{key}/page?lang={lang}"));
        browser.wait_until("document.querySelector('section.verdict h1')");
        let bars = browser.value("[...document.querySelectorAll('[data-style]')].filter((it) => it.getBoundingClientRect().width > 0).length");
        assert!(bars.as_i64().is_some_and(|count| count > 0), "bars are drawn: {bars}");
        let faults = browser.faults(address);
        assert!(faults.is_empty(), "{faults:?}");
    }
    let plan = get(address, &format!("/api/v1/diagnoses/{key}/plan"));
    assert!(plan.status == 404 || plan.body.starts_with("time_s,run,operation"), "{}", plan.body);
    assert_eq!(get(address, "/api/v1/diagnoses/1-f/page").status, 404);
    assert_eq!(get(address, "/api/v1/diagnoses/..%2F..%2Fpersons/page").status, 404);
    browser.open(&format!("http://{address}/twin?lang=en"));
    browser.wait_until("document.querySelector('.diagnosis a.button-link')");
}

fn accept(browser: &mut Browser, key: &str, model: &std::path::Path) {
    let before = std::fs::read_to_string(model).expect("a model");
    let (status, told) = ask(browser, "POST", "/api/v1/twin/model", &json!({ "key": key }));
    assert_eq!(status, 200, "{told}");
    let after = std::fs::read_to_string(model).expect("a model");
    assert_ne!(before, after);
    assert_eq!(std::fs::read_to_string(model.with_extension("before.toml")).expect("kept"), before);
}
