//! Before a diagnosis is begun the page tells how much of the chosen time is recorded, and what little of it costs.

use super::brought::open_twin;
use super::browser::{self, Browser};
use super::editing::person;
use super::wear_view::answer_instead;
use serde_json::json;
use testkit::process::{Gateway, get};

const TOLD: &str = "document.querySelector('[data-recorded-s]')";

#[test]
fn little_history_is_told_before_a_diagnosis_is_begun_and_refuses_none() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &[]);
    let address = gateway.address();
    let token = person(&data, "Li", "setter");
    let enough_s = get(&address, "/api/v1/diagnosis").json()["enough_s"].as_u64().expect("seconds");
    assert_eq!(enough_s, 45 * 60);
    let mut browser = Browser::start(directory.path());
    open_twin(&mut browser, &address, &token);
    for (language, only, length) in [("en", "Only ", "45 min"), ("zh", "仅", "45 分")] {
        browser.open(&format!("http://{address}/twin?lang={language}"));
        browser.wait_until(&format!("document.body?.dataset.fresh === 'yes' && {TOLD}"));
        let told = browser.value(&format!("[{TOLD}.innerText, {TOLD}.className, Number({TOLD}.dataset.recordedS)]"));
        let text = told[0].as_str().expect("text");
        assert!(text.contains(only) && text.contains(length), "{text}");
        assert!(told[1].as_str().is_some_and(|classes| classes.contains("warn-text")), "{told}");
        assert!(told[2].as_f64().is_some_and(|recorded_s| recorded_s < 600.0), "{told}");
        browser.wait_until("[...document.querySelectorAll('button.primary')].some((it) => !it.disabled)");
    }
    // An hour of it is enough: the same place says so without a warning.
    let hour = json!({ "/api/v1/utilisation": { "rows": [{ "from_ms": 0, "total_s": 3600.0, "seconds": {} }], "shifts": [] } });
    answer_instead(&mut browser, &hour);
    browser.open(&format!("http://{address}/twin?lang=en"));
    browser.wait_until(&format!("document.body?.dataset.fresh === 'yes' && {TOLD}?.innerText.includes('1 h 00 min')"));
    assert_eq!(browser.value(&format!("{TOLD}.classList.contains('warn-text')")), false);
    assert_eq!(browser.faults(&address), Vec::<String>::new());
    gateway.stop();
}
