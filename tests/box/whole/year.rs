//! A year of history on the page: how long the API and the first plot take, how many bytes, and what ten live pages do to the tick.
//!
//! Long ranges are drawn from sums by minute, hour and day, whose number does not depend on how densely it was sampled. The year is
//! therefore made with one sample in six seconds (`CNC_GATEWAY_YEAR_STEP_MS`) and its last day with ten a second, all of twenty
//! quantities; 100 makes the whole year at 10 Hz, which takes an hour and 5 GB.

use super::browser::{self, Browser};
use adapters::clock::SECOND_NS;
use adapters::{ChannelId, Sample, Slot, Value};
use gateway::history::{Options, Part, StateChange, WhenFull, Writer};
use serde_json::{Value as Json, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use testkit::process::{Gateway, get, request, wait_for};

const DAY_NS: i64 = 86_400 * SECOND_NS;
const CHANNELS: [&str; 20] = [
    "spindle_programmed_rpm",
    "feed_programmed_mm_min",
    "spindle_speed_rpm",
    "feed_mm_min",
    "feed_override_pct",
    "spindle_override_pct",
    "x_axis_position_mm",
    "z_axis_position_mm",
    "x_axis_velocity_mm_min",
    "z_axis_velocity_mm_min",
    "spindle_power_w",
    "total_power_w",
    "spindle_current_a",
    "spindle_load_pct",
    "x_axis_current_a",
    "z_axis_current_a",
    "bearing_temperature_c",
    "motor_temperature_c",
    "ambient_temperature_c",
    "supply_voltage_v",
];
/// What the page shows first.
const SHOWN: &str = "spindle_power_w,total_power_w,spindle_speed_rpm,feed_mm_min,feed_override_pct";
/// The steps of the page, `LADDER` in `history-data.js`: up to so many seconds, buckets of so many.
const LADDER: [(f64, u32); 9] = [
    (300.0, 0),
    (900.0, 1),
    (3600.0, 4),
    (7200.0, 10),
    (172_800.0, 60),
    (432_000.0, 300),
    (5_184_000.0, 3600),
    (31_968_000.0, 21_600),
    (f64::INFINITY, 86_400),
];

/// A number from 0 to 1 that depends on nothing but its arguments (splitmix64).
fn uniform(row: i64, stream: u64) -> f64 {
    let mut x = row.unsigned_abs().wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ stream.wrapping_mul(0xd1b5_4a32_d192_ed03);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (x ^ (x >> 31)) as f64 / u64::MAX as f64
}

/// Cutting for six of ten minutes by day, off by night.
fn state(at_s: i64) -> &'static str {
    match (at_s.rem_euclid(86_400) / 3600, at_s.rem_euclid(600)) {
        (22.. | 0..6, _) => "off",
        (_, 0..360) => "cutting",
        (_, 360..480) => "idle",
        _ => "standby",
    }
}

fn value(at_ns: i64, index: usize) -> f64 {
    let at_s = at_ns / SECOND_NS;
    let level = match state(at_s) {
        "cutting" => 1.0,
        "idle" => 0.4,
        "standby" => 0.1,
        _ => 0.0,
    };
    let noise = uniform(at_ns / 1_000_000, index as u64) - 0.5;
    let size = 20.0 * (index + 1) as f64;
    ((level * size * 10.0 + noise * size * 0.3) * 10.0).round() / 10.0
}

