//! A foreign file on the page, from the drop to the report: a workbook of a German office is understood, a column is corrected by a click, it is compared
//! with a kind of machine, and the report is read. An example is diagnosed in one click and its truth told. A rule is made new.

use super::browser::{self, Browser};
use super::editing::{ask, person, sign_in};
use serde_json::{Value, json};
use std::path::Path;
use std::time::{Duration, Instant};
use testkit::process::{Gateway, get, wait_for};

/// Opens the view of the twin for somebody who may bring files.
pub(super) fn open_twin(browser: &mut Browser, address: &str, token: &str) {
    browser.open(&format!("http://{address}/twin?lang=en"));
    browser.wait_until("document.querySelector('.drop-zone')");
    sign_in(browser, "Li", token);
    browser.open(&format!("http://{address}/twin?lang=en"));
    browser.wait_until(
        "document.querySelector('.drop-zone button') && !document.querySelector('.drop-zone button').disabled",
    );
}

/// Drops a file of the tests on the zone, as a hand does.
fn drop_file(browser: &mut Browser, path: &Path, name: &str) {
    let bytes: Vec<u8> = std::fs::read(path).expect("a file");
    browser.value(&format!(
        "(() => {{ const data = new DataTransfer(); data.items.add(new File([new Uint8Array({bytes:?})], {0}));
            document.querySelector('.drop-zone').dispatchEvent(new DragEvent('drop', {{ dataTransfer: data, bubbles: true, cancelable: true }})); }})()",
        json!(name)
    ));
}

pub(super) fn finished(address: &str) -> Value {
    wait_for("the diagnosis of the file", Duration::from_secs(900), || {
        let run = get(address, "/api/v1/files-diagnosis").json();
        (!["none", "running"].contains(&run["state"].as_str().unwrap_or_default())).then_some(run)
    })
}

pub(super) fn press(browser: &mut Browser, text: &str) {
    let find = format!(
        "[...document.querySelectorAll('main button')].find((it) => it.textContent === {} && !it.disabled)",
        json!(text)
    );
    browser.wait_until(&find);
    browser.value(&format!("{find}.click()"));
}

#[test]
fn a_foreign_file_is_dropped_understood_mapped_and_diagnosed_on_the_page() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &[]);
    let address = gateway.address();
    let token = person(&data, "Li", "setter");
    let mut browser = Browser::start(directory.path());
    open_twin(&mut browser, &address, &token);
    let began = Instant::now();
    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/foreign");
    drop_file(&mut browser, &files.join("excel_de.xlsx"), "Messung Müller.xlsx");
    browser.wait_until("document.querySelector('.brought h3')?.textContent === 'Messung Müller.xlsx'");
    let told = browser.value("document.querySelector('.brought').textContent");
    let told = told.as_str().expect("text");
    for words in ["640 rows", "Spindelleistung [kW] -> spindle_power_w (1000x)", "local time"] {
        assert!(told.contains(words), "{words} in {told}");
    }
    // A column that the office called something of its own is left out by a click.
    let put = "(() => { const input = [...document.querySelectorAll('.brought input')].find((it) => it.value === 'coolant_on'); input.value = ''; })()";
    browser.value(put);
    press(&mut browser, "Read it so");
    browser.wait_until("[...document.querySelectorAll('.brought th')].every((it) => it.textContent !== 'coolant_on')");
    press(&mut browser, "Diagnose");
    let done = finished(&address);
    assert_eq!(done["state"], "done", "{done}");
    browser.wait_until("document.querySelector('.diagnosis a.button-link')");
    println!("from the drop to the answer on the page: {:.0} s", began.elapsed().as_secs_f64());
    let page = get(&address, &format!("/api/v1/diagnoses/{}/page?lang=zh", done["key"].as_str().expect("a key")));
    assert_eq!(page.status, 200);
    assert!(page.body.contains("lang=\"zh\""), "{}", &page.body[..300]);
    example(&mut browser, &address);
    let faults = browser.faults(&address);
    assert!(faults.is_empty(), "{faults:?}");
    new_rule(&mut browser, &address);
    // A refused request is told among the faults of the browser: they were looked at before.
    let files = get(&address, "/api/v1/files").json();
    let key = json!({ "key": files["diagnoses"][0]["key"] });
    let (status, told) = ask(&mut browser, "POST", "/api/v1/twin/model", &key);
    assert!((400..500).contains(&status), "the model of an example was taken over: {told}");
    gateway.stop();
}

fn example(browser: &mut Browser, address: &str) {
    let (status, _) = ask(browser, "POST", "/api/v1/gallery/axis", &json!({}));
    assert_eq!(status, 200);
    let done = finished(address);
    assert_eq!(done["state"], "done", "{done}");
    let files = get(address, "/api/v1/files").json();
    assert_eq!(files["diagnoses"][0]["truth"], "axis", "{files}");
    let refused = &files["diagnoses"][0]["refused"];
    assert!(refused["en"].as_str().is_some_and(|why| why.contains("this is an example")), "{refused}");
    let truth = get(address, "/api/v1/gallery/axis/truth").json();
    assert!(truth["en"].as_str().is_some_and(|text| text.contains("Dry friction")), "{truth}");
    println!("the axis of the gallery: {}", files["diagnoses"][0]["summary"]);
}

fn new_rule(browser: &mut Browser, address: &str) {
    browser.open(&format!("http://{address}/rules?lang=en"));
    browser.wait_until("document.querySelector('.editor-host')?.shadowRoot?.querySelector('.cm-line')");
    press(browser, "New rule");
    browser.wait_until("document.querySelector('dialog input')");
    browser.value("(() => { document.querySelector('dialog input').value = 'parts_of_li'; document.querySelector('dialog .primary').click(); })()");
    browser.wait_until("cncGateway.view().rules.current === 'parts_of_li.rhai'");
    browser.wait_until("!cncGateway.view().rules.busy && !cncGateway.view().rules.actions.activate.disabled");
    browser.value("cncGateway.view().rules.actions.activate.click()");
    wait_for("the new rule in charge", Duration::from_secs(20), || {
        let scripts = get(address, "/api/v1/status").json()["scripts"].clone();
        scripts.as_array()?.iter().any(|script| script["file"] == "parts_of_li.rhai").then_some(())
    });
}
