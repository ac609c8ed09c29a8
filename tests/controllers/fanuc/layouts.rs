//! What stands in which byte of an answer. Every expected value was told by the vendor's library (libfwlib32 1.0.5, x64) when it
//! was given these very bytes; the interop test here asks it again. `cargo test --test controllers fanuc::layouts -- --nocapture` prints the
//! table of function 1/22.

use crate::fanuc::bytes::{self, Answer, ByteControl, VERSIONS, ask, bytes};
use crate::fanuc::interop::{partner, python};
use crate::fanuc::support::{number, poll, serve, value};
use crate::fanuc::vendor::{library, opened_in, settings};
use adapters::address::{Address, Endpoint};
use adapters::fanuc::answer::{Alarm, FocasAnswer};
use adapters::fanuc::focas::Focas;
use adapters::fanuc::item::{BlockWord, FocasItem, Position, PositionFrame, Servo, Spindle};
use adapters::fanuc::native::{Native, NativeSettings};
use adapters::fanuc::wire::Number;
use adapters::fanuc_server::{Controller, ServerSettings};
use adapters::open::open_address;
use adapters::{Absence, Reading};
use serde_json::json;
use std::time::Duration;

/// Function 1/22: bytes, and what `cnc_modal` of the library makes of them: data, flag1, flag2. The same for the version words
/// 2, 3 and 4.
const MODAL: [(&str, i32, u8, u8); 12] = [
    ("000000fa 01020304", 250, 0x02, 4),
    ("00000005 00c00002", 5, 0xC0, 2),
    ("000000fa 00c00003", 250, 0xC0, 3),
    ("000000fa 00400003", 250, 0x40, 3),
    ("000004b0 00840000", 1200, 0x84, 0),
    ("000004b0 40000000", 1200, 0x00, 0),
    ("ffffff38 00c00002", -200, 0xC0, 2),
    ("000000fa 00400000", 250, 0x40, 0),
    ("7fffffff 00c00008", i32::MAX, 0xC0, 8),
    ("000000fa 00c000ff", 250, 0xC0, 0xFF),
    ("000004b0 00070000", 1200, 0x07, 0),
    ("00000303 ffff0000", 771, 0xFF, 0),
];

/// The value is the data with `flag2` decimals; more than nine make no sense.
fn expected((_, data, _, places): &(&str, i32, u8, u8)) -> Result<f64, Absence> {
    if *places > 9 { Err(Absence::OutOfRange) } else { Ok(f64::from(*data) / 10f64.powi(i32::from(*places))) }
}

/// Motion of a cut at 1000 rpm in millimetres; `group` is 0 for feed per minute, 1 for feed per revolution.
fn cut(version: u16, modal: &str, group: u8) -> ByteControl {
    let unit = if version <= 2 { "0000" } else { "0003" };
    let answers: Vec<Answer> = vec![
        ("1/19", bytes("0001 0003 0001 0000 0000 0000 0000")),
        ("1/88", bytes(unit)),
        ("1/21", vec![group, 0]),
        ("1/25", bytes("000003e8 000a 0000")),
        ("1/22", bytes(modal)),
    ];
    bytes::serve(version, answers)
}

fn read(control: &ByteControl) -> Vec<Reading> {
    let address: Address = format!("fanuc://{}", control.address).parse().expect("usable");
    poll(open_address(&address, 0).expect("opens").sources[0].as_mut()).expect("answers")
}

fn found(readings: &[Reading], channel: &str) -> Result<f64, Absence> {
    value(readings, channel).map(|value| value.as_number().expect("a number"))
}

#[test]
fn layouts_of_modal_words_are_read_natively_as_the_library_reads_them() {
    for version in VERSIONS {
        for row in &MODAL {
            let control = cut(version, row.0, 0);
            let speed = found(&read(&control), "spindle_programmed_rpm");
            assert_eq!(speed, expected(row), "{} of generation {version}", row.0);
            println!("generation {version} | {} | library {} {:02x} {} | native {speed:?}", row.0, row.1, row.2, row.3);
        }
    }
}

#[test]
fn layouts_of_feeds_are_millimetres_per_minute() {
    // F0.05 mm/rev at 1000 rpm; F250 and F0.25 in mm/min; 1200 with low bits of the flag set.
    for (modal, group, mm_min) in [
        ("0000000500C00002", 1, 50.0),
        ("000000fa00C00000", 0, 250.0),
        ("000000fa00C00003", 0, 0.25),
        ("000004b000840000", 0, 1200.0),
    ] {
        for version in VERSIONS {
            let feed = found(&read(&cut(version, modal, group)), "feed_programmed_mm_min");
            assert_eq!(feed, Ok(mm_min), "{modal} of generation {version}");
        }
    }
}

