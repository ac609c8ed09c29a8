//! A time in which the box was off: in every kind of chart the line ends before it and another one begins behind it, the place is told as
//! not recorded, and the axis is as long as what was asked for.

use super::browser::{self, Browser};
use super::views::picture;
use serde_json::{Value, json};
use std::thread;
use std::time::Duration;
use testkit::process::{Gateway, get, wait_for};

/// The box runs, is off, and runs again for so long, s.
const RUNS_S: u64 = 20;
const OFF_S: u64 = 24;
/// Every chart over time, by its view, with the length of its axis in seconds; `None`: all that is recorded.
const CHARTS: [(&str, &str, Option<f64>); 4] = [
    ("now", ".trend .plot", Some(600.0)),
    ("history", ".charts .plot", Some(3600.0)),
    ("thermal", ".plot", None),
    ("twin", ".plot", Some(3600.0)),
];

/// Of every chart: its axis, what is told as not recorded, and how many points of a line lie in the middle of the gap, before and behind
/// it. Lines have a colour; hatching, grid and words are grey.
const LOOK: &str = "((selector, gap) => [...document.querySelectorAll(selector)].map((box) => {
    const [from, to] = [Number(box.dataset.from), Number(box.dataset.to)];
    const canvas = box.querySelector('canvas');
    const ratio = canvas.width / canvas.clientWidth;
    const [area, whole] = [box.querySelector('.u-over').getBoundingClientRect(), canvas.getBoundingClientRect()];
    const x = (s) => Math.round((area.left - whole.left + ((s - from) / (to - from)) * area.width) * ratio);
    const pen = canvas.getContext('2d');
    const coloured = (a, b) => {
        const [left, right] = [x(a), Math.max(x(a) + 1, x(b))];
        const { data } = pen.getImageData(left, Math.round((area.top - whole.top) * ratio), right - left, Math.round(area.height * ratio));
        let count = 0;
        for (let i = 0; i < data.length; i += 4)
            if (data[i + 3] > 150 && Math.max(data[i], data[i + 1], data[i + 2]) - Math.min(data[i], data[i + 1], data[i + 2]) > 70) count += 1;
        return count;
    };
    const told = JSON.parse(box.dataset.unrecorded);
    const [a, b] = told.find(([a, b]) => a < gap && gap < b) ?? [NaN, NaN];
    const room = 0.25 * (b - a);
    return { from, to, told, a, b, inside: a < b ? coloured(a + room, b - room) : null, before: a < b ? coloured(a - 15, a) : null, behind: a < b ? coloured(b, b + 12) : null };
}))";

/// When the history holds nothing, s since 1970: its middle.
fn gap_between(before_ms: i64, after_ms: i64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "milliseconds of this century")]
    let middle = (before_ms + after_ms) as f64 / 2000.0;
    middle
}

fn look(browser: &mut Browser, address: &str, (view, selector, axis_s): (&str, &str, Option<f64>), gap_s: f64) {
    browser.open(&format!("http://{address}/{view}?lang=en"));
    browser.wait_until("document.body?.dataset.fresh === 'yes'");
    let asked = format!("{LOOK}({}, {gap_s})", json!(selector));
    browser.wait_until(&format!(
        "document.body.dataset.view === '{view}' && document.querySelector({0})?.dataset.unrecorded && {asked}.every((it) => it.inside !== null && it.a > it.from + 1)",
        json!(selector)
    ));
    let charts: Value = browser.value(&asked);
    picture(browser, &format!("gap-{view}"));
    let charts = charts.as_array().expect("a list");
    assert!(!charts.is_empty(), "{view} has no chart");
    for chart in charts {
        assert_eq!(chart["inside"], 0, "{view}: a line goes across the gap: {chart}");
        let (from, to) = (chart["from"].as_f64().expect("s"), chart["to"].as_f64().expect("s"));
        if let Some(axis_s) = axis_s {
            assert!((to - from - axis_s).abs() < 1.0, "{view}: the axis is not what is asked for: {chart}");
            // What lies before the first row was not recorded either.
            let first = chart["told"][0].as_array().expect("a stretch");
            assert!((first[0].as_f64().expect("s") - from).abs() < 5.0, "{view}: {chart}");
        }
    }
    let lines = |place: &str| charts.iter().filter_map(|chart| chart[place].as_i64()).sum::<i64>();
    assert!(lines("before") > 20 && lines("behind") > 0, "{view}: no line on both sides: {charts:?}");
}

