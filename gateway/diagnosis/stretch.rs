//! A stretch of the history as a diagnosis needs it: what was measured and commanded, one row per second, a run per
//! part, and the output only where the work had settled, as the watch looks at it.

use adapter_core::ChannelId;
use adapter_core::clock::TimeNs;
use gateway_history::{HistoryError, Query, Reader};
use recording::Recording;
use recording::{Cells, Numbers, Words};
use std::ops::Range;
use std::path::Path;

/// So much of the machine as it is now makes a diagnosis that can be relied upon, s. The box begins none of its own with less, and the page
/// warns a person who asks for one: with few cuts of each kind the error on rows that were left out says little, and the answer is more
/// often "cannot tell".
pub const ENOUGH_S: i64 = 45 * 60;
/// Rows of a stretch; the beginning of a longer one is left out.
const ROWS_MAX: usize = 28_800;
/// Seconds of the same work before and after a row that counts.
const SETTLED: (usize, usize) = (4, 2);
/// Relative change of the speed within these seconds that is no steady speed.
const STEADY_SHARE: f64 = 0.02;
/// More rows than this in a second are put together.
const DENSE_PER_S: f64 = 1.5;
/// Runs that make a part the unit of hold-out; with fewer the recording is cut into stretches.
const RUNS_MIN: usize = 8;

/// Reads the channels from `from_ns` to before `to_ns`. Estimates are left out: they follow from what they would explain.
///
/// # Errors
/// What the history says.
pub fn read(history: &Path, from_ns: TimeNs, to_ns: TimeNs, output: &str) -> Result<Recording, HistoryError> {
    let reader = Reader::open(history)?;
    let names: Vec<String> = reader.read_series()?.iter().map(|series| series.name.to_string()).collect();
    let channels = names.iter().map(String::as_str).filter(|name| ChannelId::from_name(name).is_some());
    let recording = reader.read_recording(&Query::between(from_ns, to_ns).with_series(channels))?;
    Ok(select_settled_rows(add_derived_columns(per_second(&recording, ROWS_MAX)), output))
}

/// A range of a history as `diagnose --recording history:...` reads it: the same as for the page. What was stored once a second or
/// less often stands as it is, but for what the machine's own words say without saying it.
#[must_use]
pub fn of_history(recording: Recording, output: &str) -> Recording {
    let span_s = recording.time_s.last().zip(recording.time_s.first()).map_or(0.0, |(last, first)| last - first);
    #[expect(clippy::cast_precision_loss, reason = "numbers of rows are far below 2^53")]
    let dense = recording.count_rows() as f64 > DENSE_PER_S * (span_s + 1.0);
    if dense {
        select_settled_rows(add_derived_columns(per_second(&recording, usize::MAX)), output)
    } else {
        add_derived_columns(recording)
    }
}

/// The output stands only in rows of settled work.
fn select_settled_rows(mut recording: Recording, output: &str) -> Recording {
    let Some(measured) = recording.find_numbers(output) else { return recording };
    let kept = |row: usize| measured.get(row).filter(|_| is_settled(&recording, row));
    let kept: Numbers = (0..recording.count_rows()).map(kept).collect();
    recording.set_column(output, Cells::Numbers(kept));
    recording
}

fn is_settled(recording: &Recording, row: usize) -> bool {
    let (before, after) = SETTLED;
    let near = row.saturating_sub(before)..(row + after + 1).min(recording.count_rows());
    let number = |name: &str, row: usize| recording.find_numbers(name).and_then(|numbers| numbers.get(row));
    let word = |name: &str, row: usize| recording.find_words(name).and_then(|words| words.find_code(row));
    let speed = number("spindle_speed_rpm", row).unwrap_or(0.0);
    let steady = |other: f64| (other - speed).abs() <= STEADY_SHARE * speed.abs().max(1.0);
    near.into_iter().all(|other| {
        steady(number("spindle_speed_rpm", other).unwrap_or(0.0))
            && ["engaged", "rapid"].iter().all(|name| number(name, other) == number(name, row))
            && ["tool", "operation"].iter().all(|name| word(name, other) == word(name, row))
    })
}

/// The mean of every number and the last of every word in each second; of more seconds than `rows_max` the beginning is left out.
#[must_use]
pub fn per_second(recording: &Recording, rows_max: usize) -> Recording {
    let mut seconds = split_seconds(recording);
    let surplus = seconds.len().saturating_sub(rows_max);
    seconds.drain(..surplus);
    let time_s = seconds.iter().map(|rows| recording.time_s[rows.start].floor()).collect();
    let mut thinned = Recording::new(recording.source.clone(), time_s, recording.start_ns);
    for column in recording.columns().iter().filter(|column| !column.name.ends_with("_missing")) {
        let cells = match &column.cells {
            // A channel that nobody delivered is no column: it may follow from others.
            Cells::Numbers(numbers) if numbers.count_present() == 0 => continue,
            Cells::Words(words) if words.words().is_empty() => continue,
            Cells::Numbers(numbers) => Cells::Numbers(seconds.iter().map(|rows| mean_of_rows(numbers, rows)).collect()),
            Cells::Words(words) => {
                Cells::Words(seconds.iter().map(|rows| words.get(rows.end - 1).unwrap_or("")).collect::<Words>())
            }
        };
        thinned.set_column(&column.name, cells);
    }
    thinned
}

