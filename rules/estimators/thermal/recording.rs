//! Temperatures and thermal error of a recording, as rows to learn from.

use super::course::{Course, Sensor};
use super::quantities::THERMAL_ERROR;
use crate::regression::{Refusal, RefusalKind};
use adapter_core::channel::quantity::{has_word, unit_of};
use recording::Recording;
use recording::{Cells, Numbers};
use serde::Serialize;

/// A sensor that has no value in more than this share of the rows with an error is left out.
const ABSENT_MAX: f64 = 0.2;

/// Rows to learn from, and what was left out.
#[derive(Debug, Clone, PartialEq)]
pub struct ThermalRows {
    /// Times, errors and temperatures that are complete.
    pub course: Course,
    /// What was left out and why.
    pub left_out: LeftOut,
}

/// What of a recording was not used.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Rows without an error or without one of the temperatures.
    pub rows: usize,
    /// Sensors that mostly have no value.
    pub sensors: Vec<String>,
}

/// Is this the column of a temperature? `temperature_<n>_c`, `bearing_temperature_c` and the like.
fn is_temperature(name: &str) -> bool {
    unit_of(name) == Some("°C") && has_word(name, "temperature")
}

/// Temperatures and error of a recording, in rows that have all of them.
///
/// # Errors
/// A [`Refusal`] where the error or every temperature is missing, or was recorded under the name of another unit.
pub fn collect_rows(recording: &Recording) -> Result<ThermalRows, Refusal> {
    let error = recording.find_numbers(THERMAL_ERROR).ok_or_else(|| no_error(recording))?;
    let with_error: Vec<usize> = (0..recording.count_rows()).filter(|row| error.get(*row).is_some()).collect();
    let temperatures: Vec<(&str, &Numbers)> = recording
        .columns()
        .iter()
        .filter(|column| is_temperature(&column.name))
        .filter_map(|column| match &column.cells {
            Cells::Numbers(numbers) => Some((column.name.as_str(), numbers)),
            Cells::Words(_) => None,
        })
        .collect();
    let absent = |numbers: &Numbers| with_error.iter().filter(|row| numbers.get(**row).is_none()).count();
    let few = |numbers: &Numbers| absent(numbers) as f64 > ABSENT_MAX * with_error.len() as f64;
    let (out, kept): (Vec<_>, Vec<_>) = temperatures.into_iter().partition(|(_, numbers)| few(numbers));
    if kept.is_empty() {
        return Err(no_temperature(recording, &out));
    }
    let complete = |row: &usize| kept.iter().all(|(_, numbers)| numbers.get(*row).is_some());
    let rows: Vec<usize> = with_error.into_iter().filter(complete).collect();
    let of = |numbers: &Numbers| rows.iter().filter_map(|row| numbers.get(*row)).collect::<Vec<f64>>();
    let sensors = kept.iter().map(|(name, numbers)| Sensor::new(*name, of(numbers))).collect();
    let runs = recording.list_runs().into_iter().map(|run| {
        let position = |row: usize| rows.partition_point(|kept| *kept < row);
        position(run.rows.start)..position(run.rows.end)
    });
    let runs = runs.filter(|run| !run.is_empty()).collect();
    let clock_s = rows.iter().map(|row| recording.time_s[*row]).collect();
    let left_out = LeftOut {
        rows: recording.count_rows() - rows.len(),
        sensors: out.iter().map(|(name, _)| (*name).to_owned()).collect(),
    };
    Ok(ThermalRows { course: Course::new(clock_s, runs, recording.pauses_known(), of(error), sensors), left_out })
}

fn no_error(recording: &Recording) -> Refusal {
    let other = recording.columns().iter().find(|column| column.name.starts_with("thermal_error"));
    match other {
        Some(column) => Refusal::new(
            RefusalKind::Unit,
            format!("is recorded as {}, another unit", column.name),
            "give it in micrometres as thermal_error_um",
        ),
        None => Refusal::new(
            RefusalKind::Missing,
            "is not in the recording",
            "record the displacement of the tool against the work beside the temperatures, in micrometres",
        ),
    }
    .with_place(THERMAL_ERROR)
}

fn no_temperature(recording: &Recording, out: &[(&str, &Numbers)]) -> Refusal {
    if let Some((name, _)) = out.first() {
        let next = "record with every sensor connected";
        return Refusal::new(RefusalKind::Missing, "has no value in most rows", next).with_place(*name);
    }
    let kelvin = |name: &str| name.ends_with("_k") && has_word(name, "temperature");
    match recording.columns().iter().find(|column| kelvin(&column.name)) {
        Some(column) => Refusal::new(RefusalKind::Unit, "is in kelvin", "give temperatures in °C, named .._c")
            .with_place(&column.name),
        None => Refusal::new(
            RefusalKind::Missing,
            "there is no temperature in the recording",
            "record temperatures as temperature_1_c, temperature_2_c, ... or bearing_temperature_c",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::Words;

    fn recording(columns: &[(&str, Vec<Option<f64>>)]) -> Recording {
        let rows = columns[0].1.len();
        let mut recording = Recording::new("test", (0..rows).map(|row| row as f64).collect(), None);
        for (name, values) in columns {
            recording.set_column(name, Cells::Numbers(values.iter().copied().collect()));
        }
        let runs: Words = (0..rows).map(|row| if row < rows / 2 { "a" } else { "b" }).collect();
        recording.set_column("run", Cells::Words(runs));
        recording
    }

    fn ramp(rows: usize) -> Vec<Option<f64>> {
        (0..rows).map(|row| Some(20.0 + row as f64)).collect()
    }

    #[test]
    fn rows_with_everything_are_kept_run_by_run() {
        let mut holed = ramp(20);
        holed[3] = None;
        let mut empty = vec![None; 20];
        empty[0] = Some(21.0);
        let given = recording(&[
            ("thermal_error_um", ramp(20)),
            ("temperature_1_c", holed),
            ("oil_temperature_c", ramp(20)),
            ("temperature_7_c", empty),
            ("spindle_speed_rpm", ramp(20)),
        ]);
        let collected = collect_rows(&given).expect("enough");
        let names: Vec<&str> = collected.course.sensors().iter().map(|sensor| sensor.name.as_str()).collect();
        assert_eq!(names, ["temperature_1_c", "oil_temperature_c"]);
        assert_eq!(collected.course.runs(), [0..9, 9..19]);
        assert_eq!(collected.left_out, LeftOut { rows: 1, sensors: vec!["temperature_7_c".to_owned()] });
    }

    #[test]
    fn what_is_missing_or_in_another_unit_is_said() {
        let told =
            |columns: &[(&str, Vec<Option<f64>>)]| collect_rows(&recording(columns)).expect_err("refused").to_string();
        assert!(told(&[("temperature_1_c", ramp(9))]).starts_with("thermal_error_um: is not in the recording"));
        assert!(told(&[("thermal_error_mm", ramp(9))]).contains("recorded as thermal_error_mm"));
        assert!(told(&[("thermal_error_um", ramp(9))]).contains("temperature_1_c, temperature_2_c"));
        let kelvin = told(&[("thermal_error_um", ramp(9)), ("temperature_1_k", ramp(9))]);
        assert!(kelvin.starts_with("temperature_1_k: is in kelvin"), "{kelvin}");
    }
}
