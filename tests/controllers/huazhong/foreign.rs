//! A device whose model is by another hand and whose client is paho: twelve units, nested components, Chinese, GBK, and values
//! that stand elsewhere than Huazhong puts them.

use crate::huazhong::stand::SERIAL;
use adapters::address::{Address, Target};
use adapters::channel::{CHANNELS, Kind, NewChannel};
use adapters::clock::SystemClock;
use adapters::nclink::NcLinkSource;
use adapters::own::{OwnChannel, ReadWith};
use adapters::{Absence, Reading, Source};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use testkit::broker::Broker;
use testkit::process;

struct ForeignDevice(Child);

impl ForeignDevice {
    /// `None` without paho.
    fn start(port: u16, encoding: &str) -> Option<Self> {
        let has_paho = Command::new("python3").args(["-c", "import paho.mqtt.client"]).stderr(Stdio::null()).status();
        if !has_paho.is_ok_and(|status| status.success()) {
            assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "paho-mqtt is not installed");
            eprintln!("SKIPPED: paho-mqtt is not installed (pip install paho-mqtt)");
            return None;
        }
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/controllers/huazhong/foreign_device.py");
        let mut command = Command::new("python3");
        command.arg(script).args([&port.to_string(), SERIAL, encoding]).stdout(Stdio::piped());
        let mut child = command.spawn().expect("python3 starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("it says something");
        let device = Self(child);
        assert_eq!(line.trim(), "ready", "the device did not come to the broker");
        Some(device)
    }
}

impl Drop for ForeignDevice {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn own(name: &str, read: &str, unit: &str) -> OwnChannel {
    let known = CHANNELS.iter().find(|row| row.name == name);
    let (range, kind) = known.map_or(((-1e6, 1e6), Kind::Held), |row| (row.range, row.kind));
    OwnChannel {
        new: NewChannel {
            name: name.to_owned(),
            unit: unit.to_owned(),
            range,
            kind,
            en: String::new(),
            zh: String::new(),
        },
        read: read.to_owned(),
        scale: 1.0,
        offset: 0.0,
        pace: ReadWith::Slow,
        path: None,
        encoding: None,
    }
}

fn read(port: u16, own: Vec<OwnChannel>) -> (Vec<Reading>, NcLinkSource) {
    let address: Address = format!("nclink://127.0.0.1:{port}/{SERIAL}").parse().expect("usable");
    let address = address.with_channels(own).expect("usable");
    let Target::NcLink(target) = address.target() else { panic!("nclink") };
    let mut source = NcLinkSource::new(address.text(), target, None);
    let mut out = Vec::new();
    source.read(&SystemClock::new(), &mut out).expect("read");
    (out, source)
}

fn of<'a>(readings: &'a [Reading], channel: &str) -> &'a Reading {
    let mut found = readings.iter().filter(|reading| reading.channel.name() == channel);
    let first = found.next().unwrap_or_else(|| panic!("no {channel}"));
    assert!(found.next().is_none(), "{channel} twice");
    first
}

fn number(readings: &[Reading], channel: &str) -> Result<f64, Absence> {
    of(readings, channel).value.clone().map(|value| (value.as_number().expect("a number") * 1e6).round() / 1e6)
}

fn text(readings: &[Reading], channel: &str) -> String {
    of(readings, channel).value.clone().ok().and_then(|value| value.as_text().map(str::to_owned)).unwrap_or_default()
}

/// By hand: 20 mm/s, 12345 µm, 100 inch/min, 1500 mA, 1.5 inch, 2 m/min, 50 r/s, 100π rad/s, 0.012 kA.
const RIGHT: [(&str, f64); 12] = [
    ("feed_mm_min", 1200.0),
    ("feed_override_pct", 95.0),
    ("part_count", 1204.0),
    ("x_axis_position_mm", 12.345),
    ("x_axis_velocity_mm_min", 2540.0),
    ("x_axis_current_a", 1.5),
    ("y_axis_position_mm", 38.1),
    ("y_axis_velocity_mm_min", 2000.0),
    ("z_axis_velocity_mm_min", 250.0),
    ("spindle_programmed_rpm", 3000.0),
    ("spindle_speed_rpm", 3000.0),
    ("spindle_current_a", 12.0),
];

