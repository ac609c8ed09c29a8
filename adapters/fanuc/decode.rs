//! The data of an answer, typed. Every length is checked: the vendor's own library does not, and takes nothing for a
//! value.

use super::answer::{Alarm, FocasAnswer, SpeedUnit, Status, System};
use super::item::{FocasItem, PmcWidth, PositionFrame, Spindle};
use super::opening::Generation;
use super::request::{HISTORY_TEXT_LEN, MESSAGE_TEXT_LEN};
use super::wire::{Cursor, Number, WireError};
use crate::text::TextEncoding;

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
pub fn answer(item: FocasItem, dialect: impl Into<Dialect>, data: &[u8]) -> Result<FocasAnswer, WireError> {
    let Dialect { generation, encoding } = dialect.into();
    let text = |bytes: &[u8]| encoding.text(bytes);
    let mut cursor = Cursor::new("data of an answer", data);
    let answer = match item {
        FocasItem::System => FocasAnswer::System(system(&mut cursor)?),
        FocasItem::Status => FocasAnswer::Status(status(&mut cursor)?),
        FocasItem::StatusLong => {
            let status = status(&mut cursor)?;
            cursor.bytes(8)?;
            FocasAnswer::Status(status)
        }
        FocasItem::Feed | FocasItem::SpindleSpeed | FocasItem::Position(_, 1..) => {
            FocasAnswer::Number(number(&mut cursor)?.measured())
        }
        FocasItem::Macro(_) => FocasAnswer::Number(number(&mut cursor)?.value()),
        FocasItem::ToolOffset(..) | FocasItem::WorkOffset(..) => FocasAnswer::Number(number(&mut cursor)?.measured()),
        FocasItem::Spindles(Spindle::PlainLoad | Spindle::MaxSpeed | Spindle::Gear) => {
            FocasAnswer::Numbers(each(&mut cursor, Number::LEN, |c| Ok(Some(f64::from(low_half(number(c)?)))))?)
        }
        FocasItem::Spindles(_) | FocasItem::Servos(_) | FocasItem::Position(..) => {
            FocasAnswer::Numbers(each(&mut cursor, Number::LEN, |cursor| Ok(number(cursor)?.measured()))?)
        }
        FocasItem::FeedUnit => FocasAnswer::Unit(unit(generation, cursor.i16()?)),
        FocasItem::PositionUnit(frame) => FocasAnswer::Units(each(&mut cursor, 4, |c| position_unit(c, frame))?),
        FocasItem::SpindleUnit => {
            // The library says rpm whatever the number is.
            cursor.i16()?;
            FocasAnswer::Unit(SpeedUnit::Rpm)
        }
        FocasItem::HandleRetrace | FocasItem::ToolMode | FocasItem::Count(_) | FocasItem::TuningMode => {
            FocasAnswer::Whole(i32::from(cursor.i16()?))
        }
        FocasItem::Sequence | FocasItem::BlockCount | FocasItem::AlarmBits => FocasAnswer::Whole(cursor.i32()?),
        FocasItem::AxisNames | FocasItem::SpindleNames(_) => FocasAnswer::Names(each(&mut cursor, 4, name)?),
        FocasItem::Program => FocasAnswer::Program { running: cursor.i32()?, main: cursor.i32()? },
        FocasItem::ProgramName => FocasAnswer::Named { number: cursor.i32()?, name: text(rest(&mut cursor)?) },
        FocasItem::ProgramPath | FocasItem::MainProgram => FocasAnswer::Text(text(rest(&mut cursor)?)),
        FocasItem::Alarms(_) => {
            let length = 16 + super::request::ALARM_TEXT_LEN;
            FocasAnswer::Alarms(each(&mut cursor, length, |cursor| alarm(cursor, encoding))?)
        }
        FocasItem::ModalGroup(_) => FocasAnswer::Groups(each(&mut cursor, 2, |cursor| Ok(cursor.bytes(2)?[0]))?),
        FocasItem::ModalWord(_) => modal_word(&mut cursor)?,
        FocasItem::Parameter(wanted, axis) => parameter(&mut cursor, generation, wanted, axis, REAL)?,
        FocasItem::Diagnosis(wanted, axis) => parameter(&mut cursor, generation, wanted, axis, DIAGNOSIS_REAL)?,
        FocasItem::Pmc(stretch) => {
            if data.len() != stretch.len() {
                return Err(mismatch("bytes of PMC memory", stretch.len(), data.len()));
            }
            FocasAnswer::Memory(each(&mut cursor, usize::from(stretch.width.bytes()), |c| element(c, stretch.width))?)
        }
        FocasItem::ExecutedText(_) => FocasAnswer::Named { number: cursor.i32()?, name: text(rest(&mut cursor)?) },
        FocasItem::Timer(_) => FocasAnswer::Time { minutes: cursor.i32()?, milliseconds: cursor.i32()? },
        FocasItem::PanelSignals(_) => FocasAnswer::Signals(each(&mut cursor, 2, |cursor| cursor.i16())?),
        FocasItem::CncId => FocasAnswer::Text(super::records::cnc_id(&mut cursor)?),
        FocasItem::Messages(_) => {
            let length = 12 + MESSAGE_TEXT_LEN;
            FocasAnswer::Messages(each(&mut cursor, length, |cursor| super::records::message(cursor, encoding))?)
        }
        FocasItem::HistoryCount => FocasAnswer::Whole(cursor.i32()?),
        FocasItem::AlarmHistory(..) => {
            let length = 28 + HISTORY_TEXT_LEN;
            FocasAnswer::History(each(&mut cursor, length, |cursor| super::records::past_alarm(cursor, encoding))?)
        }
        FocasItem::GCodes => FocasAnswer::Names(each(&mut cursor, 12, super::records::g_code)?),
        FocasItem::ToolGroup => tool_group(&mut cursor)?,
        FocasItem::ToolLife(group) => super::records::life(&mut cursor, group)?,
    };
    cursor.end()?;
    Ok(answer)
}

