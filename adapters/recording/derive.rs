//! Quantities that follow from others when a recording does not hold them.

use super::{Cells, Numbers, Recording};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Those that follow from other rows as well: what was counted before the recording began is in the recorded ones.
pub const OF_OTHER_ROWS: [&str; 2] = ["spindle_acceleration_rpm_per_s", "cutting_time_min"];

/// Names that can be derived, each after those that it follows from.
pub const DERIVABLE: [&str; 6] = [
    "feed_per_rev_mm",
    "cutting_speed_m_min",
    "feed_per_tooth_mm",
    "removal_rate_cm3_min",
    "spindle_acceleration_rpm_per_s",
    "cutting_time_min",
];

/// The recording with every derivable quantity that it lacks. A column without a single value is lacking: a history has the column
/// of every channel that its sources know, whether or not the machine delivers it.
#[must_use]
pub fn with_derived(mut recording: Recording) -> Recording {
    for name in DERIVABLE {
        let lacking = recording.find_numbers(name).is_none_or(|numbers| numbers.present_values().next().is_none());
        if lacking && let Some(numbers) = derive_quantity(&recording, name) {
            recording.set_column(name, Cells::Numbers(numbers));
        }
    }
    recording
}

/// The quantity `name`, computed from the others; `None` where it cannot be.
#[must_use]
pub fn derive_quantity(recording: &Recording, name: &str) -> Option<Numbers> {
    match name {
        "feed_per_rev_mm" => combine_columns(recording, "feed_mm_min", "spindle_speed_rpm", |feed, speed| {
            (speed.abs() > 1.0).then(|| feed / speed.abs())
        }),
        "cutting_speed_m_min" => combine_columns(recording, "diameter_mm", "spindle_speed_rpm", |diameter, speed| {
            Some(PI * diameter * speed.abs() / 1000.0)
        }),
        "feed_per_tooth_mm" => {
            combine_columns(recording, "feed_per_rev_mm", "teeth", |feed, teeth| (teeth >= 1.0).then(|| feed / teeth))
        }
        "removal_rate_cm3_min" => removal_rate(recording),
        "spindle_acceleration_rpm_per_s" => compute_rate(recording, "spindle_speed_rpm"),
        "cutting_time_min" => cutting_time(recording),
        _ => None,
    }
}

fn combine_columns(recording: &Recording, a: &str, b: &str, law: impl Fn(f64, f64) -> Option<f64>) -> Option<Numbers> {
    let a = recording.find_numbers(a)?;
    let b = recording.find_numbers(b)?;
    Some(a.iter().zip(b.iter()).map(|(a, b)| law(a?, b?)).collect())
}

/// Milling: `ap ae vf / 1000`; turning (no width of cut): `vc f ap`. Both in cm3/min.
fn removal_rate(recording: &Recording) -> Option<Numbers> {
    let depth = recording.find_numbers("depth_of_cut_mm")?;
    if let (Some(width), Some(feed)) =
        (recording.find_numbers("width_of_cut_mm"), recording.find_numbers("feed_mm_min"))
    {
        let rows = 0..recording.count_rows();
        return Some(rows.map(|row| Some(depth.get(row)? * width.get(row)? * feed.get(row)? / 1000.0)).collect());
    }
    let speed = recording.find_numbers("cutting_speed_m_min")?;
    let feed = recording.find_numbers("feed_per_rev_mm")?;
    Some((0..recording.count_rows()).map(|row| Some(speed.get(row)? * feed.get(row)? * depth.get(row)?)).collect())
}

/// Central difference within a run, one-sided at its ends.
fn compute_rate(recording: &Recording, name: &str) -> Option<Numbers> {
    let values = recording.find_numbers(name)?;
    let mut rates = Numbers::default();
    for run in recording.list_runs() {
        for row in run.rows.clone() {
            let before = row.saturating_sub(1).max(run.rows.start);
            let after = (row + 1).min(run.rows.end - 1);
            rates.push(compute_slope(recording, values, before, after));
        }
    }
    Some(rates)
}

fn compute_slope(recording: &Recording, values: &Numbers, before: usize, after: usize) -> Option<f64> {
    let dt_s = recording.time_s[after] - recording.time_s[before];
    (dt_s > 0.0).then_some((values.get(after)? - values.get(before)?) / dt_s)
}

/// Engaged minutes of this row's `tool`, summed over the whole recording, also when other tools cut in between.
fn cutting_time(recording: &Recording) -> Option<Numbers> {
    let engaged = recording.find_numbers("engaged")?;
    let tools = recording.find_words("tool");
    let mut minutes: BTreeMap<Option<u32>, f64> = BTreeMap::new();
    let mut times = Numbers::default();
    for run in recording.list_runs() {
        for row in run.rows.clone() {
            let step_s = if row > run.rows.start { recording.time_s[row] - recording.time_s[row - 1] } else { 0.0 };
            let sum = minutes.entry(tools.and_then(|tools| tools.find_code(row))).or_default();
            *sum += engaged.get(row).unwrap_or(0.0) * step_s.max(0.0) / 60.0;
            times.push(Some(*sum));
        }
    }
    Some(times)
}

#[cfg(test)]
mod tests {
    use super::super::Words;
    use super::*;

    #[test]
    fn the_published_cutting_speed() {
        let mut recording = Recording::new("test", vec![0.0], None);
        recording.set_column("diameter_mm", Cells::Numbers(Numbers::from_values(vec![79.0])));
        recording.set_column("spindle_speed_rpm", Cells::Numbers(Numbers::from_values(vec![800.0])));
        let speed =
            derive_quantity(&recording, "cutting_speed_m_min").and_then(|numbers| numbers.get(0)).expect("derivable");
        assert!((speed - 198.5).abs() < 0.1, "{speed}");
    }

    #[test]
    fn cutting_time_belongs_to_the_tool() {
        let mut recording = Recording::new("test", (0..6).map(|i| f64::from(i) * 60.0).collect(), None);
        recording.set_column("engaged", Cells::Numbers(Numbers::from_values(vec![1.0; 6])));
        recording.set_column("tool", Cells::Words(Words::from_iter(["A", "A", "B", "B", "A", "A"])));
        let minutes = derive_quantity(&recording, "cutting_time_min").expect("derivable");
        assert_eq!(minutes.iter().flatten().collect::<Vec<_>>(), vec![0.0, 1.0, 1.0, 2.0, 2.0, 3.0]);
    }
}
