//! The pictures of README, made of the demonstration by a command, each with the figures that it shows beside it.
//!
//! `tests/handbook/pictures.rs` adds those figures up, and holds each picture against the sum in its file.

use super::browser::{self, Browser};
use super::views::base64;
use serde_json::{Value as Json, json};
use sha2::{Digest, Sha256};
use std::path::Path;
use std::time::Duration;
use testkit::process::{Gateway, get, program, wait_for};

/// Holds back what the box tells while a picture is taken: figures and picture are of one moment.
const STANDS_STILL: &str = "(() => { const Own = EventSource; window.EventSource = class extends Own {
    addEventListener(kind, handle) { super.addEventListener(kind, (event) => window.standsStill || handle(event)); } }; })()";

/// Text of the figure of a part of the power, a number in watts.
const NOW: &str = "(() => { const watts = (it) => Number(it.textContent.replace(/[^0-9.-]/g, ''));
    const part = (key) => watts(document.querySelector(`[data-part=${key}] b`));
    const shown = [...document.querySelectorAll('[data-part] b')].every((it) => /\\d/.test(it.textContent));
    return { shown: shown && document.getElementById('state').dataset.word === 'cutting',
        sum_w: watts(document.querySelector('.power [data-quantity=spindle_power_w]')),
        parts_w: ['no_load_power_w', 'load_loss_w', 'cutting_power_w', 'rest'].map(part) }; })()";

/// Recorded is simulated plus the difference.
const TWIN: &str = "(() => { const rows = [...document.querySelectorAll('main .row')];
    const line = (what) => rows.find((it) => it.querySelector('.what')?.textContent === what)?.querySelector('.num').textContent ?? '';
    const watts = (what) => Number(line(what).replace(/[^0-9.-]/g, ''));
    const names = ['Recorded', 'Simulated', 'Recorded minus simulated'];
    return { shown: names.every((it) => /\\d/.test(line(it))) && watts('Recorded') > 300,
        sum_w: watts('Recorded'), parts_w: [watts('Simulated'), watts('Recorded minus simulated')] }; })()";

/// Takes the picture of one view when it shows what it should, and writes it with its figures.
fn take_picture(browser: &mut Browser, address: &str, name: &str, figures: &str) {
    browser.open(&format!("http://{address}/{name}?lang=en"));
    browser.wait_until("document.body?.dataset.fresh === 'yes' && document.querySelector('.uplot canvas')");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("gateway/handbook/pictures");
    wait_for(name, Duration::from_secs(120), || {
        browser.value("window.standsStill = true; 0");
        browser.wait_until("document.getAnimations().every((it) => it.playState !== 'running')");
        let before = browser.value(figures);
        let picture = base64(&browser.picture_of_window());
        let whole = before == browser.value(figures) && browser.value("document.body.dataset.fresh") == "yes";
        browser.value("window.standsStill = false; 0");
        if before["shown"] != true || !whole {
            return None;
        }
        let sum: String = Sha256::digest(&picture).iter().map(|byte| format!("{byte:02x}")).collect();
        let told = json!({ "picture": format!("{name}.png"), "sha256": sum, "sum_w": before["sum_w"], "parts_w": before["parts_w"] });
        std::fs::write(folder.join(format!("{name}.png")), picture).expect("written");
        std::fs::write(folder.join(format!("{name}.json")), format!("{told:#}\n")).expect("written");
        println!("{name}: {told}");
        Some(())
    });
}

/// `cargo test --test box pictures_of_the_readme -- --ignored`
#[test]
#[ignore = "2 minutes: makes the pictures of README anew, in the tree"]
fn pictures_of_the_readme_are_made() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::Builder::new().prefix("demonstration-").tempdir().expect("a directory");
    // In its own folder, so that a picture shows the path that a reader has.
    let mut command = program();
    command.current_dir(directory.path()).args(["run", "--data-dir", "cnc-gateway-data", "--listen", "127.0.0.1:0"]);
    let mut gateway = Gateway::spawn(command);
    let address = gateway.address();
    wait_for("the worn edge", Duration::from_secs(120), || {
        let alarms: Json = get(&address, "/api/v1/status").json()["alarms"].clone();
        alarms.to_string().contains("tool_worn").then_some(())
    });
    let mut browser = Browser::start(directory.path());
    browser.size(1280, 1000);
    browser.call("Emulation.setScrollbarsHidden", &json!({ "hidden": true }));
    browser.before_every_document(STANDS_STILL);
    take_picture(&mut browser, &address, "now", NOW);
    take_picture(&mut browser, &address, "twin", TWIN);
    gateway.stop();
}
