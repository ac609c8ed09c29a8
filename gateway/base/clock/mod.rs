//! What "now" is, decided in one place: history, retention, outputs, page, alarms and certificates ask here.
//!
//! # Why the box does not read the wall clock
//! A wall clock is somebody else's: a battery dies, a time server is wrong for three seconds, a person types a wrong year. A
//! box that believes each reading dates its rows wrongly, and a housekeeper that believes one erases them. So the box has a
//! time of its own: the wall clock of one moment, carried on by the clock of the processor (which counts a sleep of the
//! computer too). The wall clock is looked at every second and *compared*.
//!
//! # What is believed
//! | [`Trust`] | meaning |
//! |---|---|
//! | `unset` | the wall clock said at the start what cannot be: a time before this program was made, or two seconds and more before rows that are certain. The box goes on from the last certain time, and everything it stores is provisional |
//! | `plausible` | the wall clock agrees with the box, for less than the time of confirmation |
//! | `confirmed` | it has agreed for the time of confirmation (two hours unless configured) |
//! | `leapt` | it says something else than the box. The box keeps its own time |
//!
//! Another reading is followed when it has stood long enough: half a minute where it is better supported than that of the box
//! (the box had none, or one for which the machine must have been off much longer), otherwise the time of confirmation. To follow, the
//! box ends its run as for a stop, dates the provisional rows of this boot anew, and begins again: no part of it ever sees a
//! clock that runs backwards, and a gate that was armed is not armed any more.
//!
//! | file | what |
//! |---|---|
//! | `judge` | the rules above, pure: readings in, news out |
//! | `box_clock` | the time of the box for everybody in the process |

mod status;
pub use status::ClockStatus;
mod box_clock;
mod judge;

pub use box_clock::{BoxClock, ClockMark, of_box};
pub use judge::{Certain, ClockNews, ClockRules, Trust};

use adapter_core::clock::{Clock, SECOND_NS, TimeNs};

/// Nobody runs this program before it was made: 2026-01-01, a lower bound of every true reading.
pub const MADE_NS: TimeNs = 1_767_225_600 * SECOND_NS;

/// The time of the box.
#[must_use]
pub fn now_ns() -> TimeNs {
    of_box().now_ns()
}

/// A length of time in words.
#[must_use]
pub fn format_span(ns: i64) -> String {
    let seconds = ns.unsigned_abs().saturating_add(SECOND_NS.unsigned_abs() / 2) / SECOND_NS.unsigned_abs();
    match seconds {
        0..=119 => format!("{seconds} s"),
        120..=7199 => format!("{} min", seconds / 60),
        7200..=172_799 => format!("{} h", seconds / 3600),
        172_800..=63_071_999 => format!("{} days", seconds / 86_400),
        _ => format!("{} years", seconds / 31_557_600),
    }
}
