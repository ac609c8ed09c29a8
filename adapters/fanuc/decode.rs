//! The data of an answer, typed. Every length is checked: the vendor's own library does not, and takes nothing for a
//! value.

use super::answer::{Alarm, Answer, SpeedUnit, Status, System};
use super::item::{Item, Spindle, Width};
use super::opening::Generation;
use super::request::{HISTORY_TEXT_LEN, MESSAGE_TEXT_LEN};
use super::wire::{Cursor, Number, WireError};

/// Types of parameters and diagnosis numbers whose values are reals.
const REAL: i16 = 4;
const DIAGNOSIS_REAL: i16 = 5;

/// The answer to an item from its data.
///
/// # Errors
/// The length does not fit the item.
pub fn answer(item: Item, generation: Generation, data: &[u8]) -> Result<Answer, WireError> {
    let mut cursor = Cursor::new("data of an answer", data);
    let answer = match item {
        Item::System => Answer::System(system(&mut cursor)?),
        Item::Status => Answer::Status(status(&mut cursor)?),
        Item::StatusLong => {
            let status = status(&mut cursor)?;
            cursor.bytes(8)?;
            Answer::Status(status)
        }
        Item::Feed | Item::SpindleSpeed | Item::Position(_, 1..) => Answer::Number(number(&mut cursor)?.measured()),
        Item::Macro(_) => Answer::Number(number(&mut cursor)?.value()),
        Item::ToolOffset(..) | Item::WorkOffset(..) => Answer::Number(number(&mut cursor)?.measured()),
        Item::Spindles(Spindle::PlainLoad | Spindle::MaxSpeed | Spindle::Gear) => {
            Answer::Numbers(each(&mut cursor, Number::LEN, |c| Ok(Some(f64::from(number(c)?.mantissa))))?)
        }
        Item::Spindles(_) | Item::Servos(_) | Item::Position(..) => {
            Answer::Numbers(each(&mut cursor, Number::LEN, |cursor| Ok(number(cursor)?.measured()))?)
        }
        Item::FeedUnit => Answer::Unit(unit(generation, cursor.i16()?)),
        Item::SpindleUnit => {
            // The library says rpm whatever the number is.
            cursor.i16()?;
            Answer::Unit(SpeedUnit::Rpm)
        }
        Item::HandleRetrace | Item::ToolMode | Item::Count(_) | Item::TuningMode => {
            Answer::Whole(i32::from(cursor.i16()?))
        }
        Item::Sequence | Item::BlockCount | Item::AlarmBits => Answer::Whole(cursor.i32()?),
        Item::AxisNames | Item::SpindleNames(_) => Answer::Names(each(&mut cursor, 4, name)?),
        Item::Program => Answer::Program { running: cursor.i32()?, main: cursor.i32()? },
        Item::ProgramName => Answer::Named { number: cursor.i32()?, name: text(rest(&mut cursor)?) },
        Item::ProgramPath | Item::MainProgram => Answer::Text(text(rest(&mut cursor)?)),
        Item::Alarms(_) => Answer::Alarms(each(&mut cursor, 16 + super::request::ALARM_TEXT_LEN, alarm)?),
        Item::ModalGroup(_) => Answer::Groups(each(&mut cursor, 2, |cursor| Ok(cursor.bytes(2)?[0]))?),
        Item::ModalWord(_) => {
            let (value, flags) = (cursor.i32()?, [cursor.u8()?, cursor.u8()?]);
            cursor.bytes(2)?;
            Answer::Modal { value, flags }
        }
        Item::Parameter(wanted, axis) => parameter(&mut cursor, generation, wanted, axis, REAL)?,
        Item::Diagnosis(wanted, axis) => parameter(&mut cursor, generation, wanted, axis, DIAGNOSIS_REAL)?,
        Item::Pmc(stretch) => {
            if data.len() != stretch.len() {
                return Err(mismatch("bytes of PMC memory", stretch.len(), data.len()));
            }
            Answer::Memory(each(&mut cursor, usize::from(stretch.width.bytes()), |c| element(c, stretch.width))?)
        }
        Item::ExecutedText(_) => Answer::Named { number: cursor.i32()?, name: text(rest(&mut cursor)?) },
        Item::Timer(_) => Answer::Time { minutes: cursor.i32()?, milliseconds: cursor.i32()? },
        Item::PanelSignals(_) => Answer::Signals(each(&mut cursor, 2, |cursor| cursor.i16())?),
        Item::CncId => Answer::Text(super::records::cnc_id(&mut cursor)?),
        Item::Messages(_) => Answer::Messages(each(&mut cursor, 12 + MESSAGE_TEXT_LEN, super::records::message)?),
        Item::HistoryCount => Answer::Whole(cursor.i32()?),
        Item::AlarmHistory(..) => {
            Answer::History(each(&mut cursor, 28 + HISTORY_TEXT_LEN, super::records::past_alarm)?)
        }
        Item::GCodes => Answer::Names(each(&mut cursor, 12, super::records::g_code)?),
        Item::ToolGroup => {
            let [_next, in_use, _selected] = [cursor.i32()?, cursor.i32()?, cursor.i32()?];
            cursor.bytes(cursor.left())?;
            Answer::Whole(in_use)
        }
        Item::ToolLife(group) => super::records::life(&mut cursor, group)?,
    };
    cursor.end()?;
    Ok(answer)
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

/// Text up to the first NUL, without the blanks around it. Controllers of Asian shops send other character sets; what
/// is not UTF-8 is replaced.
pub(super) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).trim().to_owned()
}

/// One or two characters; the bytes behind them may be anything.
fn name(cursor: &mut Cursor<'_>) -> Result<String, WireError> {
    let bytes = cursor.bytes(4)?;
    let letters = bytes.iter().take(2).take_while(|byte| byte.is_ascii_alphanumeric());
    Ok(letters.map(|byte| char::from(*byte)).collect())
}

fn system(cursor: &mut Cursor<'_>) -> Result<System, WireError> {
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

fn alarm(cursor: &mut Cursor<'_>) -> Result<Alarm, WireError> {
    let (number, kind, axis, length) = (cursor.i32()?, cursor.i32()?, cursor.i32()?, cursor.i32()?);
    let bytes = cursor.bytes(super::request::ALARM_TEXT_LEN)?;
    let length = usize::try_from(length).unwrap_or(0).min(bytes.len());
    Ok(Alarm { number, kind, axis, text: text(&bytes[..length]) })
}

fn element(cursor: &mut Cursor<'_>, width: Width) -> Result<i32, WireError> {
    match width {
        Width::Byte => cursor.u8().map(i32::from),
        Width::Word => cursor.i16().map(i32::from),
        Width::Long => cursor.i32(),
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
) -> Result<Answer, WireError> {
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
    Ok(Answer::Data { kind, values })
}