#[test]
fn layouts_of_modal_words_through_a_library_of_ours() {
    let library = library(&[]);
    for row in &MODAL {
        let mut settings = settings(&library);
        let told = format!("{} {} {}", row.1, row.2, row.3);
        settings.environment.push(("FAKE_LIBRARY_MODAL".to_owned(), told));
        let readings = poll(opened_in(settings, "fanuc://fake").sources[0].as_mut()).expect("answers");
        assert_eq!(found(&readings, "spindle_programmed_rpm"), expected(row), "{}", row.0);
    }
}

#[test]
fn layouts_of_modal_words_are_served_with_the_decimals_in_the_last_byte() {
    // Value, places, and the four bytes of the number and the last one, by hand.
    for (mantissa, places, number, last) in
        [(5, 2, "00000005", 2), (250, 3, "000000fa", 3), (1200, 0, "000004b0", 0), (-200, 2, "ffffff38", 2)]
    {
        for version in VERSIONS {
            let mut control = Controller::new(version, &['X']);
            control.modal_words.insert(BlockWord::F, Number::from_decimal(mantissa, places));
            let server = serve(control, ServerSettings::default());
            let data = ask(server.address(), 1, 0x22, 5);
            assert_eq!((&data[..4], data[7], data.len()), (&bytes(number)[..], last, 8), "generation {version}");
            assert_eq!(data[5] & 0x07, 0, "no decimals in the flag");
        }
    }
}

/// Other answers with every byte different, and what the library made of them.
fn marked() -> Vec<(u16, &'static str, Vec<u8>, FocasItem, FocasAnswer)> {
    let alarm = [&bytes("00000102 00000003 00000004 00000005")[..], b"TEXTxy", &[0; 58]].concat();
    let alarms = FocasAnswer::Alarms(vec![Alarm { number: 0x102, kind: 3, axis: 4, text: "TEXTx".into() }]);
    let life = FocasAnswer::Life { tools: 0x11, life: 0x13, count: 0x15 };
    let servos = |width: usize| [bytes("ffffffe1 0007 0001"), bytes("0000000a 000a 0001").repeat(width - 1)].concat();
    let loads = |width: usize| {
        let mut loads = vec![Some(1.0); width];
        loads[0] = Some(-3.1);
        FocasAnswer::Numbers(loads)
    };
    let units = "0001 0002 0003 0004 0005 0006";
    let mut rows = Vec::new();
    for version in VERSIONS {
        let width = if version <= 2 { 8 } else { 32 };
        rows.extend([
            (
                version,
                "1/40",
                bytes("01020304 0007 0002"),
                FocasItem::Spindles(Spindle::Gear),
                FocasAnswer::Numbers(vec![Some(772.0)]),
            ),
            (
                version,
                "1/40",
                bytes("ffffe0c0 000a 0000"),
                FocasItem::Spindles(Spindle::PlainLoad),
                FocasAnswer::Numbers(vec![Some(-8000.0)]),
            ),
            (version, "1/23", alarm.clone(), FocasItem::Alarms(8), alarms.clone()),
            (version, "1/6b", bytes("00000007"), FocasItem::HistoryCount, FocasAnswer::Whole(7)),
            (
                version,
                "1/8b",
                bytes("00000005 00000011 00000012 00000013 00000014 00000015"),
                FocasItem::ToolLife(5),
                life.clone(),
            ),
            (
                version,
                "1/120",
                bytes("00000102 00000304"),
                FocasItem::Timer(adapters::fanuc::item::Timer::PowerOn),
                FocasAnswer::Time { minutes: 0x102, milliseconds: 0x304 },
            ),
            (version, "1/56", servos(width), FocasItem::Servos(Servo::Load), loads(width)),
            (version, "1/26", servos(width), FocasItem::Position(Position::Machine, -1), loads(width)),
            (version, "1/21", bytes("0102"), FocasItem::ModalGroup(4), FocasAnswer::Groups(vec![1])),
            (version, "1/48", bytes("00000001 00000002 00000003"), FocasItem::ToolGroup, FocasAnswer::Whole(2)),
            (
                version,
                "1/88 2",
                bytes(units),
                FocasItem::PositionUnit(PositionFrame::Machine),
                FocasAnswer::Units(vec![2, 4, 6]),
            ),
        ]);
        let of_work = if version <= 2 { "1/88 2" } else { "1/88 1" };
        rows.push((
            version,
            of_work,
            bytes(units),
            FocasItem::PositionUnit(PositionFrame::Work),
            FocasAnswer::Units(vec![1, 3, 5]),
        ));
    }
    rows
}

#[test]
fn layouts_of_marked_answers_are_read_as_the_library_reads_them() {
    for (version, key, data, item, expected) in marked() {
        let control = bytes::serve(version, vec![(key, data)]);
        let at = Endpoint { host: control.address.ip().to_string(), port: control.address.port() };
        let encoding = adapters::text::TextEncoding::default();
        let mut native =
            Native::connect(NativeSettings { endpoint: at, path: 1, timeout: Duration::from_secs(5), encoding })
                .expect("opens");
        let mut out = Vec::new();
        native.ask_questions(&[item.to_question(1)], &mut out).expect("answers");
        assert_eq!(out, [Ok(expected)], "{key} of generation {version}");
    }
}

