//! What a controller answers, typed. Numbers are in the unit that the question implies.

use super::code::{Consequence, FocasReturnCode};
use adapter_core::driver::SEE_DOCTOR;
use adapter_core::reading::Absence;
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
    /// Series of the control's software, four characters.
    pub series: String,
    /// Version of that software, four characters.
    pub version: String,
    /// Controlled axes as two digits.
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
    /// 1 alarm; 2 battery low, 3 fan and further warnings, which stop nothing.
    pub alarm: i16,
    /// Editing state, as the control numbers it.
    pub edit: i16,
}

/// Unit of a speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum SpeedUnit {
    /// Millimetres (degrees of a rotary axis) per minute.
    MmMin,
    /// Inches per minute along the path.
    InchMin,
    /// Revolutions per minute of a spindle.
    Rpm,
    /// Millimetres per revolution of the spindle.
    MmRev,
    /// Inches per revolution of the spindle.
    InchRev,
    /// A number that is in no manual; nothing in this unit is passed on.
    Unknown(i16),
}

impl SpeedUnit {
    /// Every known unit with its number in the library's `SPEEDELM.unit`. Source: FOCAS2 manual, `cnc_rdspeed`.
    const ALL: [(Self, i16); 5] =
        [(Self::MmMin, 0), (Self::InchMin, 1), (Self::Rpm, 2), (Self::MmRev, 3), (Self::InchRev, 4)];
    /// What newer controls add to the library's number on the wire. Source: `libfwlib32` 1.0.5, which takes it off.
    const WIRE_OFFSET: i16 = 3;

    /// The unit with this number in the library.
    #[must_use]
    pub fn of_library(number: i16) -> Self {
        Self::ALL.iter().find(|(_, known)| *known == number).map_or(Self::Unknown(number), |(unit, _)| *unit)
    }

    /// Its number in the library.
    #[must_use]
    pub fn number_in_library(self) -> i16 {
        match self {
            Self::Unknown(number) => number,
            known => Self::ALL.iter().find(|(unit, _)| *unit == known).map_or(0, |(_, number)| *number),
        }
    }

    /// The unit of the feed from the number on the wire of a newer control.
    #[must_use]
    pub fn of_newer(number: i16) -> Self {
        match Self::of_library(number.saturating_sub(Self::WIRE_OFFSET)) {
            Self::Unknown(_) => Self::Unknown(number),
            known => known,
        }
    }

    /// Its number on the wire of a newer control.
    #[must_use]
    pub fn newer_number(self) -> i16 {
        match self {
            Self::Unknown(number) => number,
            known => known.number_in_library() + Self::WIRE_OFFSET,
        }
    }

    /// The unit of the feed from the number on the wire of an older control, which tells only millimetres (0) from
    /// inches. Source: `libfwlib32` 1.0.5.
    #[must_use]
    pub fn of_older(number: i16) -> Self {
        if number == 0 { Self::MmMin } else { Self::InchMin }
    }

    /// Its number on the wire of an older control.
    #[must_use]
    pub fn older_number(self) -> i16 {
        i16::from(self.is_inch())
    }

    /// The same length per revolution of the spindle.
    #[must_use]
    pub fn per_revolution(self) -> Self {
        match self {
            Self::MmMin => Self::MmRev,
            Self::InchMin => Self::InchRev,
            other => other,
        }
    }

    /// Is it a length per revolution of the spindle?
    #[must_use]
    pub fn is_per_revolution(self) -> bool {
        matches!(self, Self::MmRev | Self::InchRev)
    }

    /// Is it in inches?
    #[must_use]
    pub fn is_inch(self) -> bool {
        matches!(self, Self::InchMin | Self::InchRev)
    }
}

/// Unit of a position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PositionUnit {
    /// Millimetres, number 0 of `POSELM.unit`.
    Mm,
    /// Inches, number 1 of `POSELM.unit`.
    Inch,
    /// Degrees, number 2 of `POSELM.unit`.
    Degrees,
}

impl PositionUnit {
    /// The unit with this number; `None` for one that is in no manual. Source: FOCAS2 manual, `POSELM.unit`.
    #[must_use]
    pub fn of_number(number: i16) -> Option<Self> {
        [Self::Mm, Self::Inch, Self::Degrees].get(usize::try_from(number).ok()?).copied()
    }
}

/// An alarm as the control tells it.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Alarm {
    /// Number within its type.
    pub number: i32,
    /// Type; what it means depends on the generation: see [`alarms`](super::alarms).
    pub kind: i32,
    /// Axis from 1; 0 none.
    pub axis: i32,
    /// Its text; empty where the control sends none.
    pub text: String,
}