#[test]
fn no_line_goes_across_a_time_in_which_the_box_was_off() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let span = |address: &str| {
        let told = get(address, "/api/v1/series").json();
        (told["first_ms"].as_i64().unwrap_or(0), told["last_ms"].as_i64().unwrap_or(0))
    };
    let mut first = Gateway::start(&data, &[]);
    let address = first.address();
    thread::sleep(Duration::from_secs(RUNS_S));
    let (_, before_ms) = span(&address);
    first.stop();
    thread::sleep(Duration::from_secs(OFF_S));
    let mut second = Gateway::start(&data, &[]);
    let address = second.address();
    let after_ms = wait_for("the first status", Duration::from_secs(30), || {
        get(&address, "/api/v1/status").json()["at_ms"].as_i64()
    });
    wait_for("a history behind the gap", Duration::from_secs(60), || {
        (span(&address).1 > after_ms + 1000 * i64::try_from(RUNS_S).ok()?).then_some(())
    });
    let gap_s = gap_between(before_ms + 2000, after_ms);
    let mut browser = Browser::start(directory.path());
    browser.size(1440, 1080);
    for chart in CHARTS {
        look(&mut browser, &address, chart, gap_s);
    }
    assert_eq!(browser.faults(&address), Vec::<String>::new());
    second.stop();
}

/// The functions behind it, over gaps of every place and length: what was not recorded and what was are the whole time, and every value
/// stays.
#[test]
fn what_is_recorded_and_what_is_not_are_the_whole_time() {
    if !browser::is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let mut gateway = Gateway::start(&directory.path().join("data"), &[]);
    let address = gateway.address();
    let mut browser = Browser::start(directory.path());
    browser.open(&format!("http://{address}/now"));
    browser.wait_until("document.body?.dataset.fresh === 'yes'");
    let wrong = browser.value(
        "import('/web/gaps.js').then(({ findGaps, breakAtGaps, unrecorded }) => {
            const wrong = [];
            let seed = 7;
            const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
            for (let round = 0; round < 500; round += 1) {
                const width = [0, 1, 4, 60][round % 4];
                const step = width || 0.1;
                const runs = 1 + Math.floor(random() * 4);
                const x = [];
                const offs = [];
                let s = Math.floor(random() * 100) * 60;
                for (let run = 0; run < runs; run += 1) {
                    const rows = 12 + Math.floor(random() * 40);
                    for (let row = 0; row < rows; row += 1) { x.push(s); s += step; }
                    if (run + 1 < runs) {
                        const off = Math.max(2, step * 3) + Math.floor(random() * 50) * step;
                        offs.push([x.at(-1), x.at(-1) + off]);
                        s = x.at(-1) + off;
                    }
                }
                const gaps = findGaps(x, Math.max(1, 1.5 * width));
                if (JSON.stringify(gaps) !== JSON.stringify(offs)) wrong.push(['gaps', round, gaps, offs]);
                const values = x.map((_, at) => at);
                const [times, broken] = breakAtGaps([x, values], gaps);
                const empty = times.filter((_, at) => broken[at] === null);
                if (broken.filter((v) => v !== null).length !== values.length || empty.length !== offs.length) wrong.push(['rows', round]);
                if (!empty.every((at, i) => offs[i][0] < at && at < offs[i][1])) wrong.push(['places', round]);
                if (times.some((at, i) => i && at <= times[i - 1])) wrong.push(['order', round]);
                const [from, to] = [x[0] - 1000, x.at(-1) + width + 1000];
                const told = unrecorded(x, gaps, { from, to, width });
                const sum = told.reduce((all, [a, b]) => all + b - a, 0);
                const recorded = offs.reduce((all, [a, b]) => all - (b - a - width), x.at(-1) + width - x[0]);
                if (Math.abs(sum + recorded - (to - from)) > 1e-6 || told.length !== offs.length + 2) wrong.push(['whole', round, told]);
            }
            return wrong.slice(0, 5);
        })",
    );
    assert_eq!(wrong, json!([]), "{wrong}");
    gateway.stop();
}
