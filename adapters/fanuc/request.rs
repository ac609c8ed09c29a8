//! Items and writes as blocks on the wire, in the encoding of the controller's generation.

use super::item::{FocasItem, PositionFrame, Write};
use super::opening::{Generation, Opening};
use super::wire::{Number, Request};

pub use super::table::function;

/// Whose unit is asked for, on newer controls; older ones know the feed only, as 0.
pub const UNIT_OF_FEED: i32 = 3;
/// See [`UNIT_OF_FEED`].
pub const UNIT_OF_SPINDLE: i32 = 4;

/// Units of positions: in pairs, work and machine coordinates, with this number; newer controls are asked with
/// [`UNIT_OF_WORK`] for those of the work coordinates.
pub const UNIT_OF_POSITIONS: i32 = 2;
/// See [`UNIT_OF_POSITIONS`].
pub const UNIT_OF_WORK: i32 = 1;

/// Longest text of an alarm that is asked for.
pub const ALARM_TEXT_LEN: usize = 64;

/// Length of the text of an alarm that has been.
pub const HISTORY_TEXT_LEN: usize = 32;

/// Length of the text of a message to the operator.
pub const MESSAGE_TEXT_LEN: usize = 256;

fn by_generation(generation: Generation, newer: u16, older: u16) -> u16 {
    if matches!(generation, Generation::Newer(_)) { newer } else { older }
}

/// The block that asks for an item.
#[must_use]
pub fn reading(item: FocasItem, generation: Generation) -> Request {
    use function as f;
    let number = i32::from;
    match item {
        FocasItem::System => Request::cnc(f::SYSTEM, &[]),
        FocasItem::Status => Request::cnc(f::STATUS, &[]),
        FocasItem::StatusLong => Request::cnc(f::STATUS_LONG, &[]),
        FocasItem::HandleRetrace => Request::cnc(f::HANDLE_RETRACE, &[]),
        FocasItem::ToolMode => Request::cnc(f::TOOL_MODE, &[]),
        FocasItem::Feed => Request::cnc(f::FEED, &[]),
        FocasItem::SpindleSpeed => Request::cnc(f::SPINDLE_SPEED, &[]),
        FocasItem::Spindles(what) => Request::cnc(f::SPINDLES, &[what.number(), -1]),
        FocasItem::Servos(what) => Request::cnc(f::SERVOS, &[what.number()]),
        FocasItem::Count(what) => Request::cnc(f::COUNT, &[number(what)]),
        FocasItem::AxisNames => Request::cnc(f::AXIS_NAMES, &[]),
        FocasItem::SpindleNames(which) => Request::cnc(f::SPINDLE_NAMES, &[number(which)]),
        FocasItem::FeedUnit => {
            Request::cnc(f::SPEED_UNIT, &[if matches!(generation, Generation::Newer(_)) { UNIT_OF_FEED } else { 0 }])
        }
        FocasItem::SpindleUnit => Request::cnc(f::SPEED_UNIT, &[UNIT_OF_SPINDLE]),
        FocasItem::PositionUnit(frame) => {
            let of_work = frame == PositionFrame::Work && matches!(generation, Generation::Newer(_));
            Request::cnc(f::SPEED_UNIT, &[if of_work { UNIT_OF_WORK } else { UNIT_OF_POSITIONS }])
        }
        FocasItem::Program => Request::cnc(f::PROGRAM, &[]),
        FocasItem::ProgramName => Request::cnc(f::PROGRAM_NAME, &[]),
        FocasItem::ProgramPath => Request::cnc(f::PROGRAM_PATH, &[]),
        FocasItem::MainProgram => Request::cnc(f::MAIN_PROGRAM, &[]),
        FocasItem::Sequence => Request::cnc(f::SEQUENCE, &[]),
        FocasItem::BlockCount => Request::cnc(f::BLOCK_COUNT, &[]),
        FocasItem::AlarmBits => Request::cnc(f::ALARM_BITS, &[]),
        FocasItem::Alarms(most) => Request::cnc(f::ALARMS, &[-1, i32::from(most), 2, signed(ALARM_TEXT_LEN)]),
        FocasItem::ModalGroup(group) => Request::cnc(f::MODAL_GROUP, &[number(group)]),
        FocasItem::ModalWord(word) => Request::cnc(f::MODAL_WORD, &[word.number()]),
        FocasItem::Position(what, axis) => Request::cnc(f::POSITION, &[what.number(), number(axis)]),
        FocasItem::Macro(variable) => Request::cnc(f::MACRO, &twice(variable)),
        FocasItem::Parameter(parameter, axis) => {
            let [first, last] = twice(parameter);
            Request::cnc(by_generation(generation, f::PARAMETER, f::PARAMETER_OLDER), &[first, last, number(axis)])
        }
        FocasItem::Diagnosis(diagnosis, axis) => {
            let [first, last] = twice(diagnosis);
            Request::cnc(by_generation(generation, f::DIAGNOSIS, f::DIAGNOSIS_OLDER), &[first, last, number(axis)])
        }
        FocasItem::Pmc(stretch) => Request::pmc(f::PMC_READ, &pmc(stretch)),
        FocasItem::ToolOffset(offset, kind) => Request::cnc(f::TOOL_OFFSET, &tool(offset, kind)),
        FocasItem::WorkOffset(offset, axis) => Request::cnc(f::WORK_OFFSET, &work(offset, axis)),
        FocasItem::ExecutedText(most) => Request::cnc(f::EXECUTED_TEXT, &[i32::from(most)]),
        FocasItem::Timer(timer) => Request::cnc(f::TIMER, &[timer.number()]),
        FocasItem::TuningMode => Request::cnc(f::TUNING_MODE, &[]),
        FocasItem::PanelSignals(mask) => Request::cnc(f::PANEL_SIGNALS, &[i32::from(mask)]),
        FocasItem::CncId => Request::cnc(f::CNC_ID, &[]),
        FocasItem::Messages(most) => match generation {
            Generation::Newer(_) => Request::cnc(f::MESSAGES, &[0, -1, i32::from(most)]),
            Generation::Older(_) => Request::cnc(f::MESSAGES_OLDER, &[-1]),
        },
        FocasItem::HistoryCount => Request::cnc(f::ALARM_HISTORY_COUNT, &[]),
        FocasItem::AlarmHistory(first, last) => Request::cnc(f::ALARM_HISTORY, &[first.into(), last.into(), 1]),
        FocasItem::GCodes => Request::cnc(f::G_CODES, &[-1, 0]),
        FocasItem::ToolGroup => Request::cnc(f::TOOL_GROUP, &[]),
        FocasItem::ToolLife(group) => Request::cnc(f::TOOL_LIFE, &twice(group)),
    }
}

