//! A person who reads Chinese works on the page: what the box answers, what stands in the audit afterwards, trials, drafts, settings, the
//! doctor, a box that is set up. No English sentence is met on the way.

use super::browser::{self, Browser};
use super::editing::{ask, person, sign_in};
use super::reading::{cut_texts, english_words, unfold};
use super::views::picture;
use serde_json::json;
use std::time::Duration;
use testkit::process::{Gateway, get, wait_for};

/// Opens a view and waits until it is drawn.
fn open(browser: &mut Browser, address: &str, view: &str, drawn: &str) {
    browser.open(&format!("http://{address}/{view}?lang=zh"));
    browser.wait_until(&format!("document.body?.dataset.fresh === 'yes' && document.body.dataset.view === '{view}'"));
    browser.wait_until(drawn);
}

/// What is on the page now is Chinese, and can be read to its end.
fn check(browser: &mut Browser, what: &str) {
    unfold(browser);
    picture(browser, &format!("zh-{what}"));
    let (english, cut) = (english_words(browser), cut_texts(browser));
    assert!(english.is_empty(), "{what} is English here:\n{}", english.join("\n"));
    assert!(cut.is_empty(), "{what}:\n{}", cut.join("\n"));
}

/// Presses the button with these words.
fn press(browser: &mut Browser, words: &str) {
    let button =
        format!("[...document.querySelectorAll('main button')].find((it) => it.textContent === {})", json!(words));
    browser.wait_until(&format!("{button} && !{button}.disabled"));
    browser.value(&format!("{button}.click()"));
}

/// Changes and refusals of every kind, as the page asks for them; each refusal is shown in Chinese.
fn work(browser: &mut Browser) {
    for (method, path, body, status) in [
        ("PUT", "/api/v1/settings", json!({ "script": "tool_wear", "name": "limit_parts", "value": 4 }), 200),
        ("PUT", "/api/v1/rules/energy.rhai/draft", json!({ "text": "// 新", "digest": "" }), 409),
        ("DELETE", "/api/v1/rules/energy.rhai/draft", json!({}), 0),
        ("POST", "/api/v1/persons", json!({ "name": "王芳", "role": "viewer" }), 201),
        ("DELETE", "/api/v1/persons/王芳", json!({}), 200),
        ("POST", "/api/v1/doctor", json!({ "source": "nobody" }), 400),
        ("POST", "/api/v1/diagnosis", json!({ "from": "-1h", "to": "now" }), 0),
        ("DELETE", "/api/v1/diagnosis", json!({}), 0),
        ("POST", "/api/v1/facts", json!({ "fact": "scrap", "parts": 1 }), 200),
        ("POST", "/api/v1/gallery/axis", json!({}), 0),
        ("POST", "/api/v1/disarm", json!({}), 0),
        ("POST", "/api/v1/restart", json!({}), 409),
    ] {
        let (answered, told) = match method {
            // Such a request has no body.
            "DELETE" => {
                let answer = browser.value(&format!(
                    "fetch({}, {{ method: 'DELETE' }}).then(async (it) => [it.status, await it.json().catch(() => null)])",
                    json!(path)
                ));
                (answer[0].as_u64().expect("a status"), answer[1].clone())
            }
            _ => ask(browser, method, path, &body),
        };
        assert!(status == 0 || answered == status, "{method} {path}: {answered} {told}");
        // A refusal as the page would show it.
        if answered >= 400 {
            let shown = browser.value(&format!(
                "import('/web/words.js').then(({{ box }}) => [{}, {}].map((it) => box(it)).join(' – '))",
                told["title"], told["hint"]
            ));
            let shown = shown.as_str().expect("text");
            assert!(shown.chars().any(|c| ('\u{4e00}'..='\u{9fff}').contains(&c)), "{method} {path}: {shown}");
        }
    }
}

#[test]
fn whoever_works_in_chinese_meets_no_english_sentence() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &[]);
    let address = gateway.address();
    let token = person(&data, "李伟", "admin");
    let mut browser = Browser::start(directory.path());
    browser.size(1440, 1080);
    open(&mut browser, &address, "now", "document.querySelector('.trend .uplot canvas')");
    check(&mut browser, "now");
    sign_in(&mut browser, "李伟", &token);
    // The demonstration has no file: the view to set up says so.
    open(&mut browser, &address, "setup", "document.querySelector('main').innerText.includes('没有配置文件')");
    check(&mut browser, "setup");
    open(
        &mut browser,
        &address,
        "rules",
        "document.querySelector('.editor-host')?.shadowRoot?.querySelector('.cm-line')",
    );
    press(&mut browser, "运行试验");
    browser.wait_until("document.querySelector('main').innerText.includes('项试验全部通过')");
    check(&mut browser, "trials");
    work(&mut browser);
    open(&mut browser, &address, "audit", "document.querySelectorAll('main table tbody tr').length > 6");
    browser.value("(() => { const all = document.querySelector('main select'); all.value = 'all'; all.dispatchEvent(new Event('change')); })()");
    check(&mut browser, "audit");
    open(&mut browser, &address, "box", "document.querySelectorAll('main .card .row').length > 3");
    press(&mut browser, "检查");
    browser.wait_until("document.querySelector('main').innerText.includes('全部数值')");
    check(&mut browser, "box");
    for (at, tab) in ["parts", "use", "marks", "facts"].iter().enumerate() {
        open(&mut browser, &address, "history", "document.getElementById('main').dataset.drawnMs");
        browser.value(&format!("document.querySelectorAll('.tabs button')[{at}].click()"));
        browser.wait_until(&format!("document.querySelectorAll('.tabs button')[{at}].getAttribute('aria-pressed') === 'true' && document.querySelector('.tab-body > *')"));
        check(&mut browser, &format!("history-{tab}"));
    }
    // The answer to an example is told in words, with an equation.
    wait_for("the answer to the example", Duration::from_secs(900), || {
        let files = get(&address, "/api/v1/files").json();
        files["diagnoses"].as_array().is_some_and(|all| !all.is_empty()).then_some(())
    });
    open(&mut browser, &address, "twin", "document.querySelector('.verdict')?.textContent.length > 2");
    browser
        .wait_until("document.querySelector('.brought, .drop-zone') && document.querySelector('.diagnosis .summary')");
    check(&mut browser, "twin");
    gateway.stop();
}
