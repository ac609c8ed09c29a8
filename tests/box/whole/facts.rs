//! Facts that a person adds on the page: a form in a real browser, for who may; each is there once, with the person's name.

use super::browser::{self, Browser};
use super::editing::{ask, person, sign_in};
use serde_json::json;
use std::time::Duration;
use testkit::process::{Gateway, get, wait_for};

/// Fills in the form and presses its button.
fn add(browser: &mut Browser, kind: &str, value: &str, parts: &str) {
    browser.value(&format!(
        "(() => {{ const form = document.querySelector('.facts-form'); const [kind] = form.querySelectorAll('select');
          kind.value = {}; kind.dispatchEvent(new Event('change'));
          const [value, parts] = form.querySelectorAll('input'); value.value = {}; parts.value = {};
          form.querySelector('button').click(); }})()",
        json!(kind),
        json!(value),
        json!(parts)
    ));
}

#[test]
fn a_person_tells_scrap_and_an_order_on_the_page() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &["--speed", "1"]);
    let address = gateway.address();
    let (setter, viewer) = (person(&data, "Li", "setter"), person(&data, "Wang", "viewer"));
    let mut browser = Browser::start(directory.path());
    browser.open(&format!("http://{address}/history?lang=en"));
    browser.wait_until("document.body?.dataset.fresh === 'yes'");
    let fact = json!({ "fact": "scrap", "parts": 1 });
    assert_eq!(ask(&mut browser, "POST", "/api/v1/facts", &fact).0, 401, "nobody is signed in");
    wait_for("the person is known", Duration::from_secs(20), || {
        let told = ask(&mut browser, "POST", "/api/v1/login", &json!({ "name": "Wang", "token": viewer }));
        (told.0 == 200).then_some(())
    });
    assert_eq!(ask(&mut browser, "POST", "/api/v1/facts", &fact).0, 403, "a viewer tells nothing");
    sign_in(&mut browser, "Li", &setter);
    browser.open(&format!("http://{address}/history?lang=en"));
    let tab = "[...document.querySelectorAll('.tabs button')].find((it) => it.textContent === 'Orders and scrap')";
    browser.wait_until(&format!("document.body?.dataset.fresh === 'yes' && {tab}"));
    wait_for("the form", Duration::from_secs(20), || {
        browser.value(&format!("{tab}.click()"));
        browser.value("Boolean(document.querySelector('.facts-form'))").as_bool().filter(|there| *there)
    });
    add(&mut browser, "order", "A-4711", "200");
    browser.wait_until("document.querySelector('.facts-form + .note').textContent === 'Stored.'");
    add(&mut browser, "scrap", "chatter", "2");
    let rows = wait_for("both are stored", Duration::from_secs(20), || {
        let rows = get(&address, "/api/v1/facts?from=-1h&to=now").json()["rows"].as_array()?.clone();
        (rows.len() == 2).then_some(rows)
    });
    for (row, (fact, value, parts)) in rows.iter().zip([("order", "A-4711", 200), ("scrap", "chatter", 2)]) {
        assert_eq!((&row["fact"], &row["value"], &row["parts"]), (&json!(fact), &json!(value), &json!(parts)), "{row}");
        assert!(
            row["way"] == "page" && row["author"].as_str().is_some_and(|author| author.starts_with("Li ")),
            "{row}"
        );
    }
    browser.wait_until("document.querySelector('.tab-body table')?.textContent.includes('chatter')");
    add(&mut browser, "scrap", "", "");
    browser.wait_until("document.querySelector('.facts-form + .note').textContent.includes('scrap needs parts')");
    assert_eq!(get(&address, "/api/v1/facts?from=-1h&to=now").json()["rows"].as_array().map(Vec::len), Some(2));
    let audit = get(&address, "/api/v1/audit").json();
    let of_facts = audit["rows"].as_array().expect("rows").iter().filter(|row| row["kind"] == "fact").count();
    assert_eq!(of_facts, 2, "each is in the audit");
    gateway.stop();
}
