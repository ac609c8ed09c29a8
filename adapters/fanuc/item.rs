//! What can be asked of a controller and what can be written to it, in the words of the control.

use serde::{Deserialize, Serialize};

/// Which position of the axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Position {
    /// In the work coordinate system.
    Absolute,
    /// In the machine coordinate system.
    Machine,
    /// In the relative coordinate system.
    Relative,
    /// Still to go in this block.
    ToGo,
}

/// What of the spindles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Spindle {
    /// Load in whole percent, as older controls give it.
    PlainLoad,
    /// Greatest speed, rpm.
    MaxSpeed,
    /// Gear stage.
    Gear,
    /// Speed from the position coder, rpm.
    Speed,
    /// Load meter, percent.
    Load,
    /// Speed meter, rpm.
    MotorSpeed,
}

/// What of the axis drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Servo {
    /// Load meter, percent of the continuous rating.
    Load,
    /// Speed of the motor, rpm.
    Speed,
    /// Current, A.
    Current,
}

/// Area of PMC memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Area {
    /// Signals from the ladder to the control.
    G,
    /// Signals from the control to the ladder.
    F,
    /// Outputs to the machine.
    Y,
    /// Inputs from the machine.
    X,
    /// Message requests.
    A,
    /// Internal relays; cleared at power-on up to the battery-backed part.
    R,
    /// Timers.
    T,
    /// Keep relays.
    K,
    /// Counters.
    C,
    /// Data table, battery-backed.
    D,
    /// Extra relays, shared between PMCs.
    E,
}

impl Area {
    /// Every area with its letter and its number.
    pub const ALL: [(Self, char, i32); 11] = [
        (Self::G, 'G', 0),
        (Self::F, 'F', 1),
        (Self::Y, 'Y', 2),
        (Self::X, 'X', 3),
        (Self::A, 'A', 4),
        (Self::R, 'R', 5),
        (Self::T, 'T', 6),
        (Self::K, 'K', 7),
        (Self::C, 'C', 8),
        (Self::D, 'D', 9),
        (Self::E, 'E', 12),
    ];

    /// Its number on the wire and in the library.
    #[must_use]
    pub fn number(self) -> i32 {
        Self::ALL.iter().find(|(area, ..)| *area == self).map_or(0, |(.., number)| *number)
    }

    /// Its letter.
    #[must_use]
    pub fn letter(self) -> char {
        Self::ALL.iter().find(|(area, ..)| *area == self).map_or('?', |(_, letter, _)| *letter)
    }

    /// The area with this number.
    #[must_use]
    pub fn of_number(number: i32) -> Option<Self> {
        Self::ALL.iter().find(|(.., known)| *known == number).map(|(area, ..)| *area)
    }

    /// The area with this letter.
    #[must_use]
    pub fn of_letter(letter: char) -> Option<Self> {
        Self::ALL.iter().find(|(_, known, _)| *known == letter.to_ascii_uppercase()).map(|(area, ..)| *area)
    }
}

/// Bytes of one element of PMC memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Width {
    /// One byte, 0 to 255.
    Byte,
    /// Two bytes, signed.
    Word,
    /// Four bytes, signed.
    Long,
}

impl Width {
    /// Number of bytes.
    #[must_use]
    pub fn bytes(self) -> u16 {
        match self {
            Self::Byte => 1,
            Self::Word => 2,
            Self::Long => 4,
        }
    }

    /// Its number on the wire.
    #[must_use]
    pub fn number(self) -> i32 {
        match self {
            Self::Byte => 0,
            Self::Word => 1,
            Self::Long => 2,
        }
    }

    /// The width with this number.
    #[must_use]
    pub fn of_number(number: i32) -> Option<Self> {
        [Self::Byte, Self::Word, Self::Long].into_iter().find(|width| width.number() == number)
    }
}

/// A stretch of PMC memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Stretch {
    /// Where.
    pub area: Area,
    /// First byte.
    pub from: u16,
    /// Last byte.
    pub to: u16,
    /// Size of the elements.
    pub width: Width,
}

impl Stretch {
    /// So many single bytes.
    #[must_use]
    pub fn bytes(area: Area, from: u16, count: u16) -> Self {
        Self { area, from, to: from.saturating_add(count.saturating_sub(1)), width: Width::Byte }
    }