/// Rows of each whole second.
fn split_seconds(recording: &Recording) -> Vec<Range<usize>> {
    let mut seconds: Vec<Range<usize>> = Vec::new();
    for (row, time_s) in recording.time_s.iter().enumerate() {
        match seconds.last_mut() {
            Some(rows) if recording.time_s[rows.start].floor() == time_s.floor() => rows.end = row + 1,
            _ => seconds.push(row..row + 1),
        }
    }
    seconds
}

/// The mean of the rows that have a value, where at least half of them have.
fn mean_of_rows(numbers: &Numbers, rows: &Range<usize>) -> Option<f64> {
    let present: Vec<f64> = rows.clone().filter_map(|row| numbers.get(row)).collect();
    let enough = !present.is_empty() && 2 * present.len() >= rows.len();
    #[expect(clippy::cast_precision_loss, reason = "rows of one second")]
    enough.then(|| present.iter().sum::<f64>() / present.len() as f64)
}

/// Adds what the machine's own words say without saying it: in the cut where a depth is planned and the axis feeds, and
/// a run per part.
fn add_derived_columns(mut recording: Recording) -> Recording {
    if recording.find_numbers("engaged").is_none()
        && let Some(engaged) = derive_engaged(&recording)
    {
        recording.set_column("engaged", Cells::Numbers(engaged));
    }
    if recording.find_words("run").is_none()
        && let Some(runs) = derive_runs(&recording)
    {
        recording.set_column("run", Cells::Words(runs));
    }
    recording
}

/// In the cut as the program says it: a depth is planned, the axis feeds, and not in rapid traverse.
#[must_use]
pub fn derive_engaged(recording: &Recording) -> Option<Numbers> {
    let (depth, feed) = (recording.find_numbers("depth_of_cut_mm")?, recording.find_numbers("feed_mm_min")?);
    let rapid = recording.find_numbers("rapid");
    let in_cut = |row: usize| {
        let rapid = rapid.and_then(|rapid| rapid.get(row)).unwrap_or(0.0) > 0.0;
        Some(f64::from(u8::from(depth.get(row)? > 0.0 && feed.get(row)? > 0.0 && !rapid)))
    };
    Some((0..recording.count_rows()).map(in_cut).collect())
}

fn derive_runs(recording: &Recording) -> Option<Words> {
    let parts = recording.find_numbers("part_count")?;
    let mut names = Vec::with_capacity(recording.count_rows());
    let (mut run, mut last) = (1, None);
    for row in 0..recording.count_rows() {
        let count = parts.get(row).or(last);
        run += usize::from(last.is_some() && count != last);
        last = count;
        names.push(run.to_string());
    }
    (run >= RUNS_MIN).then(|| names.iter().map(String::as_str).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_rows_become_one_and_the_program_tells_the_cut() {
        let mut recording = Recording::new("test", (0..40).map(|row| f64::from(row) / 10.0).collect(), Some(0));
        let numbers = |of: fn(i32) -> Option<f64>| Cells::Numbers((0..40).map(of).collect());
        recording.set_column("spindle_power_w", numbers(|row| (row % 10 != 3).then(|| f64::from(row))));
        recording.set_column("depth_of_cut_mm", numbers(|row| Some(f64::from(row / 20))));
        recording.set_column("feed_mm_min", numbers(|_| Some(100.0)));
        recording.set_column("engaged", numbers(|_| None));
        recording.set_column("spindle_power_w_missing", Cells::Words(std::iter::repeat_n("", 40).collect()));
        let thinned = add_derived_columns(per_second(&recording, ROWS_MAX));
        assert_eq!(thinned.time_s, [0.0, 1.0, 2.0, 3.0]);
        let power = thinned.find_numbers("spindle_power_w").expect("kept").get(0).expect("nine of ten");
        assert!((power - 42.0 / 9.0).abs() < 1e-12, "{power}");
        let engaged: Vec<_> = thinned.find_numbers("engaged").expect("told by the program").iter().flatten().collect();
        assert_eq!(engaged, [0.0, 0.0, 1.0, 1.0]);
        let settled: Vec<bool> = {
            let settled = select_settled_rows(thinned.clone(), "spindle_power_w");
            settled.find_numbers("spindle_power_w").expect("kept").iter().map(|power| power.is_some()).collect()
        };
        assert_eq!(settled, [false; 4], "the cut begins in the middle of four seconds");
        assert!(thinned.find_words("spindle_power_w_missing").is_none() && thinned.find_words("run").is_none());
    }
}
