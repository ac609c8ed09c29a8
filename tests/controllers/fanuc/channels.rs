//! Further axes and spindles by their own names, details, and the user's own channels of every kind: read natively and, where
//! it is named, through the vendor's library; in a whole box with its history.

use crate::fanuc::commands::doctor;
use crate::fanuc::interop::{machine, partner, real};
use crate::fanuc::support::{number, poll, serve, text, value};
use crate::fanuc::vendor::opened_in;
use adapters::address::Target;
use adapters::clock::{Clock, SystemClock};
use adapters::fanuc::open::{OpenedFanuc, open_native};
use adapters::fanuc::wire::Number;
use adapters::fanuc_server::{Controller, Data, Server, ServerSettings, SpindleState};
use adapters::{Absence, Address, Reading};
use std::time::Duration;
use testkit::process::{get, run, stderr, stdout, text as path_text, wait_for};
use testkit::served::{channel, prepared, started};

/// Eight axes with names of their own, two of which turn, two spindles, and a second path with two axes more.
fn turning_centre(version: u16) -> Controller {
    let names = ["X1", "Z1", "Y1", "C1", "A", "B", "W", "V"];
    let mut control = machine(version).with_axes(&names).with_path(&["X2", "Z2"]);
    for (place, axis) in (1..).zip(&mut control.axes) {
        axis.positions = [10, 20, 30, 40].map(|which| Number::from_decimal(1000 * place + which, 3));
        (axis.load, axis.current) = (Number::from_decimal(place, 0), Number::from_decimal(10 * place, 1));
    }
    let each = |from: i32| (0..8).map(|place| Number::from_decimal(from + place, 0)).collect::<Vec<_>>();
    control.diagnosis_of_axes(308, 2, each(41));
    control.diagnosis_of_axes(309, 2, each(31));
    // C1, A and B turn.
    let rotary = (0..8).map(|place| Number::from_decimal(i32::from((3..6).contains(&place)), 0)).collect();
    control.parameters.insert(1006, Data { kind: 0, values: rotary });
    let second = [15, 4000, 1, 3000, 45, 3001].map(|value| Number::from_decimal(value, 0));
    control.spindles.push(SpindleState { quantities: second });
    control.opening.spindles = 2;
    control.further[0].axes[1].positions[1] = Number::from_decimal(-77_000, 3);
    control.further[0].parameters.insert(1006, Data { kind: 0, values: vec![Number::from_decimal(0, 0); 2] });
    control
}

/// What the configuration of a box says besides the address: one channel of each kind.
const OWN: &str = r#"
[[source.channel]]
name = "own_variable_mm"
read = "macro 502"
unit = "mm"
[[source.channel]]
name = "own_parts"
read = "parameter 6711"
[[source.channel]]
name = "own_rapid_mm_min"
read = "parameter 1420 axis 2"
unit = "mm/min"
[[source.channel]]
name = "own_temperature_c"
read = "diagnosis 308 axis 3"
unit = "°C"
[[source.channel]]
name = "own_dword_bar"
read = "pmc R100 long"
unit = "bar"
scale = -0.001
offset = 1.0
[[source.channel]]
name = "own_bit"
read = "pmc G12.3"
pace = "fast"
[[source.channel]]
name = "own_tool_length_mm"
read = "tool_offset 1 type 3"
unit = "mm"
[[source.channel]]
name = "own_work_offset_mm"
read = "work_offset 1 axis 2"
unit = "mm"
[[source.channel]]
name = "own_vacant"
read = "macro 501"
"#;

/// What they must show, by hand: -123456 x -0.001 + 1; 0x9B has bit 3; offsets are thousandths.
const SHOWN: [(&str, f64); 8] = [
    ("own_variable_mm", -3.25),
    ("own_parts", 456.0),
    ("own_rapid_mm_min", 24_001.0),
    ("own_temperature_c", 43.0),
    ("own_dword_bar", 124.456),
    ("own_bit", 1.0),
    ("own_tool_length_mm", 98.765),
    ("own_work_offset_mm", 20.0),
];

const KEYS: &str = "paths=1,2&axes=X1,Z1,Y1,C1,A,B,W,V,Z2@2&positions=absolute,relative,to_go&spindles=2&duty_pct=100&timeout_ms=10000";

fn opened(server: &Server) -> OpenedFanuc {
    let address: Address = format!("fanuc://{}?{KEYS}", server.address()).parse().expect("usable");
    let Target::Fanuc { at, path, options, .. } = address.target() else { panic!("{address}") };
    open_native(address.text(), at, *path, options)
}

fn everything(opened: &mut OpenedFanuc) -> Vec<Reading> {
    opened.sources.iter_mut().flat_map(|source| poll(source.as_mut()).expect("answers")).collect()
}

