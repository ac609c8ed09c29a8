//! Recordings put together, one after the other.
//!
//! Runs stay distinct: a name that an earlier recording used gets the number of its recording, `3 (2)`. Recordings
//! with `time_utc` share a clock; others share one when their `time_s` goes on increasing.

use adapter_core::clock::SECOND_NS;
use recording::Recording;
use recording::{Cells, Numbers, Words, derive_quantity};
use std::collections::BTreeSet;
use thiserror::Error;

/// Quantities that follow from others of the same row: computed where only some of the recordings hold them.
const DERIVED_PER_ROW: [&str; 4] =
    ["feed_per_rev_mm", "cutting_speed_m_min", "feed_per_tooth_mm", "removal_rate_cm3_min"];

/// Why recordings cannot be put together.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum JoinError {
    /// The list of recordings is empty.
    #[error("no recording given")]
    Nothing,
    /// A column holds numbers in one recording and text in another.
    #[error(
        "column {column} holds numbers in {numbers_in} and text in {text_in}: rename one of them or correct its cells"
    )]
    TwoKinds {
        /// Name of the column that both recordings have.
        column: String,
        /// The recording with the numbers.
        numbers_in: String,
        /// The recording with the text.
        text_in: String,
    },
}

/// One recording that holds all of them.
///
/// # Errors
/// Columns that hold numbers in one recording and text in another.
pub fn join_recordings(mut recordings: Vec<Recording>) -> Result<Recording, JoinError> {
    if recordings.len() < 2 {
        return recordings.pop().ok_or(JoinError::Nothing);
    }
    derive_where_some_hold(&mut recordings);
    let names = column_names(&recordings);
    let mut joined = on_one_time_axis(&recordings);
    for name in names.iter().filter(|name| *name != "run") {
        let cells =
            if is_text(&recordings, name)? { join_words(&recordings, name) } else { join_numbers(&recordings, name) };
        joined.set_column(name, cells);
    }
    joined.set_column("run", Cells::Words(join_runs(&recordings)));
    Ok(joined)
}

fn derive_where_some_hold(recordings: &mut [Recording]) {
    for name in DERIVED_PER_ROW {
        if recordings.iter().any(|recording| recording.find_numbers(name).is_some()) {
            for recording in recordings.iter_mut().filter(|recording| recording.find_numbers(name).is_none()) {
                if let Some(numbers) = derive_quantity(recording, name) {
                    recording.set_column(name, Cells::Numbers(numbers));
                }
            }
        }
    }
}

/// Every column, in the order of first appearance.
fn column_names(recordings: &[Recording]) -> Vec<String> {
    let mut seen = BTreeSet::new();
    let all = recordings.iter().flat_map(|recording| recording.columns());
    all.filter(|column| seen.insert(column.name.as_str())).map(|column| column.name.clone()).collect()
}

/// The times, with nothing else yet.
fn on_one_time_axis(recordings: &[Recording]) -> Recording {
    let source = recordings.iter().map(|recording| recording.source.as_str()).collect::<Vec<_>>().join(", ");
    let starts: Option<Vec<i64>> = recordings.iter().map(|recording| recording.start_ns).collect();
    let all_unset = recordings.iter().all(|recording| recording.start_ns.is_none());
    let first_ns = starts.as_ref().and_then(|starts| starts.first().copied());
    let mut time_s = Vec::with_capacity(recordings.iter().map(Recording::count_rows).sum());
    for (index, recording) in recordings.iter().enumerate() {
        let shift_s = match (&starts, first_ns) {
            (Some(starts), Some(first_ns)) => to_seconds(starts[index] - first_ns),
            _ => 0.0,
        };
        time_s.extend(recording.time_s.iter().map(|time_s| time_s + shift_s));
    }
    let in_order = time_s.windows(2).all(|pair| pair[1] >= pair[0]);
    let restarts = recordings.iter().any(|recording| !recording.pauses_known());
    let mut joined = Recording::new(source, time_s, first_ns.filter(|_| in_order));
    if !in_order || restarts || (first_ns.is_none() && !all_unset) {
        joined.forget_pauses();
    }
    joined
}

#[expect(
    clippy::cast_precision_loss,
    reason = "a double counts nanoseconds exactly over 104 days, microseconds beyond"
)]
fn to_seconds(ns: i64) -> f64 {
    ns as f64 / SECOND_NS as f64
}

fn is_text(recordings: &[Recording], name: &str) -> Result<bool, JoinError> {
    let text =
        recordings.iter().find(|recording| recording.find_words(name).is_some_and(|words| !words.words().is_empty()));
    let number = recordings
        .iter()
        .find(|recording| recording.find_numbers(name).is_some_and(|numbers| numbers.count_present() > 0));
    match (text, number) {
        (Some(text), Some(number)) => Err(JoinError::TwoKinds {
            column: name.to_owned(),
            numbers_in: number.source.clone(),
            text_in: text.source.clone(),
        }),
        (Some(_), None) => Ok(true),
        (None, Some(_)) => Ok(false),
        (None, None) => Ok(recordings.iter().any(|recording| recording.find_words(name).is_some())),
    }
}

