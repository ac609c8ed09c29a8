//! The recording that the story follows: twenty channels in steps, with changes of state, rows that are missing and cells that
//! are empty.

use serde_json::{Value as Json, json};
use std::fmt::Write;

/// Numbers: name, least value, range. All of them are continuous but the last five.
const NUMBERS: [(&str, f64, f64); 16] = [
    ("spindle_speed_rpm", 900.0, 200.0),
    ("feed_mm_min", 180.0, 60.0),
    ("spindle_power_w", 0.0, 0.0),
    ("total_power_w", 0.0, 0.0),
    ("spindle_current_a", 2.0, 9.0),
    ("x_axis_position_mm", -120.0, 300.0),
    ("z_axis_position_mm", -400.0, 380.0),
    ("motor_temperature_c", 30.0, 12.0),
    ("ambient_temperature_c", 18.0, 5.0),
    ("coolant_temperature_c", 19.0, 7.0),
    ("supply_voltage_v", 395.0, 11.0),
    ("spindle_programmed_rpm", 900.0, 200.0),
    ("feed_programmed_mm_min", 180.0, 60.0),
    ("feed_override_pct", 60.0, 40.0),
    ("spindle_override_pct", 80.0, 40.0),
    ("depth_of_cut_mm", 0.1, 4.0),
];
/// From here on [`NUMBERS`] hold until they change; the others are interpolated between two readings.
pub(super) const HELD_FROM: usize = 11;
/// Texts, and what stands before the number in them. `block` names the step.
const TEXTS: [(&str, &str); 4] = [("block", "N"), ("program", "O"), ("tool", "T"), ("operation", "op ")];

/// Rows for which the last step stands.
const TAIL_ROWS: usize = 3600;

/// How long the recording is, and how often it changes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Course {
    /// Steps in which every value stands.
    pub(super) steps: usize,
    /// Rows of a step, one a second of the recording.
    pub(super) rows: usize,
    /// Steps of one state.
    pub(super) state_steps: usize,
}

/// The twenty channels in the order of the recording.
pub(super) fn channels() -> Vec<&'static str> {
    NUMBERS.iter().map(|it| it.0).chain(TEXTS.iter().map(|it| it.0)).collect()
}

/// Is it one that is interpolated?
pub(super) fn is_continuous(channel: &str) -> bool {
    NUMBERS[..HELD_FROM].iter().any(|it| it.0 == channel)
}

/// What the machine does in a step: stands, idles, cuts.
fn find_work(step: usize, course: Course) -> usize {
    step / course.state_steps % 3
}

/// A share from 0 to 1 with as many digits as a number has.
fn draw_share(step: usize, salt: usize) -> f64 {
    ((step * 7919 + salt * 104_729) % 10_007) as f64 / 10_007.0
}

/// What the source delivers of this channel in this step.
pub(super) fn find_delivered(channel: &str, step: usize, course: Course) -> Json {
    if let Some(found) = TEXTS.iter().find(|it| it.0 == channel) {
        let number = match found.0 {
            "block" => step,
            "program" => 1000 + step / course.state_steps,
            _ => 1 + step / course.state_steps % 5,
        };
        return json!(format!("{}{number}", found.1));
    }
    let at = NUMBERS.iter().position(|it| it.0 == channel).expect("a channel of the story");
    let (name, least, range) = NUMBERS[at];
    let doing = find_work(step, course);
    let drawn = least + range * draw_share(step, at);
    json!(match (name, doing) {
        ("spindle_speed_rpm" | "feed_mm_min" | "spindle_programmed_rpm", 0) | ("feed_mm_min", 1) => 0.0,
        ("spindle_power_w", 0) => 0.0,
        ("spindle_power_w", 1) => 520.0 + 9.0 * draw_share(step, at),
        ("spindle_power_w", _) => 1650.0 + 90.0 * draw_share(step, at),
        ("total_power_w", 0) => 610.0 + 7.0 * draw_share(step, at),
        ("total_power_w", 1) => 1420.0 + 9.0 * draw_share(step, at),
        ("total_power_w", _) => 2600.0 + 90.0 * draw_share(step, at),
        _ => drawn,
    })
}

/// Is there a row in this step, and are there values in it? Every 30th step the source says nothing, every 37th it has no value.
pub(super) fn is_silent(step: usize) -> bool {
    step > 0 && step.is_multiple_of(30)
}

pub(super) fn is_empty(step: usize) -> bool {
    step > 0 && step.is_multiple_of(37)
}

/// The whole recording as CSV.
pub(super) fn write_csv(course: Course) -> String {
    let channels = channels();
    let mut text = format!("time_s,{}\n", channels.join(","));
    for step in (0..course.steps).filter(|step| !is_silent(*step)) {
        let cell = |channel: &&str| match find_delivered(channel, step, course) {
            _ if is_empty(step) => String::new(),
            Json::String(word) => word,
            number => number.to_string(),
        };
        let cells: Vec<String> = channels.iter().map(cell).collect();
        // The last step stands while everybody is asked: a box whose recording is over ends.
        let rows = course.rows + if step + 1 == course.steps { TAIL_ROWS } else { 0 };
        for row in 0..rows {
            let _written = writeln!(text, "{},{}", step * course.rows + row, cells.join(","));
        }
    }
    text
}

/// Does `found` tell what the source delivered at a moment of `step`? A quantity may lie on the way to the next step or from the
/// one before, `None`; a number has at most the digits of the history.
pub(super) fn agrees_with_source(channel: &str, found: &Json, step: usize, course: Course) -> Option<bool> {
    let of = |step: usize| find_delivered(channel, step, course);
    let (Some(number), Some(own)) = (found.as_f64(), of(step).as_f64()) else { return Some(*found == of(step)) };
    let tolerance = 0.051_f64.min(own.abs() * 1e-2).max(5.1e-5);
    if (number - own).abs() <= tolerance {
        return Some(true);
    }
    let neighbours = [of(step.saturating_sub(1)), of(step + 1)];
    let between = neighbours
        .iter()
        .filter_map(Json::as_f64)
        .any(|other| (own.min(other) - tolerance..=own.max(other) + tolerance).contains(&number));
    if is_continuous(channel) && between { None } else { Some(false) }
}