/// What is read of the turning centre, whoever reads it; by hand from the control above.
fn centre(readings: &[Reading], version: u16) {
    let expected = [
        ("x1_axis_position_mm", 1.020),
        ("z1_axis_position_mm", 2.020),
        ("c1_axis_position_deg", 4.020),
        ("a_axis_absolute_deg", 5.010),
        ("b_axis_relative_deg", 6.030),
        ("w_axis_to_go_mm", 7.040),
        ("v_axis_load_pct", 8.0),
        ("y1_axis_current_a", 3.0),
        ("c1_axis_motor_temperature_c", 44.0),
        ("v_axis_encoder_temperature_c", 38.0),
        ("z2_axis_position_mm", -77.0),
        ("spindle_speed_rpm", 8000.0),
        ("spindle2_speed_rpm", 3000.0),
        ("spindle2_load_pct", 45.0),
        ("part_count", 456.0),
        ("parts_total", 9456.0),
        ("parts_required", 500.0),
        ("power_on_time_s", 740_706.0),
        ("cycle_time_s", 2703.0),
        ("tool_life", 200.0),
        ("tool_life_used", 17.0),
    ];
    for (name, wanted) in expected {
        let found = number(readings, name);
        assert!((found - wanted).abs() < 1e-9, "{name}: {found}, not {wanted}");
    }
    assert_eq!(text(readings, "block_text"), "N120 G01 X10.5 F1200");
    assert_eq!(text(readings, "operator_message"), "2001 CHANGE THE BOX OF PARTS");
    assert_eq!(text(readings, "g_codes"), "G01 G17 G94 G54.3");
    assert_eq!(text(readings, "m_code"), "M3");
    let history = text(readings, "alarm_history");
    let [servo, program] = if version < 3 { ["SV 417", "P/S 5010"] } else { ["SV0417", "PS5010"] };
    assert!(
        history.starts_with(&format!("2026-11-24 20:16:07 {servo} (Z1) SERVO ALARM; 2026-11-24 20:15:07 {program}")),
        "{history}"
    );
}

#[test]
fn eight_axes_two_spindles_and_two_paths_by_their_names() {
    for version in [2, 3, 4] {
        let server = serve(turning_centre(version), ServerSettings::default());
        let mut opened = opened(&server);
        assert_eq!(opened.refused, None);
        centre(&everything(&mut opened), version);
    }
}

#[test]
fn an_axis_of_the_other_kind_has_no_position() {
    let server = serve(turning_centre(4), ServerSettings::default());
    let address: Address = format!("fanuc://{}?axes=B:mm", server.address()).parse().expect("usable");
    let mut opened = adapters::open::open_address(&address, SystemClock::new().now_ns()).expect("opens");
    let readings = poll(opened.sources[0].as_mut()).expect("answers");
    assert_eq!(value(&readings, "b_axis_position_mm"), Err(Absence::NotSupported), "B turns");
    assert_eq!(number(&readings, "b_axis_load_pct"), 6.0);
}

#[test]
fn interop_the_same_channels_through_the_vendors_library() {
    let Some(library) = partner("CNC_GATEWAY_FWLIB") else { return };
    // The library has neither currents nor unit codes for every axis of the older controls.
    let server = serve(turning_centre(4), ServerSettings::default());
    let mut opened = opened_in(real(&library, &server), &format!("fanuc://real?{KEYS}"));
    centre(&everything(&mut opened), 4);
    println!("the channels of eight axes, two spindles and two paths are the same through the vendor's library");
}

#[test]
fn a_box_stores_own_channels_of_every_kind() {
    let server = serve(turning_centre(4), ServerSettings::default());
    let address = format!("fanuc://{}?{KEYS}", server.address());
    let directory = tempfile::tempdir().expect("a directory");
    let config = prepared(directory.path(), "", &format!("[[source]]\naddress = \"{address}\"\n{OWN}"));
    let (gateway, at) = started(&config);
    wait_for("the own channels in the merged sample", Duration::from_secs(60), || {
        let status = get(&at, "/api/v1/status").json();
        let near = |(name, wanted): &(&str, f64)| {
            channel(&status, name).and_then(|value| value.as_f64()).is_some_and(|found| (found - wanted).abs() < 1e-6)
        };
        (SHOWN.iter().all(near) && channel(&status, "c1_axis_position_deg").is_some()).then_some(())
    });
    std::thread::sleep(Duration::from_secs(2));
    gateway.stop();
    let database = directory.path().join("data/history.db");
    let found = run(&[
        "history",
        "query",
        "--history",
        path_text(&database),
        "--channels",
        "own_dword_bar,own_bit,z2_axis_position_mm,spindle2_speed_rpm",
    ]);
    assert!(found.status.success(), "{}", stderr(&found));
    let rows = stdout(&found);
    let last = rows.lines().last().expect("a row");
    println!("{}\n{last}", rows.lines().next().unwrap_or_default());
    for part in ["124.456", "-77", "3000"] {
        assert!(last.contains(part), "{part}: {last}");
    }
    let (_, report) = doctor(&[&address, "--config", path_text(&config)]);
    let readings = report["readings"].as_array().expect("a list");
    for (name, wanted, unit) in [("c1_axis_position_deg", 4.02, "°"), ("own_dword_bar", 124.456, "bar")] {
        let shown = readings.iter().find(|row| row["channel"] == name).expect("doctor shows it");
        assert!((shown["value"].as_f64().expect("a number") - wanted).abs() < 1e-6, "{shown}");
        assert_eq!(shown["unit"].as_str(), Some(unit));
    }
}