/// Makes the year that ends now, unless it is there already.
fn make(path: &Path) -> i64 {
    let now_ns =
        i64::try_from(SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_nanos()).expect("fits");
    let step_ms: i64 = std::env::var("CNC_GATEWAY_YEAR_STEP_MS").ok().and_then(|it| it.parse().ok()).unwrap_or(6000);
    let (began, from_ns) = (Instant::now(), now_ns - 365 * DAY_NS);
    let writer = Writer::open(path, Options { when_full: WhenFull::Wait, ..Options::default() }).expect("opens");
    let ids = CHANNELS.map(|name| ChannelId::from_name(name).expect(name));
    let (mut sample, mut at_ns, mut word, mut rows, mut part_ns) = (Sample::new_empty(0), from_ns, "", 0_u64, from_ns);
    while at_ns < now_ns - 2 * SECOND_NS {
        sample.at_ns = at_ns;
        for (index, id) in ids.iter().enumerate() {
            sample.set_slot(*id, Slot { value: Ok(Value::Number(value(at_ns, index))), age_ns: 0 });
        }
        writer.queue_sample(&sample, &[]);
        let now = state(at_ns / SECOND_NS);
        if now != word {
            if word == "cutting" {
                writer.queue_record(Part {
                    began_ns: part_ns,
                    ended_ns: at_ns,
                    count: 1,
                    cutting_s: Some(360.0),
                    energy_j: Some(9e5),
                    ..Part::default()
                });
                part_ns = at_ns;
            }
            word = now;
            writer.queue_record(StateChange {
                at_ns,
                state: now.to_owned(),
                program: "O1".to_owned(),
                tool: "T1".to_owned(),
            });
        }
        rows += 1;
        at_ns += if at_ns > now_ns - DAY_NS { SECOND_NS / 10 } else { step_ms * 1_000_000 };
    }
    drop(writer);
    let size = std::fs::metadata(path).map_or(0, |file| file.len());
    println!(
        "made a year: {rows} rows of 20 quantities, {:.2} GB, in {:.0} s",
        size as f64 / 1e9,
        began.elapsed().as_secs_f64()
    );
    now_ns
}

fn percentile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() as f64 * share) as usize).min(sorted.len() - 1)]
}

/// Two hundred ranges of every length, anywhere in the year, as the page asks for them.
fn ranges(address: &str, now_ns: i64) {
    let mut all: Vec<(f64, f64, usize)> = Vec::new();
    for turn in 0..200 {
        let span_s = 10_f64.powf(1.0 + 6.49 * uniform(turn, 1));
        let resolution = LADDER.iter().find(|(most, _)| span_s <= *most).map_or(86_400, |(_, step)| *step);
        let latest_s = (now_ns / SECOND_NS) as f64;
        let to_s = latest_s - uniform(turn, 2) * (365.0 * 86_400.0 - span_s).max(0.0);
        let utc = |s: f64| gateway::moment::format_utc((s * 1e9) as i64);
        let path = format!(
            "/api/v1/samples?from={}&to={}&channels={SHOWN}&resolution_s={resolution}",
            utc(to_s - span_s),
            utc(to_s)
        );
        let began = Instant::now();
        let answer = get(address, &path);
        assert_eq!(answer.status, 200, "{path}: {}", answer.body);
        all.push((began.elapsed().as_secs_f64() * 1e3, span_s, answer.body.len()));
    }
    let mut times: Vec<f64> = all.iter().map(|(ms, ..)| *ms).collect();
    times.sort_by(f64::total_cmp);
    let bytes = all.iter().map(|(.., bytes)| *bytes).max().unwrap_or(0);
    let slowest = all.iter().max_by(|a, b| a.0.total_cmp(&b.0)).expect("some");
    println!(
        "200 ranges of 5 channels: p50 {:.0} ms, p95 {:.0} ms, slowest {:.0} ms (a range of {:.0} s), at most {:.0} kB",
        percentile(&times, 0.5),
        percentile(&times, 0.95),
        slowest.0,
        slowest.1,
        bytes as f64 / 1e3
    );
}