/// Which byte is which: what `libfwlib32` 1.0.5 makes of `000000fa 01020304` is flag 2 and 4 places.
fn modal_word(cursor: &mut Cursor<'_>) -> Result<FocasAnswer, WireError> {
    let value = cursor.i32()?;
    let [_, flag, _, places] = [cursor.u8()?, cursor.u8()?, cursor.u8()?, cursor.u8()?];
    Ok(FocasAnswer::Modal { value, flag, places })
}

fn position_unit(cursor: &mut Cursor<'_>, frame: PositionFrame) -> Result<i16, WireError> {
    let [of_work, of_machine] = [cursor.i16()?, cursor.i16()?];
    Ok(if frame == PositionFrame::Machine { of_machine } else { of_work })
}

fn tool_group(cursor: &mut Cursor<'_>) -> Result<FocasAnswer, WireError> {
    let [_next, in_use, _selected] = [cursor.i32()?, cursor.i32()?, cursor.i32()?];
    cursor.bytes(cursor.left())?;
    Ok(FocasAnswer::Whole(in_use))
}

fn unit(generation: Generation, number: i16) -> SpeedUnit {
    match generation {
        Generation::Newer(_) => SpeedUnit::of_newer(number),
        Generation::Older(_) => SpeedUnit::of_older(number),
    }
}

fn mismatch(what: &'static str, expected: usize, found: usize) -> WireError {
    let signed = |length| i64::try_from(length).unwrap_or(i64::MAX);
    WireError::Mismatch { what, expected: signed(expected), found: signed(found) }
}

fn number(cursor: &mut Cursor<'_>) -> Result<Number, WireError> {
    Number::read(cursor)
}

fn rest<'a>(cursor: &mut Cursor<'a>) -> Result<&'a [u8], WireError> {
    cursor.bytes(cursor.left())
}

