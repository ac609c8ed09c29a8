//! Items and writes as blocks on the wire, in the encoding of the controller's generation.

use super::generation::{Generation, Opening};
use super::item::{FocasItem, PositionFrame, Write};
use super::wire::{Number, Request};
use adapter_core::integer::convert_bounded;

pub use super::table::function;

/// Whose unit is asked for, on newer controls; older ones know the feed only, as 0.
pub const UNIT_OF_FEED: i32 = 3;
/// The unit of the spindle's speed, asked for as [`UNIT_OF_FEED`] is.
pub const UNIT_OF_SPINDLE: i32 = 4;

/// Units of positions: in pairs, work and machine coordinates, with this number; newer controls are asked with
/// [`UNIT_OF_WORK`] for those of the work coordinates.
pub const UNIT_OF_POSITIONS: i32 = 2;
/// The units of the work coordinates, asked for as [`UNIT_OF_POSITIONS`] is.
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
pub fn build_read_request(item: FocasItem, generation: Generation) -> Request {
    use function as f;
    let number = i32::from;
    match item {
        FocasItem::System => Request::new_cnc(f::SYSTEM, &[]),
        FocasItem::Status => Request::new_cnc(f::STATUS, &[]),
        FocasItem::StatusLong => Request::new_cnc(f::STATUS_LONG, &[]),
        FocasItem::HandleRetrace => Request::new_cnc(f::HANDLE_RETRACE, &[]),
        FocasItem::ToolMode => Request::new_cnc(f::TOOL_MODE, &[]),
        FocasItem::Feed => Request::new_cnc(f::FEED, &[]),
        FocasItem::SpindleSpeed => Request::new_cnc(f::SPINDLE_SPEED, &[]),
        FocasItem::Spindles(what) => Request::new_cnc(f::SPINDLES, &[what.wire_number(), -1]),
        FocasItem::Servos(what) => Request::new_cnc(f::SERVOS, &[what.wire_number()]),
        FocasItem::Count(what) => Request::new_cnc(f::COUNT, &[number(what)]),
        FocasItem::AxisNames => Request::new_cnc(f::AXIS_NAMES, &[]),
        FocasItem::SpindleNames(which) => Request::new_cnc(f::SPINDLE_NAMES, &[number(which)]),
        FocasItem::FeedUnit => Request::new_cnc(
            f::SPEED_UNIT,
            &[if matches!(generation, Generation::Newer(_)) { UNIT_OF_FEED } else { 0 }],
        ),
        FocasItem::SpindleUnit => Request::new_cnc(f::SPEED_UNIT, &[UNIT_OF_SPINDLE]),
        FocasItem::PositionUnit(frame) => {
            let of_work = frame == PositionFrame::Work && matches!(generation, Generation::Newer(_));
            Request::new_cnc(f::SPEED_UNIT, &[if of_work { UNIT_OF_WORK } else { UNIT_OF_POSITIONS }])
        }
        FocasItem::Program => Request::new_cnc(f::PROGRAM, &[]),
        FocasItem::ProgramName => Request::new_cnc(f::PROGRAM_NAME, &[]),
        FocasItem::ProgramPath => Request::new_cnc(f::PROGRAM_PATH, &[]),
        FocasItem::MainProgram => Request::new_cnc(f::MAIN_PROGRAM, &[]),
        FocasItem::Sequence => Request::new_cnc(f::SEQUENCE, &[]),
        FocasItem::BlockCount => Request::new_cnc(f::BLOCK_COUNT, &[]),
        FocasItem::AlarmBits => Request::new_cnc(f::ALARM_BITS, &[]),
        FocasItem::Alarms(most) => {
            Request::new_cnc(f::ALARMS, &[-1, i32::from(most), 2, convert_bounded(ALARM_TEXT_LEN, i32::MAX)])
        }
        FocasItem::ModalGroup(group) => Request::new_cnc(f::MODAL_GROUP, &[number(group)]),
        FocasItem::ModalWord(word) => Request::new_cnc(f::MODAL_WORD, &[word.wire_number()]),
        FocasItem::Position(what, axis) => Request::new_cnc(f::POSITION, &[what.wire_number(), number(axis)]),
        FocasItem::Macro(variable) => Request::new_cnc(f::MACRO, &repeat_number(variable)),
        FocasItem::Parameter(parameter, axis) => {
            let [first, last] = repeat_number(parameter);
            Request::new_cnc(by_generation(generation, f::PARAMETER, f::PARAMETER_OLDER), &[first, last, number(axis)])
        }
        FocasItem::Diagnosis(diagnosis, axis) => {
            let [first, last] = repeat_number(diagnosis);
            Request::new_cnc(by_generation(generation, f::DIAGNOSIS, f::DIAGNOSIS_OLDER), &[first, last, number(axis)])
        }
        FocasItem::Pmc(stretch) => Request::new_pmc(f::PMC_READ, &encode_stretch(stretch)),
        FocasItem::ToolOffset(offset, kind) => Request::new_cnc(f::TOOL_OFFSET, &encode_tool_offset(offset, kind)),
        FocasItem::WorkOffset(offset, axis) => Request::new_cnc(f::WORK_OFFSET, &encode_work_offset(offset, axis)),
        FocasItem::ExecutedText(most) => Request::new_cnc(f::EXECUTED_TEXT, &[i32::from(most)]),
        FocasItem::Timer(timer) => Request::new_cnc(f::TIMER, &[timer.wire_number()]),
        FocasItem::TuningMode => Request::new_cnc(f::TUNING_MODE, &[]),
        FocasItem::PanelSignals(mask) => Request::new_cnc(f::PANEL_SIGNALS, &[i32::from(mask)]),
        FocasItem::CncId => Request::new_cnc(f::CNC_ID, &[]),
        FocasItem::Messages(most) => match generation {
            Generation::Newer(_) => Request::new_cnc(f::MESSAGES, &[0, -1, i32::from(most)]),
            Generation::Older(_) => Request::new_cnc(f::MESSAGES_OLDER, &[-1]),
        },
        FocasItem::HistoryCount => Request::new_cnc(f::ALARM_HISTORY_COUNT, &[]),
        FocasItem::AlarmHistory(first, last) => Request::new_cnc(f::ALARM_HISTORY, &[first.into(), last.into(), 1]),
        FocasItem::GCodes => Request::new_cnc(f::G_CODES, &[-1, 0]),
        FocasItem::ToolGroup => Request::new_cnc(f::TOOL_GROUP, &[]),
        FocasItem::ToolLife(group) => Request::new_cnc(f::TOOL_LIFE, &repeat_number(group)),
    }
}