#[test]
fn units_places_and_character_sets_of_another_maker() {
    let Some(broker) = Broker::start() else { return };
    for encoding in ["utf-8", "gbk"] {
        let Some(_device) = ForeignDevice::start(broker.port, encoding) else { return };
        let (readings, source) = read(broker.port, Vec::new());
        for (channel, expected) in RIGHT {
            assert_eq!(number(&readings, channel), Ok(expected), "{encoding}: {channel}");
        }
        assert_eq!(text(&readings, "program"), "O0100 精铣", "{encoding}");
        assert!(text(&readings, "alarm").contains("主轴过热"), "{encoding}: {}", text(&readings, "alarm"));
        assert_eq!(source.query_identity()[0].1, "立式加工中心");
        // A furlong is no unit that is known, and a current in bar is none.
        for channel in ["z_axis_position_mm", "z_axis_current_a"] {
            assert_eq!(number(&readings, channel), Err(Absence::UnknownUnit), "{encoding}: {channel}");
        }
        assert_eq!(number(&readings, "spindle_override_pct"), Err(Absence::NotSupported), "two places: 120 or 80");
        let told: Vec<String> =
            source.list_problems().into_iter().map(|problem| format!("{} | {}", problem.what, problem.next)).collect();
        for part in ["\"furlong\", which is no unit that is known", "\"bar\", which measures something else"] {
            assert!(told.iter().any(|line| line.contains(part)), "{part}: {told:?}");
        }
        let places = "CONTROLLER/CHANNEL@1/SPDL_OVERRIDE, PANEL/SPDL_OVERRIDE";
        assert!(told.iter().any(|line| line.contains(places) && line.contains("[[source.channel]]")), "{told:?}");
        println!("{encoding}: {} numbers and 2 texts right, 2 without a known unit, 1 in two places", RIGHT.len());
    }
}

#[test]
fn what_the_table_does_not_place_the_user_places() {
    let Some(broker) = Broker::start() else { return };
    let Some(_device) = ForeignDevice::start(broker.port, "gbk") else { return };
    let channels = vec![
        own("spindle_override_pct", "PANEL/SPDL_OVERRIDE", "%"),
        own("foreign_coolant_bar", "CONTROLLER/COOLANT/PUMP/PRESSURE", "bar"),
        own("foreign_coolant_c", "c712", "°C"),
        own("foreign_pump_s", "CONTROLLER/COOLANT/PUMP/RUN_TIME", "s"),
        own("foreign_nothing_c", "CONTROLLER/HEATER/TEMPERATURE", "°C"),
    ];
    let (readings, source) = read(broker.port, channels);
    let found = ["spindle_override_pct", "foreign_coolant_bar", "foreign_coolant_c", "foreign_pump_s"];
    assert_eq!(found.map(|channel| number(&readings, channel)), [Ok(80.0), Ok(25.0), Ok(25.0), Ok(5400.0)]);
    assert_eq!(number(&readings, "foreign_nothing_c"), Err(Absence::NotSupported));
    let told = source.list_problems();
    assert!(told.iter().any(|one| one.what.contains("no CONTROLLER/HEATER/TEMPERATURE")), "{told:?}");
}

#[test]
fn doctor_lists_what_the_device_has_and_nobody_reads() {
    let Some(broker) = Broker::start() else { return };
    let Some(_device) = ForeignDevice::start(broker.port, "gbk") else { return };
    let address = format!("nclink://127.0.0.1:{}/{SERIAL}", broker.port);
    let output = process::program().args(["doctor", &address, "--all", "--json"]).output().expect("runs");
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let offers = report["offers"].as_array().expect("a list");
    assert!(offers.len() >= 24, "{report:#}");
    let pump = offers.iter().find(|offer| offer["name"].as_str().is_some_and(|name| name.ends_with("PUMP/PRESSURE")));
    let pump = pump.unwrap_or_else(|| panic!("{report:#}"));
    assert!(
        pump["channel"].is_null() && pump.to_string().contains("2.5") && pump.to_string().contains("MPa"),
        "{pump}"
    );
    let mapped = offers.iter().filter(|offer| !offer["channel"].is_null()).count();
    println!("{} items offered, {mapped} of them feed a channel", offers.len());
    let output = process::program().args(["doctor", &address, "--all"]).output().expect("runs");
    let shown = String::from_utf8_lossy(&output.stdout);
    assert!(shown.contains("CONTROLLER/COOLANT/PUMP/PRESSURE") && shown.contains("精铣"), "{shown}");
}