/// Time until the page has drawn a range, from the address on.
fn first_plot(browser: &mut Browser, address: &str, from: &str, to: &str, what: &str) {
    let began = Instant::now();
    browser.open(&format!("http://{address}/history?lang=en&from={from}&to={to}&channels={SHOWN}"));
    browser.wait_until("document.getElementById('main')?.dataset.drawnMs");
    let drawn = browser.value("Number(document.getElementById('main').dataset.drawnMs)");
    let bytes = browser.value("performance.getEntriesByType('resource').reduce((sum, it) => sum + it.transferSize, 0)");
    println!(
        "{what}: first plot {:.0} ms after the address was given, its questions and drawing {drawn} ms, {:.0} kB in all",
        began.elapsed().as_secs_f64() * 1e3,
        bytes.as_f64().unwrap_or(0.0) / 1e3
    );
}

fn late_p99_ms(address: &str) -> f64 {
    get(address, "/api/v1/status").json()["tick"]["late_p99_ms"].as_f64().expect("a number")
}

/// Ten pages that listen and read for a minute.
fn ten_clients(address: &str) {
    thread::sleep(Duration::from_secs(61));
    let before = late_p99_ms(address);
    let stop = Instant::now() + Duration::from_secs(61);
    let clients: Vec<_> = (0..10)
        .map(|_| {
            let address = address.to_owned();
            thread::spawn(move || {
                let mut stream = TcpStream::connect(&address).expect("it listens");
                stream.set_read_timeout(Some(Duration::from_secs(2))).expect("a limit");
                write!(stream, "GET /api/v1/live HTTP/1.1\r\nHost: {address}\r\n\r\n").expect("sent");
                let (mut buffer, mut bytes) = (vec![0; 65_536], 0_usize);
                while Instant::now() < stop {
                    bytes += stream.read(&mut buffer).unwrap_or(0);
                }
                bytes
            })
        })
        .collect();
    let bytes: usize = clients.into_iter().map(|client| client.join().expect("no panic")).sum();
    let after = late_p99_ms(address);
    println!(
        "ten live clients: lateness p99 of the tick {before:.2} ms before, {after:.2} ms with them; {:.1} kB/s each",
        bytes as f64 / 61.0 / 10.0 / 1e3
    );
}

/// `cargo test --release --test box a_year -- --ignored --nocapture`
#[test]
#[ignore = "30 minutes: a year of history is made and drawn, in release; takes gigabytes"]
fn a_year_is_drawn_at_once() {
    let directory = tempfile::tempdir().expect("a directory");
    let database = std::env::var_os("CNC_GATEWAY_YEAR").map_or(directory.path().join("year.db"), PathBuf::from);
    let now_ns = make(&database);
    let config = directory.path().join("box.toml");
    let text = format!(
        "[gateway]\nname = \"Year\"\n[history]\npath = {}\nretention_days = 3650\n[[source]]\naddress = \"simulated://lathe\"\n",
        json!(database)
    );
    std::fs::write(&config, text).expect("written");
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &["--config", config.to_str().expect("a path")]);
    let address = gateway.address();
    let known: Json = wait_for("a started box", Duration::from_secs(60), || {
        Some(get(&address, "/api/v1/series")).filter(|answer| answer.status == 200)
    })
    .json();
    assert!(known["last_ms"].as_i64() > known["first_ms"].as_i64(), "{known}");
    assert_eq!(request(&address, &format!("GET /api/v1/series HTTP/1.0\r\nHost: {address}\r\n\r\n")).status, 200);
    ranges(&address, now_ns);
    if browser::is_there() {
        let mut browser = Browser::start(directory.path());
        let utc = |back_ns: i64| gateway::moment::format_utc(now_ns - back_ns);
        first_plot(&mut browser, &address, &utc(365 * DAY_NS), &utc(0), "a year, cold");
        first_plot(&mut browser, &address, &utc(365 * DAY_NS), &utc(0), "a year, again");
        first_plot(&mut browser, &address, &utc(7 * DAY_NS), &utc(0), "a week");
        first_plot(&mut browser, &address, &utc(DAY_NS), &utc(DAY_NS - 300 * SECOND_NS), "five minutes, every sample");
    }
    ten_clients(&address);
    gateway.stop();
}
