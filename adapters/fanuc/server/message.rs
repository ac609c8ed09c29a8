//! Alarms, those that have been, messages to the operator, and the clock.

use super::answer_form::{Data8, NUMBER};
use super::controller::Controller;
use super::encode::{convert_to_i32, encode_longs, encode_shorts, encode_text};
use adapter_core::integer::clamp_count;
use fanuc::answer::{Alarm, OperatorMessage, PastAlarm};
use fanuc::request::{ALARM_TEXT_LEN, HISTORY_TEXT_LEN, MESSAGE_TEXT_LEN};

/// At most so many records in one answer.
const RECORDS_MAX: usize = 10;

/// Texts of the alarms, in records as long as the client wants them.
pub(super) fn encode_alarms(controller: &Controller, most: i32, length: i32) -> Vec<u8> {
    let most = clamp_count(most, usize::MAX);
    let length = usize::try_from(length).ok().filter(|length| (1..=ALARM_TEXT_LEN).contains(length));
    let length = length.unwrap_or(ALARM_TEXT_LEN);
    controller.alarms.iter().take(most).flat_map(|alarm| encode_alarm(alarm, length)).collect()
}

fn encode_alarm(alarm: &Alarm, length: usize) -> Vec<u8> {
    let told = convert_to_i32(alarm.text.len().min(length));
    [encode_longs(&[alarm.number, alarm.kind, alarm.axis, told]), encode_text(&alarm.text, length)].concat()
}

/// Alarms that have been, the oldest first, counted from 1.
pub(super) fn encode_history(controller: &Controller, first: i32, last: i32) -> Data8 {
    let (Ok(first @ 1..), Ok(last)) = (usize::try_from(first), usize::try_from(last)) else { return Err(NUMBER) };
    let past = controller.alarm_history.get(first - 1..last.min(controller.alarm_history.len())).ok_or(NUMBER)?;
    let record = |past: &PastAlarm| {
        let PastAlarm { alarm, at } = past;
        let told = convert_to_i32(alarm.text.len().min(HISTORY_TEXT_LEN));
        let head = encode_longs(&[alarm.number, alarm.kind, alarm.axis]);
        [head, encode_shorts(at), encode_longs(&[told]), encode_text(&alarm.text, HISTORY_TEXT_LEN)].concat()
    };
    Ok(past.iter().take(RECORDS_MAX).flat_map(record).collect())
}

/// Messages to the operator: all of them, or those of one kind.
pub(super) fn encode_messages(controller: &Controller, kind: i32, most: usize) -> Vec<u8> {
    let record = |message: &OperatorMessage| {
        let told = convert_to_i32(message.text.len().min(MESSAGE_TEXT_LEN));
        [encode_longs(&[message.number, message.kind, told]), encode_text(&message.text, MESSAGE_TEXT_LEN)].concat()
    };
    let wanted = controller.messages.iter().filter(|message| kind == -1 || message.kind == kind);
    let found: Vec<u8> = wanted.take(most.min(RECORDS_MAX)).flat_map(record).collect();
    // A client that asks for one kind wants to hear that there is none of it.
    if found.is_empty() {
        record(&OperatorMessage { number: -1, kind: kind.max(0), text: String::new() })
    } else {
        found
    }
}
