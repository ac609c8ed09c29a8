//! A whole day in five minutes, again and again: for a demonstration, in which nobody wants to wait for an evening.

use super::{Action, ProgramWriter, lathe};
use adapter_core::words::{execution, mode};

/// Parts of one day.
pub(super) const PARTS: u32 = 4;
/// From power-up until the control has started, s.
const START_S: f64 = 13.0;
/// Time for loading, s.
const LOAD_S: f64 = 5.0;
/// How long the alarm stands, s.
const ALARM_S: f64 = 12.0;
/// Fetching and changing an edge, s.
const EDGE_S: f64 = 8.0;
/// From the last part to the main switch, s.
const CLEAR_S: f64 = 5.0;
/// The machine is off for so long at least, s.
const OFF_S: f64 = 10.0;

/// Power-up and a short warm-up.
pub(super) fn write_morning(out: &mut ProgramWriter<'_>) {
    (out.mode, out.execution) = (mode::MANUAL, execution::READY);
    out.append_action(Action::Mains(true)).append_action(Action::Wait(START_S));
    out.append_action(Action::Hydraulics(true)).append_action(Action::Drives(true)).append_action(Action::Wait(2.0));
    (out.mode, out.execution, out.program) = (mode::AUTOMATIC, execution::ACTIVE, 9000);
    out.operation = "warm-up";
    for speed_rpm in [300.0, 600.0, 960.0] {
        out.append_action(Action::Spindle(speed_rpm, 1)).append_action(Action::Wait(2.0));
    }
    out.operation = "";
    out.append_action(Action::Stop);
}

/// Part number `of_day` of the day, from 0; first the edge of `worn` is changed.
pub(super) fn write_part(out: &mut ProgramWriter<'_>, of_day: u32, worn: Option<u8>, pause_s: f64) {
    if let Some(tool) = worn {
        (out.mode, out.execution) = (mode::MANUAL, execution::READY);
        out.append_action(Action::ToolChange(tool)).append_action(Action::Wait(EDGE_S)).append_action(Action::NewEdge);
    }
    if of_day == 2 {
        out.append_aside(mode::AUTOMATIC, execution::READY, Action::Hydraulics(false));
        out.append_aside(mode::AUTOMATIC, execution::READY, Action::Wait(pause_s));
        out.append_aside(mode::AUTOMATIC, execution::READY, Action::Hydraulics(true));
    }
    out.append_aside(mode::AUTOMATIC, execution::PROGRAM_COMPLETED, Action::Wait(LOAD_S));
    if of_day == 1 {
        out.append_aside(mode::AUTOMATIC, execution::STOPPED, Action::Alarm("1005 CHUCK PRESSURE LOW"));
        out.append_aside(mode::AUTOMATIC, execution::STOPPED, Action::Wait(ALARM_S));
        out.append_aside(mode::AUTOMATIC, execution::READY, Action::Alarm(""));
    }
    (out.mode, out.execution) = (mode::AUTOMATIC, execution::ACTIVE);
    lathe::write_pin(out);
    out.append_action(Action::PartDone);
}

/// Off, until the next day begins at a multiple of `rhythm_s`.
pub(super) fn write_night(out: &mut ProgramWriter<'_>, since_s: f64, rhythm_s: f64) {
    (out.mode, out.execution) = (mode::MANUAL, execution::READY);
    out.append_action(Action::Wait(CLEAR_S))
        .append_action(Action::Drives(false))
        .append_action(Action::Hydraulics(false))
        .append_action(Action::Mains(false));
    let off_s = rhythm_s - (since_s + CLEAR_S).rem_euclid(rhythm_s);
    out.append_action(Action::Wait(if off_s < OFF_S { off_s + rhythm_s } else { off_s }));
}
