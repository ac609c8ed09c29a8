//! The settings of the scripts on the page: only for whoever may, by keyboard, with errors at the field; of two who change one
//! setting the second is told; a tool gets a value of its own; who changed it stands beside it.

use super::browser::{self, Browser};
use super::editing::{ask, person, sign_in};
use super::views::{axe, barriers, picture};
use serde_json::{Value, json};
use std::time::Duration;
use testkit::process::{Gateway, get, wait_for};

const SETTINGS: &str = "/api/v1/settings";
const LINE: &str = "document.getElementById('setting-constant_load-target_w')";
const FIELD: &str = "document.getElementById('value-constant_load-target_w-')";

fn open(browser: &mut Browser, address: &str, language: &str) {
    browser.open(&format!("http://{address}/rules?file=constant_load.rhai&lang={language}"));
    browser.wait_until(&format!(
        "document.body?.dataset.fresh === 'yes' && cncGateway.view()?.rules?.editor?.text && {LINE} && {FIELD}.offsetParent"
    ));
}

fn key(browser: &mut Browser, name: &str, text: &str) {
    let code = match name {
        "Tab" => 9,
        _ => 13,
    };
    for kind in ["keyDown", "keyUp"] {
        let mut event = json!({ "type": kind, "key": name, "code": name, "windowsVirtualKeyCode": code });
        if kind == "keyDown" {
            event["text"] = json!(text);
        }
        browser.call("Input.dispatchKeyEvent", &event);
    }
}

/// Types into a field that has the focus, in the place of what is there, and presses Enter.
fn enter(browser: &mut Browser, field: &str, text: &str) {
    browser.wait_until(&format!("{field} && !{field}.disabled"));
    browser.value(&format!("({field}.focus(), {field}.select(), 0)"));
    browser.call("Input.insertText", &json!({ "text": text }));
    key(browser, "Enter", "\r");
}

fn error(browser: &mut Browser) -> String {
    browser.wait_until(&format!("{LINE}.querySelector('[aria-invalid]')"));
    let told = format!("[...{LINE}.querySelectorAll('.setting-error')].map((it) => it.textContent).join('')");
    browser.value(&told).as_str().expect("text").to_owned()
}

fn target(address: &str) -> Value {
    let found = get(address, SETTINGS).json();
    let rows = found["settings"].as_array().expect("rows");
    rows.iter().find(|row| row["script"] == "constant_load" && row["name"] == "target_w").expect("declared").clone()
}

fn becomes(address: &str, what: &str, is: impl Fn(&Value) -> bool) -> Value {
    wait_for(what, Duration::from_secs(30), || Some(target(address)).filter(|row| is(row)))
}

/// Out of its range, and of the wrong kind: told at the field, and nothing is changed.
fn wrong_values(browser: &mut Browser, address: &str) {
    enter(browser, FIELD, "99999");
    assert_eq!(error(browser), "99999 is outside 0 … 50000 W.");
    let focus = browser.value(&format!("document.activeElement === {FIELD}"));
    assert_eq!(focus, json!(true), "the focus stays where the error is");
    enter(browser, FIELD, "much");
    assert_eq!(error(browser), "“much” is not a number.");
    assert_eq!(target(address)["chosen"], false);
    let (status, told) =
        ask(browser, "PUT", SETTINGS, &json!({ "script": "constant_load", "name": "target_w", "value": "much" }));
    assert_eq!(status, 400, "{told}");
}

/// Wu changes what Li is typing: Li is told, keeps what he typed, and may use it.
fn two_editors(browser: &mut Browser, address: &str, (li, wu): (&str, &str)) {
    browser.value(&format!("({FIELD}.value = '1900', {FIELD}.dispatchEvent(new Event('input')), 0)"));
    sign_in(browser, "Wu", wu);
    let asked = json!({ "script": "constant_load", "name": "target_w", "value": 2000, "began_from": "1800.0" });
    assert_eq!(ask(browser, "PUT", SETTINGS, &asked).0, 200);
    sign_in(browser, "Li", li);
    browser.value(&format!("({FIELD}.form.requestSubmit(), 0)"));
    assert!(error(browser).starts_with("Changed meanwhile by Wu: it is 2000 W now."), "{}", error(browser));
    assert_eq!(target(address)["value"], 2000.0, "nothing of Wu is lost");
    assert_eq!(browser.value(&format!("{FIELD}.value")), "1900", "nothing of Li is lost");
    browser.value(&format!("({FIELD}.form.requestSubmit(), 0)"));
    becomes(address, "the second time", |row| row["value"] == 1900.0);
    // The box has the value before the page has its answer. What is looked at next is the page.
    browser.wait_until(&format!("!{LINE}.querySelector('[aria-invalid]')"));
}

