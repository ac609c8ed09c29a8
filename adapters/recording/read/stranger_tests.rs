//! Files as loggers, offices and vendors write them, read to the values that stand in them.

use super::tests::{column, read, told, under};
use crate::Mapping;
use crate::read::input::Input;

/// Reads bytes of any format.
fn read_bytes(bytes: &[u8], name: &str) -> Result<super::ReadRecording, super::RecordingError> {
    super::read_input(Input::from_memory(bytes.to_vec(), name), &Mapping::default())
}

/// The first second of the files here: 2026-03-17T08:15:00Z.
const START_NS: i64 = 1_773_735_300_000_000_000;

#[test]
fn every_writing_of_a_time_is_the_same_time() {
    let second = |text: &dyn Fn(usize) -> String| {
        let rows: String = (0..4).map(|row| format!("{},{}\n", text(row), 100 + row)).collect();
        format!("Time,spindle_power_w\n{rows}")
    };
    let files = [
        second(&|row| format!("2026031708150{row}")),
        second(&|row| format!("2026031708150{row}000")),
        second(&|row| format!("17-Mar-2026 08:15:0{row}.000")),
        second(&|row| format!("2026/3/17 上午 8:15:0{row}")),
        second(&|row| format!("\"\"\"2026-03-17T08:15:0{row}\"\"\"")),
        second(&|row| format!("{}", 3_856_580_100_u64 + row as u64)),
        format!(
            "Datum,Uhrzeit,spindle_power_w\n{}",
            (0..4).map(|row| format!("20260317,08150{row},{}\n", 100 + row)).collect::<String>()
        ),
        format!(
            "Datum,Uhrzeit,spindle_power_w\n{}",
            (0..4).map(|row| format!("17.03.2026,08:15:0{row},{}\n", 100 + row)).collect::<String>()
        ),
    ];
    for text in files {
        let got = under(&text, "[time]\nzone = \"UTC\"").expect(&text).recording;
        assert_eq!((got.start_ns, &got.time_s[..]), (Some(START_NS), &[0.0, 1.0, 2.0, 3.0][..]), "{text}");
        assert_eq!(column(&got, "spindle_power_w")[3], Some(103.0));
    }
    let durations = second(&|row| format!("0 days 00:00:0{row}.5"));
    assert_eq!(read(&durations).expect("durations").recording.time_s, [0.5, 1.5, 2.5, 3.5]);
    // Digits that are no date in every row are numbers.
    assert!(read(&second(&|row| format!("2026131708150{row}"))).is_ok_and(|got| got.recording.start_ns.is_none()));
}

#[test]
fn a_map_says_date_and_time_in_two_columns() {
    let text = "Datum;Uhrzeit;n\n17.03.2026;08:15:00;1\n17.03.2026;08:15:01;2\n";
    let got = under(text, "[time]\ndate = \"Datum\"\nclock = \"Uhrzeit\"\nzone = \"UTC\"").expect("two columns");
    assert_eq!((got.recording.start_ns, got.recording.time_s), (Some(START_NS), vec![0.0, 1.0]));
}

#[test]
fn a_file_without_a_column_of_time_asks_for_the_step() {
    let text = ",v_mm_s,p_kw\n0,20,0.4\n1,,0.5\n2,30,0.6\n";
    let error = read(text).expect_err("no time").to_string();
    assert!(error.contains("[time] step"), "{error}");
    let got = under(text, "[time]\nstep = 0.1\nstart = \"2026-03-17T08:15:00Z\"").expect("a step").recording;
    assert_eq!((got.start_ns, got.time_s.clone()), (Some(START_NS), vec![0.0, 0.1, 0.2]));
    assert_eq!(column(&got, "p_kw"), [Some(0.4), Some(0.5), Some(0.6)]);
}

#[test]
fn a_file_without_names_is_given_them() {
    let text = "0;800;310\n1;900;320\n2;1000;330\n";
    assert!(read(text).expect_err("no names").to_string().contains("names = ["));
    let got = under(text, "names = [\"time_s\", \"spindle_speed_rpm\", \"spindle_power_w\"]").expect("names").recording;
    assert_eq!(column(&got, "spindle_speed_rpm"), [Some(800.0), Some(900.0), Some(1000.0)]);
}

#[test]
fn units_in_the_cells_are_those_of_their_numbers() {
    let text =
        "Zeit [s];Drehzahl [1/min];Spindelleistung\n0;800;383.8 W\n1;800;0.471 kW\n2;800;472 W\n3;800;5 bar\n4;800;7\n";
    let got = read(text).expect("readable");
    let power = column(&got.recording, "spindle_power_w");
    assert_eq!(power, [Some(383.8), Some(471.0), Some(472.0), None, None]);
    assert!(told(&got).contains("its cells are in W, kW, taken together in W"), "{}", told(&got));
    let share = read("Zeit [s],Spindle load\n0,50 %\n1,60 %\n").expect("readable").recording;
    assert_eq!(column(&share, "spindle_load_pct"), [Some(50.0), Some(60.0)]);
}

