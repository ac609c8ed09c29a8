//! Several recordings in the order in which they were measured, whatever the order in which they were named; and what is there
//! twice - a file, a run, rows that two files share - once.
//!
//! Noise does not repeat itself: a run whose numbers are those of another one to the last digit is a copy of it, under whatever
//! name and time. Counted twice it would make half of the evidence look like all of it.

use adapter_core::bilingual::Bilingual;
use recording::{Cells, Numbers, Recording, Run};
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashSet, hash_map::DefaultHasher};
use std::hash::{Hash, Hasher};

/// Rows of a run below which another one may be equal by chance,
const COPY_ROWS_MIN: usize = 10;
/// and different values that one of its columns must have: what stands still is equal everywhere.
const COPY_VALUES_MIN: usize = 5;
/// Times that differ by less than this are one, s: what a double keeps of a time of day.
const SAME_TIME_S: f64 = 1e-6;
/// Copies, or files, that are named one by one.
const NAMED_MAX: usize = 12;

/// Recordings in order, each row once, and what was done to them.
#[derive(Debug)]
pub(super) struct OrderedRecordings {
    /// In the order of time.
    pub(super) recordings: Vec<Recording>,
    /// What a reader of the report has to know; the same for every order of the files.
    pub(super) remarks: Vec<Bilingual>,
}

/// What is there twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Copies {
    /// Stays: commands and inputs of a simulation repeat themselves.
    Keep,
    /// Counts once: measurements do not.
    CountOnce,
}

/// Puts recordings in the order of time and leaves out what is there twice where it counts once.
#[must_use]
pub(super) fn order_recordings(mut recordings: Vec<Recording>, copies: Copies) -> OrderedRecordings {
    let several = recordings.len() > 1;
    recordings.sort_by(|a, b| compare_names(&a.source, &b.source));
    let by_time = sort_by_time(&mut recordings);
    let mut remarks = Vec::new();
    let mut seen = SeenRows::default();
    let mut kept = Vec::new();
    let last = recordings.len().saturating_sub(1);
    for (index, recording) in recordings.into_iter().enumerate() {
        let rows = match copies {
            Copies::Keep => (0..recording.count_rows()).collect(),
            Copies::CountOnce => seen.list_new_rows(&recording, index < last, &mut remarks),
        };
        match rows.len() {
            0 if recording.count_rows() > 0 => {}
            all if all == recording.count_rows() => kept.push(recording),
            _ => kept.push(recording.take_rows(&rows)),
        }
    }
    // A copy that went may have been all that hid the order of time.
    let by_time = by_time || sort_by_time(&mut kept);
    let hidden = remarks.len().saturating_sub(NAMED_MAX);
    remarks.truncate(NAMED_MAX);
    if hidden > 0 {
        remarks.push(Bilingual::new(
            format!("and {hidden} more copies, each counted once"),
            format!("另有{hidden}个副本，各计一次"),
        ));
    }
    if several {
        remarks.insert(0, describe_order(&kept, by_time));
    }
    OrderedRecordings { recordings: kept, remarks }
}

fn describe_order(kept: &[Recording], by_time: bool) -> Bilingual {
    let names: Vec<&str> = kept.iter().take(NAMED_MAX).map(|recording| recording.source.as_str()).collect();
    let more = kept.len().saturating_sub(NAMED_MAX);
    let mut list = names.join(", ");
    if more > 0 {
        list.push_str(&format!(", ... ({more})"));
    }
    let count = kept.len();
    match by_time {
        true => Bilingual::new(
            format!("{count} recordings in the order of their times: {list}"),
            format!("{count}个记录按时间排序：{list}"),
        ),
        false => Bilingual::new(
            format!("{count} recordings in the order of their names, because their times start again in each: {list}"),
            format!("{count}个记录各自重新计时，因此按名称排序：{list}"),
        ),
    }
}

/// Sorts by the time of the first row, where times of all of them are on one clock; says whether they are.
fn sort_by_time(recordings: &mut [Recording]) -> bool {
    if recordings.iter().all(|recording| recording.start_ns.is_some()) {
        recordings.sort_by_key(|recording| recording.start_ns);
        return true;
    }
    if recordings.iter().any(|recording| recording.start_ns.is_some() || !recording.pauses_known()) {
        return false;
    }
    let first = |recording: &Recording| recording.time_s.first().copied().unwrap_or(0.0);
    let last = |recording: &Recording| recording.time_s.last().copied().unwrap_or(0.0);
    let mut order: Vec<&Recording> = recordings.iter().collect();
    order.sort_by(|a, b| first(a).total_cmp(&first(b)));
    let on_one_clock = order.windows(2).all(|pair| last(pair[0]) <= first(pair[1]));
    if on_one_clock {
        recordings.sort_by(|a, b| first(a).total_cmp(&first(b)));
    }
    on_one_clock
}

