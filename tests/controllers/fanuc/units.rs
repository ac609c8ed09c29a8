//! The unit of the feed and of positions: the value that the control means, read by ourselves, through the vendor's way
//! with a library of ours, and as bytes that are written here by hand from the reference. None of the expected values
//! comes from the table of the program.

use crate::fanuc::support::{address, number, poll, serve};
use crate::fanuc::vendor::{opened_in, settings};
use adapters::clock::{Clock, SystemClock};
use adapters::fanuc::answer::SpeedUnit;
use adapters::fanuc::item::BlockWord;
use adapters::fanuc::wire::Number;
use adapters::fanuc_server::{Controller, Server, ServerSettings};
use adapters::open::open_address;
use adapters::{Absence, Reading};
use std::io::{Read, Write};
use std::net::TcpStream;

/// A feed as the control shows it and what it is in mm/min at 1000 rpm.
pub(crate) struct Case {
    pub(crate) unit: SpeedUnit,
    /// `SPEEDELM.unit` of the FOCAS2 manual.
    pub(crate) in_library: i16,
    /// Number on the wire of a newer control: the library takes 3 off.
    newer: u8,
    /// On the wire of an older control: only inches are told apart.
    older: u8,
    /// What is shown: whole number and places after the point.
    pub(crate) shown: (i32, i16),
    pub(crate) mm_min: f64,
}

/// By hand: 47.25 in/min x 25.4 = 1200.15; 0.25 mm/rev x 1000 rpm = 250; 0.01 in/rev x 25.4 x 1000 rpm = 254.
pub(crate) const CASES: [Case; 4] = [
    Case { unit: SpeedUnit::MmMin, in_library: 0, newer: 3, older: 0, shown: (1200, 0), mm_min: 1200.0 },
    Case { unit: SpeedUnit::InchMin, in_library: 1, newer: 4, older: 1, shown: (4725, 2), mm_min: 1200.15 },
    Case { unit: SpeedUnit::MmRev, in_library: 3, newer: 6, older: 0, shown: (25, 2), mm_min: 250.0 },
    Case { unit: SpeedUnit::InchRev, in_library: 4, newer: 7, older: 1, shown: (10, 3), mm_min: 254.0 },
];

/// The control of a case: 1000 rpm, and X at 50.8 mm or 2 inches.
pub(crate) fn control(version: u16, case: &Case, inch: bool) -> Controller {
    let mut control = Controller::new(version, &['X', 'Z']);
    control.measure_in_inches(inch);
    let shown = Number::from_decimal(case.shown.0, case.shown.1);
    control.feed_in(case.unit, shown);
    control.modal_words.insert(BlockWord::F, shown);
    control.set_modal_words([(BlockWord::S, 1000), (BlockWord::T, 5), (BlockWord::R, 77)]);
    control.spindles[0].quantities[3] = Number::from_decimal(1000, 0);
    let place = if inch { Number::from_decimal(20_000, 4) } else { Number::from_decimal(50_800, 3) };
    control.axes[0].positions[1] = place;
    // F002.0 INCH: the program is in the unit of the feed.
    let inch_program = matches!(case.unit, SpeedUnit::InchMin | SpeedUnit::InchRev);
    control.memory.set_bit(adapters::fanuc::item::Area::F, 2, 0, inch_program);
    control
}

fn read(server: &Server) -> Vec<Reading> {
    let mut opened = open_address(&address(server, ""), SystemClock::new().now_ns()).expect("opens");
    poll(opened.sources[0].as_mut()).expect("answers")
}

fn near(readings: &[Reading], channel: &str, expected: f64, what: &str) -> f64 {
    let found = number(readings, channel);
    assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{what}: {channel} is {found}, not {expected}");
    found
}

/// The bytes of an answer: the version word, and the data of its only block.
fn asked(server: &Server, question: &str) -> (u16, Vec<u8>) {
    let bytes = |hex: &str| -> Vec<u8> {
        let digit = |at: usize| u8::from_str_radix(&hex[at..at + 2], 16).expect("hexadecimal");
        (0..hex.len()).step_by(2).map(digit).collect()
    };
    let mut stream = TcpStream::connect(server.address()).expect("listens");
    let mut frame = |request: &str| {
        stream.write_all(&bytes(request)).expect("sent");
        let mut head = [0; 10];
        stream.read_exact(&mut head).expect("a head");
        let mut body = vec![0; usize::from(u16::from_be_bytes([head[8], head[9]]))];
        stream.read_exact(&mut body).expect("a body");
        (u16::from_be_bytes([head[4], head[5]]), body)
    };
    frame("a0a0a0a00001010100020002");
    let (version, body) = frame(question);
    (version, body[18..].to_vec())
}

