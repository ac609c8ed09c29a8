//! What an integrator needs of the box itself, on the page: the configuration in force, a doctor, a receiver that cannot be reached, the
//! recipe edited by two, a backup and its way back, an archive for support without secrets.

use super::browser::{self, Browser};
use super::editing::{ask, person, sign_in};
use serde_json::json;
use std::path::Path;
use std::time::Duration;
use testkit::process::{Gateway, get, program, text, wait_for};

const RECIPE: &str =
    "schema = \"operations/1\"\n[[operation]]\nprogram = \"O1\"\nname = \"rough\"\ndepth_of_cut_mm = 1.5\n";

fn started(place: &Path) -> Gateway {
    std::fs::create_dir_all(place.join("data/scripts")).expect("a folder");
    std::fs::write(place.join("data/scripts/mine.rhai"), "request_feed_override(90, \"mine\");").expect("written");
    std::fs::write(place.join("recipe.toml"), RECIPE).expect("written");
    let config = "[gateway]\nname = \"Seven\"\ndata_dir = \"data\"\n[operations]\npath = \"recipe.toml\"\n[http]\nshifts = \"5:30 17:30\"\n\
                  [[source]]\nname = \"lathe\"\naddress = \"simulated://lathe\"\n[[sink]]\nname = \"plant\"\naddress = \"mqtt://127.0.0.1:9/plant\"\n";
    std::fs::write(place.join("box.toml"), config).expect("written");
    let mut command = program();
    command.current_dir(place).args(["run", "--config", "box.toml", "--listen", "127.0.0.1:0"]);
    Gateway::spawn(command)
}

/// Names and texts of an archive, unpacked by the browser itself, as one text.
fn unpacked(browser: &mut Browser, path: &str) -> String {
    let script = format!(
        "fetch('{path}').then(async (answer) => {{ globalThis.taken = await answer.blob();
            return answer.status + ' ' + await new Response(taken.stream().pipeThrough(new DecompressionStream('gzip'))).text(); }})"
    );
    browser.value(&script).as_str().expect("text").to_owned()
}

#[test]
fn the_box_itself_is_looked_after_from_the_page() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let place = directory.path();
    let mut gateway = started(place);
    let address = gateway.address();
    let token = person(&place.join("data"), "Root", "admin");
    let mut browser = Browser::start(place);
    browser.open(&format!("http://{address}/box?lang=en"));
    browser.wait_until("document.body?.dataset.fresh === 'yes'");
    for (method, path) in [("POST", "/api/v1/doctor"), ("POST", "/api/v1/restore"), ("PUT", "/api/v1/operations")] {
        assert_eq!(ask(&mut browser, method, path, &json!({})).0, 401, "{path}");
    }
    assert_eq!((get(&address, "/api/v1/backup").status, get(&address, "/api/v1/support").status), (401, 401));
    sign_in(&mut browser, "Root", &token);
    browser.open(&format!("http://{address}/box?lang=en"));
    browser.wait_until(
        "document.body?.dataset.fresh === 'yes' && document.querySelectorAll('.recipe tbody tr').length === 1",
    );
    browser.wait_until("document.body.innerText.includes('5:30 17:30')");
    configuration(&mut browser, &address);
    wait_for("the sink that fails", Duration::from_secs(30), || {
        let status = get(&address, "/api/v1/status").json();
        (status["sinks"][0]["failing"] == true).then_some(())
    });
    browser
        .wait_until("document.body.innerText.includes('plant') && document.body.innerText.includes('At the moment:')");
    let shifts = get(&address, "/api/v1/utilisation?by=shift").json();
    assert_eq!(shifts["shifts"], json!(["5:30", "17:30"]), "{shifts}");
    doctor(&mut browser);
    recipe(&mut browser, &place.join("recipe.toml"));
    archives(&mut browser, place);
    gateway.stop();
}