/// A tool that never came is asked about; after that it has a value of its own.
fn own_value(browser: &mut Browser, address: &str) {
    let which = format!("{LINE}.querySelector('.setting-add input')");
    enter(browser, &which, "T99");
    assert!(error(browser).starts_with("Tool T99 is not known here"), "{}", error(browser));
    key(browser, "Enter", "\r");
    enter(browser, "document.getElementById('value-constant_load-target_w-tool_T99')", "1500,5");
    let row = becomes(address, "the tool", |row| row["special"][0]["value"] == 1500.5);
    assert_eq!(row["special"][0]["tool"], "T99");
}

fn looks(browser: &mut Browser, address: &str) {
    let axe = axe();
    for (language, width, scheme) in
        [("en", 390, "dark"), ("en", 1920, "light"), ("zh", 390, "light"), ("zh", 1920, "dark")]
    {
        browser.size(width, if width < 600 { 844 } else { 1080 });
        browser.scheme(scheme);
        open(browser, address, language);
        browser.wait_until(&format!("cncGateway.view().rules.may() && !{FIELD}.disabled"));
        browser.value(&format!(
            "({FIELD}.value = '99999', {FIELD}.dispatchEvent(new Event('input')), {FIELD}.form.requestSubmit(), 0)"
        ));
        error(browser);
        let wide = browser.value("document.documentElement.scrollWidth - innerWidth");
        assert!(wide.as_i64().is_some_and(|pixels| pixels <= 0), "{language} {width}: {wide} pixels too wide");
        let nameless = "[...document.querySelectorAll('.settings input, .settings select, .settings button')]
            .filter((it) => !it.ariaLabel && !it.textContent).length";
        assert_eq!(browser.value(nameless), 0, "every field has a name");
        if let Some(axe) = &axe {
            let found = barriers(browser, axe);
            assert!(found.is_empty(), "{language} {width}:\n{}", found.join("\n"));
        }
        browser.value("(document.querySelector('.settings').scrollIntoView(), 0)");
        picture(browser, &format!("settings-{language}-{width}-{scheme}"));
    }
}

#[test]
fn a_setting_is_changed_on_the_page_and_two_persons_do_not_lose_what_they_typed() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &["--speed", "60"]);
    let address = gateway.address();
    let (li, wu) = (person(&data, "Li", "setter"), person(&data, "Wu", "setter"));
    let mut browser = Browser::start(directory.path());
    open(&mut browser, &address, "en");
    let every = "[...document.querySelectorAll('.setting-input input, .setting-input select')]";
    assert_eq!(browser.value(&format!("{every}.length > 30 && {every}.every((it) => it.disabled)")), json!(true));
    let asked = json!({ "script": "constant_load", "name": "target_w", "value": 1800 });
    assert_eq!(ask(&mut browser, "PUT", SETTINGS, &asked).0, 401, "nobody is signed in");
    wait_for("Li is known", Duration::from_secs(20), || {
        let told = ask(&mut browser, "POST", "/api/v1/login", &json!({ "name": "Li", "token": li }));
        (told.0 == 200).then_some(())
    });
    open(&mut browser, &address, "en");
    wrong_values(&mut browser, &address);
    enter(&mut browser, FIELD, "1800");
    let row = becomes(&address, "who changed it", |row| row["changes"][0]["by"] == "Li");
    assert_eq!(
        (&row["value"], &row["written"], &row["changes"][0]["after"]),
        (&json!(1800.0), &json!("1800.0"), &json!("1800.0"))
    );
    browser.wait_until(&format!("{LINE}.querySelector('.setting-who').textContent.startsWith('Li, ')"));
    two_editors(&mut browser, &address, (&li, &wu));
    own_value(&mut browser, &address);
    looks(&mut browser, &address);
    browser.size(1400, 1000);
    open(&mut browser, &address, "en");
    browser.value(&format!("({FIELD}.form.querySelector('button[type=button]').click(), 0)"));
    let row = becomes(&address, "the default", |row| row["chosen"] == false);
    assert_eq!(row["value"], row["default"]);
    gateway.stop();
}
