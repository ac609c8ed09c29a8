//! A script on the page, as a person edits it: a mistake is marked at its line and stays a draft; a good one is tried, run over
//! the history, put in charge, and taken back; of two who save, the second is told; arming asks for a token.

use super::browser::{self, Browser};
use serde_json::{Value, json};
use std::path::Path;
use std::time::Duration;
use testkit::process::{Gateway, run, stdout, text, wait_for};

const FILE: &str = "energy.rhai";

/// A new person; gives the token.
pub(super) fn person(data: &Path, name: &str, role: &str) -> String {
    let made = run(&["person", "add", name, "--role", role, "--data-dir", text(data)]);
    let said = stdout(&made);
    let token = said.split_whitespace().find(|word| word.matches('-').count() == 4);
    token
        .unwrap_or_else(|| panic!("no token: {said} {}", String::from_utf8_lossy(&made.stderr)))
        .trim_end_matches(';')
        .to_owned()
}

/// Asks as the page does; gives the status and the answer.
pub(super) fn ask(browser: &mut Browser, method: &str, path: &str, body: &Value) -> (u64, Value) {
    let told = browser.value(&format!(
        "fetch({}, {{ method: '{method}', headers: {{ 'content-type': 'application/json' }}, body: JSON.stringify({body}) }})
            .then(async (answer) => [answer.status, await answer.json().catch(() => null)])",
        json!(path)
    ));
    (told[0].as_u64().expect("a status"), told[1].clone())
}

pub(super) fn sign_in(browser: &mut Browser, name: &str, token: &str) {
    let (status, told) = ask(browser, "POST", "/api/v1/login", &json!({ "name": name, "token": token }));
    assert_eq!(status, 200, "{told}");
}

/// Presses a button of the view and waits until its work is done.
fn press(browser: &mut Browser, action: &str) -> String {
    let idle = "!cncGateway.view().rules.busy";
    browser.wait_until(&format!("{idle} && !cncGateway.view().rules.actions.{action}.disabled"));
    browser.value(&format!("cncGateway.view().rules.actions.{action}.click()"));
    browser.wait_until(idle);
    browser.value("cncGateway.view().rules.note.textContent").as_str().expect("text").to_owned()
}

fn typed(browser: &mut Browser, text: &str) {
    browser.value(&format!(
        "(() => {{ const it = cncGateway.view().rules; it.editor.open({0}); it.typed({0}); }})()",
        json!(text)
    ));
}

fn active_version(address: &str) -> String {
    let status = testkit::process::get(address, "/api/v1/status").json();
    let scripts = status["scripts"].as_array().expect("scripts").clone();
    let found = scripts.iter().find(|script| script["file"] == FILE).expect("it runs");
    found["version"].as_str().expect("a version").to_owned()
}

/// Out of charge with one click; the text stays as a draft and comes back with another one.
fn take_out_and_back(browser: &mut Browser, address: &str, path: &std::path::Path, (before, original): (&str, &str)) {
    assert!(press(browser, "remove").contains("is out of charge"));
    assert!(!path.exists(), "the rule is removed from the directory");
    wait_for("the box goes on without it", Duration::from_secs(20), || {
        let status = testkit::process::get(address, "/api/v1/status").json();
        status["scripts"].as_array()?.iter().all(|it| it["file"] != FILE).then_some(())
    });
    browser.wait_until("!cncGateway.view().rules.actions.activate.disabled");
    press(browser, "activate");
    wait_for("in charge again", Duration::from_secs(20), || {
        let status = testkit::process::get(address, "/api/v1/status").json();
        status["scripts"].as_array()?.iter().any(|it| it["version"] == before).then_some(())
    });
    assert_eq!(std::fs::read_to_string(path).expect("there"), original);
}

