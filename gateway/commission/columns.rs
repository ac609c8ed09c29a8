//! The history as a recording, with what a person has measured as columns.

use super::annotations::{Annotation, Quantity};
use super::torque_file::{TorqueFileError, torque_course};
use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_history::{HistoryError, Query, Reader, STATE_SERIES};
use recording::{Cells, Numbers, Recording};
use rules::estimators::alignment::{Matched, match_courses};
use rules::estimators::regression::Refusal;
use std::path::Path;

/// Series that the identification looks at, where the history has them.
const SERIES: [&str; 30] = [
    "spindle_power_w",
    "total_power_w",
    "spindle_speed_rpm",
    "feed_mm_min",
    "feed_per_rev_mm",
    "cutting_speed_m_min",
    "rapid",
    "gear_stage",
    "depth_of_cut_mm",
    "diameter_mm",
    "supply_voltage_v",
    STATE_SERIES,
    "no_load_power_w",
    "tool",
    "operation",
    "program",
    "block",
    "torque_nm",
    "cutting_force_n",
    "thermal_error_um",
    "bearing_temperature_c",
    "motor_temperature_c",
    "ambient_temperature_c",
    "coolant_temperature_c",
    "temperature_1_c",
    "temperature_2_c",
    "temperature_3_c",
    "temperature_4_c",
    "temperature_5_c",
    "temperature_6_c",
];
/// A wear is taken for that of a cut within so much time of the nearest microscope reading, ns: an edge is not left in the machine
/// over a weekend and looked at again.
const WEAR_REACHES_NS: i64 = 12 * 3600 * SECOND_NS;
/// A gauge or probe reading belongs to the row nearest to it, within so much time, ns.
const GAUGE_REACHES_NS: i64 = 30 * SECOND_NS;

/// The history from a time on, of at most a day by default.
///
/// # Errors
/// The history cannot be read, or is empty.
pub fn read(history: &Path, from_ns: Option<TimeNs>) -> Result<Recording, HistoryError> {
    let reader = Reader::open(history)?;
    let known: Vec<String> = reader.read_series()?.into_iter().map(|it| it.name.to_string()).collect();
    let series: Vec<String> =
        SERIES.iter().filter(|name| known.iter().any(|it| it == *name)).map(|name| (*name).to_owned()).collect();
    reader.read_recording(&Query { from_ns, series, ..Query::default() })
}

/// Time of every row, ns.
fn times_ns(recording: &Recording) -> Vec<TimeNs> {
    let start_ns = recording.start_ns.unwrap_or(0);
    #[expect(clippy::cast_possible_truncation, reason = "seconds of a history are far below 2^63 ns")]
    recording.time_s.iter().map(|time_s| start_ns + (time_s * SECOND_NS as f64) as i64).collect()
}

/// Flank wear between the microscope readings of one edge, in a straight line over time.
pub fn add_wear(recording: &mut Recording, annotations: &[Annotation]) {
    let readings: Vec<WearReading<'_>> = annotations
        .iter()
        .filter(|it| it.quantity == Quantity::FlankWear)
        .filter_map(|it| Some((it.at_ns, it.value?, it.of.as_str())))
        .collect();
    if readings.is_empty() {
        return;
    }
    let wear = |at_ns: TimeNs| {
        let between = find_bracket(&readings, at_ns).map(|(one, other)| {
            let share = (at_ns - one.0) as f64 / (other.0 - one.0).max(1) as f64;
            one.1 + share * (other.1 - one.1)
        });
        let next = readings.partition_point(|(then_ns, ..)| *then_ns <= at_ns);
        let before = next.checked_sub(1).map(|at| readings[at]).filter(|it| at_ns - it.0 <= WEAR_REACHES_NS);
        let after = readings.get(next).copied().filter(|it| it.0 - at_ns <= WEAR_REACHES_NS);
        between.or_else(|| before.or(after).map(|it| it.1))
    };
    let column = times_ns(recording).into_iter().map(wear).collect::<Numbers>();
    recording.set_column("flank_wear_mm", Cells::Numbers(column));
}

/// A microscope reading: when, mm, of which edge.
type WearReading<'a> = (TimeNs, f64, &'a str);

/// The closest two readings of one edge with a time between them: an edge was in the machine from the one to the other.
fn find_bracket<'a>(readings: &[WearReading<'a>], at_ns: TimeNs) -> Option<(WearReading<'a>, WearReading<'a>)> {
    let (before, after): (Vec<WearReading<'_>>, Vec<WearReading<'_>>) =
        readings.iter().copied().partition(|it| it.0 <= at_ns);
    let pair = |one: &WearReading<'a>| Some((*one, *after.iter().find(|it| it.2 == one.2 && it.1 >= one.1)?));
    let pairs = before.iter().filter_map(pair).filter(|(one, other)| other.0 - one.0 <= WEAR_REACHES_NS);
    pairs.min_by_key(|(one, other)| other.0 - one.0)
}

