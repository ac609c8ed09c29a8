//! What a controller answers, typed. Numbers are in the unit that the question implies.

use super::code::ReturnCode;
use crate::driver::SEE_DOCTOR;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Kind, series and version of a control.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct System {
    /// Bits; bit 1 is the i series.
    pub additional: i16,
    /// Most axes there can be.
    pub axes_max: i16,
    /// Two characters: 15, 16, 18, 30, 31, 0 and so on.
    pub kind: String,
    /// M milling, T turning, L laser and so on.
    pub machine: String,
    /// Four characters.
    pub series: String,
    /// Four characters.
    pub version: String,
    /// Two digits.
    pub axes: String,
}

/// What the control does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Status {
    /// Mode: 0 MDI, 1 memory, 3 edit, 4 handle, 5 jog, 6 teach in jog, 7 teach in handle, 8 increment, 9 reference,
    /// 10 remote.
    pub automatic: i16,
    /// 0 reset, 1 stop, 2 hold, 3 start, 4 restart of a block by hand.
    pub run: i16,
    /// 0 none, 1 axes move, 2 dwell.
    pub motion: i16,
    /// 1 while M, S, T or B functions are being carried out.
    pub auxiliary: i16,
    /// 1 emergency stop, 2 reset.
    pub emergency: i16,
    /// 1 alarm, 2 battery low and other warnings.
    pub alarm: i16,
    /// Editing state.
    pub edit: i16,
}

/// One alarm.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Alarm {
    /// Number within its type.
    pub number: i32,
    /// Type: 0 SW, 1 PW, 2 IO, 3 PS, 4 OT, 5 OH, 6 SV, 7 SR, 8 MC, 9 SP, 10 DS, 11 IE, 12 BG, 13 SN, 15 EX.
    pub kind: i32,
    /// Axis from 1; 0 none.
    pub axis: i32,
    /// Its text.
    pub text: String,
}

/// What was asked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Answer {
    /// To [`Item::System`](super::item::Item::System).
    System(System),
    /// To a status.
    Status(Status),
    /// One number; `None` when the control says that there is none.
    Number(Option<f64>),
    /// One number per axis or spindle.
    Numbers(Vec<Option<f64>>),
    /// A whole number.
    Whole(i32),
    /// Numbers of the running and the main program.
    Program {
        /// Running now.
        running: i32,
        /// Main program.
        main: i32,
    },
    /// A name and a number.
    Named {
        /// The number.
        number: i32,
        /// The name.
        name: String,
    },
    /// Names of axes or spindles.
    Names(Vec<String>),
    /// A text.
    Text(String),
    /// The alarms that are on.
    Alarms(Vec<Alarm>),
    /// A modal word; flags as on the wire.
    Modal {
        /// Its value without a decimal point.
        value: i32,
        /// First and second flag.
        flags: [u8; 2],
    },
    /// Modal G codes of the groups from 0, as the control numbers them.
    Groups(Vec<u8>),
    /// A parameter or diagnosis: its kind and a value per axis (one without an axis).
    Data {
        /// Kind as on the wire.
        kind: i16,
        /// Values.
        values: Vec<Option<f64>>,
    },
    /// Elements of PMC memory.
    Memory(Vec<i32>),
    /// Minutes and milliseconds beyond them.
    Time {
        /// Whole minutes.
        minutes: i32,
        /// Milliseconds within the minute.
        milliseconds: i32,
    },
    /// Signals of the operator's panel.
    Signals(Vec<i16>),
}

/// The control answered and said no.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refusal {
    /// Why.
    pub code: ReturnCode,
    /// More about it.
    pub detail: i16,
}

/// Why one item of a poll has no value, while the others have.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum ItemError {
    /// The control refused.
    Refused(Refusal),
    /// Its answer makes no sense.
    Malformed(String),
    /// This way of talking to the control cannot ask for it.
    NotOffered,
}

impl fmt::Display for ItemError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(refusal) => refusal.code.fmt(f),
            Self::Malformed(what) => f.write_str(what),
            Self::NotOffered => f.write_str("the control, or this way of talking to it, does not have it"),
        }
    }
}

impl ItemError {
    /// What to do next.
    #[must_use]
    pub fn next(&self) -> &'static str {
        match self {
            Self::Refused(refusal) => refusal.code.next(),
            Self::Malformed(_) | Self::NotOffered => SEE_DOCTOR,
        }
    }
}

/// What became of one item.
pub type ItemResult = Result<Answer, ItemError>;
