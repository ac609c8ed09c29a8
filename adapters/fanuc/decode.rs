//! The data of an answer, typed. Every length is checked: the vendor's own library does not, and takes nothing for a
//! value.

use super::answer::{Alarm, FocasAnswer, SpeedUnit, Status, System};
use super::generation::Generation;
use super::item::{FocasItem, PmcWidth, PositionFrame, Spindle};
use super::records;
use super::request::{HISTORY_TEXT_LEN, MESSAGE_TEXT_LEN};
use super::wire::{Cursor, Number, WireError};
use adapter_core::integer::{clamp_count, length_to_i64};
use adapter_core::text::TextEncoding;

/// Types of parameters and diagnosis numbers whose values are reals.
const REAL: i16 = 4;
const DIAGNOSIS_REAL: i16 = 5;

/// How the answers of a control are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dialect {
    /// Encoding of numbers and units.
    pub generation: Generation,
    /// Character set of its texts.
    pub encoding: TextEncoding,
}

impl From<Generation> for Dialect {
    fn from(generation: Generation) -> Self {
        Self { generation, encoding: TextEncoding::default() }
    }
}

/// The answer to an item from its data.
///
/// # Errors
/// The length does not fit the item.
#[expect(clippy::too_many_lines, reason = "one arm for each item that a control knows")]
pub fn read_answer(item: FocasItem, dialect: impl Into<Dialect>, data: &[u8]) -> Result<FocasAnswer, WireError> {
    let Dialect { generation, encoding } = dialect.into();
    let text = |bytes: &[u8]| encoding.decode_trimmed(bytes);
    let mut whole = Cursor::new("data of an answer", data);
    let at = &mut whole;
    let answer = match item {
        FocasItem::System => FocasAnswer::System(read_system(at)?),
        FocasItem::Status => FocasAnswer::Status(read_status(at)?),
        FocasItem::StatusLong => {
            let status = read_status(at)?;
            at.read_bytes(8)?;
            FocasAnswer::Status(status)
        }
        FocasItem::Feed | FocasItem::SpindleSpeed | FocasItem::Position(_, 1..) => {
            FocasAnswer::Number(read_number(at)?.measured_value())
        }
        FocasItem::Macro(_) => FocasAnswer::Number(read_number(at)?.value()),
        FocasItem::ToolOffset(..) | FocasItem::WorkOffset(..) => FocasAnswer::Number(read_number(at)?.measured_value()),
        FocasItem::Spindles(Spindle::PlainLoad | Spindle::MaxSpeed | Spindle::Gear) => {
            FocasAnswer::Numbers(read_records(at, Number::LEN, |c| Ok(Some(f64::from(low_half(read_number(c)?)))))?)
        }
        FocasItem::Spindles(_) | FocasItem::Servos(_) | FocasItem::Position(..) => {
            FocasAnswer::Numbers(read_records(at, Number::LEN, |c| Ok(read_number(c)?.measured_value()))?)
        }
        FocasItem::FeedUnit => FocasAnswer::Unit(decode_speed_unit(generation, at.read_i16()?)),
        FocasItem::PositionUnit(frame) => FocasAnswer::Units(read_records(at, 4, |c| position_unit(c, frame))?),
        FocasItem::SpindleUnit => {
            // The library says rpm whatever the number is.
            at.read_i16()?;
            FocasAnswer::Unit(SpeedUnit::Rpm)
        }
        FocasItem::HandleRetrace | FocasItem::ToolMode | FocasItem::Count(_) | FocasItem::TuningMode => {
            FocasAnswer::Whole(i32::from(at.read_i16()?))
        }
        FocasItem::Sequence | FocasItem::BlockCount | FocasItem::AlarmBits => FocasAnswer::Whole(at.read_i32()?),
        FocasItem::AxisNames | FocasItem::SpindleNames(_) => FocasAnswer::Names(read_records(at, 4, read_name)?),
        FocasItem::Program => FocasAnswer::Program { running: at.read_i32()?, main: at.read_i32()? },
        FocasItem::ProgramName => FocasAnswer::Named { number: at.read_i32()?, name: text(read_rest(at)?) },
        FocasItem::ProgramPath | FocasItem::MainProgram => FocasAnswer::Text(text(read_rest(at)?)),
        FocasItem::Alarms(_) => {
            let length = 16 + super::request::ALARM_TEXT_LEN;
            FocasAnswer::Alarms(read_records(at, length, |c| read_alarm(c, encoding))?)
        }
        FocasItem::ModalGroup(_) => FocasAnswer::Groups(read_records(at, 2, |c| Ok(c.read_bytes(2)?[0]))?),
        FocasItem::ModalWord(_) => modal_word(at)?,
        FocasItem::Parameter(wanted, axis) => read_parameter(at, generation, wanted, axis, REAL)?,
        FocasItem::Diagnosis(wanted, axis) => read_parameter(at, generation, wanted, axis, DIAGNOSIS_REAL)?,
        FocasItem::Pmc(stretch) => {
            if data.len() != stretch.len() {
                return Err(build_mismatch("bytes of PMC memory", stretch.len(), data.len()));
            }
            FocasAnswer::Memory(read_records(at, usize::from(stretch.width.byte_count()), |c| {
                read_element(c, stretch.width)
            })?)
        }
        FocasItem::ExecutedText(_) => FocasAnswer::Named { number: at.read_i32()?, name: text(read_rest(at)?) },
        FocasItem::Timer(_) => FocasAnswer::Time { minutes: at.read_i32()?, milliseconds: at.read_i32()? },
        FocasItem::PanelSignals(_) => FocasAnswer::Signals(read_records(at, 2, |c| c.read_i16())?),
        FocasItem::CncId => FocasAnswer::Text(records::cnc_id(at)?),
        FocasItem::Messages(_) => {
            let length = 12 + MESSAGE_TEXT_LEN;
            FocasAnswer::Messages(read_records(at, length, |c| records::read_message(c, encoding))?)
        }
        FocasItem::HistoryCount => FocasAnswer::Whole(at.read_i32()?),
        FocasItem::AlarmHistory(..) => {
            let length = 28 + HISTORY_TEXT_LEN;
            FocasAnswer::History(read_records(at, length, |c| records::past_alarm(c, encoding))?)
        }
        FocasItem::GCodes => FocasAnswer::Names(read_records(at, 12, records::g_code)?),
        FocasItem::ToolGroup => tool_group(at)?,
        FocasItem::ToolLife(group) => records::read_tool_life(at, group)?,
    };
    if !has_longer_form(item) {
        whole.check_end()?;
    }
    Ok(answer)
}

