//! The triangles of the view "History": one stands where an audit row says that the machine was written to, and nowhere else.

use super::browser::{self, Browser};
use super::wear_view::answer_instead;
use serde_json::{Value, json};
use std::time::Duration;
use testkit::process::{Gateway, get, wait_for};

/// Kinds of rows and outcomes that the audit has; those that reached the machine are the first ones.
const REACHED: [(&str, &str); 3] = [("write", "written"), ("stop", "sent"), ("feed_hold", "sent")];
const OTHERS: [(&str, &str); 12] = [
    ("write", "failed"),
    ("write", "shadow"),
    ("write", "refused"),
    ("stop", "shadow"),
    ("stop", "latched"),
    ("feed_hold", "failed"),
    ("request", "permitted"),
    ("request", "limited"),
    ("reaction", "seen"),
    ("armed", "armed"),
    ("disarmed", "person"),
    ("change", "done"),
];

/// Places of triangles of writes in the band of states, in seconds: their colour is that of the accent, in the row of points between the
/// band and the outline of their foot.
const TRIANGLES: &str = "(() => {
    const canvas = document.querySelector('.ribbon-box canvas.ribbon');
    const ratio = canvas.width / canvas.clientWidth;
    const probe = document.createElement('canvas').getContext('2d');
    probe.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--accent').trim();
    probe.fillRect(0, 0, 1, 1);
    const [r, g, b] = probe.getImageData(0, 0, 1, 1).data;
    const query = new URLSearchParams(location.search);
    const [from, to] = ['from', 'to'].map((key) => Date.parse(query.get(key)) / 1000);
    const row = canvas.getContext('2d').getImageData(0, canvas.height - Math.ceil(2 * ratio), canvas.width, 1).data;
    const places = [];
    let begin = null;
    for (let x = 0; x <= canvas.width; x += 1) {
        const is = x < canvas.width && Math.abs(row[4 * x] - r) < 8 && Math.abs(row[4 * x + 1] - g) < 8 && Math.abs(row[4 * x + 2] - b) < 8;
        if (is && begin === null) begin = x;
        if (!is && begin !== null) {
            const middle = (begin + x) / 2 / ratio;
            places.push(from + ((middle - 64) / (canvas.clientWidth - 64 - 28)) * (to - from));
            begin = null;
        }
    }
    return places;
})()";

fn row(number: usize, at_s: i64, (kind, outcome): (&str, &str)) -> Value {
    json!({ "number": number, "at_ns": at_s * 1_000_000_000, "kind": kind, "outcome": outcome, "asked": 80, "after": 80, "unit": "%",
        "reason": "as asked for", "script": "constant_load.rhai", "person": "" })
}

#[test]
fn a_triangle_stands_where_the_machine_was_written_to_and_nowhere_else() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let mut gateway = Gateway::start(&directory.path().join("data"), &[]);
    let address = gateway.address();
    let now_s = wait_for("the first status", Duration::from_secs(30), || {
        Some(get(&address, "/api/v1/status").json()["at_ms"].as_i64()? / 1000)
    });
    // A row each minute of the hour before the box began: the band is empty there.
    let kinds: Vec<(&str, &str)> = REACHED.into_iter().chain(OTHERS).collect();
    let at_s = |at: usize| now_s - 3300 + 180 * i64::try_from(at).expect("small");
    let rows: Vec<Value> = kinds.iter().enumerate().map(|(at, kind)| row(at, at_s(at), *kind)).collect();
    let mut browser = Browser::start(directory.path());
    browser.size(1440, 1080);
    answer_instead(&mut browser, &json!({ "/api/v1/audit": { "schema": "audit/1", "rows": rows } }));
    browser.open(&format!("http://{address}/history?lang=en"));
    browser.wait_until("document.getElementById('main')?.dataset.drawnMs && location.search.includes('from=')");
    browser.wait_until(&format!("{TRIANGLES}.length >= {}", REACHED.len()));
    let told = browser.value(TRIANGLES);
    let places: Vec<f64> = told.as_array().expect("a list").iter().filter_map(Value::as_f64).collect();
    assert_eq!(places.len(), REACHED.len(), "{places:?}");
    for (at, place) in places.iter().enumerate() {
        #[expect(clippy::cast_precision_loss, reason = "seconds of this century")]
        let should = at_s(at) as f64;
        assert!((place - should).abs() < 20.0, "{:?} stands {} s off", kinds[at], place - should);
    }
    assert_eq!(browser.faults(&address), Vec::<String>::new());
    gateway.stop();
}
