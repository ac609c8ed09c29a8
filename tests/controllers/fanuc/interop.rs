//! The vendor's own library and pyfanuc as clients of our server, and the library under our own child process. Both are
//! named by environment variables, and their absence is said; nothing of them is part of this project.
//!
//! `CNC_GATEWAY_FWLIB=/path/to/libfwlib32-linux-x64.so.1.0.5 cargo test --test controllers interop -- --nocapture`
//! `CNC_GATEWAY_PYFANUC=/path/to/pyfanuc.py cargo test --test controllers interop -- --nocapture`

use crate::fanuc::support::{number, poll, serve};
use crate::fanuc::units::{CASES, control};
use crate::fanuc::vendor::opened_in;
use adapters::address::Endpoint;
use adapters::fanuc::answer::{Alarm, OperatorMessage, PastAlarm, SpeedUnit, Status, System};
use adapters::fanuc::item::{Area, BlockWord};
use adapters::fanuc::vendor::VendorSettings;
use adapters::fanuc::wire::Number;
use adapters::fanuc_server::{Controller, ProgramFile, Server, ServerSettings, ToolGroup};
use serde_json::{Value, json};
use std::io::Write;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use testkit::library::Library;

/// The file that this variable names, or words that it is not there.
pub(crate) fn partner(variable: &str) -> Option<PathBuf> {
    let found = std::env::var_os(variable).map(PathBuf::from);
    if found.is_none() {
        eprintln!("SKIPPED: {variable} names no file; it is run by hand, see the handbook's chapter about FANUC");
    }
    found
}

/// Runs a script of this folder with Python and gives what it prints as JSON.
pub(crate) fn python(script: &str, arguments: &[&str], input: &Value) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/controllers/fanuc").join(script);
    let mut command = Command::new("python3");
    command.arg(script).args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.spawn().expect("python3 starts");
    write!(child.stdin.take().expect("piped"), "{input}").expect("it reads");
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success(), "{:?} {}", output.status, String::from_utf8_lossy(&output.stdout));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// The control that the partners talk to: every value differs from every other.
pub(crate) fn machine(version: u16) -> Controller {
    let mut control = Controller::new(version, &['X', 'Y', 'Z']);
    control.system = System { series: "D4F1".into(), machine: "M".into(), ..control.system };
    control.status = Status { automatic: 1, run: 3, motion: 1, ..Status::default() };
    control.measure_in_inches(false);
    control.feed_in(SpeedUnit::MmMin, Number::from_decimal(1200, 0));
    let quantities = [27, 6000, 2, 8000, 275, 8012];
    control.spindles[0].quantities = quantities.map(|value| Number::from_decimal(value, 0));
    control.spindles[0].quantities[4] = Number::from_decimal(275, 1);
    let values = [
        (-31, 12, [123_456, 223_456, 1000, 500]),
        (52, 34, [-98_765, -198_765, 2000, 0]),
        (118, 56, [10_500, -10_500, -3000, -250]),
    ];
    for (axis, (load, current, positions)) in control.axes.iter_mut().zip(values) {
        (axis.load, axis.current) = (Number::from_decimal(load, 0), Number::from_decimal(current, 1));
        axis.positions = positions.map(|position| Number::from_decimal(position, 3));
    }
    (control.program, control.program_path) = ((1234, 1000), "//CNC_MEM/USER/PATH1/O1234".into());
    (control.sequence, control.blocks, control.alarm_bits) = (120, 77, 72);
    control.executed = (0, "N120 G01 X10.5 F1200\nN130 Z-2.\nM30\n%".into());
    control.clock = [2026, 11, 24, 21, 5, 9];
    control.timers = [(12345, 6000), (2345, 5000), (345, 4000), (45, 3000)];
    control.set_modal_words([
        (BlockWord::F, 1200),
        (BlockWord::M, 3),
        (BlockWord::S, 8000),
        (BlockWord::T, 12),
        (BlockWord::R, 77),
        (BlockWord::H, 7),
    ]);
    control.g_codes.extend(
        [(0, 1), (1, 17), (13, 543)].map(|(group, code)| (group, Number::from_decimal(code, i16::from(code == 543)))),
    );
    texts(&mut control);
    variables(&mut control);
    control
}

