//! The contract as it always was, and files of strangers.

use super::*;
use crate::Recording;

pub(super) fn read(text: &str) -> Result<ReadRecording, RecordingError> {
    read_csv(text.as_bytes(), "t.csv")
}

pub(super) fn under(text: &str, map: &str) -> Result<ReadRecording, RecordingError> {
    let mapping = Mapping::parse(&format!("schema = \"map/1\"\n{map}"), "map").expect("a map");
    read_input(Input::from_memory(text.as_bytes().to_vec(), "t.csv"), &mapping)
}

pub(super) fn told(read: &ReadRecording) -> String {
    read.notes.iter().map(|note| note.text.en.clone()).collect::<Vec<_>>().join("\n")
}

pub(super) fn column(recording: &Recording, name: &str) -> Vec<Option<f64>> {
    recording.find_numbers(name).unwrap_or_else(|| panic!("no column {name}")).iter().collect()
}

#[test]
fn a_bad_cell_refuses_its_row_with_line_and_column() {
    let got = read("time_s,spindle_power_w\n0,1\n1,abc\n2,\n").expect("readable");
    assert_eq!(got.recording.count_rows(), 2);
    assert_eq!(got.refused, 1);
    let problem = got.problems[0].to_string();
    assert!(problem.starts_with("line 3, column spindle_power_w: \"abc\""), "{problem}");
    assert_eq!(got.recording.find_numbers("spindle_power_w").map(|n| n.get(1)), Some(None));
}

#[test]
fn time_may_restart_only_at_a_new_run() {
    let got = read("time_s,run,engaged\n0,a,1\n1,a,1\n0,a,1\n0,b,1\n").expect("readable");
    assert_eq!((got.recording.count_rows(), got.refused), (3, 1));
    assert_eq!(got.recording.list_runs().len(), 2);
    assert!(!got.recording.pauses_known());
}

#[test]
fn utc_times_are_seconds_since_the_first_row() {
    let got = read("time_utc,x_v\n2026-01-31T08:15:00Z,1\n2026-01-31T08:15:02.5Z,2\n").expect("readable");
    assert_eq!(got.recording.time_s, vec![0.0, 2.5]);
    assert!(got.recording.start_ns.is_some() && got.recording.pauses_known());
    assert!(got.notes.is_empty(), "{:?}", got.notes);
}

#[test]
fn numbers_in_text_columns_stay_text_and_unknown_columns_are_kept() {
    let got = read("time_s,run,pump_v,note\n0,1,,\n1,1,3.5,door open\n").expect("readable");
    let recording = got.recording;
    assert_eq!(recording.find_words("run").and_then(|words| words.get(0)), Some("1"));
    assert_eq!(recording.find_numbers("pump_v").and_then(|numbers| numbers.get(1)), Some(3.5));
    assert_eq!(recording.find_words("note").and_then(|words| words.get(1)), Some("door open"));
}

#[test]
fn a_header_without_time_is_refused() {
    let error = read("a,b\n1,2\n").expect_err("no time").to_string();
    assert!(error.contains("time_s"), "{error}");
}

/// One strange cell in the first row must not make words of a column of numbers.
#[test]
fn no_single_cell_decides_what_a_column_is() {
    for (first, value) in
        [("NaN", None), ("#N/A", None), ("UNAVAILABLE", None), ("\"1,250.0\"", Some(1250.0)), ("broken", None)]
    {
        let got = read(&format!("time_s,pump_flow_l_min,spindle_power_w\n0,{first},1\n1,2.5,1\n2,3.5,1\n"))
            .expect("readable");
        assert_eq!(column(&got.recording, "pump_flow_l_min"), [value, Some(2.5), Some(3.5)], "{first}");
        assert_eq!(got.refused, 0);
        assert_eq!(
            told(&got).contains("line") && told(&got).contains("broken"),
            first == "broken",
            "{first}: {}",
            told(&got)
        );
    }
}

#[test]
fn absent_words_are_absent_in_columns_of_the_contract_too() {
    let got = read("time_s,spindle_power_w,tool\n0,NaN,T1\n1,2,NA\n2,UNAVAILABLE,T1\n").expect("readable");
    assert_eq!(column(&got.recording, "spindle_power_w"), [None, Some(2.0), None]);
    assert_eq!(got.recording.find_words("tool").and_then(|tool| tool.get(1)), None);
    assert_eq!(got.refused, 0);
}

#[test]
fn a_column_of_words_with_numbers_in_it_is_told() {
    let got = read("time_s,state_of_pump,x_w\n0,idle,1\n1,12,1\n2,busy,1\n").expect("readable");
    assert_eq!(got.recording.find_words("state_of_pump").and_then(|words| words.get(1)), Some("12"));
    assert!(told(&got).contains("state_of_pump is read as words"), "{}", told(&got));
}

#[test]
fn flags_are_numbers_and_that_is_told() {
    let got = read("time_s,pump_running,coolant_on\n0,OFF,FALSE\n1,ON,TRUE\n").expect("readable");
    assert_eq!(column(&got.recording, "pump_running"), [Some(0.0), Some(1.0)]);
    assert_eq!(column(&got.recording, "coolant_on"), [Some(0.0), Some(1.0)]);
    assert!(told(&got).contains("ON for 1, OFF for 0"), "{}", told(&got));
}