fn repeat_number(number: u16) -> [i32; 2] {
    [i32::from(number); 2]
}

fn encode_stretch(stretch: super::item::Stretch) -> [i32; 4] {
    [i32::from(stretch.from), i32::from(stretch.to), stretch.area.wire_number(), stretch.width.wire_number()]
}

fn encode_tool_offset(offset: u16, kind: u16) -> [i32; 3] {
    [i32::from(offset), i32::from(offset), 1000 + i32::from(kind)]
}

fn encode_work_offset(offset: u16, axis: i16) -> [i32; 3] {
    [i32::from(offset), i32::from(offset), i32::from(axis)]
}

/// The block that writes.
#[must_use]
pub fn build_write_request(write: &Write, generation: Generation) -> Request {
    use function as f;
    match write {
        Write::Macro { number, mantissa, places } => {
            let value = match generation {
                _ if *places < 0 => Number::VACANT,
                Generation::Newer(_) => Number::from_decimal(*mantissa, *places),
                Generation::Older(_) => Number::from_decimal_as_binary(*mantissa, *places),
            };
            Request::new_cnc(f::MACRO_WRITE, &repeat_number(*number)).with_data(value.to_bytes().to_vec())
        }
        Write::Pmc { stretch, values } => {
            let bytes = usize::from(stretch.width.byte_count());
            let data = values.iter().flat_map(|value| value.to_be_bytes()[4 - bytes..].to_vec()).collect();
            Request::new_pmc(f::PMC_WRITE, &encode_stretch(*stretch)).with_data(data)
        }
        Write::WorkOffset { number, axis, value } => {
            Request::new_cnc(f::WORK_OFFSET_WRITE, &encode_work_offset(*number, *axis))
                .with_data(encode_increments(*value))
        }
        Write::ToolOffset { number, kind, value } => {
            Request::new_cnc(f::TOOL_OFFSET_WRITE, &encode_tool_offset(*number, *kind))
                .with_data(encode_increments(*value))
        }
        Write::PanelSignals { mask, signals } => {
            let data = signals.iter().flat_map(|signal| signal.to_be_bytes()).collect();
            Request::new_cnc(f::PANEL_SIGNALS_WRITE, &[i32::from(*mask)]).with_data(data)
        }
    }
}

/// An offset in least input increments: no base, exponent -1.
fn encode_increments(value: i32) -> Vec<u8> {
    Number { mantissa: value, base: 0, exponent: -1 }.to_bytes().to_vec()
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
