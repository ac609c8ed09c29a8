//! What a data item of the simulated machine is worth at a moment.

use adapter_core::words::{execution, mode};
use serde_json::{Value, json};
use simulated::{Moment, Panel};

/// The value of the item with this path; `None` when it is no single value of this machine.
pub(super) fn find_value(path: &str, moment: &Moment) -> Option<Value> {
    let panel = &moment.panel;
    Some(match path {
        "STATUS" => json!(name_status(panel)),
        "FEED_SPEED" => json!(round_to_tenth(panel.feed_mm_min)),
        "FEED_OVERRIDE" => json!(panel.feed_override_pct),
        "SPDL_OVERRIDE" => json!(100),
        "PART_COUNT" => json!(panel.part_count),
        "CONTROLLER/PROGRAM" => json!(format!("../prog/O{}", panel.program)),
        "CONTROLLER/PROGRAM_NUMBER" => json!(panel.program),
        "CONTROLLER/LINE_NUMBER" => json!(panel.block),
        "CONTROLLER/TOOL_NUMBER" => json!(panel.tool),
        "CONTROLLER/WARNING" if panel.alarm.is_empty() => json!([]),
        "CONTROLLER/WARNING" => json!([{"number": "1", "text": panel.alarm}]),
        _ => find_axis_value(path.strip_prefix("AXIS@")?, moment)?,
    })
}

fn find_axis_value(rest: &str, moment: &Moment) -> Option<Value> {
    let panel = &moment.panel;
    let (number, item) = rest.split_once('/')?;
    let number: usize = number.parse().ok()?;
    Some(match (number, item) {
        (5, "SERVO_DRIVER/SPEED") => json!(round_to_tenth(panel.spindle_programmed_rpm)),
        (5, "MOTOR/SPEED") => json!(round_to_tenth(panel.spindle_speed_rpm)),
        (5, "MOTOR/CURRENT") => json!(round_to_thousandth(moment.electric.spindle_current_a)),
        (0..=2, "SERVO_DRIVER/POSITION" | "SCREW/POSITION") => json!(round_to_thousandth(panel.position_mm[number])),
        (0..=2, "SERVO_DRIVER/SPEED" | "SCREW/SPEED") => json!(round_to_tenth(panel.velocity_mm_min[number])),
        _ => return None,
    })
}

fn name_status(panel: &Panel) -> &'static str {
    match panel.execution {
        _ if !panel.alarm.is_empty() => "alarm",
        execution::ACTIVE => "running",
        execution::FEED_HOLD => "holding",
        _ => "free",
    }
}

/// The channel's first F word.
pub(super) fn channel_word(panel: &Panel) -> i64 {
    let mode = match panel.mode {
        mode::AUTOMATIC => 1,
        mode::SEMI_AUTOMATIC => 1 | 0x08,
        mode::MANUAL_DATA_INPUT => 7,
        _ => 2,
    };
    let bits = [
        (panel.execution == execution::FEED_HOLD, 0x10),
        (matches!(panel.execution, execution::ACTIVE | execution::FEED_HOLD), 0x20),
        (panel.override_locked, 0x200),
    ];
    bits.iter().filter(|(set, _)| *set).fold(mode, |word, (_, bit)| word | bit)
}

fn round_to_tenth(number: f64) -> f64 {
    (number * 10.0).round() / 10.0
}

fn round_to_thousandth(number: f64) -> f64 {
    (number * 1000.0).round() / 1000.0
}