#[test]
fn a_german_file_is_read_and_every_assumption_said() {
    let text = "Zeit;Drehzahl [1/min];Vorschub [m/min];Spindelleistung [kW]\n\
                26.11.2026 14:03:01,250;1.200;0,24;1,25\n26.11.2026 14:03:02,250;800;0,16;0,31\n26.11.2026 14:03:03,250;800;0,16;0,31\n";
    let got = under(text, "[time]\nzone = \"Europe/Berlin\"").expect("readable");
    assert_eq!(column(&got.recording, "spindle_speed_rpm")[..2], [Some(1200.0), Some(800.0)]);
    assert_eq!(column(&got.recording, "feed_mm_min")[0], Some(240.0));
    assert_eq!(column(&got.recording, "spindle_power_w")[..2], [Some(1250.0), Some(310.0)]);
    assert_eq!(got.recording.start_ns, Some(1_795_698_181_250_000_000));
    let told = told(&got);
    for word in [
        "semicolon",
        "decimal comma",
        "local time Europe/Berlin",
        "Vorschub [m/min] -> feed_mm_min (1000x)",
        "thousands",
    ] {
        assert!(told.contains(word), "{word} in:\n{told}");
    }
}

#[test]
fn two_candidates_for_one_column_are_neither() {
    let text = "Zeit [s],Drehzahl [1/min],Speed [rpm],Spindelleistung [W]\n0,1,2,3\n1,2,2,3\n";
    let got = read(text).expect("readable");
    assert!(got.recording.find_numbers("spindle_speed_rpm").is_none());
    assert!(told(&got).contains("Drehzahl [1/min] and Speed [rpm] could all be spindle_speed_rpm"), "{}", told(&got));
    let got = under(text, "[[column]]\nfrom = \"Speed [rpm]\"\nto = \"spindle_speed_rpm\"").expect("readable");
    assert_eq!(column(&got.recording, "spindle_speed_rpm"), [Some(2.0), Some(2.0)]);
}

#[test]
fn what_cannot_be_told_is_refused_with_line_and_cure() {
    for (text, line, cure) in [
        ("time_s;x_w\n0,0;1,5\n1,0;2.5\n", "line 3", "decimal"),
        ("Zeit [ms];Wert\n26/11;1\n", "line 1", "time"),
        ("Time,Value\n01/02/2026 10:00,1.5\n02/02/2026 10:01,1.5\n", "line 1", "order"),
        ("Time,x\n0,1\n100,2\n200,3\n", "line 1", "ms"),
        ("time_s,spindle_speed_rpm\ns,1/s\n0,10\n1,10\n", "line 1", "rename the column"),
        ("time_s,spindle_power_w\n0,abc\n1,def\n2,3\n", "line 2", "most of its cells are words"),
    ] {
        let error = read(text).expect_err(text).to_string();
        assert!(error.contains(line) && error.contains(cure), "{text}: {error}");
    }
    let wrong =
        under("Zeit [s],Leistung [kW]\n0,1\n1,2\n", "[[column]]\nfrom = \"Leistung [kW]\"\nto = \"spindle_speed_rpm\"");
    let error = wrong.expect_err("another quantity").to_string();
    assert!(error.contains("kW cannot become spindle_speed_rpm"), "{error}");
}

#[test]
fn footers_repeated_headers_and_remarks_are_left_out_and_told() {
    let text = "# logger 2\ntime_s,x_w\n0,1\n1,2\n# pause\ntime_s,x_w\n2,3\nMax,3\nMin,1\n";
    let got = read(text).expect("readable");
    assert_eq!(got.recording.count_rows(), 3);
    assert_eq!(got.refused, 0);
    let told = told(&got);
    for word in
        ["2 lines after the data left out (from line 8)", "1 times the header stands again", "1 lines of remarks"]
    {
        assert!(told.contains(word), "{word} in:\n{told}");
    }
}

#[test]
fn a_file_of_another_kind_is_refused_by_its_name() {
    for (bytes, word) in [
        (&b"\x89HDF\r\n\x1a\n\0\0"[..], "HDF5"),
        (b"{\"a\": 1}", "JSON"),
        (b"<html></html>", "no answer of an MTConnect agent"),
        (b"\0\0\0\0\x01\x02\x03\0\0\0\0\0\0\0\0\0", "no format that is known"),
        (b"", "no usable row"),
    ] {
        let error =
            read_input(Input::from_memory(bytes.to_vec(), "f"), &Mapping::default()).expect_err(word).to_string();
        assert!(error.contains(word), "{error}");
    }
}

proptest::proptest! {
    #[test]
    fn no_text_makes_it_panic(text in "(time_s|time_utc|run|Zeit|X_Value|,|;|\t|\n|ON|[0-9.:\"-]|\\PC){0,80}") {
        let _ = read(&text);
    }

    #[test]
    fn no_bytes_make_it_panic(start in 0..6_usize, bytes in proptest::collection::vec(proptest::num::u8::ANY, 0..300)) {
        let starts: [&[u8]; 6] = [b"TDSm\x0e\0\0\0\x69\x12\0\0", b"MATLAB 5.0 MAT-file", b"PK\x03\x04", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", b"<MTConnectStreams>", b"LabVIEW Measurement\t\n"];
        let all: Vec<u8> = starts[start].iter().copied().chain(bytes).collect();
        let _ = read_input(Input::from_memory(all, "f"), &Mapping::default());
    }
}