    /// Number of bytes; 0 when it ends before it begins.
    #[must_use]
    pub fn len(self) -> usize {
        usize::from(self.to) + 1 - usize::from(self.from.min(self.to.saturating_add(1)))
    }

    /// Does it end before it begins?
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.to < self.from
    }
}

/// Meters of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Timer {
    /// Power is on.
    PowerOn,
    /// A program runs.
    Operating,
    /// Cutting feed.
    Cutting,
    /// This cycle.
    Cycle,
}

/// One thing to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Item {
    /// Kind, series, version of the control.
    System,
    /// Mode, running, motion, emergency, alarm.
    Status,
    /// The same with more words.
    StatusLong,
    /// Handle retrace.
    HandleRetrace,
    /// T or M mode.
    ToolMode,
    /// Feed along the path.
    Feed,
    /// Spindle speed of the first spindle.
    SpindleSpeed,
    /// One quantity of all spindles.
    Spindles(Spindle),
    /// One quantity of all axis drives.
    Servos(Servo),
    /// How many: 1 spindles, 2 axis drives, 3 both speeds of `cnc_rdspeed`, 0 controlled axes.
    Count(i16),
    /// Names of the axes.
    AxisNames,
    /// Names of the spindles; the argument that the generations want differently.
    SpindleNames(i16),
    /// Unit of a speed: 3 feed, 4 spindle, 0 the feed on older controls.
    SpeedUnit(i16),
    /// Numbers of the program running and of the main program.
    Program,
    /// Name and number of the program running.
    ProgramName,
    /// Its full path.
    ProgramPath,
    /// Path of the main program.
    MainProgram,
    /// Sequence number N.
    Sequence,
    /// Blocks run since the start.
    BlockCount,
    /// One bit per kind of alarm.
    AlarmBits,
    /// Texts of at most so many alarms.
    Alarms(u16),
    /// Modal G codes: of one group, or all with -1.
    ModalGroup(i16),
    /// Modal word by its number: F 5, M 11, S 20, T 22 (others in the reference).
    ModalWord(i16),
    /// A position of one axis from 1, or all with -1.
    Position(Position, i16),
    /// A custom macro variable.
    Macro(u16),
    /// A parameter; axis 0 none, -1 all.
    Parameter(u16, i16),
    /// A diagnosis number; axis 0 none, -1 all.
    Diagnosis(u16, i16),
    /// PMC memory.
    Pmc(Stretch),
    /// A tool offset: number and type.
    ToolOffset(u16, u16),
    /// A work offset: 0 external, 1 is G54; axis from 1.
    WorkOffset(u16, i16),
    /// Text of the program from the block that runs, at most so many bytes.
    ExecutedText(u16),
    /// A meter of time.
    Timer(Timer),
    /// Operation mode of spindle tuning.
    TuningMode,
    /// Signals of the software operator's panel.
    PanelSignals(u16),
}

/// An item of one path of the control. PMC memory belongs to no path: it is the same whichever path asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Question {
    /// Path from 1.
    pub path: u8,
    /// What is asked.
    pub item: Item,
}

impl Item {
    /// The question for it on a path from 1.
    #[must_use]
    pub fn on(self, path: u8) -> Question {
        Question { path, item: self }
    }
}

/// One thing to be written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Write {
    /// `mantissa / 10^places` into a custom macro variable.
    Macro {
        /// Which.
        number: u16,
        /// Whole number.
        mantissa: i32,
        /// Places after the point.
        places: i16,
    },
    /// Elements into PMC memory.
    Pmc {
        /// Where.
        stretch: Stretch,
        /// As many as the stretch has elements.
        values: Vec<i32>,
    },
    /// A work offset in least input increments.
    WorkOffset {
        /// 0 external, 1 is G54.
        number: u16,
        /// From 1.
        axis: i16,
        /// New value.
        value: i32,
    },
    /// A tool offset in least input increments.
    ToolOffset {
        /// Which.
        number: u16,
        /// Which of its values.
        kind: u16,
        /// New value.
        value: i32,
    },
    /// Signals of the software operator's panel; `mask` says which of them count.
    PanelSignals {
        /// One bit per signal.
        mask: u16,
        /// The signals.
        signals: [i16; 16],
    },
}
