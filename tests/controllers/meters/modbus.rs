//! Shipped profiles against pymodbus, over TCP and over a serial line. The addresses are typed from the meters' lists, not
//! taken from the profiles.

use super::partner::{Cell, cable, near, poll, pymodbus, pymodbus_is_there, socat_is_there, source};
use adapters::{Reading, Source};
use std::time::{Duration, Instant};
use testkit::port::free_port;

const SDM630: [Cell; 10] = [
    (0x00, "f", 229.0),
    (0x02, "f", 230.0),
    (0x04, "f", 231.0),
    (0x06, "f", 3.0),
    (0x08, "f", 4.0),
    (0x0A, "f", 5.0),
    (0x0C, "f", -400.0),
    (0x0E, "f", -400.0),
    (0x10, "f", -434.5),
    (0x34, "f", -1234.5),
];
const IEM3000: [Cell; 10] = [
    (0x0BB7, "f", 3.0),
    (0x0BB9, "f", 4.0),
    (0x0BBB, "f", 5.0),
    (0x0BD3, "f", 229.0),
    (0x0BD5, "f", 230.0),
    (0x0BD7, "f", 231.0),
    (0x0BED, "f", -0.4),
    (0x0BEF, "f", -0.4),
    (0x0BF1, "f", -0.4345),
    (0x0BF3, "f", -1.2345),
];
const ADL400: [Cell; 12] = [
    (0x0800, "f", 229.0),
    (0x0802, "f", 230.0),
    (0x0804, "f", 231.0),
    (0x080C, "f", 3.0),
    (0x080E, "f", 4.0),
    (0x0810, "f", 5.0),
    (0x0814, "f", -0.4),
    (0x0816, "f", -0.4),
    (0x0818, "f", -0.4345),
    (0x0832, "f", -0.44),
    (0x0834, "f", 50.0),
    (0x0842, "I", 12345.0),
];
const PAC: [Cell; 10] = [
    (1, "f", 229.0),
    (3, "f", 230.0),
    (5, "f", 231.0),
    (13, "f", 3.0),
    (15, "f", 4.0),
    (17, "f", 5.0),
    (25, "f", -400.0),
    (27, "f", -400.0),
    (29, "f", -434.5),
    (65, "f", -1234.5),
];
/// Counts of the native scaling: 0.025 V, 0.5 mA, 0.375 W and 0.125 W of a phase; the highest bit of power is its sign.
const EDA9033A: [Cell; 10] = [
    (0, "H", 9160.0),
    (1, "H", 6000.0),
    (2, "H", 9200.0),
    (3, "H", 8000.0),
    (4, "H", 9240.0),
    (5, "H", 10000.0),
    (6, "H", 36060.0),
    (9, "H", 36060.0),
    (10, "H", 36060.0),
    (11, "H", 36060.0),
];

/// Voltage between phases of 229, 230 and 231 V against neutral.
const BETWEEN_V: f64 = 398.371_686_5;

/// The first answer of a partner that a loaded computer takes its time to start.
fn first(meter: &mut dyn Source) -> Vec<Reading> {
    let until = Instant::now() + Duration::from_secs(60);
    loop {
        match poll(meter) {
            Ok(readings) => return readings,
            Err(error) => assert!(Instant::now() < until, "{error}"),
        }
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn whole_of(address: &str) {
    let mut meter = source(address);
    let readings = first(meter.as_mut());
    near(&readings, "spindle_power_w", -1234.5);
    near(&readings, "spindle_current_a", 4.0);
    near(&readings, "supply_voltage_v", BETWEEN_V);
    for _ in 0..50 {
        poll(meter.as_mut()).unwrap_or_else(|error| panic!("{error}"));
    }
}

#[test]
fn profiles_over_tcp_against_pymodbus() {
    if !pymodbus_is_there() {
        return;
    }
    let profiles = [("sdm630", &SDM630[..]), ("iem3000", &IEM3000), ("adl400", &ADL400), ("pac", &PAC)];
    for (profile, cells) in profiles {
        let port = free_port();
        let _meter = pymodbus(&["tcp", &port.to_string()], cells);
        whole_of(&format!("modbus-tcp://127.0.0.1:{port}?unit=1&profile={profile}&circuit=spindle&timeout_ms=3000"));
    }
}

#[test]
fn profiles_over_a_serial_line_against_pymodbus() {
    if !(pymodbus_is_there() && socat_is_there()) {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    for (profile, cells) in [("sdm630", &SDM630[..]), ("iem3000", &IEM3000), ("adl400", &ADL400)] {
        let cable = cable(directory.path());
        let _meter = pymodbus(&["rtu", &cable.theirs.display().to_string(), "19200"], cells);
        let line = format!("modbus-rtu://{}?baud=19200&unit=1", cable.ours.display());
        whole_of(&format!("{line}&profile={profile}&circuit=spindle&timeout_ms=3000"));
    }
}

#[test]
fn a_map_of_the_secondary_side_takes_the_transformers() {
    if !pymodbus_is_there() {
        return;
    }
    let port = free_port();
    let _meter = pymodbus(&["tcp", &port.to_string()], &EDA9033A);
    let address = format!("modbus-tcp://127.0.0.1:{port}?profile=eda9033a&ct=20&timeout_ms=3000");
    let mut meter = source(&address);
    let readings = poll(meter.as_mut()).unwrap_or_else(|error| panic!("{error}"));
    // 36060 is 3292 counts with the sign set.
    near(&readings, "total_power_w", -3292.0 * 0.375 * 20.0);
    near(&readings, "supply_voltage_v", 3.0_f64.sqrt() * 230.0);
    let facts = format!("{:?}", meter.collect_facts());
    assert!(facts.contains("to be confirmed"), "{facts}");
}

#[test]
fn registers_that_are_not_there_are_refused_in_words() {
    if !pymodbus_is_there() {
        return;
    }
    let port = free_port();
    let _meter = pymodbus(&["tcp", &port.to_string()], &SDM630);
    let directory = tempfile::tempdir().expect("a directory");
    let text = "format = \"meter/1\"\nmeter = \"own\"\nregisters = \"holding\"\n[[value]]\nquantity = \"power\"\n\
                address = 60000\ntype = \"i32\"\nunit = \"W\"\n";
    std::fs::write(directory.path().join("own.toml"), text).expect("written");
    let own = directory.path().display();
    let mut meter = source(&format!("modbus-tcp://127.0.0.1:{port}?profile=own&profiles={own}&timeout_ms=3000"));
    let error = poll(meter.as_mut()).expect_err("no such registers").to_string();
    assert!(error.contains("refused") && error.contains("illegal data address") && error.contains("60000"), "{error}");
}
