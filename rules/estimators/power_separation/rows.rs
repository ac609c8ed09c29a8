//! A recording through the estimators, row by row.

use crate::regression::{Plausible, Refusal, RefusalKind};
use crate::{Inference, Settings, State};
use adapter_core::clock::SECOND_NS;
use adapter_core::{Absence, ChannelId, Sample, Slot, Value};
use recording::Recording;

/// Slower recordings do not show when a state begins.
const PERIOD_MAX_S: f64 = 5.0;

/// Channels that the estimators look at.
const LOOKED_AT: [&str; 7] =
    ["spindle_power_w", "total_power_w", "spindle_speed_rpm", "feed_mm_min", "rapid", "gear_stage", "supply_voltage_v"];

/// One row and what the machine was doing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MachineRow {
    /// Row of the recording.
    pub(super) row: usize,
    pub(super) time_s: f64,
    /// Spindle power; total power above standby stands for it where there is none.
    pub(super) power_w: Option<f64>,
    /// Magnitude of the spindle speed.
    pub(super) speed_rpm: Option<f64>,
    /// Does the spindle turn backward (M4)?
    pub(super) backward: bool,
    /// Gear stage; 0 where the recording has none.
    pub(super) stage: usize,
    /// Is an axis feeding?
    pub(super) feeding: bool,
    /// What the machine was doing.
    pub(super) state: State,
}

/// Every row of the recording with its state.
///
/// # Errors
/// A column that is missing, a unit that was mistaken, a recording too slow to show states.
pub(super) fn classify_rows(recording: &Recording) -> Result<Vec<MachineRow>, Refusal> {
    check_recording(recording)?;
    let period_s = period_s(recording)?;
    let mut settings = Settings::default();
    // A pause is several periods of this recording, whatever its pace.
    let gap_s = (3.0 * period_s).max(2.0);
    settings.set_value("gap_s", gap_s).map_err(|error| Refusal::new(RefusalKind::OutOfRange, error.to_string(), ""))?;
    let mut pipeline = Inference::new(settings);
    let runs = recording.list_runs();
    let mut rows = Vec::with_capacity(recording.count_rows());
    let mut shift_s = 0.0;
    let mut last_s = f64::NEG_INFINITY;
    for run in runs {
        // Runs that do not share a clock follow each other after a pause.
        let first_s = recording.time_s[run.rows.start];
        if first_s + shift_s <= last_s {
            shift_s = last_s + 10.0 * gap_s - first_s;
        }
        for row in run.rows {
            last_s = recording.time_s[row] + shift_s;
            let sample = build_sample(recording, row, last_s);
            let state = pipeline.update_with_sample(&sample).state;
            rows.push(build_machine_row(recording, row, last_s, state, pipeline.settings()));
        }
    }
    Ok(rows)
}

fn check_recording(recording: &Recording) -> Result<(), Refusal> {
    let missing = |name: &str| {
        let what = format!("the recording has no column {name}");
        Refusal::new(RefusalKind::Missing, what, "record it; the recording format names the columns")
    };
    let speed = recording.find_numbers("spindle_speed_rpm").ok_or_else(|| missing("spindle_speed_rpm"))?;
    let power = recording.find_numbers("spindle_power_w").or_else(|| recording.find_numbers("total_power_w"));
    let power = power.ok_or_else(|| missing("spindle_power_w"))?;
    recording.find_numbers("feed_mm_min").ok_or_else(|| missing("feed_mm_min"))?;
    Plausible::SPINDLE_SPEED_RPM
        .check_values(speed.present_values())
        .map_err(|refusal| refusal.with_place("spindle_speed_rpm"))?;
    let turning = power.iter().zip(speed.iter()).filter(|(_, speed)| speed.is_some_and(|speed| speed.abs() > 10.0));
    Plausible::SPINDLE_POWER_W
        .check_values(turning.filter_map(|(power, _)| power))
        .map_err(|refusal| refusal.with_place("spindle power"))
}

fn period_s(recording: &Recording) -> Result<f64, Refusal> {
    let mut steps: Vec<f64> =
        recording.time_s.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    let period_s = steps.get(steps.len() / 2).copied().unwrap_or(f64::INFINITY);
    if period_s <= PERIOD_MAX_S {
        return Ok(period_s);
    }
    let what = format!("one row in {period_s:.1} s is too slow to tell when the spindle idles");
    Err(Refusal::new(RefusalKind::TooFew, what, "record at least one row per second"))
}

fn build_sample(recording: &Recording, row: usize, time_s: f64) -> Sample {
    #[expect(clippy::cast_possible_truncation, reason = "seconds of a recording are far below 2^63 ns")]
    let mut sample = Sample::new_empty((time_s * SECOND_NS as f64) as i64);
    for name in LOOKED_AT {
        if let (Some(numbers), Some(channel)) = (recording.find_numbers(name), ChannelId::from_name(name)) {
            let value = numbers.get(row).map(Value::Number).ok_or(Absence::NotRecorded);
            sample.set_slot(channel, Slot { value, age_ns: 0 });
        }
    }
    sample
}

fn build_machine_row(recording: &Recording, row: usize, time_s: f64, state: State, settings: &Settings) -> MachineRow {
    let number = |name: &str| recording.find_numbers(name).and_then(|numbers| numbers.get(row));
    let own = recording.find_numbers("spindle_power_w").is_some();
    let feed = number("feed_mm_min").unwrap_or(f64::INFINITY);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to what a machine has")]
    let stage = number("gear_stage").map_or(0, |stage| stage.clamp(0.0, 7.0).round() as usize);
    MachineRow {
        row,
        time_s,
        power_w: if own { number("spindle_power_w") } else { number("total_power_w") },
        speed_rpm: number("spindle_speed_rpm").map(f64::abs),
        backward: number("spindle_speed_rpm").is_some_and(|speed| speed < 0.0),
        stage,
        feeding: feed > settings.get("feed_min_mm_min").unwrap_or(0.5) || number("rapid").unwrap_or(0.0) > 0.5,
        state,
    }
}