/// As many records as there are bytes for; a broken one at the end is an error.
fn each<T>(
    cursor: &mut Cursor<'_>,
    len: usize,
    read: impl Fn(&mut Cursor<'_>) -> Result<T, WireError>,
) -> Result<Vec<T>, WireError> {
    (0..cursor.left() / len).map(|_| read(cursor)).collect()
}

/// The second half of the mantissa: what `libfwlib32` 1.0.5 takes of these quantities, whatever stands in the first half.
fn low_half(number: Number) -> i16 {
    let [_, _, high, low] = number.mantissa.to_be_bytes();
    i16::from_be_bytes([high, low])
}

/// One or two characters; the bytes behind them may be anything.
fn name(cursor: &mut Cursor<'_>) -> Result<String, WireError> {
    let bytes = cursor.bytes(4)?;
    let letters = bytes.iter().take(2).take_while(|byte| byte.is_ascii_alphanumeric());
    Ok(letters.map(|byte| char::from(*byte)).collect())
}

fn system(cursor: &mut Cursor<'_>) -> Result<System, WireError> {
    let text = |bytes: &[u8]| TextEncoding::default().text(bytes);
    let (additional, axes_max) = (cursor.i16()?, cursor.i16()?);
    Ok(System {
        additional,
        axes_max,
        kind: text(cursor.bytes(2)?),
        machine: text(cursor.bytes(2)?),
        series: text(cursor.bytes(4)?),
        version: text(cursor.bytes(4)?),
        axes: text(cursor.bytes(2)?),
    })
}

fn status(cursor: &mut Cursor<'_>) -> Result<Status, WireError> {
    Ok(Status {
        automatic: cursor.i16()?,
        run: cursor.i16()?,
        motion: cursor.i16()?,
        auxiliary: cursor.i16()?,
        emergency: cursor.i16()?,
        alarm: cursor.i16()?,
        edit: cursor.i16()?,
    })
}

fn alarm(cursor: &mut Cursor<'_>, encoding: TextEncoding) -> Result<Alarm, WireError> {
    let (number, kind, axis, length) = (cursor.i32()?, cursor.i32()?, cursor.i32()?, cursor.i32()?);
    let bytes = cursor.bytes(super::request::ALARM_TEXT_LEN)?;
    let length = usize::try_from(length).unwrap_or(0).min(bytes.len());
    Ok(Alarm { number, kind, axis, text: encoding.text(&bytes[..length]) })
}

fn element(cursor: &mut Cursor<'_>, width: PmcWidth) -> Result<i32, WireError> {
    match width {
        PmcWidth::Byte => cursor.u8().map(i32::from),
        PmcWidth::Word => cursor.i16().map(i32::from),
        PmcWidth::Long => cursor.i32(),
    }
}

/// A parameter or diagnosis: number, axis, kind, and places for every axis the controller could have. Asked for no
/// axis or for one, the first place holds the value.
fn parameter(
    cursor: &mut Cursor<'_>,
    generation: Generation,
    wanted: u16,
    axis: i16,
    real: i16,
) -> Result<FocasAnswer, WireError> {
    let (found, _axis, kind) = (cursor.i32()?, cursor.i16()?, cursor.i16()?);
    if found != i32::from(wanted) {
        let what = "number of a parameter";
        return Err(WireError::Mismatch { what, expected: i64::from(wanted), found: i64::from(found) });
    }
    let mut values = match generation {
        Generation::Newer(_) => each(cursor, Number::LEN, |cursor| {
            let number = number(cursor)?;
            Ok(if kind == real { number.measured() } else { Some(f64::from(number.mantissa)) })
        })?,
        Generation::Older(_) if kind == real => each(cursor, Number::LEN, |cursor| Ok(number(cursor)?.measured()))?,
        Generation::Older(_) => each(cursor, 4, |cursor| Ok(Some(f64::from(cursor.i32()?))))?,
    };
    if axis >= 0 {
        values.truncate(1);
    }
    Ok(FocasAnswer::Data { kind, values })
}