fn join_numbers(recordings: &[Recording], name: &str) -> Cells {
    let mut joined = Numbers::default();
    for recording in recordings {
        let numbers = recording.find_numbers(name);
        (0..recording.count_rows()).for_each(|row| joined.push(numbers.and_then(|numbers| numbers.get(row))));
    }
    Cells::Numbers(joined)
}

fn join_words(recordings: &[Recording], name: &str) -> Cells {
    let mut joined = Words::default();
    for recording in recordings {
        let words = recording.find_words(name);
        (0..recording.count_rows()).for_each(|row| joined.push(words.and_then(|words| words.get(row)).unwrap_or("")));
    }
    Cells::Words(joined)
}

/// The `run` of every row, distinct between recordings.
fn join_runs(recordings: &[Recording]) -> Words {
    let mut used: BTreeSet<String> = BTreeSet::new();
    let mut joined = Words::default();
    for (index, recording) in recordings.iter().enumerate() {
        let stretches = recording.list_runs();
        let own: BTreeSet<&str> = stretches.iter().map(|run| run.name.as_str()).collect();
        let mut new = BTreeSet::new();
        for run in &stretches {
            let name = distinct_name(&run.name, index + 1, &used, &own);
            run.rows.clone().for_each(|_| joined.push(&name));
            new.insert(name);
        }
        used.extend(new);
    }
    joined
}

fn distinct_name(name: &str, number: usize, used: &BTreeSet<String>, own: &BTreeSet<&str>) -> String {
    if !used.contains(name) && !name.is_empty() {
        return name.to_owned();
    }
    let mut tried = format!("{name} ({number})").trim_start().to_owned();
    while used.contains(&tried) || own.contains(tried.as_str()) {
        tried.push('\'');
    }
    tried
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::read_csv;

    fn read(text: &str, file: &str) -> Recording {
        read_csv(text.as_bytes(), file).expect("readable").recording
    }

    #[test]
    fn runs_of_two_files_stay_distinct_and_pauses_between_them_unknown() {
        let a = read("time_s,run,p_w\n0,1,1\n1,2,2\n", "a.csv");
        let b = read("time_s,run,p_w,q_w\n0,2,3,9\n1,3,4,9\n", "b.csv");
        let joined = join_recordings(vec![a, b]).expect("fits");
        let names: Vec<String> = joined.list_runs().into_iter().map(|run| run.name).collect();
        assert_eq!(names, ["1", "2", "2 (2)", "3"]);
        assert_eq!(joined.time_s, [0.0, 1.0, 0.0, 1.0]);
        assert!(!joined.pauses_known());
        assert_eq!(
            joined.find_numbers("q_w").map(|q| q.iter().collect::<Vec<_>>()),
            Some(vec![None, None, Some(9.0), Some(9.0)])
        );
    }

    #[test]
    fn files_without_runs_become_runs_and_utc_is_one_clock() {
        let a = read("time_utc,p_w\n2026-01-31T08:00:00Z,1\n2026-01-31T08:00:01Z,2\n", "a.csv");
        let b = read("time_utc,p_w\n2026-01-31T09:00:00Z,1\n2026-01-31T09:00:02Z,2\n", "b.csv");
        let joined = join_recordings(vec![a.clone(), b.clone()]).expect("fits");
        assert_eq!(joined.time_s, [0.0, 1.0, 3600.0, 3602.0]);
        assert_eq!(joined.list_runs().len(), 2);
        assert!(joined.pauses_known());
        let swapped = join_recordings(vec![b, a]).expect("fits");
        assert_eq!(swapped.time_s, [0.0, 2.0, -3600.0, -3599.0]);
        assert!(!swapped.pauses_known());
    }

    #[test]
    fn clocks_of_two_kinds_are_not_one() {
        let a = read("time_utc,p_w\n2026-01-31T08:00:00Z,1\n2026-01-31T08:00:01Z,2\n", "a.csv");
        let b = read("time_s,p_w\n100,1\n101,2\n", "b.csv");
        let joined = join_recordings(vec![a, b]).expect("fits");
        assert!(!joined.pauses_known() && joined.start_ns.is_none());
    }

    #[test]
    fn a_column_of_two_kinds_is_refused() {
        let a = read("time_s,note\n0,1\n", "a.csv");
        let b = read("time_s,note\n0,door\n", "b.csv");
        let problem = join_recordings(vec![a, b]).expect_err("two kinds");
        assert!(problem.to_string().contains("numbers in a.csv and text in b.csv"), "{problem}");
    }

    #[test]
    fn what_one_file_holds_is_derived_for_the_other() {
        let a = read("time_s,feed_per_rev_mm,feed_mm_min,spindle_speed_rpm\n0,0.2,200,1000\n", "a.csv");
        let b = read("time_s,feed_mm_min,spindle_speed_rpm\n0,300,1000\n", "b.csv");
        let joined = join_recordings(vec![a, b]).expect("fits");
        assert_eq!(joined.find_numbers("feed_per_rev_mm").and_then(|f| f.get(1)), Some(0.3));
    }
}
