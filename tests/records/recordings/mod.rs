//! Recordings as people have them: files that programs of others wrote (`tests/records/recordings/make_files.py`) come to the same numbers as the clean file,
//! or are refused by name with the cure; none is read wrongly without a word.

#[cfg(feature = "fleet")]
mod codecs;

use adapters::Recording;
use adapters::recording::{ColumnMapping, Mapping, NoteKind, ReadRecording, TimeMapping, read_path_as};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What stands in `table.json` of a file.
#[derive(Debug, Deserialize)]
struct Truth {
    columns: Vec<String>,
    refused: Option<String>,
    start: bool,
}

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/foreign")
}

fn path(name: &str) -> PathBuf {
    let plain = directory().join(name);
    if plain.exists() { plain } else { directory().join(format!("{name}.gz")) }
}

fn truths() -> BTreeMap<String, Truth> {
    let text = std::fs::read_to_string(directory().join("table.json")).expect("the table");
    serde_json::from_str(&text).expect("its form")
}

fn berlin() -> Mapping {
    Mapping {
        time: TimeMapping { zone: Some("Europe/Berlin".to_owned()), ..TimeMapping::default() },
        ..Mapping::default()
    }
}

/// Short names of the generator.
const COLUMNS: [(&str, &str); 8] = [
    ("run", "run"),
    ("n", "spindle_speed_rpm"),
    ("vf", "feed_mm_min"),
    ("ap", "depth_of_cut_mm"),
    ("d", "diameter_mm"),
    ("engaged", "engaged"),
    ("coolant", "coolant_on"),
    ("p", "spindle_power_w"),
];

fn long(short: &str) -> &'static str {
    COLUMNS.iter().find(|(name, _)| *name == short).map(|(_, long)| *long).expect("a column of the generator")
}

/// What differs from the clean recording; empty where nothing does.
fn differences(clean: &Recording, read: &Recording, columns: &[&str]) -> Vec<String> {
    let mut found = Vec::new();
    if clean.count_rows() != read.count_rows() {
        found.push(format!("{} rows for {}", read.count_rows(), clean.count_rows()));
        return found;
    }
    let length =
        |recording: &Recording| recording.time_s.last().unwrap_or(&0.0) - recording.time_s.first().unwrap_or(&0.0);
    if (length(clean) - length(read)).abs() > 0.01 {
        found.push(format!("{} s for {} s", length(read), length(clean)));
    }
    for name in columns {
        if let (Some(a), Some(b)) = (clean.find_words(name), read.find_words(name)) {
            found.extend(
                (0..clean.count_rows())
                    .find(|row| a.get(*row) != b.get(*row))
                    .map(|row| format!("{name} in row {row}: {:?}", b.get(row))),
            );
            continue;
        }
        let (Some(a), Some(b)) = (clean.find_numbers(name), read.find_numbers(name)) else {
            found.push(format!("no {name}"));
            continue;
        };
        // Single precision and rounded cells; an absent cell is no wrong value.
        let wrong = |row: &usize| match (a.get(*row), b.get(*row)) {
            (Some(a), Some(b)) => (a - b).abs() > 2e-4 * a.abs().max(1.0),
            _ => false,
        };
        found.extend(
            (0..clean.count_rows())
                .find(wrong)
                .map(|row| format!("{name} in row {row}: {:?} for {:?}", b.get(row), a.get(row))),
        );
        if a.count_present() > b.count_present() + 2 {
            found.push(format!("{name}: {} of {} values", b.count_present(), a.count_present()));
        }
    }
    found
}

/// Columns that the file has under a name that does not say enough, and what it says of them.
fn asked(read: &ReadRecording, columns: &[&str]) -> Vec<(String, String)> {
    let missing: Vec<&&str> =
        columns.iter().filter(|name| read.recording.columns().iter().all(|column| column.name != **name)).collect();
    let doubts =
        || read.notes.iter().filter(|note| note.kind == NoteKind::Doubt && note.text.en.contains("recording map"));
    missing
        .into_iter()
        .filter_map(|name| {
            let doubt = doubts().find(|note| note.text.en.contains(*name))?;
            Some(((*name).to_owned(), doubt.text.en.split(": may be").next()?.to_owned()))
        })
        .collect()
}

#[test]
fn files_of_strangers_come_to_the_numbers_of_the_clean_file() {
    let clean = read_path_as(&path("clean.csv"), &Mapping::default()).expect("the clean file").recording;
    let (mut same, mut by_map, mut refused, mut wrong) = (0, 0, 0, Vec::new());
    for (name, truth) in truths() {
        let columns: Vec<&str> = truth.columns.iter().map(|column| long(column)).collect();
        match (read_path_as(&path(&name), &berlin()), &truth.refused) {
            (Err(error), Some(word))
                if error.to_string().contains(word.as_str()) && !error.describe_in_chinese().is_empty() =>
            {
                refused += 1
            }
            (Err(error), _) => wrong.push(format!("{name}: refused: {error}")),
            (Ok(read), Some(word)) if COLUMNS.iter().any(|(_, long)| long == word) => {
                // Read, and what the name does not say is not guessed.
                if read.recording.find_numbers(word).is_some() {
                    wrong.push(format!("{name}: {word} was guessed"))
                } else {
                    refused += 1
                }
            }
            (Ok(_), Some(word)) => wrong.push(format!("{name}: read, not refused for {word}")),
            (Ok(read), None) => {
                let questions = asked(&read, &columns);
                let mut mapping = berlin();
                mapping.column = questions
                    .iter()
                    .map(|(to, from)| ColumnMapping { from: from.clone(), to: to.clone(), ..ColumnMapping::default() })
                    .collect();
                let answered = if questions.is_empty() {
                    read
                } else {
                    read_path_as(&path(&name), &mapping).expect("under a map")
                };
                let mut differs = differences(&clean, &answered.recording, &columns);
                let late_ns = answered.recording.start_ns.zip(clean.start_ns).map(|(a, b)| (a - b).abs());
                if truth.start && late_ns.is_none_or(|late_ns| late_ns > 1_000_000_000) {
                    differs.push(format!("it begins at {:?}", answered.recording.start_ns));
                }
                match (differs.is_empty(), questions.is_empty()) {
                    (true, true) => same += 1,
                    (true, false) => by_map += 1,
                    (false, _) => wrong.push(format!("{name}: {}", differs.join("; "))),
                }
            }
        }
    }
    println!(
        "{same} files read as the clean one, {by_map} after one question that was asked, {refused} refused with the cure, {} wrong",
        wrong.len()
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(same + by_map + refused >= 40, "fewer than forty files");
}

/// The statement says what was assumed of each file, in both languages.
#[test]
fn what_was_assumed_is_said_in_both_languages() {
    let read = read_path_as(&path("excel_de.csv"), &berlin()).expect("readable");
    let statement = read.describe_assumptions();
    for (text, words) in [
        (&statement.en, ["encoding windows-1252", "semicolon", "decimal comma", "local time Europe/Berlin"]),
        (&statement.zh, ["编码windows-1252", "分号分隔", "小数点为逗号", "当地时间Europe/Berlin"]),
    ] {
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
    }
}