fn texts(control: &mut Controller) {
    let alarm = |number, kind, axis, text: &str| Alarm { number, kind, axis, text: text.into() };
    control.alarms = vec![alarm(100, 3, 0, "PARAMETER ENABLE SWITCH ON"), alarm(417, 6, 2, "SERVO ALARM")];
    let past = |alarm, minute| PastAlarm { alarm, at: [2026, 11, 24, 20, minute, 7] };
    control.alarm_history =
        vec![past(alarm(5010, 3, 0, "END OF RECORD"), 15), past(alarm(417, 6, 2, "SERVO ALARM"), 16)];
    control.messages = vec![OperatorMessage { number: 2001, kind: 0, text: "CHANGE THE BOX OF PARTS".into() }];
    let file = |number, bytes, comment: &str| ProgramFile { number, bytes, comment: comment.into() };
    control.programs = vec![file(1000, 2048, "MAIN"), file(1234, 512, "POCKET")];
}

fn variables(control: &mut Controller) {
    control.macros.extend([(500, Some(25.5)), (502, Some(-3.25))]);
    for (number, kind, value) in
        [(6711, 3, 456), (6712, 3, 9456), (6713, 3, 500), (20, 1, 4), (3208, 0, 33), (3741, 3, 6000)]
    {
        control.set_parameter(number, kind, Number::from_decimal(value, 0));
    }
    [3106, 9936].into_iter().for_each(|number| control.set_parameter(number, 3, Number::from_decimal(0, 0)));
    let each = |values: [i32; 3], places| values.map(|value| Number::from_decimal(value, places)).to_vec();
    control.parameters.insert(3115, adapters::fanuc_server::Data { kind: 0, values: each([0; 3], 0) });
    control
        .parameters
        .insert(1420, adapters::fanuc_server::Data { kind: 3, values: each([24_000, 24_001, 24_002], 0) });
    control.set_parameter(1410, 3, Number::from_decimal(3000, 0));
    control.diagnosis_of_axes(308, 2, each([41, 42, 43], 0));
    control.diagnosis_of_axes(301, 2, each([11, 12, 13], 0));
    control.tool_offsets.extend([((1, 0), -1234), ((1, 3), 98_765)]);
    control.work_offsets.extend([((0, 1), -250), ((1, 1), 10_000), ((1, 2), 20_000), ((1, 3), 30_000)]);
    control.tool_groups.insert(5, ToolGroup { tools: 3, life: 200, count: 17 });
    control.tool_group = [6, 5, 5];
    control.memory.set_byte(Area::G, 12, 0x9B);
    (-123_456i32).to_le_bytes().iter().zip(100..).for_each(|(byte, at)| control.memory.set_byte(Area::R, at, *byte));
}

const ALL: &[u16] = &[2, 3, 4];
const NEWER: &[u16] = &[3, 4];

