//! A whole day in five minutes, again and again: for a demonstration, in which nobody wants to wait for an evening.

use super::{Action, ProgramWriter, lathe};
use crate::words::{execution, mode};

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
pub(super) fn morning(out: &mut ProgramWriter<'_>) {
    (out.mode, out.execution) = (mode::MANUAL, execution::READY);
    out.put(Action::Mains(true)).put(Action::Wait(START_S));
    out.put(Action::Hydraulics(true)).put(Action::Drives(true)).put(Action::Wait(2.0));
    (out.mode, out.execution, out.program) = (mode::AUTOMATIC, execution::ACTIVE, 9000);
    out.operation = "warm-up";
    for speed_rpm in [300.0, 600.0, 960.0] {
        out.put(Action::Spindle(speed_rpm, 1)).put(Action::Wait(2.0));
    }
    out.operation = "";
    out.put(Action::Stop);
}

/// Part number `of_day` of the day, from 0; first the edge of `worn` is changed.
pub(super) fn part(out: &mut ProgramWriter<'_>, of_day: u32, worn: Option<u8>, pause_s: f64) {
    if let Some(tool) = worn {
        (out.mode, out.execution) = (mode::MANUAL, execution::READY);
        out.put(Action::ToolChange(tool)).put(Action::Wait(EDGE_S)).put(Action::NewEdge);
    }
    if of_day == 2 {
        out.aside(mode::AUTOMATIC, execution::READY, Action::Hydraulics(false));
        out.aside(mode::AUTOMATIC, execution::READY, Action::Wait(pause_s));
        out.aside(mode::AUTOMATIC, execution::READY, Action::Hydraulics(true));
    }
    out.aside(mode::AUTOMATIC, execution::PROGRAM_COMPLETED, Action::Wait(LOAD_S));
    if of_day == 1 {
        out.aside(mode::AUTOMATIC, execution::STOPPED, Action::Alarm("1005 CHUCK PRESSURE LOW"));
        out.aside(mode::AUTOMATIC, execution::STOPPED, Action::Wait(ALARM_S));
        out.aside(mode::AUTOMATIC, execution::READY, Action::Alarm(""));
    }
    (out.mode, out.execution) = (mode::AUTOMATIC, execution::ACTIVE);
    lathe::pin(out);
    out.put(Action::PartDone);
}

/// Off, until the next day begins at a multiple of `rhythm_s`.
pub(super) fn night(out: &mut ProgramWriter<'_>, since_s: f64, rhythm_s: f64) {
    (out.mode, out.execution) = (mode::MANUAL, execution::READY);
    out.put(Action::Wait(CLEAR_S)).put(Action::Drives(false)).put(Action::Hydraulics(false)).put(Action::Mains(false));
    let off_s = rhythm_s - (since_s + CLEAR_S).rem_euclid(rhythm_s);
    out.put(Action::Wait(if off_s < OFF_S { off_s + rhythm_s } else { off_s }));
}