/// An alarm that has been.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct PastAlarm {
    /// The alarm that was on.
    pub alarm: Alarm,
    /// Year, month, day, hour, minute and second at which it came, on the control's clock.
    pub at: [i16; 6],
}

/// A message to the operator.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct OperatorMessage {
    /// Its number; -1 where there is none.
    pub number: i32,
    /// 0 to 3 messages of the ladder, 4 of a macro program.
    pub kind: i32,
    /// Its text as the ladder or the program wrote it.
    pub text: String,
}

/// What was asked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum FocasAnswer {
    /// The answer to [`Item::System`](super::item::FocasItem::System).
    System(System),
    /// The answer to [`Item::Status`](super::item::FocasItem::Status).
    Status(Status),
    /// One number; `None` when the control says that there is none.
    Number(Option<f64>),
    /// One number per axis or spindle.
    Numbers(Vec<Option<f64>>),
    /// A whole number, such as a count.
    Whole(i32),
    /// Numbers of the running and the main program.
    Program {
        /// Number of the program that runs, as in O1234.
        running: i32,
        /// Number of the main program, as in O1234.
        main: i32,
    },
    /// A name and a number.
    Named {
        /// The number that came with the name.
        number: i32,
        /// The name, or the text of the program.
        name: String,
    },
    /// The unit of a speed.
    Unit(SpeedUnit),
    /// Numbers of the units of positions, one per axis; see [`PositionUnit`].
    Units(Vec<i16>),
    /// Names of axes or spindles.
    Names(Vec<String>),
    /// A text out of the control's character set.
    Text(String),
    /// The alarms that are on.
    Alarms(Vec<Alarm>),
    /// Messages to the operator.
    Messages(Vec<OperatorMessage>),
    /// Alarms that have been, the oldest first.
    History(Vec<PastAlarm>),
    /// Life of the tools of a group.
    Life {
        /// Tools of the group.
        tools: i32,
        /// Their life, in uses or minutes as the control counts it.
        life: i32,
        /// How much of it is used.
        count: i32,
    },
    /// A modal word: its value is `value / 10^places`.
    Modal {
        /// Its value without a decimal point.
        value: i32,
        /// Bits about the word (`flag1` of the library): bit 6 says that a decimal point was written, bit 7 that the block
        /// holds the word. No bit of it counts decimals.
        flag: u8,
        /// Places after the point (`flag2` of the library).
        places: u8,
    },
    /// Modal G codes of the groups from 0, as the control numbers them.
    Groups(Vec<u8>),
    /// A parameter or diagnosis: its kind and a value per axis (one without an axis).
    Data {
        /// Kind as on the wire.
        kind: i16,
        /// One value, or one per axis; `None` where the control tells none.
        values: Vec<Option<f64>>,
    },
    /// Elements of PMC memory.
    Memory(Vec<i32>),
    /// Minutes and milliseconds beyond them.
    Time {
        /// Whole minutes of the meter.
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
    /// The return code that says why.
    pub code: FocasReturnCode,
    /// The detail beside the return code.
    pub detail: i16,
}

/// Why one item of a poll has no value, while the others have.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum FocasItemError {
    /// The control refused this item alone.
    Refused(Refusal),
    /// Its answer makes no sense.
    Malformed(String),
    /// What runs the vendor's library ended or hung in this question.
    Failed(String),
    /// This way of talking to the control cannot ask for it.
    NotOffered,
}

impl fmt::Display for FocasItemError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(refusal) => refusal.code.fmt(f),
            Self::Malformed(what) | Self::Failed(what) => f.write_str(what),
            Self::NotOffered => f.write_str("the control, or this way of talking to it, does not have it"),
        }
    }
}

impl FocasItemError {
    /// The reason that a reading without this item has.
    #[must_use]
    pub fn to_absence(&self) -> Absence {
        match self {
            Self::Refused(refusal) if refusal.code == FocasReturnCode::PATH => Absence::Refused,
            Self::Refused(refusal) => match refusal.code.consequence() {
                Consequence::NotSupported | Consequence::Wrong => Absence::NotSupported,
                _ => Absence::Refused,
            },
            Self::Malformed(_) => Absence::OutOfRange,
            Self::Failed(_) => Absence::Disconnected,
            Self::NotOffered => Absence::NotSupported,
        }
    }

    /// What to do next.
    #[must_use]
    pub fn next(&self) -> &'static str {
        match self {
            Self::Refused(refusal) => refusal.code.next(),
            Self::Malformed(_) | Self::Failed(_) | Self::NotOffered => SEE_DOCTOR,
        }
    }
}

/// What became of one item.
pub type FocasItemResult = Result<FocasAnswer, FocasItemError>;