/// Readings of gauge and probe as thermal error, in the rows nearest to them.
pub fn add_thermal_error(recording: &mut Recording, annotations: &[Annotation]) {
    let times_ns = times_ns(recording);
    let mut values = vec![None; times_ns.len()];
    for it in annotations.iter().filter(|it| matches!(it.quantity, Quantity::Gauge | Quantity::Probe)) {
        let next = times_ns.partition_point(|at_ns| *at_ns < it.at_ns);
        let nearest = neighbouring_rows(next, times_ns.len()).min_by_key(|at| (times_ns[*at] - it.at_ns).abs());
        if let Some(at) = nearest.filter(|at| (times_ns[*at] - it.at_ns).abs() <= GAUGE_REACHES_NS) {
            values[at] = it.value;
        }
    }
    if values.iter().any(Option::is_some) {
        recording.set_column("thermal_error_um", Cells::Numbers(values.into_iter().collect::<Numbers>()));
    }
}

/// The rows before and after a place among so many rows.
fn neighbouring_rows(next: usize, rows: usize) -> impl Iterator<Item = usize> {
    [next.checked_sub(1), Some(next)].into_iter().flatten().filter(move |at| *at < rows)
}

/// What became of a torque file.
#[derive(Debug, Clone)]
pub struct Merged {
    /// Absolute path of the torque file, for the report.
    pub file: String,
    /// Where it lies in the history, or why it cannot be told.
    pub matched: Result<Matched, Refusal>,
}

/// Lays torque files on the clock of the history, by their cuts, and adds them as `torque_nm`.
///
/// # Errors
/// A file that can no longer be read.
pub fn add_torque(recording: &mut Recording, annotations: &[Annotation]) -> Result<Vec<Merged>, TorqueFileError> {
    let mut merged = Vec::new();
    let mut sums = vec![(0.0, 0.0); recording.count_rows()];
    let power = torque_like(recording);
    for file in annotations.iter().filter_map(|it| it.file.as_deref()) {
        let course = torque_course(file)?;
        let matched = match_courses(&power, &course);
        if let Ok(matched) = &matched {
            spread_torques(&mut sums, &recording.time_s, &course, matched);
        }
        merged.push(Merged { file: file.display().to_string(), matched });
    }
    if sums.iter().any(|(_, n)| *n > 0.0) {
        let column = sums.iter().map(|(sum, n)| (*n > 0.0).then(|| sum / n)).collect::<Numbers>();
        recording.set_column("torque_nm", Cells::Numbers(column));
    }
    Ok(merged)
}

/// What the torque must look like: spindle power over angular speed, while the spindle turns at a steady speed.
fn torque_like(recording: &Recording) -> Vec<(f64, f64)> {
    let number = |name: &str, row: usize| recording.find_numbers(name).and_then(|it| it.get(row));
    let one = |row: usize| {
        let (power, speed) = (number("spindle_power_w", row)?, number("spindle_speed_rpm", row)?.abs());
        let no_load = number("no_load_power_w", row).unwrap_or(0.0);
        let state = recording.find_words(STATE_SERIES).and_then(|words| words.get(row)).unwrap_or("");
        let cutting = state == "cutting" && speed > 1.0;
        let torque = if cutting { (power - no_load) * 60.0 / (std::f64::consts::TAU * speed) } else { 0.0 };
        Some((recording.time_s[row], torque))
    };
    (0..recording.count_rows()).filter_map(one).collect()
}

/// Adds the torques of a file to the rows that they fall into.
fn spread_torques(sums: &mut [(f64, f64)], time_s: &[f64], course: &[(f64, f64)], matched: &Matched) {
    for (second_s, torque) in course {
        let at_s = matched.on_first_clock(*second_s);
        let next = time_s.partition_point(|row_s| *row_s < at_s);
        let nearest = neighbouring_rows(next, time_s.len())
            .min_by(|a, b| (time_s[*a] - at_s).abs().total_cmp(&(time_s[*b] - at_s).abs()));
        if let Some(at) = nearest.filter(|at| (time_s[*at] - at_s).abs() <= 0.5) {
            sums[at] = (sums[at].0 + torque, sums[at].1 + 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_takes_the_wear_of_the_edge_that_was_in_the_machine() {
        let reading = |at_s: i64, value: f64, of: &str| Annotation {
            quantity: Quantity::FlankWear,
            at_ns: at_s * SECOND_NS,
            value: Some(value),
            sd: None,
            file: None,
            of: of.to_owned(),
        };
        // The second edge was noted a moment before the last reading of the first.
        let noted = [reading(0, 0.02, "a"), reading(99, 0.14, "b"), reading(100, 0.04, "a"), reading(200, 0.16, "b")];
        let mut recording = Recording::new("history", vec![50.0, 150.0, 300.0], Some(0));
        add_wear(&mut recording, &noted);
        let wears: Vec<f64> = recording.find_numbers("flank_wear_mm").expect("a column").present_values().collect();
        let near = |at: usize, wear: f64| (wears[at] - wear).abs() < 1e-3;
        assert!(near(0, 0.03) && near(1, 0.15) && near(2, 0.16), "{wears:?}");
    }
}