/// Single values whose beginning is their meaning: controls send more bytes behind them, and the vendor's library (1.0.5) reads the
/// beginning all the same. An answer that is too short is refused as ever.
fn has_longer_form(item: FocasItem) -> bool {
    matches!(
        item,
        FocasItem::Feed | FocasItem::SpindleSpeed | FocasItem::Sequence | FocasItem::Program | FocasItem::ModalWord(_)
    )
}

/// Which byte is which: what `libfwlib32` 1.0.5 makes of `000000fa 01020304` is flag 2 and 4 places.
fn modal_word(cursor: &mut Cursor<'_>) -> Result<FocasAnswer, WireError> {
    let value = cursor.read_i32()?;
    let [_, flag, _, places] = [cursor.read_u8()?, cursor.read_u8()?, cursor.read_u8()?, cursor.read_u8()?];
    Ok(FocasAnswer::Modal { value, flag, places })
}

fn position_unit(cursor: &mut Cursor<'_>, frame: PositionFrame) -> Result<i16, WireError> {
    let [of_work, of_machine] = [cursor.read_i16()?, cursor.read_i16()?];
    Ok(if frame == PositionFrame::Machine { of_machine } else { of_work })
}

fn tool_group(cursor: &mut Cursor<'_>) -> Result<FocasAnswer, WireError> {
    let [_next, in_use, _selected] = [cursor.read_i32()?, cursor.read_i32()?, cursor.read_i32()?];
    cursor.read_bytes(cursor.bytes_left())?;
    Ok(FocasAnswer::Whole(in_use))
}

fn decode_speed_unit(generation: Generation, number: i16) -> SpeedUnit {
    match generation {
        Generation::Newer(_) => SpeedUnit::of_newer(number),
        Generation::Older(_) => SpeedUnit::of_older(number),
    }
}

fn build_mismatch(what: &'static str, expected: usize, found: usize) -> WireError {
    WireError::Mismatch { what, expected: length_to_i64(expected), found: length_to_i64(found) }
}

fn read_number(cursor: &mut Cursor<'_>) -> Result<Number, WireError> {
    Number::read(cursor)
}

fn read_rest<'a>(cursor: &mut Cursor<'a>) -> Result<&'a [u8], WireError> {
    cursor.read_bytes(cursor.bytes_left())
}