/// As a person counts: `part2` before `part10`.
pub(super) fn compare_names(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    loop {
        let (x, y) = (take_chunk(&mut a_rest), take_chunk(&mut b_rest));
        let (Some(x), Some(y)) = (x, y) else { return x.is_some().cmp(&y.is_some()).then_with(|| a.cmp(b)) };
        let digits =
            |text: &str| text.starts_with(|c: char| c.is_ascii_digit()).then(|| text.trim_start_matches('0').len());
        let order = match (digits(x), digits(y)) {
            (Some(long), Some(other)) => {
                long.cmp(&other).then_with(|| x.trim_start_matches('0').cmp(y.trim_start_matches('0')))
            }
            _ => x.cmp(y),
        };
        if order != Ordering::Equal {
            return order;
        }
    }
}

/// The digits, or the other characters, that a text begins with.
fn take_chunk<'a>(rest: &mut &'a str) -> Option<&'a str> {
    let digit = rest.chars().next()?.is_ascii_digit();
    let end = rest.find(|c: char| c.is_ascii_digit() != digit).unwrap_or(rest.len());
    let (chunk, left) = rest.split_at(end);
    *rest = left;
    Some(chunk)
}

/// What has come already.
#[derive(Default)]
struct SeenRows {
    /// Runs by their numbers: where each came first.
    runs: BTreeMap<u64, String>,
    /// Rows that tell the time of day, with everything in them.
    rows: HashSet<u64>,
}

impl SeenRows {
    /// The rows that have not come before. They are remembered where others come after them.
    fn list_new_rows(&mut self, recording: &Recording, others_come: bool, remarks: &mut Vec<Bilingual>) -> Vec<usize> {
        let runs = recording.list_runs();
        let mut kept = Vec::new();
        let mut own = Vec::new();
        for run in &runs {
            let here = format!("run {} of {}", run.name, recording.source);
            match compute_run_digest(recording, run) {
                Some(digest) => match self.runs.get(&digest) {
                    Some(first) => remarks.push(describe_copy(&here, first, run.rows.len())),
                    None => {
                        self.runs.insert(digest, here);
                        kept.extend(run.rows.clone());
                    }
                },
                None => kept.extend(run.rows.clone()),
            }
        }
        let Some(start_ns) = recording.start_ns else { return kept };
        if self.rows.is_empty() && !others_come {
            return kept;
        }
        let before = kept.len();
        kept.retain(|row| {
            let digest = compute_row_digest(recording, start_ns, *row);
            own.push(digest);
            !self.rows.contains(&digest)
        });
        self.rows.extend(own);
        if kept.len() < before {
            let shared = before - kept.len();
            remarks.push(Bilingual::new(
                format!("{shared} rows of {} stand in an earlier recording too: counted once", recording.source),
                format!("{}中有{shared}行已在前面的记录中：只计一次", recording.source),
            ));
        }
        kept
    }
}

fn describe_copy(copy: &str, first: &str, rows: usize) -> Bilingual {
    Bilingual::new(
        format!("{copy} is a copy of {first} ({rows} rows): counted once"),
        format!("{copy}是{first}的副本（{rows}行）：只计一次"),
    )
}

/// A digest of the numbers of a run over the time since it began; `None` where another run may be equal by chance.
fn compute_run_digest(recording: &Recording, run: &Run) -> Option<u64> {
    let mut columns: Vec<(&str, &Numbers)> = list_numbers(recording).collect();
    columns.sort_by_key(|(name, _)| *name);
    let varies = |(_, numbers): &(&str, &Numbers)| {
        let mut values = HashSet::new();
        run.rows.clone().filter_map(|row| numbers.get(row)).any(|value| {
            values.insert(value.to_bits());
            values.len() >= COPY_VALUES_MIN
        })
    };
    if run.rows.len() < COPY_ROWS_MIN || !columns.iter().any(varies) {
        return None;
    }
    let mut hasher = DefaultHasher::new();
    let start_s = recording.time_s[run.rows.start];
    run.rows.clone().for_each(|row| round_time(recording.time_s[row] - start_s).hash(&mut hasher));
    for (name, numbers) in columns {
        name.hash(&mut hasher);
        run.rows.clone().for_each(|row| numbers.get(row).map(f64::to_bits).hash(&mut hasher));
    }
    Some(hasher.finish())
}

/// A digest of a row with the time of day and every cell but the name of the run.
fn compute_row_digest(recording: &Recording, start_ns: i64, row: usize) -> u64 {
    let mut hasher = DefaultHasher::new();
    (start_ns / 1000 + round_time(recording.time_s[row])).hash(&mut hasher);
    for column in recording.columns().iter().filter(|column| column.name != "run") {
        match &column.cells {
            Cells::Numbers(numbers) => {
                if let Some(value) = numbers.get(row) {
                    (column.name.as_str(), value.to_bits()).hash(&mut hasher);
                }
            }
            Cells::Words(words) => {
                if let Some(word) = words.get(row) {
                    (column.name.as_str(), word).hash(&mut hasher);
                }
            }
        }
    }
    hasher.finish()
}

