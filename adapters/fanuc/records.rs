//! Records within the data of an answer: messages, remembered alarms, G codes, tool life. What is known of their layout
//! comes from what the vendor's library makes of them.

use super::answer::{Alarm, FocasAnswer, OperatorMessage, PastAlarm};
use super::request::{HISTORY_TEXT_LEN, MESSAGE_TEXT_LEN};
use super::wire::{Cursor, WireError};
use adapter_core::integer::clamp_count;
use adapter_core::text::TextEncoding;

type Read<T> = Result<T, WireError>;

/// Four words, as `cnc_rdcncid` is usually written.
pub(super) fn cnc_id(cursor: &mut Cursor<'_>) -> Read<String> {
    let word = |cursor: &mut Cursor<'_>| cursor.read_i32().map(|word| format!("{word:08x}"));
    Ok([word(cursor)?, word(cursor)?, word(cursor)?, word(cursor)?].join("-"))
}

/// Text of so many bytes, of which the first `told` count.
fn read_counted_text(cursor: &mut Cursor<'_>, told: i32, length: usize, encoding: TextEncoding) -> Read<String> {
    let bytes = cursor.read_bytes(length)?;
    let told = clamp_count(told, bytes.len());
    Ok(encoding.decode_trimmed(&bytes[..told]))
}

pub(super) fn read_message(cursor: &mut Cursor<'_>, encoding: TextEncoding) -> Read<OperatorMessage> {
    let (number, kind, length) = (cursor.read_i32()?, cursor.read_i32()?, cursor.read_i32()?);
    Ok(OperatorMessage { number, kind, text: read_counted_text(cursor, length, MESSAGE_TEXT_LEN, encoding)? })
}

pub(super) fn past_alarm(cursor: &mut Cursor<'_>, encoding: TextEncoding) -> Read<PastAlarm> {
    let (number, kind, axis) = (cursor.read_i32()?, cursor.read_i32()?, cursor.read_i32()?);
    let mut at = [0; 6];
    for part in &mut at {
        *part = cursor.read_i16()?;
    }
    let length = cursor.read_i32()?;
    let text = read_counted_text(cursor, length, HISTORY_TEXT_LEN, encoding)?;
    Ok(PastAlarm { alarm: Alarm { number, kind, axis, text }, at })
}

/// `G54.3` from group, flag, 543 and one place.
pub(super) fn g_code(cursor: &mut Cursor<'_>) -> Read<String> {
    let (_group, _flag, code) = (cursor.read_i16()?, cursor.read_i16()?, cursor.read_i32()?);
    let (_unused, places) = (cursor.read_i16()?, cursor.read_i16()?);
    Ok(match places {
        0 => format!("G{code:02}"),
        _ => {
            let power = 10f64.powi(i32::from(places.clamp(0, 4)));
            let places = clamp_count(places, 4);
            format!("G{:.places$}", f64::from(code) / power)
        }
    })
}

pub(super) fn read_tool_life(cursor: &mut Cursor<'_>, wanted: u16) -> Read<FocasAnswer> {
    let found = cursor.read_i32()?;
    if found != i32::from(wanted) {
        let what = "number of a group of tools";
        return Err(WireError::Mismatch { what, expected: i64::from(wanted), found: i64::from(found) });
    }
    let tools = cursor.read_i32()?;
    cursor.read_i32()?;
    let life = cursor.read_i32()?;
    cursor.read_i32()?;
    let count = cursor.read_i32()?;
    // What stands behind is not known; controls may send more.
    cursor.read_bytes(cursor.bytes_left())?;
    Ok(FocasAnswer::Life { tools, life, count })
}