fn signed(length: usize) -> i32 {
    i32::try_from(length).unwrap_or(i32::MAX)
}

fn twice(number: u16) -> [i32; 2] {
    [i32::from(number); 2]
}

fn pmc(stretch: super::item::Stretch) -> [i32; 4] {
    [i32::from(stretch.from), i32::from(stretch.to), stretch.area.number(), stretch.width.number()]
}

fn tool(offset: u16, kind: u16) -> [i32; 3] {
    [i32::from(offset), i32::from(offset), 1000 + i32::from(kind)]
}

fn work(offset: u16, axis: i16) -> [i32; 3] {
    [i32::from(offset), i32::from(offset), i32::from(axis)]
}

/// The block that writes.
#[must_use]
pub fn writing(write: &Write, generation: Generation) -> Request {
    use function as f;
    match write {
        Write::Macro { number, mantissa, places } => {
            let value = match generation {
                _ if *places < 0 => Number::VACANT,
                Generation::Newer(_) => Number::decimal(*mantissa, *places),
                Generation::Older(_) => Number::binary(*mantissa, *places),
            };
            Request::cnc(f::MACRO_WRITE, &twice(*number)).writing(value.bytes().to_vec())
        }
        Write::Pmc { stretch, values } => {
            let bytes = usize::from(stretch.width.bytes());
            let data = values.iter().flat_map(|value| value.to_be_bytes()[4 - bytes..].to_vec()).collect();
            Request::pmc(f::PMC_WRITE, &pmc(*stretch)).writing(data)
        }
        Write::WorkOffset { number, axis, value } => {
            Request::cnc(f::WORK_OFFSET_WRITE, &work(*number, *axis)).writing(increments(*value))
        }
        Write::ToolOffset { number, kind, value } => {
            Request::cnc(f::TOOL_OFFSET_WRITE, &tool(*number, *kind)).writing(increments(*value))
        }
        Write::PanelSignals { mask, signals } => {
            let data = signals.iter().flat_map(|signal| signal.to_be_bytes()).collect();
            Request::cnc(f::PANEL_SIGNALS_WRITE, &[i32::from(*mask)]).writing(data)
        }
    }
}

/// An offset in least input increments: no base, exponent -1.
fn increments(value: i32) -> Vec<u8> {
    Number { mantissa: value, base: 0, exponent: -1 }.bytes().to_vec()
}

/// About how many bytes the answer to an item takes, its head included, for a frame that the controller can send.
#[must_use]
pub fn answer_len(item: FocasItem, opening: &Opening) -> usize {
    let (axes, spindles) = (usize::from(opening.axes_max), usize::from(opening.spindles_max));
    let values = match opening.generation {
        Generation::Newer(_) => 8 * axes,
        Generation::Older(_) => 4 * axes,
    };
    let data = match item {
        FocasItem::Servos(_) | FocasItem::Position(_, -1) => 8 * axes,
        FocasItem::Spindles(_) => 8 * spindles,
        FocasItem::AxisNames | FocasItem::PositionUnit(_) => 4 * axes,
        FocasItem::SpindleNames(_) => 4 * spindles,
        FocasItem::Parameter(..) | FocasItem::Diagnosis(..) => 8 + values,
        FocasItem::Alarms(most) => usize::from(most) * (16 + ALARM_TEXT_LEN),
        FocasItem::ModalGroup(-1) => 80,
        FocasItem::ExecutedText(most) => 4 + usize::from(most),
        FocasItem::ProgramPath | FocasItem::MainProgram => 256,
        FocasItem::ProgramName | FocasItem::PanelSignals(_) => 40,
        FocasItem::Pmc(stretch) => stretch.len(),
        FocasItem::Messages(most) => usize::from(most.max(1)) * (12 + MESSAGE_TEXT_LEN),
        FocasItem::AlarmHistory(first, last) => (usize::from(last.saturating_sub(first)) + 1) * (28 + HISTORY_TEXT_LEN),
        // Controls that are known have up to 28 groups.
        FocasItem::GCodes => 28 * 12,
        FocasItem::ToolLife(_) => 24,
        FocasItem::CncId => 16,
        FocasItem::System | FocasItem::StatusLong => 22,
        FocasItem::Status => 14,
        _ => Number::LEN,
    };
    16 + data
}