/// As many records as there are bytes for; a broken one at the end is an error.
fn read_records<T>(
    cursor: &mut Cursor<'_>,
    len: usize,
    read: impl Fn(&mut Cursor<'_>) -> Result<T, WireError>,
) -> Result<Vec<T>, WireError> {
    (0..cursor.bytes_left() / len).map(|_| read(cursor)).collect()
}

/// The second half of the mantissa: what `libfwlib32` 1.0.5 takes of these quantities, whatever stands in the first half.
fn low_half(number: Number) -> i16 {
    let [_, _, high, low] = number.mantissa.to_be_bytes();
    i16::from_be_bytes([high, low])
}

/// One or two characters; the bytes behind them may be anything.
fn read_name(cursor: &mut Cursor<'_>) -> Result<String, WireError> {
    let bytes = cursor.read_bytes(4)?;
    let letters = bytes.iter().take(2).take_while(|byte| byte.is_ascii_alphanumeric());
    Ok(letters.map(|byte| char::from(*byte)).collect())
}

fn read_system(cursor: &mut Cursor<'_>) -> Result<System, WireError> {
    let text = |bytes: &[u8]| TextEncoding::default().decode_trimmed(bytes);
    let (additional, axes_max) = (cursor.read_i16()?, cursor.read_i16()?);
    Ok(System {
        additional,
        axes_max,
        kind: text(cursor.read_bytes(2)?),
        machine: text(cursor.read_bytes(2)?),
        series: text(cursor.read_bytes(4)?),
        version: text(cursor.read_bytes(4)?),
        axes: text(cursor.read_bytes(2)?),
    })
}

fn read_status(cursor: &mut Cursor<'_>) -> Result<Status, WireError> {
    Ok(Status {
        automatic: cursor.read_i16()?,
        run: cursor.read_i16()?,
        motion: cursor.read_i16()?,
        auxiliary: cursor.read_i16()?,
        emergency: cursor.read_i16()?,
        alarm: cursor.read_i16()?,
        edit: cursor.read_i16()?,
    })
}

fn read_alarm(cursor: &mut Cursor<'_>, encoding: TextEncoding) -> Result<Alarm, WireError> {
    let (number, kind, axis, length) = (cursor.read_i32()?, cursor.read_i32()?, cursor.read_i32()?, cursor.read_i32()?);
    let bytes = cursor.read_bytes(super::request::ALARM_TEXT_LEN)?;
    let length = clamp_count(length, bytes.len());
    Ok(Alarm { number, kind, axis, text: encoding.decode_trimmed(&bytes[..length]) })
}

fn read_element(cursor: &mut Cursor<'_>, width: PmcWidth) -> Result<i32, WireError> {
    match width {
        PmcWidth::Byte => cursor.read_u8().map(i32::from),
        PmcWidth::Word => cursor.read_i16().map(i32::from),
        PmcWidth::Long => cursor.read_i32(),
    }
}

/// A parameter or diagnosis: number, axis, kind, and places for every axis the controller could have. Asked for no
/// axis or for one, the first place holds the value.
fn read_parameter(
    cursor: &mut Cursor<'_>,
    generation: Generation,
    wanted: u16,
    axis: i16,
    real: i16,
) -> Result<FocasAnswer, WireError> {
    let (found, _axis, kind) = (cursor.read_i32()?, cursor.read_i16()?, cursor.read_i16()?);
    if found != i32::from(wanted) {
        let what = "number of a parameter";
        return Err(WireError::Mismatch { what, expected: i64::from(wanted), found: i64::from(found) });
    }
    let mut values = match generation {
        Generation::Newer(_) => read_records(cursor, Number::LEN, |cursor| {
            let number = read_number(cursor)?;
            Ok(if kind == real { number.measured_value() } else { Some(f64::from(number.mantissa)) })
        })?,
        Generation::Older(_) if kind == real => {
            read_records(cursor, Number::LEN, |cursor| Ok(read_number(cursor)?.measured_value()))?
        }
        Generation::Older(_) => read_records(cursor, 4, |cursor| Ok(Some(f64::from(cursor.read_i32()?))))?,
    };
    if axis >= 0 {
        values.truncate(1);
    }
    Ok(FocasAnswer::Data { kind, values })
}

#[cfg(test)]
mod tests {
    use super::super::item::BlockWord;
    use super::*;

    /// Controls send more behind these values than is known; the beginning is their meaning. One byte too few is refused.
    #[test]
    fn more_bytes_behind_a_value_change_nothing() {
        let number = [0, 0, 4, 0xB0, 0, 10, 0, 0];
        for item in [
            FocasItem::Feed,
            FocasItem::SpindleSpeed,
            FocasItem::Sequence,
            FocasItem::Program,
            FocasItem::ModalWord(BlockWord::F),
        ] {
            let whole = if item == FocasItem::Sequence { &number[..4] } else { &number[..] };
            let generation = Generation::from_version(4);
            let plain = read_answer(item, generation, whole).expect("whole");
            for more in 1..=24 {
                let longer = [whole, &vec![0xAA; more]].concat();
                assert_eq!(read_answer(item, generation, &longer), Ok(plain.clone()), "{item:?} with {more} more");
            }
            for fewer in 0..whole.len() {
                assert!(read_answer(item, generation, &whole[..fewer]).is_err(), "{item:?} with {fewer} bytes");
            }
        }
        assert_eq!(
            read_answer(FocasItem::Feed, Generation::from_version(4), &number),
            Ok(FocasAnswer::Number(Some(1200.0)))
        );
    }
}