fn list_numbers(recording: &Recording) -> impl Iterator<Item = (&str, &Numbers)> {
    recording.columns().iter().filter_map(|column| match &column.cells {
        Cells::Numbers(numbers) if numbers.count_present() > 0 => Some((column.name.as_str(), numbers)),
        _ => None,
    })
}

/// A time in microseconds.
fn round_time(seconds: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "seconds of a recording")]
    let rounded = (seconds / SAME_TIME_S).round() as i64;
    rounded
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::join::join_recordings;
    use recording::read_csv;
    use std::fmt::Write as _;

    /// A file of a run of this many rows, `at` seconds after eight o'clock where it tells the time of day.
    fn build_file(name: &str, run: &str, at: Option<u32>, seed: u32) -> Recording {
        let mut text = String::from(if at.is_some() { "time_utc,run,p_w\n" } else { "time_s,run,p_w\n" });
        for row in 0..30_u32 {
            let power = f64::from((row * 7919 + seed * 104_729) % 1009) / 10.0;
            let time = at.map_or_else(
                || row.to_string(),
                |at| format!("2026-01-31T08:{:02}:{:02}Z", (at + row) / 60, (at + row) % 60),
            );
            writeln!(text, "{time},{run},{power}").expect("a string takes it");
        }
        read_csv(text.as_bytes(), name).expect("readable").recording
    }

    /// Every order of three recordings.
    fn permute_recordings(all: &[Recording; 3]) -> Vec<Vec<Recording>> {
        let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        orders.map(|order| order.map(|index| all[index].clone()).to_vec()).to_vec()
    }

    #[test]
    fn no_order_of_the_files_changes_anything() {
        for clock in [Some(60), None] {
            let at = |number: u32| clock.map(|step| step * number);
            let files = [
                build_file("part10.csv", "c", at(9), 1),
                build_file("part2.csv", "b", at(5), 2),
                build_file("part1.csv", "a", at(1), 3),
            ];
            let results: Vec<(Recording, Vec<Bilingual>)> = permute_recordings(&files)
                .into_iter()
                .map(|order| {
                    let ordered = order_recordings(order, Copies::CountOnce);
                    (join_recordings(ordered.recordings).expect("fits"), ordered.remarks)
                })
                .collect();
            let runs: Vec<String> = results[0].0.list_runs().into_iter().map(|run| run.name).collect();
            assert_eq!(runs, ["a", "b", "c"], "{clock:?}");
            assert_eq!(results[0].0.pauses_known(), clock.is_some());
            assert!(results.iter().all(|result| *result == results[0]), "{clock:?}");
        }
    }

    #[test]
    fn a_copy_counts_once_under_whatever_name_and_time() {
        let first = build_file("a.csv", "1", Some(0), 1);
        for copy in [build_file("b.csv", "1", Some(0), 1), build_file("b.csv", "7", Some(600), 1)] {
            let ordered = order_recordings(vec![copy, first.clone()], Copies::CountOnce);
            assert_eq!(ordered.recordings.iter().map(Recording::count_rows).sum::<usize>(), 30);
            assert!(ordered.remarks.iter().any(|remark| remark.en.contains("copy of run 1 of a.csv (30 rows)")));
        }
        let other = order_recordings(vec![build_file("b.csv", "1", Some(600), 2), first], Copies::CountOnce);
        assert_eq!(other.recordings.iter().map(Recording::count_rows).sum::<usize>(), 60);
    }

    #[test]
    fn rows_that_two_files_share_count_once() {
        let whole = build_file("a.csv", "1", Some(0), 1);
        let tail = whole.take_rows(&(20..30).collect::<Vec<_>>());
        let head = whole.take_rows(&(0..25).collect::<Vec<_>>());
        assert_eq!((tail.time_s[0], tail.start_ns), (0.0, whole.start_ns.map(|ns| ns + 20_000_000_000)));
        let ordered = order_recordings(vec![tail, head], Copies::CountOnce);
        assert_eq!(ordered.recordings.iter().map(Recording::count_rows).collect::<Vec<_>>(), [25, 5]);
        assert!(ordered.remarks.iter().any(|remark| remark.en.starts_with("5 rows of")), "{:?}", ordered.remarks);
    }

    #[test]
    fn what_stands_still_is_no_copy() {
        let still = |name: &str| {
            let rows: String = (0..30).map(|row| format!("{row},1,250\n")).collect();
            read_csv(format!("time_s,run,p_w\n{rows}").as_bytes(), name).expect("readable").recording
        };
        assert_eq!(order_recordings(vec![still("a.csv"), still("b.csv")], Copies::CountOnce).recordings.len(), 2);
    }
}