/// The unit of the feed as the vendor's library asks for it; from the captured frames of `cnc_rdspeed`.
const UNIT_NEWER: &str = "a0a0a0a000012101001e0001001c0001000100880000000300000000000000000000000000000000";
const UNIT_OLDER: &str = "a0a0a0a000012101001e0001001c0001000100880000000000000000000000000000000000000000";
/// The modal words S and R as `cnc_modal(107)` and `cnc_modal(109)` ask for them: numbers 21 and 20.
const MODAL_S: &str = "a0a0a0a000012101001e0001001c0001000100220000001500000000000000000000000000000000";
const MODAL_R: &str = "a0a0a0a000012101001e0001001c0001000100220000001400000000000000000000000000000000";

#[test]
fn feed_and_positions_over_generations_units_and_machines() {
    println!("generation | unit shown | machine | set mm/min | read | programmed read | set X mm | read");
    for version in [2, 3, 4] {
        for case in &CASES {
            for inch in [false, true] {
                let what = format!("generation {version}, {:?}, {}", case.unit, if inch { "inch" } else { "mm" });
                let server = serve(control(version, case, inch), ServerSettings::default());
                let readings = read(&server);
                let feed = near(&readings, "feed_mm_min", case.mm_min, &what);
                let programmed = near(&readings, "feed_programmed_mm_min", case.mm_min, &what);
                let place = near(&readings, "x_axis_position_mm", 50.8, &what);
                near(&readings, "spindle_programmed_rpm", 1000.0, &what);
                println!(
                    "{version} | {:?} | {} | {} | {feed} | {programmed} | 50.8 | {place}",
                    case.unit,
                    if inch { "inch" } else { "mm" },
                    case.mm_min
                );
            }
        }
    }
}

#[test]
fn the_bytes_are_those_that_the_library_asks_for_and_takes_three_off() {
    for case in &CASES {
        for (version, question, expected) in
            [(4, UNIT_NEWER, case.newer), (3, UNIT_NEWER, case.newer), (2, UNIT_OLDER, case.older)]
        {
            let server = serve(control(version, case, false), ServerSettings::default());
            assert_eq!(asked(&server, question), (version, vec![0, expected]), "{:?} of {version}", case.unit);
            // 1000 is 0x3e8 and 77 is 0x4d.
            assert_eq!(asked(&server, MODAL_S).1, [0, 0, 3, 0xe8, 0, 0, 0, 0], "S of {version}");
            assert_eq!(asked(&server, MODAL_R).1, [0, 0, 0, 0x4d, 0, 0, 0, 0], "R of {version}");
        }
    }
}

#[test]
fn through_the_vendors_way_the_unit_and_the_decimals_count() {
    let library = crate::fanuc::vendor::library(&[]);
    println!("unit | machine | set mm/min | through the vendor's way (our library)");
    for case in &CASES {
        for inch in [false, true] {
            let mut settings = settings(&library);
            let group = i32::from(matches!(case.unit, SpeedUnit::MmRev | SpeedUnit::InchRev));
            let (data, places) = case.shown;
            let feed = format!("{data} {places} {} {group} {}", case.in_library, i32::from(inch));
            settings.environment.push(("FAKE_LIBRARY_FEED".to_owned(), feed));
            let mut opened = opened_in(settings, "fanuc://fake");
            let readings = poll(opened.sources[0].as_mut()).expect("answers");
            // This library turns at 1200 rpm, and its X stands at 79000 thousandths of the machine's unit.
            let expected = if group == 1 { case.mm_min * 1.2 } else { case.mm_min };
            let found = near(&readings, "feed_mm_min", expected, &format!("{:?}", case.unit));
            near(&readings, "x_axis_position_mm", if inch { 79.0 * 25.4 } else { 79.0 }, "X");
            println!("{:?} | {} | {expected} | {found}", case.unit, if inch { "inch" } else { "mm" });
        }
    }
}

#[test]
fn a_unit_that_is_in_no_manual_gives_no_feed() {
    for version in [3, 4] {
        let mut control = control(version, &CASES[0], false);
        control.feed_unit = SpeedUnit::Unknown(0);
        let readings = read(&serve(control, ServerSettings::default()));
        assert_eq!(
            crate::fanuc::support::value(&readings, "feed_mm_min"),
            Err(Absence::OutOfRange),
            "not 12000, not 0"
        );
        near(&readings, "feed_programmed_mm_min", 1200.0, "the program's unit is known from its G codes");
    }
}

#[test]
fn feed_per_revolution_that_is_shown_per_minute_is_told_apart_from_the_f_word() {
    // G95 F0.25 at 1000 rpm; the screen of this control shows 250 mm/min.
    for version in [2, 4] {
        let mut control = control(version, &CASES[2], false);
        control.set_parameter(3107, 0, Number::from_decimal(0, 0));
        (control.feed, control.feed_unit) = (Number::from_decimal(250, 0), SpeedUnit::MmMin);
        let readings = read(&serve(control, ServerSettings::default()));
        near(&readings, "feed_mm_min", 250.0, "shown");
        near(&readings, "feed_programmed_mm_min", 250.0, "0.25 mm per revolution");
    }
}
