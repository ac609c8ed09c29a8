//! A frozen box must not look alive: everything on the page dims within three seconds, whatever the clock of the browser says.

use super::browser::{self, Browser};
use serde_json::Value;
use std::thread;
use std::time::{Duration, Instant};
use testkit::process::Gateway;

/// A clock of the browser that is three days ahead and jumps by hours at every look.
const WRONG_CLOCK: &str = "(() => { const real = Date.now; let n = 0;
    Date.now = () => real() + 259200000 + (n++ % 7) * 3600000; })()";

/// How the page looks: its own word, and how strongly the parts that could be mistaken for fresh are drawn.
fn look(browser: &mut Browser) -> Value {
    browser.value(
        "(() => {
            const opacity = (name) => Number(getComputedStyle(document.querySelector(name)).opacity);
            return { fresh: document.body.dataset.fresh, title: document.title, link: document.getElementById('link').textContent,
                bar: getComputedStyle(document.getElementById('stale')).visibility,
                greatest: Math.max(...[...document.querySelectorAll('.ages')].map((e) => Number(getComputedStyle(e).opacity))),
                alarms: opacity('.alarms'), state: opacity('.state'), feed: opacity('.feed'), armed: opacity('#gate-pill') };
        })()",
    )
}

fn dims_within(browser: &mut Browser, limit: Duration, what: &str) -> Duration {
    let began = Instant::now();
    loop {
        let shown = look(browser);
        let dim = shown["greatest"].as_f64().is_some_and(|opacity| opacity < 0.6);
        if shown["fresh"] == "no" && dim {
            for part in ["alarms", "state", "feed", "armed"] {
                assert!(
                    shown[part].as_f64().is_some_and(|opacity| opacity < 0.6),
                    "{what}: {part} is not dimmed: {shown}"
                );
            }
            assert_eq!(shown["bar"], "visible", "{what}: {shown}");
            assert!(shown["title"].as_str().is_some_and(|title| title.starts_with('⚠')), "{what}: {shown}");
            assert_ne!(shown["link"], "live", "{what}: {shown}");
            return began.elapsed();
        }
        assert!(began.elapsed() < limit, "{what}: after {limit:?} the page still looks alive: {shown}");
        thread::sleep(Duration::from_millis(30));
    }
}

/// `cargo test --test box whole::watchdog -- --nocapture` prints after how long the page dims.
#[test]
fn a_frozen_or_killed_box_does_not_look_alive() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let mut gateway = Gateway::start(&directory.path().join("data"), &[]);
    let address = gateway.address();
    let mut browser = Browser::start(directory.path());
    browser.before_every_document(WRONG_CLOCK);
    browser.open(&format!("http://{address}/now?lang=en"));
    browser.wait_until("document.body?.dataset.fresh === 'yes' && document.getElementById('state')?.dataset.word");
    // A wrong clock does not make a living box look old either.
    thread::sleep(Duration::from_millis(2500));
    let alive = look(&mut browser);
    assert_eq!((&alive["fresh"], alive["state"].as_f64()), (&"yes".into(), Some(1.0)), "{alive}");

    let mut worst = Duration::ZERO;
    for round in 0..3 {
        gateway.signal("STOP");
        worst = worst.max(dims_within(&mut browser, Duration::from_secs(3), "SIGSTOP"));
        thread::sleep(Duration::from_millis(200 * round));
        gateway.signal("CONT");
        browser.wait_until("document.body.dataset.fresh === 'yes'");
    }
    gateway.signal("KILL");
    let killed = dims_within(&mut browser, Duration::from_secs(3), "SIGKILL");
    println!(
        "dims at the latest {} ms after SIGSTOP (n = 3), {} ms after SIGKILL",
        worst.as_millis(),
        killed.as_millis()
    );
}

/// A connection that delivers everything, but seconds late, is found by comparing two clocks that only go forward.
#[test]
fn what_arrives_late_is_not_fresh() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let mut gateway = Gateway::start(&directory.path().join("data"), &[]);
    let address = gateway.address();
    let mut browser = Browser::start(directory.path());
    browser.open(&format!("http://{address}/help"));
    browser.wait_until("document.body?.dataset.fresh === 'yes'");
    let told = browser.value(
        "(async () => {
            const { Live } = await import('/web/live.js');
            let clock = 0, heard = null;
            const stream = { addEventListener: (_, take) => { heard = take; }, close() {}, readyState: 1 };
            const live = new Live({ now: () => clock, open: () => stream });
            live.began = 0; live.connect();
            const tell = (at, uptime, count) => { clock = at; heard({ data: JSON.stringify({ uptime_s: uptime, tick: { rate_hz: 10, count }, speed: 1 }) }); return live.fresh; };
            const said = [tell(100, 50, 1), tell(300, 50.2, 3), tell(500, 50.4, 5)];
            // Five seconds pass; then the documents of those five seconds arrive at the old pace, each five seconds late.
            said.push(tell(5700, 50.6, 7), tell(5900, 50.8, 9), tell(6100, 51.0, 11));
            // The line catches up.
            said.push(tell(6300, 56.2, 63));
            // The same tick again and again: the server lives, the tick does not.
            for (let at = 6500; at <= 9000; at += 200) said.push(tell(at, 56.2 + (at - 6300) / 1000, 63));
            return said;
        })()",
    );
    let said: Vec<&str> = told.as_array().expect("a list").iter().filter_map(Value::as_str).collect();
    assert_eq!(&said[..7], ["yes", "yes", "yes", "no", "no", "no", "yes"], "{said:?}");
    assert_eq!(said.last(), Some(&"no"), "{said:?}");
    gateway.stop();
}
