//! One pass under a guess gives what counting first and taking afterwards gives, to the last bit, for every file.

use super::*;
use std::path::PathBuf;

/// The slow way: the text is read from its file in pieces, every cell is counted first, and the rows are taken in a second pass.
fn read_in_two_passes(input: Input, mapping: &Mapping) -> Result<ReadRecording, RecordingError> {
    let file = input.file.clone();
    let table = formats::open_table_within(input, mapping, 0)?;
    let head = head::find_head(table.as_ref(), head::GivenHead::from_mapping(mapping), &file)?;
    let survey = survey::survey_table(table.as_ref(), &head)?;
    if let Some(turned) = long::turn_table(table.as_ref(), &head, &survey, &file)? {
        let head = head::find_head(&turned, head::GivenHead::default(), &file)?;
        let survey = survey::survey_table(&turned, &head)?;
        let plan = understand::build_plan(&head, &survey, mapping, &file)?;
        return Ok(read_planned(&turned, &head, &plan, None, mapping, &file)?.with_notes(&plan.notes));
    }
    let plan = understand::build_plan(&head, &survey, mapping, &file)?;
    Ok(read_planned(table.as_ref(), &head, &plan, None, mapping, &file)?.with_notes(&plan.notes))
}

/// What differs between both ways; `None` where nothing does.
fn find_difference_of_ways(input: &Input, mapping: &Mapping) -> Option<String> {
    let quick = read_input(input.clone(), mapping);
    let slow = read_in_two_passes(input.clone(), mapping);
    match (quick, slow) {
        (Ok(quick), Ok(slow)) => {
            let is_same = quick.recording == slow.recording
                && quick.problems == slow.problems
                && quick.refused == slow.refused
                && quick.notes == slow.notes;
            (!is_same).then(|| format!("{quick:?}\nis not\n{slow:?}"))
        }
        (Err(quick), Err(slow)) => {
            let (quick, slow) = (quick.to_string(), slow.to_string());
            (quick != slow).then(|| format!("{quick} is not {slow}"))
        }
        (quick, slow) => Some(format!("{:?} is not {:?}", quick.err(), slow.err())),
    }
}

/// Were the rows taken in the pass that counted them?
fn is_guessed_right(text: &str) -> bool {
    let input = Input::from_memory(text.as_bytes().to_vec(), "t.csv");
    understand_input(input, &Mapping::default()).expect("readable").recordings.is_some()
}

/// Every file of the tests of recordings and every one of this crate.
fn list_files() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/foreign");
    let mut found: Vec<PathBuf> =
        std::fs::read_dir(root).expect("the folder").map(|entry| entry.expect("a file").path()).collect();
    found.sort();
    found.retain(|path| path.is_file() && path.extension().is_none_or(|end| end != "json" && end != "md"));
    found
}

#[test]
fn every_file_is_read_alike_in_one_pass_and_in_two() {
    let files = list_files();
    assert!(files.len() >= 40, "only {} files", files.len());
    for path in files {
        let difference = find_difference_of_ways(&Input::from_path(&path), &Mapping::default());
        assert_eq!(difference, None, "{}", path.display());
    }
}

#[test]
fn a_cell_far_below_the_first_rows_decides_as_it_did_and_costs_a_second_pass() {
    let rows = |first: &str, last: &str| {
        let body: String = (0..2000).map(|row| format!("{row},{}\n", if row < 500 { first } else { last })).collect();
        format!("time_s,x_w,y\n{}", body.replace('\n', ",1\n"))
    };
    for (first, last, is_right) in [
        ("1.5", "2.5", true),
        ("1.5", "abc", false),
        ("", "2.5", true),
        ("\"1,5\"", "\"2,5\"", true),
        ("1.250", "\"2,5\"", false),
        ("ON", "1.5", false),
        ("abc", "1.5", false),
        ("0.5", "0.5 kW", false),
    ] {
        let text = rows(first, last);
        assert_eq!(is_guessed_right(&text), is_right, "{first} then {last}");
        let input = Input::from_memory(text.into_bytes(), "t.csv");
        assert_eq!(find_difference_of_ways(&input, &Mapping::default()), None, "{first} then {last}");
    }
}

/// The cell of a row, of one of the kinds that stand in files.
fn write_cell(kind: u8, row: usize, separator: char) -> String {
    let (few, second) = (row % 7, row % 60);
    match kind {
        0 => few.to_string(),
        1 => format!("{row}.{few}"),
        2 if separator == ',' => format!("\"{row},{few}\""),
        2 => format!("{row},{few}"),
        3 => format!("1.{row:03}"),
        4 => ["OFF", "ON"][row % 2].to_owned(),
        5 => format!("word {few}"),
        6 => String::new(),
        7 => ["NaN", "-", "n/a"][row % 3].to_owned(),
        8 => format!("2026-03-17 08:{:02}:{second:02}", row / 60 % 60),
        9 => format!("{few}.5 {}", ["W", "kW"][row % 2]),
        10 => format!("202603170815{second:02}"),
        11 => format!("1.5e{few}"),
        12 => format!("\"{few}.25\""),
        _ => format!("{:02}/{:02}/2026 10:00:{second:02}", 1 + row % 28, 1 + row / 200),
    }
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(48))]
    /// Each column is of one kind up to a row and of another from there on.
    #[test]
    fn every_table_is_read_alike_in_one_pass_and_in_two(
        columns in proptest::collection::vec((0..14_u8, 0..14_u8, 0..900_usize), 1..5),
        time in proptest::sample::select(vec![(0_u8, "time_s"), (1, "time_s"), (1, "t"), (8, "time_utc"), (8, "Zeit"), (13, "Date"), (10, "Time")]),
        rows in 0..900_usize,
        separator in proptest::sample::select(vec![',', ';', '\t']),
        odd in 1..1200_usize,
    ) {
        let names = ["spindle_power_w", "run", "Leistung [kW]", "pump_w", "state"];
        let mut text = time.1.to_owned();
        names.iter().take(columns.len()).for_each(|name| text.extend([&separator.to_string(), *name]));
        for row in 0..rows {
            // A line that is odd now and then: a remark, the header again, too many cells.
            match (row.is_multiple_of(odd), row % 3) {
                (true, 0) => text.push_str("\n# a remark"),
                (true, 1) => text.extend(["\n", &separator.to_string().repeat(9), "x"]),
                _ => {}
            }
            text.push('\n');
            text.push_str(&if time.0 == 0 { row.to_string() } else { write_cell(time.0, row, separator) });
            for (first, then, from) in &columns {
                text.push(separator);
                text.push_str(&write_cell(if row < *from { *first } else { *then }, row, separator));
            }
        }
        let input = Input::from_memory(text.clone().into_bytes(), "t.csv");
        proptest::prop_assert_eq!(find_difference_of_ways(&input, &Mapping::default()), None, "{}", text);
    }
}