#[test]
fn a_separator_at_the_end_shifts_nothing() {
    let got = read("time_s,x_mm,p_w\n0,100,380,\n1,101,381,\n2,102,382,\n").expect("readable").recording;
    assert_eq!(got.time_s, [0.0, 1.0, 2.0]);
    assert_eq!(column(&got, "x_mm"), [Some(100.0), Some(101.0), Some(102.0)]);
}

#[test]
fn a_name_that_stands_twice_keeps_both_columns() {
    let text = "time_s;Leistung [W];n;Leistung [W]\n0;1;2;3\n1;4;5;6\n";
    let got = read(text).expect("readable");
    assert_eq!(column(&got.recording, "Leistung [W] #2"), [Some(1.0), Some(4.0)]);
    assert_eq!(column(&got.recording, "Leistung [W] #4"), [Some(3.0), Some(6.0)]);
    let map = "[[column]]\nfrom = \"#4\"\nto = \"spindle_power_w\"";
    assert_eq!(column(&under(text, map).expect("a map").recording, "spindle_power_w"), [Some(3.0), Some(6.0)]);
    let twice = under(text, "[[column]]\nfrom = \"Leistung [W]\"\nto = \"spindle_power_w\"");
    assert!(twice.expect_err("which one").to_string().contains("from = \"#4\""));
}

#[test]
fn heads_of_programs_that_are_known() {
    let two = "Name\tscope\n\nName\tS.n\tName\tS.P\nSampleTime[ms]\t100\tSampleTime[ms]\t200\nNetID\t1.1\tNetID\t1.1\n\
               Unit\trpm\tUnit\tW (Power)\n\n0\t800\t0\t310\n100\t900\t200\t330\n200\t1000\t400\t350\n300\t1100\n400\t1200\n";
    let got = read(two).expect("two clocks");
    assert_eq!((got.recording.time_s.clone(), got.refused), (vec![0.0, 0.2, 0.4], 0));
    assert_eq!(column(&got.recording, "S.n"), [Some(800.0), Some(1000.0), Some(1200.0)]);
    assert_eq!(column(&got.recording, "S.P"), [Some(310.0), Some(330.0), Some(350.0)]);
    let one = "Name\tscope\n\nName\tS.n\tS.P\nSampleTime[ms]\t100\t100\nUnit\trpm\tW (Power)\n\n0\t800\t310\n100\t900\t320\n200\t900\t330\n";
    let got = read(one).expect("one clock").recording;
    assert_eq!(got.time_s, [0.0, 0.1, 0.2]);
    assert_eq!(column(&got, "S.P"), [Some(310.0), Some(320.0), Some(330.0)]);
    let scope =
        "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-6.0e+00,1.0e-01\n0,3.8,0.9,,\n1,3.9,0.8,,\n2,4.0,0.7,,\n";
    let got = read(scope).expect("an oscilloscope").recording;
    assert!(got.time_s.iter().zip([-6.0, -5.9, -5.8]).all(|(a, b)| (a - b).abs() < 1e-12), "{:?}", got.time_s);
    assert_eq!(column(&got, "CH1"), [Some(3.8), Some(3.9), Some(4.0)]);
    let groups =
        "Zeit,Spindel,,Achse X\ns,Drehzahl [1/min],Leistung [kW],Strom [A]\n0,800,0.3,1\n1,900,0.4,2\n2,900,0.5,2\n";
    let got = read(groups).expect("two lines of names").recording;
    assert_eq!(column(&got, "spindle_power_w"), [Some(300.0), Some(400.0), Some(500.0)]);
    assert_eq!(column(&got, "Achse X Strom [A]")[1], Some(2.0));
}

