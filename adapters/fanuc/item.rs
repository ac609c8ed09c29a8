//! What can be asked of a controller and what can be written to it, in the words of the control.

pub use super::pmc::{Area, PmcWidth, Stretch};
pub use super::word::BlockWord;
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

impl Position {
    /// Every position with its number on the wire, in the order in which the library's calls give them.
    pub const ALL: [(Self, i32); 4] = [(Self::Absolute, 4), (Self::Machine, 1), (Self::Relative, 6), (Self::ToGo, 7)];

    /// Its number on the wire.
    #[must_use]
    pub fn wire_number(self) -> i32 {
        find_wire_number(&Self::ALL, self)
    }
}

/// Whose unit a position has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum PositionFrame {
    /// Of the machine coordinates.
    Machine,
    /// Of all others: work, relative, still to go.
    Work,
}

impl Position {
    /// Whose unit it has. Source: what `libfwlib32` 1.0.5 makes of marked answers in `cnc_rdposition`.
    #[must_use]
    pub fn frame(self) -> PositionFrame {
        if self == Self::Machine { PositionFrame::Machine } else { PositionFrame::Work }
    }
}

/// What of the spindles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Spindle {
    /// Load in whole percent, as older controls give it.
    PlainLoad,
    /// Greatest speed of the spindle, rpm.
    MaxSpeed,
    /// Gear stage that is engaged.
    Gear,
    /// Speed from the position coder, rpm.
    Speed,
    /// Load meter of the spindle, percent.
    Load,
    /// Speed meter of the spindle motor, rpm.
    MotorSpeed,
}

impl Spindle {
    /// Every quantity with its number on the wire.
    pub const ALL: [(Self, i32); 6] = [
        (Self::PlainLoad, 0),
        (Self::MaxSpeed, 1),
        (Self::Gear, 2),
        (Self::Speed, 3),
        (Self::Load, 4),
        (Self::MotorSpeed, 5),
    ];

    /// Its number on the wire.
    #[must_use]
    pub fn wire_number(self) -> i32 {
        find_wire_number(&Self::ALL, self)
    }
}

/// What of the axis drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Servo {
    /// Load meter, percent of the continuous rating.
    Load,
    /// Speed of the motor, rpm.
    Speed,
    /// Current of the motor, A.
    Current,
}

impl Servo {
    /// Every quantity with its number on the wire.
    pub const ALL: [(Self, i32); 3] = [(Self::Load, 1), (Self::Speed, 2), (Self::Current, 3)];

    /// Its number on the wire.
    #[must_use]
    pub fn wire_number(self) -> i32 {
        find_wire_number(&Self::ALL, self)
    }
}

/// The number that stands beside a value in its table.
fn find_wire_number<T: PartialEq>(table: &[(T, i32)], wanted: T) -> i32 {
    table.iter().find(|(known, _)| *known == wanted).map_or(0, |(_, number)| *number)
}

/// The meters of time that a control keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Timer {
    /// Time with the power on.
    PowerOn,
    /// Time in which a program ran.
    Operating,
    /// Time in cutting feed.
    Cutting,
    /// Time of the cycle that runs.
    Cycle,
}

impl Timer {
    /// Every meter with its number on the wire and in the library.
    pub const ALL: [(Self, i32); 4] = [(Self::PowerOn, 0), (Self::Operating, 1), (Self::Cutting, 2), (Self::Cycle, 3)];

    /// Its number on the wire and in the library.
    #[must_use]
    pub fn wire_number(self) -> i32 {
        find_wire_number(&Self::ALL, self)
    }
}

/// One thing to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum FocasItem {
    /// Kind, series, version of the control.
    System,
    /// Mode, running, motion, emergency, alarm.
    Status,
    /// The same with more words.
    StatusLong,
    /// State of the handle retrace function.
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
    /// Unit in which [`FocasItem::Feed`] is told.
    FeedUnit,
    /// Unit in which [`FocasItem::SpindleSpeed`] is told.
    SpindleUnit,
    /// Units of the positions of every axis.
    PositionUnit(PositionFrame),
    /// Numbers of the program running and of the main program.
    Program,
    /// Name and number of the program running.
    ProgramName,
    /// Full path of the program running.
    ProgramPath,
    /// Path of the main program.
    MainProgram,
    /// Sequence number N of the block that runs.
    Sequence,
    /// Blocks run since the start.
    BlockCount,
    /// One bit per kind of alarm.
    AlarmBits,
    /// Texts of at most so many alarms.
    Alarms(u16),
    /// Modal G codes: of one group, or all with -1.
    ModalGroup(i16),
    /// A modal word with its value in force.
    ModalWord(BlockWord),
    /// A position of one axis from 1, or all with -1.
    Position(Position, i16),
    /// A custom macro variable.
    Macro(u16),
    /// A parameter; axis 0 none, -1 all.
    Parameter(u16, i16),
    /// A diagnosis number; axis 0 none, -1 all.
    Diagnosis(u16, i16),
    /// A stretch of PMC memory, element by element.
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
    /// The number of the control, four words.
    CncId,
    /// Messages to the operator, at most so many.
    Messages(u16),
    /// How many alarms the control remembers.
    HistoryCount,
    /// Remembered alarms from the first to the last, counted from 1, the oldest first.
    AlarmHistory(u16, u16),
    /// G codes in force.
    GCodes,
    /// The group of tools in use, where their life is counted.
    ToolGroup,
    /// Life of the tools of a group.
    ToolLife(u16),
}

/// An item of one path of the control. PMC memory belongs to no path: it is the same whichever path asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Question {
    /// Path of the control, counted from 1.
    pub path: u8,
    /// The item that is read on that path.
    pub item: FocasItem,
}

impl FocasItem {
    /// The question for it on a path from 1.
    #[must_use]
    pub fn to_question(self, path: u8) -> Question {
        Question { path, item: self }
    }
}

/// One thing to be written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Write {
    /// `mantissa / 10^places` into a custom macro variable.
    Macro {
        /// Number of the variable.
        number: u16,
        /// The value without its decimal point.
        mantissa: i32,
        /// Places after the point.
        places: i16,
    },
    /// Elements into PMC memory.
    Pmc {
        /// The bytes that are written, with the width of an element.
        stretch: Stretch,
        /// As many as the stretch has elements.
        values: Vec<i32>,
    },
    /// A work offset in least input increments.
    WorkOffset {
        /// 0 external, 1 is G54.
        number: u16,
        /// Number of the axis, counted from 1.
        axis: i16,
        /// New value, least input increments.
        value: i32,
    },
    /// A tool offset in least input increments.
    ToolOffset {
        /// Number of the offset.
        number: u16,
        /// Which of its values.
        kind: u16,
        /// New value, least input increments.
        value: i32,
    },
    /// Signals of the software operator's panel; `mask` says which of them count.
    PanelSignals {
        /// One bit per signal.
        mask: u16,
        /// The signals, as sixteen words.
        signals: [i16; 16],
    },
}
