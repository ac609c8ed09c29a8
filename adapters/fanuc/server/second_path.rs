//! What a further path of the simulated machine shows: a second turret at the back of the part. It cuts when the first
//! path does, at half the speed and half the feed, under a program and an override of its own; between two cuts of the
//! first path it waits for it, and its operator acknowledges what its ladder has latched.

use super::controller::Controller;
use super::ladder::PmcLadder;
use super::memory::Memory;
use super::panel_status::{build_status, round_to_number};
use adapter_core::driver::LadderRequest;
use fanuc::item::{Area, BlockWord};
use fanuc::poll::find_signal_address;
use fanuc::wire::Number;
use simulated::Moment;

/// Its programs have numbers this much higher.
const PROGRAM_STEP: i32 = 1000;
/// Bits of F000: cycle start and drives ready.
const STARTED: u8 = 0x20;
const READY: u8 = 0x40;
const FULL: u8 = 100;
const SPINDLE_AT: u16 = 30;

/// The moment on the screen of a path from 2.
pub(super) fn show_path(control: &mut Controller, memory: &mut Memory, ladder: &mut PmcLadder, moment: &Moment) {
    let (panel, path) = (&moment.panel, ladder.path);
    let first_cuts = panel.feed_mm_min > 0.0 && !panel.rapid;
    if !first_cuts {
        LadderRequest::ALL.into_iter().for_each(|request| ladder.acknowledge_request(request));
    }
    let held = ladder.is_latched(LadderRequest::FeedHold);
    let own = f64::from(ladder.compute_override(memory).percent()) / f64::from(panel.feed_override_pct.max(1));
    let cuts = first_cuts && !held && own > 0.0;
    control.status = build_status(panel);
    (control.status.alarm, control.status.motion) = (0, i16::from(cuts));
    if held {
        control.status.run = 2;
    }
    let half = |value: f64| if cuts { round_to_number(value / 2.0) } else { round_to_number(0.0) };
    control.feed = half(panel.feed_mm_min * own);
    let (speed, load) = (round_to_number(panel.spindle_speed_rpm.abs() / 2.0), half(moment.electric.spindle_load_pct));
    control.spindles[0].quantities = [load, round_to_number(6000.0), Number::from_decimal(1, 0), speed, load, speed];
    for (axis, place) in control.axes.iter_mut().zip([0, 2]) {
        axis.positions[1] = Number { exponent: 3, ..round_to_number(-1000.0 * panel.position_mm[place]) };
    }
    let program = i32::from(panel.program) + PROGRAM_STEP * (i32::from(path) - 1);
    (control.program, control.sequence) = ((program, program), i32::from(panel.block));
    let modal =
        [(BlockWord::F, panel.feed_programmed_mm_min / 2.0), (BlockWord::S, panel.spindle_programmed_rpm.abs() / 2.0)];
    control.modal_words.extend(modal.map(|(word, value)| (word, round_to_number(value))));
    control.set_modal_words([(BlockWord::T, 20 + i32::from(panel.tool))]);
    // Half the speed at half the load.
    let power = round_to_number(moment.truth.spindle_power_w / 40.0).mantissa.saturating_mul(10);
    control.set_diagnosis(4902, 2, Number::from_decimal(power, 0));
    let bits = if panel.drives_on { READY } else { 0 } | if cuts { STARTED } else { 0 };
    memory.set_byte(Area::F, find_signal_address(0, path), bits);
    memory.set_byte(Area::G, find_signal_address(SPINDLE_AT, path), FULL);
}