#[test]
fn one_line_for_each_value_becomes_columns() {
    let wincc = "\"VarName\";\"TimeString\";\"VarValue\";\"Validity\";\"Time_ms\"\n\"n\";\"17.03.2026 08:15:00\";800,5;1;46098343750,0000\n\
                 \"P\";\"17.03.2026 08:15:00\";310,5;1;46098343750,0000\n\"n\";\"17.03.2026 08:15:01\";900,5;1;46098343761,5741\n\
                 \"P\";\"17.03.2026 08:15:01\";320,5;1;46098343761,5741\n";
    let got = under(wincc, "[time]\nzone = \"UTC\"").expect("WinCC").recording;
    assert_eq!((got.start_ns, &got.time_s[..]), (Some(START_NS), &[0.0, 1.0][..]));
    assert_eq!(
        (column(&got, "n"), column(&got, "P")),
        (vec![Some(800.5), Some(900.5)], vec![Some(310.5), Some(320.5)])
    );
    let influx = |table: usize, field: &str, value: f64| {
        format!(
            "#group,false,false,true,false,false\n#datatype,string,long,dateTime:RFC3339,double,string\n#default,mean,,,,\n,result,table,_time,_value,_field\n\
             ,,{table},2026-03-17T08:15:00Z,{value},{field}\n,,{table},2026-03-17T08:15:01Z,{},{field}\n\n",
            value + 1.0
        )
    };
    let got = read(&(influx(0, "n", 800.0) + &influx(1, "P", 310.0))).expect("InfluxDB").recording;
    assert_eq!(got.columns().len(), 2, "{:?}", got.columns());
    assert_eq!(
        (column(&got, "n"), column(&got, "P")),
        (vec![Some(800.0), Some(801.0)], vec![Some(310.0), Some(311.0)])
    );
    let seconds = (0..30).map(|s| format!("2026-03-17T08:15:{s:02}Z|Srpm|{}|Spower|{}\n", 800 + s, 310 + s));
    let begin = "2026-03-17T08:15:00Z|avail|AVAILABLE\n2026-03-17T08:15:00Z|Zcond|NORMAL||||\n".to_owned();
    let got = read(&(begin + &seconds.collect::<String>())).expect("SHDR").recording;
    assert_eq!((got.count_rows(), column(&got, "Spower")[29], column(&got, "Srpm")[1]), (30, Some(339.0), Some(801.0)));
    assert_eq!(got.find_words("Zcond").and_then(|words| words.get(2)), Some("NORMAL"));
}

/// Items with few observations: the line of names is known and not looked for.
#[test]
fn an_answer_of_an_agent_with_single_events_keeps_its_names() {
    let sample = |second: usize| {
        format!(
            "<RotaryVelocity dataItemId=\"c1\" timestamp=\"2026-03-17T08:15:{second:02}Z\">{}</RotaryVelocity>",
            800 + second
        )
    };
    let text = format!(
        "<MTConnectStreams><ComponentStream component=\"Rotary\" name=\"C\">{}<Program dataItemId=\"p\" timestamp=\"2026-03-17T08:15:00Z\">O1</Program>\
         </ComponentStream></MTConnectStreams>",
        (0..30).map(sample).collect::<String>()
    );
    let got = read(&text).expect("an answer").recording;
    assert_eq!((got.count_rows(), column(&got, "spindle_speed_rpm")[29]), (30, Some(829.0)));
    assert_eq!(got.find_words("program").and_then(|program| program.get(29)), Some("O1"));
}

#[test]
fn tests_one_after_the_other_become_runs() {
    let text = "time_s,p_w\n0,1\n1,2\n2,3\n0,4\n1,5\n0,6\n1,7\n";
    assert!(read(text).expect("readable").refused > 0);
    let got = under(text, "[time]\nset_back = \"run\"").expect("runs").recording;
    assert_eq!(got.time_s, [0.0, 1.0, 2.0, 0.0, 1.0, 0.0, 1.0]);
    assert_eq!(got.list_runs().iter().map(|run| run.rows.clone()).collect::<Vec<_>>(), [0..3, 3..5, 5..7]);
    assert!(!got.pauses_known());
}

#[test]
fn columns_may_have_clocks_of_their_own() {
    let text = "a,b\n1,10\n2,20\n3,30\n4,\n5,\n";
    let map = "[[clock]]\ncolumns = [\"a\"]\nstep = 0.5\n[[clock]]\ncolumns = [\"b\"]\nstep = 1.0";
    let got = under(text, map).expect("two clocks").recording;
    assert_eq!(got.time_s, [0.0, 1.0, 2.0]);
    assert_eq!(
        (column(&got, "a"), column(&got, "b")),
        (vec![Some(1.0), Some(3.0), Some(5.0)], vec![Some(10.0), Some(20.0), Some(30.0)])
    );
}

#[test]
fn what_is_known_and_not_read_is_refused_by_name() {
    let files: [(&[u8], &str, &str); 8] = [
        (b"|CF,2,1,1;|CK,1,3,1,1;", "f", "imc"),
        (b"anything", "week.dxd", "Dewesoft"),
        (b"\x80\x05\x95abc", "f", "pickle"),
        (b"\x80\x02}q", "f", "pickle"),
        (b"\x93NUMPY\x01\0", "f", "npy"),
        (b"BZh91AY", "f", "bzip2"),
        (b"UnFinMF ", "f", "MDF"),
        (b"\xfd7zXZ\0", "f", "xz"),
    ];
    for (bytes, name, word) in files {
        let error = read_bytes(bytes, name).expect_err(word);
        assert!(error.to_string().contains(word) && !error.describe_in_chinese().is_empty(), "{error}");
    }
    let archive = |names: &[&str]| {
        let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for name in names {
            let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
            writer.start_file(*name, options).expect("a part");
        }
        writer.finish().expect("an archive").into_inner()
    };
    for (names, word) in [(&["a.npy", "b.npy"][..], "npz"), (&["week.csv"], "zip archive (week.csv)")] {
        let error = read_bytes(&archive(names), "f").expect_err(word).to_string();
        assert!(error.contains(word), "{error}");
    }
}