/// A call, its arguments, the format of what it fills in, and what must be found there.
type Call = (&'static str, Value, &'static str, Value, &'static [u16]);

fn h(value: i16) -> Value {
    json!(["h", value])
}

fn out(size: usize) -> Value {
    json!(["out", size])
}

/// Every call with the values that the control was given, by hand; a position of 123456 is 123.456 mm.
fn calls() -> Vec<Call> {
    [states(), axes(), programs(), data(), tools()].into_iter().flatten().collect()
}

fn states() -> Vec<Call> {
    let speed = json!([1200, 0, 0, "F", 8000, 0, 2, "S"]);
    let (n, n1) = (json!(["*h", 4]), json!(["*h", 10]));
    let alarms = json!([100, 3, 0, 26, "PARAMETER ENABLE SWITCH ON", 417, 6, 2, 11, "SERVO ALARM"]);
    vec![
        ("cnc_statinfo", json!([out(18)]), "<9h", json!([0, 0, 1, 3, 1, 0, 0, 0, 0]), ALL),
        ("cnc_statinfo2", json!([out(26)]), "<13h", json!([0, 0, 1, 3, 1, 0, 0, 0, 0, 0, 0, 0, 0]), ALL),
        ("cnc_rdcncid", json!([out(16)]), "<4I", json!([0x0001_0002, 0x0003_0004, 0x0005_0006, 0x0007_0008]), ALL),
        ("cnc_actf", json!([out(8)]), "<4xi", json!([1200]), ALL),
        ("cnc_acts", json!([out(8)]), "<4xi", json!([8000]), ALL),
        ("cnc_acts2", json!([h(-1), out(36)]), "<h2xi", json!([-1, 8000]), ALL),
        ("cnc_rdspeed", json!([h(-1), out(24)]), "<ihh2xcxihh2xcx", speed, ALL),
        ("cnc_rdspmeter", json!([h(-1), n, out(96)]), "<ihhc3xihh", json!([275, 1, 0, "S", 8012, 0, 1]), ALL),
        ("cnc_rdspload", json!([h(-1), out(20)]), "<h2xh", json!([-1, 27]), ALL),
        ("cnc_rdspmaxrpm", json!([h(-1), out(20)]), "<h2xh", json!([-1, 6000]), ALL),
        ("cnc_rdspgear", json!([h(-1), out(20)]), "<h2xh", json!([-1, 2]), ALL),
        ("cnc_modal", json!([h(103), h(0), out(260)]), "<hhi", json!([103, 0, 1200]), ALL),
        ("cnc_modal", json!([h(106), h(0), out(260)]), "<hhi", json!([106, 0, 3]), ALL),
        ("cnc_modal", json!([h(107), h(0), out(260)]), "<hhi", json!([107, 0, 8000]), ALL),
        ("cnc_modal", json!([h(108), h(0), out(260)]), "<hhi", json!([108, 0, 12]), ALL),
        ("cnc_modal", json!([h(109), h(0), out(260)]), "<hhi", json!([109, 0, 77]), ALL),
        ("cnc_modal", json!([h(4), h(0), out(260)]), "<hhB", json!([4, 0, 0]), ALL),
        ("cnc_rdgcode", json!([h(13), h(0), n1, out(240)]), "<hh8s", json!([13, 1, "G54.3"]), ALL),
        ("cnc_rdgcode", json!([h(-1), h(0), ["*h", 20], out(240)]), "<hh8s", json!([0, 1, "G01"]), ALL),
        ("cnc_rdcommand", json!([h(18), h(0), ["*h", 10], out(120)]), "<cBhii", json!(["S", 0, 1, 8000, 0]), ALL),
        ("cnc_alarm2", json!([out(4)]), "<i", json!([72]), ALL),
        ("cnc_rdalmmsg2", json!([h(-1), ["*h", 8], out(608)]), "<ihh2xh64sihh2xh64s", alarms, ALL),
        ("cnc_rdalmhisno", json!([out(2)]), "<H", json!([2]), ALL),
        (
            "cnc_rdalmhistry",
            json!([["H", 1], ["H", 2], ["H", 4 + 48 * 2 + 4], out(148)]),
            "<H2xH2xhh7bxh32s",
            json!([1, 2, 3, 5010, 0, 26, 11, 24, 20, 15, 7, 13, "END OF RECORD"]),
            ALL,
        ),
        ("cnc_gettimer", json!([["in", "0000cccccccccccccccccccccccccccc"]]), "<h2x3h", json!([0, 2026, 11, 24]), ALL),
        ("cnc_gettimer", json!([["in", "0100cccccccccccccccccccccccccccc"]]), "<h2x3h", json!([1, 21, 5, 9]), ALL),
        ("cnc_rdtimer", json!([h(0), out(8)]), "<ii", json!([12345, 6000]), ALL),
        ("cnc_rdtimer", json!([h(3), out(8)]), "<ii", json!([45, 3000]), ALL),
        (
            "cnc_rdopmsg",
            json!([h(0), h(262), out(262)]),
            "<hhh23s",
            json!([2001, 0, 23, "CHANGE THE BOX OF PARTS"]),
            ALL,
        ),
        (
            "cnc_rdopmsg3",
            json!([h(-1), ["*h", 5], out(1310)]),
            "<hhh23s",
            json!([2001, 0, 23, "CHANGE THE BOX OF PARTS"]),
            ALL,
        ),
    ]
}

fn axes() -> Vec<Call> {
    let (eight, all) = (json!(["*h", 8]), out(4 + 4 * 32));
    let position = json!([123_456, 3, 0, 1, "X", 223_456, 3, 0, 1, "X", 1000, 3, 0, 1, "X", 500, 3, 0, 1, "X"]);
    let loads = json!([31, 0, 0, "X", 52, 0, 0, "Y", 118, 0, 0, "Z"]);
    let dynamic = json!([1, 72, 1234, 1000, 120, 1200, 8000, 123_456, 223_456, 1000, 500]);
    vec![
        ("cnc_rdposition", json!([h(-1), eight.clone(), out(48 * 8)]), "<ihhhcxihhhcxihhhcxihhhcx", position, NEWER),
        (
            "cnc_rdposition",
            json!([h(-1), eight.clone(), out(48 * 8)]),
            "<ihh2xcxihh2xcxihh2xcxihh2xcx",
            json!([123_456, 3, 0, "X", 223_456, 3, 0, "X", 1000, 3, 0, "X", 500, 3, 0, "X"]),
            &[2],
        ),
        ("cnc_absolute2", json!([h(-1), h(132), all.clone()]), "<4x3i", json!([123_456, -98_765, 10_500]), ALL),
        ("cnc_absolute", json!([h(-1), h(132), all.clone()]), "<4x3i", json!([123_456, -98_765, 10_500]), ALL),
        ("cnc_machine", json!([h(-1), h(132), all.clone()]), "<4x3i", json!([223_456, -198_765, -10_500]), ALL),
        ("cnc_relative2", json!([h(-1), h(132), all.clone()]), "<4x3i", json!([1000, 2000, -3000]), ALL),
        ("cnc_distance", json!([h(-1), h(132), all.clone()]), "<4x3i", json!([500, 0, -250]), ALL),
        ("cnc_rddynamic2", json!([h(1), h(44), out(44)]), "<2xh10i", dynamic, ALL),
        ("cnc_rdsvmeter", json!([eight.clone(), out(96)]), "<ihhc3xihhc3xihhc3x", loads, ALL),
        ("cnc_rdaxisname", json!([eight.clone(), out(32)]), "<cxxxcxxx", json!(["X", "Y"]), &[]),
        ("cnc_rdaxisdata", json!([h(2), ["*h", 2], h(1), eight, out(128)]), "<4sihh", json!(["X", 12, 1, 9]), NEWER),
        ("cnc_rdzofs", json!([h(1), h(-1), h(132), all]), "<hh3i", json!([1, -1, 10_000, 20_000, 30_000]), ALL),
        ("cnc_rdzofs", json!([h(0), h(1), h(8), out(8)]), "<hhi", json!([0, 1, -250]), ALL),
    ]
}

fn programs() -> Vec<Call> {
    let listed = json!([1000, 2048, "MAIN"]);
    vec![
        ("cnc_rdprgnum", json!([out(8)]), "<4xhh", json!([1234, 1000]), ALL),
        ("cnc_exeprgname", json!([out(40)]), "<36si", json!(["O1234", 1234]), ALL),
        ("cnc_exeprgname2", json!([out(256)]), "<256s", json!(["//CNC_MEM/USER/PATH1/O1234"]), ALL),
        ("cnc_rdseqnum", json!([out(8)]), "<4xi", json!([120]), ALL),
        ("cnc_rdblkcount", json!([out(4)]), "<i", json!([77]), ALL),
        ("cnc_rdexecprog", json!([["*h", 128], ["*h", 0], out(256)]), "<20s", json!(["N120 G01 X10.5 F1200"]), ALL),
        ("cnc_rdprogdir3", json!([h(2), ["*I", 1], ["*h", 5], out(440)]), "<ii4x52s", listed, ALL),
        ("cnc_rdproginfo", json!([h(0), h(12), out(12)]), "<hhii", json!([2, 398, 2560, 521_728]), ALL),
        ("cnc_rdpdf_curdir", json!([h(1), out(256)]), "<256s", json!(["//CNC_MEM/USER/PATH1/"]), NEWER),
    ]
}

fn data() -> Vec<Call> {
    let (g12, r100) = ([h(0), h(0)], [h(5), h(2)]);
    let pmc = |head: [Value; 2], from: u16, to: u16, len: u16| {
        let [area, width] = head;
        json!([area, width, ["H", from], ["H", to], ["H", len], out(usize::from(len))])
    };
    vec![
        ("cnc_rdmacro", json!([h(500), h(10), out(10)]), "<h2xih", json!([500, 255_000_000, 7]), &[]),
        ("cnc_rdmacro", json!([h(501), h(10), out(10)]), "<h2xih", json!([501, 0, -1]), ALL),
        ("cnc_rdmacror2", json!([["i", 500], ["*I", 1], out(8)]), "<d", json!([25.5]), ALL),
        ("cnc_rdmacror2", json!([["i", 502], ["*I", 1], out(8)]), "<d", json!([-3.25]), ALL),
        ("cnc_rdparam", json!([h(6711), h(0), h(8), out(260)]), "<hhi", json!([6711, 0, 456]), ALL),
        ("cnc_rdparam", json!([h(6712), h(0), h(8), out(260)]), "<hhi", json!([6712, 0, 9456]), ALL),
        ("cnc_rdparam", json!([h(20), h(0), h(5), out(260)]), "<hhB", json!([20, 0, 4]), ALL),
        ("cnc_rdparam", json!([h(3208), h(0), h(5), out(260)]), "<hhB", json!([3208, 0, 33]), ALL),
        ("cnc_rdparam", json!([h(3741), h(0), h(8), out(260)]), "<hhi", json!([3741, 0, 6000]), ALL),
        ("cnc_rdparam", json!([h(1410), h(0), h(8), out(260)]), "<hhi", json!([1410, 0, 3000]), ALL),
        ("cnc_rdparam", json!([h(1420), h(2), h(8), out(260)]), "<hhi", json!([1420, 2, 24_001]), ALL),
        ("cnc_diagnoss", json!([h(308), h(1), h(8), out(260)]), "<hhi", json!([308, 1, 41]), ALL),
        ("cnc_diagnoss", json!([h(301), h(3), h(8), out(260)]), "<hhi", json!([301, 3, 13]), ALL),
        ("pmc_rdpmcrng", pmc(g12, 12, 12, 9), "<hhHHB", json!([0, 0, 12, 12, 155]), ALL),
        ("pmc_rdpmcrng", pmc(r100, 100, 103, 12), "<hhHHi", json!([5, 2, 100, 103, -123_456]), ALL),
    ]
}

fn tools() -> Vec<Call> {
    vec![
        ("cnc_rdtofs", json!([h(1), h(0), h(8), out(8)]), "<hhi", json!([1, 0, -1234]), ALL),
        ("cnc_rdtofs", json!([h(1), h(3), h(8), out(8)]), "<hhi", json!([1, 3, 98_765]), ALL),
        ("cnc_rdtofsr", json!([h(1), h(0), h(2), h(16), out(16)]), "<3h2xii", json!([1, 0, 2, -1234, 0]), ALL),
        ("cnc_rdtofsinfo", json!([out(4)]), "<hh", json!([3, 99]), ALL),
        ("cnc_rdtofsinfo2", json!([out(6)]), "<3h", json!([3, 99, 1]), ALL),
        ("cnc_rdtlusegrp", json!([out(24)]), "<3i", json!([6, 5, 5]), NEWER),
        ("cnc_rdngrp", json!([out(8)]), "<4xi", json!([1]), ALL),
        ("cnc_rdntool", json!([h(5), out(8)]), "<h2xi", json!([5, 3]), ALL),
        ("cnc_rdlife", json!([h(5), out(8)]), "<h2xi", json!([5, 200]), ALL),
        ("cnc_rdcount", json!([h(5), out(8)]), "<h2xi", json!([5, 17]), ALL),
    ]
}

fn ask_library(library: &Path, server: &Server, calls: &[&Call]) -> Vec<Value> {
    let (host, port) = (server.address().ip().to_string(), server.address().port().to_string());
    let input: Vec<Value> =
        calls.iter().map(|(call, args, read, ..)| json!({"call": call, "args": args, "read": read})).collect();
    let found = python("library_client.py", &[&library.display().to_string(), &host, &port], &Value::from(input));
    found.as_array().expect("a list").clone()
}

#[test]
fn interop_the_vendors_library_reads_every_value_from_our_server() {
    let Some(library) = partner("CNC_GATEWAY_FWLIB") else { return };
    let all = calls();
    let mut wrong = Vec::new();
    for version in [4, 3, 2] {
        let server = serve(machine(version), ServerSettings::default());
        let calls: Vec<&Call> = all.iter().filter(|(.., versions)| versions.contains(&version)).collect();
        let found = ask_library(&library, &server, &calls);
        for ((call, args, _, expected, _), found) in calls.iter().zip(&found) {
            if found["code"] != 0 || found["numbers"] != *expected {
                wrong.push(format!("generation {version} {call}{args}: expected {expected}, found {found}"));
            }
        }
        println!("generation {version}: {} calls of the vendor's library", calls.len());
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn interop_units_as_the_vendors_library_and_our_child_with_it_read_them() {
    let Some(library) = partner("CNC_GATEWAY_FWLIB") else { return };
    println!(
        "generation | unit | machine | set mm/min | library: data, decimals, unit | native | child with the library"
    );
    for version in [4, 3, 2] {
        for case in &CASES {
            for inch in [false, true] {
                let mut control = control(version, case, inch);
                [3106, 9936]
                    .into_iter()
                    .for_each(|number| control.set_parameter(number, 3, Number::from_decimal(0, 0)));
                let server = serve(control, ServerSettings::default());
                let call: Call = ("cnc_rdspeed", json!([h(0), out(24)]), "<ihh", json!([]), ALL);
                let told = ask_library(&library, &server, &[&call]).remove(0);
                assert_eq!(
                    told["numbers"],
                    json!([case.shown.0, case.shown.1, case.in_library]),
                    "{version} {:?}",
                    case.unit
                );
                let native = poll(crate::fanuc::support::opened(&server, "").sources[0].as_mut()).expect("answers");
                let mut opened = opened_in(real(&library, &server), "fanuc://real");
                let child = poll(opened.sources[0].as_mut()).expect("answers");
                for readings in [&native, &child] {
                    let feed = number(readings, "feed_mm_min");
                    assert!((feed - case.mm_min).abs() < 1e-6, "{version} {:?}: {feed}", case.unit);
                    assert!((number(readings, "x_axis_position_mm") - 50.8).abs() < 1e-6, "{version} {inch}");
                    assert_eq!(number(readings, "spindle_programmed_rpm"), 1000.0);
                }
                println!(
                    "{version} | {:?} | {} | {} | {} | {} | {}",
                    case.unit,
                    if inch { "inch" } else { "mm" },
                    case.mm_min,
                    told["numbers"],
                    number(&native, "feed_mm_min"),
                    number(&child, "feed_mm_min")
                );
            }
        }
    }
}

pub(crate) fn real(library: &Path, server: &Server) -> VendorSettings {
    real_at(library, server.address())
}

pub(crate) fn real_at(library: &Path, address: SocketAddr) -> VendorSettings {
    VendorSettings {
        vendor_library: library.to_owned(),
        endpoint: Endpoint { host: address.ip().to_string(), port: address.port() },
        path: 1,
        timeout: Duration::from_secs(2),
        encoding: adapters::text::TextEncoding::default(),
        deadline: None,
        program: Some(Library::program()),
        environment: Vec::new(),
    }
}