#[test]
fn layouts_of_chinese_texts_keep_every_byte() {
    // 急停 in GBK, and bytes that are no text in any set.
    let gbk = [&bytes("00000001 0000000f 00000000 00000006 bcb1cda3 2031")[..], &[0; 58]].concat();
    let none = [&bytes("00000001 0000000f 00000000 00000004 ffff2031")[..], &[0; 60]].concat();
    for (text, keys, expected) in [
        (gbk.clone(), "", "EX0001 急停 1"),
        (gbk.clone(), "encoding=gbk", "EX0001 急停 1"),
        (gbk, "encoding=utf-8", "EX0001 \\xBC\\xB1\\xCD\\xA3 1"),
        (none, "", "EX0001 \\xFF\\xFF 1"),
    ] {
        let status = bytes("0001 0000 0000 0000 0000 0001 0000");
        let control = bytes::serve(4, vec![("1/19", status), ("1/23", text)]);
        let address: Address = format!("fanuc://{}?{keys}", control.address).parse().expect("usable");
        let readings = poll(open_address(&address, 0).expect("opens").sources[0].as_mut()).expect("answers");
        assert_eq!(crate::fanuc::support::text(&readings, "alarm"), expected, "{keys}");
    }
}

#[test]
fn layouts_of_positions_have_the_unit_that_the_control_says() {
    // 2.0 inch of a linear axis, 90 degrees of one that turns, on a control whose parameters say nothing.
    let place = |width: usize| {
        [bytes("00004e20 000a 0004"), bytes("00015f90 000a 0003"), bytes("00000000 000a 0003").repeat(width - 2)]
            .concat()
    };
    for version in VERSIONS {
        let width = if version <= 2 { 8 } else { 32 };
        let answers: Vec<Answer> = vec![
            ("1/26", place(width)),
            ("1/89", bytes("58000000 42000000")),
            ("1/88 2", bytes("0000 0001 0000 0002")),
        ];
        let control = bytes::serve(version, answers);
        let address: Address = format!("fanuc://{}?axes=B", control.address).parse().expect("usable");
        let readings = poll(open_address(&address, 0).expect("opens").sources[0].as_mut()).expect("answers");
        assert_eq!((number(&readings, "x_axis_position_mm"), number(&readings, "b_axis_position_deg")), (50.8, 90.0));
    }
}

#[test]
fn interop_layouts_the_vendors_library_still_says_so() {
    let Some(file) = partner("CNC_GATEWAY_FWLIB") else { return };
    let (mut asked, mut wrong) = (0, Vec::new());
    for version in VERSIONS {
        for row in &MODAL {
            let control = cut(version, row.0, 0);
            let (host, port) = (control.address.ip().to_string(), control.address.port().to_string());
            let call = json!([{"call": "cnc_modal", "args": [["h", 107], ["h", 0], ["out", 260]], "read": "<hhiBB"}]);
            let told = python("library_client.py", &[&file.display().to_string(), &host, &port], &call);
            let expected = json!([107, 0, row.1, row.2, row.3]);
            asked += 1;
            if told[0]["numbers"] != expected {
                wrong.push(format!("generation {version} {}: {} for {expected}", row.0, told[0]));
            }
            let mut settings = crate::fanuc::interop::real_at(&file, control.address);
            settings.path = 1;
            let child = poll(opened_in(settings, "fanuc://real").sources[0].as_mut()).expect("answers");
            let speed = found(&child, "spindle_programmed_rpm");
            if speed != self::expected(row) {
                wrong.push(format!("generation {version} {} through our child: {speed:?}", row.0));
            }
        }
        for (mantissa, places) in [(5, 2), (250, 3), (1200, 0), (-200, 2)] {
            let mut control = Controller::new(version, &['X']);
            control.modal_words.insert(BlockWord::F, Number::from_decimal(mantissa, places));
            let server = serve(control, ServerSettings::default());
            let (host, port) = (server.address().ip().to_string(), server.address().port().to_string());
            let call = json!([{"call": "cnc_modal", "args": [["h", 103], ["h", 0], ["out", 260]], "read": "<hhixB"}]);
            let told = python("library_client.py", &[&file.display().to_string(), &host, &port], &call);
            asked += 1;
            if told[0]["numbers"] != json!([103, 0, mantissa, places]) {
                wrong.push(format!("served, generation {version}, {mantissa} with {places} places: {}", told[0]));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    println!("{asked} answers of the vendor's library, and {} through our child process: all equal", 3 * MODAL.len());
}