/// Every key that the box knows stands on the page with its value and where that comes from; what is in no file too.
fn configuration(browser: &mut Browser, address: &str) {
    let keys = get(address, "/api/v1/configuration").json()["keys"].as_array().expect("keys").clone();
    let shown = browser.value(
        "Object.fromEntries([...document.querySelectorAll('main td code')].filter((it) => it.textContent.startsWith('['))
            .map((it) => [it.textContent, [...it.closest('tr').cells].slice(1, 3).map((cell) => cell.textContent)]))",
    );
    let words = |from: &str| match from {
        "file" => "configuration file",
        "command_line" => "command line",
        "environment" => "environment variable",
        "default" => "built in, in no file",
        other => panic!("where is {other}?"),
    };
    for key in &keys {
        let name = key["key"].as_str().expect("a name");
        let value = key["value"].as_str().unwrap_or("not set");
        assert_eq!(shown[name], json!([value, words(key["from"].as_str().expect("a word"))]), "{name}");
    }
    let from = |name: &str| keys.iter().find(|key| key["key"] == name).map(|key| key["from"].clone());
    assert_eq!(from("[gateway] name"), Some(json!("file")));
    assert_eq!(from("[http] listen"), Some(json!("command_line")));
    assert_eq!(from("[http] tls"), Some(json!("default")));
    assert!(keys.len() > 60, "{} keys", keys.len());
}

fn doctor(browser: &mut Browser) {
    let (status, report) = ask(browser, "POST", "/api/v1/doctor", &json!({ "source": "lathe" }));
    assert_eq!((status, &report["reachable"]), (200, &json!(true)), "{report}");
    assert_eq!(ask(browser, "POST", "/api/v1/doctor", &json!({ "source": "mill" })).0, 400);
    browser
        .value("[...document.querySelectorAll('main button')].find((it) => it.textContent === 'Look at it').click()");
    browser.wait_until("document.body.innerText.includes('answers') && document.body.innerText.includes('All values')");
}

/// Edited in the table; of two who have it open, the second is told.
fn recipe(browser: &mut Browser, file: &Path) {
    let edit = "(() => { const cell = document.querySelector('.recipe input[aria-label=\"Depth ap, mm\"]'); cell.value = '2.25';
                  cell.dispatchEvent(new Event('input')); [...document.querySelectorAll('main button')].find((it) => it.textContent === 'Save the recipe').click(); })()";
    browser.value(edit);
    browser.wait_until("document.body.innerText.includes('Saved:')");
    let stored = std::fs::read_to_string(file).expect("there");
    assert!(stored.contains("depth_of_cut_mm = 2.25") && stored.contains("program = \"O1\""), "{stored}");
    std::fs::write(file, RECIPE).expect("somebody else");
    browser.value(&edit.replace("2.25", "3"));
    browser.wait_until("document.body.innerText.includes('somebody else has changed the recipe meanwhile')");
    assert_eq!(std::fs::read_to_string(file).expect("there"), RECIPE, "nothing of theirs is lost");
    let (status, told) = ask(browser, "PUT", "/api/v1/operations", &json!({ "text": "depth = ", "digest": "0" }));
    assert_eq!(status, 409, "{told}");
}

fn archives(browser: &mut Browser, place: &Path) {
    let backup = unpacked(browser, "/api/v1/backup");
    assert!(backup.starts_with("200 ") && backup.contains("scripts/mine.rhai") && backup.contains("name = \"Seven\""));
    assert!(!backup.contains("sha256$"), "no hash of a token");
    let scripts = place.join("data/scripts");
    std::fs::write(scripts.join("mine.rhai"), "// lost").expect("written");
    std::fs::write(scripts.join("other.rhai"), "// of later").expect("written");
    let restored = browser.value(
        "fetch('/api/v1/restore', { method: 'POST', headers: { 'content-type': 'application/octet-stream' }, body: taken })
            .then(async (answer) => [answer.status, (await answer.json()).text])",
    );
    assert_eq!(restored[0], 200, "{restored}");
    assert!(std::fs::read_to_string(scripts.join("mine.rhai")).expect("back").contains("request_feed_override"));
    assert!(!scripts.join("other.rhai").exists(), "{}", text(&scripts));
    let kept = std::fs::read_dir(place.join("data")).expect("there").flatten();
    assert_eq!(kept.filter(|it| it.file_name().to_string_lossy().contains("before-restore")).count(), 1);
    let nonsense = ask(browser, "POST", "/api/v1/restore", &json!({ "not": "an archive" }));
    assert_eq!(nonsense.0, 400, "{}", nonsense.1);
    let support = unpacked(browser, "/api/v1/support");
    assert!(support.starts_with("200 ") && support.contains("status.json") && support.contains("configuration/1"));
    for secret in ["sha256$", "PRIVATE KEY", "request_feed_override("] {
        assert!(!support.contains(secret), "the archive for support holds {secret}");
    }
}
