//! Experiments: stretches of commanded speed, feed and auxiliaries, run once.

use super::{Action, Cut, ProgramWriter, Rate};
use adapter_core::integer::convert_bounded;
use adapter_core::words::{execution, mode};

/// Number of the program that an experiment runs under.
pub const EXPERIMENT_PROGRAM: u16 = 9100;

/// From the main switch to the first step: the control starts and the drives settle.
const START_S: f64 = 20.0;

/// A cut of an experiment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExperimentCut {
    /// Feed of the cut, mm/min.
    pub feed_mm_min: f64,
    /// Depth of cut, mm.
    pub depth_mm: f64,
    /// Diameter of the work, mm.
    pub diameter_mm: f64,
    /// Goes on from where the cut before it ended: the tool is not retracted.
    pub onward: bool,
}

/// What is commanded over a stretch of time. A change of the spindle speed takes its time on top.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExperimentStep {
    /// How long the step lasts, s.
    pub seconds: f64,
    /// Spindle speed, rpm; 0 is a stop.
    pub spindle_rpm: f64,
    /// Gear stage from 1; `None` takes the one that programs use at this speed.
    pub gear_stage: Option<u8>,
    /// The cut, if there is one.
    pub cut: Option<ExperimentCut>,
    /// Velocity of Z without a cut, mm/min, signed.
    pub axis_mm_min: f64,
    /// Does the coolant pump run?
    pub coolant_on: bool,
    /// Does the hydraulic pump run?
    pub hydraulics_on: bool,
    /// Feed override during the step, %.
    pub override_pct: u8,
    /// A fresh edge before the step.
    pub new_edge: bool,
}

/// Switches the machine on and writes every step.
pub(super) fn write(out: &mut ProgramWriter<'_>, steps: &[ExperimentStep]) {
    if steps.is_empty() {
        return;
    }
    (out.mode, out.execution) = (mode::MANUAL, execution::READY);
    out.append_action(Action::Mains(true)).append_action(Action::Wait(START_S)).append_action(Action::Drives(true));
    (out.mode, out.execution, out.program, out.operation) =
        (mode::AUTOMATIC, execution::ACTIVE, EXPERIMENT_PROGRAM, "experiment");
    let mut place = Place { stage: 1, z_mm: 160.0 };
    for (index, step) in steps.iter().enumerate() {
        out.set_number(convert_bounded(index + 1, u16::MAX));
        write_step(out, step, &mut place);
    }
}

/// Where the steps so far have left the machine.
struct Place {
    stage: u8,
    z_mm: f64,
}

fn write_step(out: &mut ProgramWriter<'_>, step: &ExperimentStep, place: &mut Place) {
    out.append_to_block(Action::Hydraulics(step.hydraulics_on)).append_to_block(Action::Coolant(step.coolant_on));
    out.append_to_block(Action::Override(step.override_pct));
    if step.new_edge {
        out.append_to_block(Action::NewEdge);
    }
    let wanted = step.gear_stage.unwrap_or(if step.spindle_rpm.abs() <= 1000.0 { 1 } else { 2 });
    if step.spindle_rpm == 0.0 {
        out.append_to_block(Action::Stop);
    } else {
        if wanted != place.stage {
            out.append_to_block(Action::Stop);
            place.stage = wanted;
        }
        out.append_to_block(Action::Spindle(step.spindle_rpm, wanted));
    }
    match step.cut {
        Some(cut) => place.z_mm = write_cut(out, &cut, step, place.z_mm),
        None if step.axis_mm_min != 0.0 => {
            let rate = Rate::PerMinute(step.axis_mm_min.abs());
            place.z_mm += step.axis_mm_min / 60.0 * step.seconds;
            out.append_to_block(Action::Feed { to: [200.0, 0.0, place.z_mm], rate, cut: None, locked: false });
        }
        None => {
            out.append_to_block(Action::Wait(step.seconds));
        }
    }
}

/// Writes a cut along Z, from zero or from where the tool is; where it ends.
fn write_cut(out: &mut ProgramWriter<'_>, cut: &ExperimentCut, step: &ExperimentStep, z_mm: f64) -> f64 {
    let length_mm = cut.feed_mm_min * f64::from(step.override_pct) / 100.0 * step.seconds / 60.0;
    let begins_mm = if cut.onward { z_mm } else { 0.0 };
    if !cut.onward {
        out.append_to_block(Action::Rapid([cut.diameter_mm, 0.0, 0.0]));
    }
    let planned = Cut {
        depth_mm: cut.depth_mm,
        diameter_from_mm: cut.diameter_mm,
        diameter_to_mm: cut.diameter_mm,
        ..Cut::default()
    };
    let rate = Rate::PerMinute(cut.feed_mm_min);
    let ends_mm = begins_mm - length_mm;
    out.append_to_block(Action::Feed { to: [cut.diameter_mm, 0.0, ends_mm], rate, cut: Some(planned), locked: false });
    ends_mm
}
