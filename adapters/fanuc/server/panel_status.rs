//! What both paths show alike: whole numbers, and the state of a panel.

use adapter_core::words::{execution, mode};
use fanuc::answer::Status;
use fanuc::wire::Number;
use simulated::Panel;

pub(super) fn round_to_number(value: f64) -> Number {
    #[expect(clippy::cast_possible_truncation, reason = "saturates, which is what a display does")]
    let mantissa = value.round() as i32;
    Number::from_decimal(mantissa, 0)
}

pub(super) fn build_status(panel: &Panel) -> Status {
    let automatic = match panel.mode {
        mode::MANUAL_DATA_INPUT => 0,
        mode::EDIT => 3,
        mode::MANUAL => 5,
        _ => 1,
    };
    let run = match panel.execution {
        execution::ACTIVE | execution::INTERRUPTED => 3,
        execution::FEED_HOLD => 2,
        execution::STOPPED => 1,
        _ => 0,
    };
    let motion = i16::from(panel.feed_mm_min > 0.0);
    Status { automatic, run, motion, alarm: i16::from(!panel.alarm.is_empty()), ..Status::default() }
}