#[test]
fn a_script_is_edited_tried_run_over_the_history_put_in_charge_and_taken_back() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &["--speed", "60"]);
    let address = gateway.address();
    let (setter, viewer) = (person(&data, "Li", "setter"), person(&data, "Wang", "viewer"));
    let mut browser = Browser::start(directory.path());
    browser.open(&format!("http://{address}/rules?file={FILE}&lang=en"));
    browser.wait_until("document.body?.dataset.fresh === 'yes' && globalThis.cncGateway?.view()?.rules?.editor?.text");
    let original = browser.value("cncGateway.view().rules.editor.text").as_str().expect("text").to_owned();
    let before = active_version(&address);
    let rule = format!("/api/v1/rules/{FILE}");
    let changed = format!("{original}\n// Looked through.\n");
    let body = json!({ "text": changed, "digest": "" });
    let (status, _) = ask(&mut browser, "PUT", &format!("{rule}/draft"), &body);
    assert_eq!(status, 401, "nobody is signed in");
    wait_for("the person is known", Duration::from_secs(20), || {
        let told = ask(&mut browser, "POST", "/api/v1/login", &json!({ "name": "Wang", "token": viewer }));
        (told.0 == 200).then_some(())
    });
    let (status, told) = ask(&mut browser, "PUT", &format!("{rule}/draft"), &body);
    assert_eq!(status, 403, "a viewer changes nothing: {told}");
    let (status, told) = ask(&mut browser, "POST", "/api/v1/arm", &json!({ "token": "wrong" }));
    assert!([401, 403].contains(&status), "armed without a token: {status} {told}");
    sign_in(&mut browser, "Li", &setter);

    browser.open(&format!("http://{address}/rules?file={FILE}&lang=en"));
    browser.wait_until("globalThis.cncGateway?.view()?.rules?.editor?.text && cncGateway.view().rules.may()");
    typed(&mut browser, &format!("{original}\nlet broken = ;\n"));
    browser.wait_until("document.querySelector('.editor-host').shadowRoot.querySelector('.cm-lint-marker-error')");
    press(&mut browser, "activate");
    let note = browser.value("cncGateway.view().rules.note.textContent");
    assert!(note.as_str().is_some_and(|note| note.contains("stays a draft")), "{note}");
    assert_eq!(active_version(&address), before, "what fails its trials does not come into force");

    typed(&mut browser, &changed);
    assert_eq!(press(&mut browser, "save"), "The draft is saved; the version in charge goes on.");
    assert!(press(&mut browser, "trial").starts_with("All "));
    assert!(press(&mut browser, "backtest").contains("of history in"));
    assert!(
        browser.value("document.querySelector('.rules').innerText").as_str().expect("text").contains("alarms lost")
    );
    let (status, told) =
        ask(&mut browser, "PUT", &format!("{rule}/draft"), &json!({ "text": "let x = 1;", "digest": "0" }));
    assert_eq!(
        (status, told["title"].as_str().is_some_and(|it| it.contains("changed meanwhile"))),
        (409, true),
        "{told}"
    );
    assert!(press(&mut browser, "activate").starts_with("In charge from now on."));
    wait_for("the new version in force", Duration::from_secs(20), || {
        (active_version(&address) != before).then_some(())
    });

    browser.wait_until("cncGateway.view().rules.versions.querySelectorAll('button').length > 1");
    browser.value("cncGateway.view().rules.versions.querySelectorAll('button')[1].click()");
    browser.wait_until(&format!("cncGateway.view().rules.editor.text === {}", json!(original)));
    press(&mut browser, "activate");
    wait_for("the version before", Duration::from_secs(20), || (active_version(&address) == before).then_some(()));
    assert_eq!(std::fs::read_to_string(data.join("scripts").join(FILE)).expect("there"), original);

    take_out_and_back(&mut browser, &address, &data.join("scripts").join(FILE), (&before, &original));
    let audit = ask(&mut browser, "POST", "/api/v1/logout", &json!({}));
    assert_eq!(audit.0, 200);
    let rows = testkit::process::get(&address, "/api/v1/audit?limit=1000").json();
    let told: Vec<&Value> = rows["rows"].as_array().expect("rows").iter().filter(|row| row["person"] == "Li").collect();
    assert!(told.iter().any(|row| row["reason"].as_str().is_some_and(|it| it.contains("in the place of"))), "{told:?}");
    gateway.stop();
}
