//! Answers to channels: units, states, and a reason where there is no value. Pure.

use super::alarms;
use super::answer::FocasAnswer;
use super::fast_channels::{FAST, FastAnswers, POWER};
use super::item::FocasItem;
use super::line::Asked;
use super::manner::Manner;
use super::states::OrAbsence;
use adapter_core::channel::{ChannelId, on_path};
use adapter_core::reading::{Reading, Stamp, Value};

/// A channel of the quick group under the name that it has on a path, and how its value is found.
#[derive(Clone, Copy)]
pub(super) struct FastColumn {
    pub(super) channel: ChannelId,
    find: fn(&FastAnswers<'_>) -> OrAbsence<Value>,
}

/// Channels of the quick group that the table of channels has, under the plain names or those of a further path.
pub(super) fn list_columns(further: Option<u8>, with_power: bool) -> Vec<FastColumn> {
    let identify = |name: &str| {
        further.map_or_else(|| ChannelId::from_name(name), |path| ChannelId::from_name(&on_path(name, path)))
    };
    let rows = FAST.iter().chain(with_power.then_some(&POWER));
    rows.filter_map(|row| identify(row.name).map(|channel| FastColumn { channel, find: row.find })).collect()
}

/// Does the answer say that alarms of this path have to be asked for?
#[must_use]
pub fn has_alarm(asked: &Asked, path: u8) -> bool {
    matches!(asked.find_question_result(FocasItem::Status.to_question(path)), Some(Ok(FocasAnswer::Status(status))) if alarms::has_alarm(status))
}

/// The warning of a path, with what to do; `None` without one.
#[must_use]
pub fn describe_warning(asked: &Asked, path: u8) -> Option<(String, &'static str)> {
    match asked.find_question_result(FocasItem::Status.to_question(path)) {
        Some(Ok(FocasAnswer::Status(status))) => alarms::describe_warning(status),
        _ => None,
    }
}

/// The readings of the quick group of one path. `alarms` are the results of asking for alarms, when they were.
pub(super) fn append_fast_readings(
    columns: &[FastColumn],
    asked: &Asked,
    alarms: Option<&Asked>,
    manner: Manner,
    out: &mut Vec<Reading>,
) {
    let found = FastAnswers::new(asked, alarms, manner);
    let stamp = Stamp::of_request(asked.began_ns, asked.ended_ns);
    out.extend(columns.iter().map(|column| build_reading(column.channel, stamp, (column.find)(&found))));
}

pub(super) fn build_reading(channel: ChannelId, stamp: Stamp, value: OrAbsence<Value>) -> Reading {
    match value {
        Ok(Value::Number(value)) => Reading::from_number(channel, stamp, value),
        Ok(Value::Text(text)) => Reading::from_text(channel, stamp, text),
        Err(reason) => Reading::from_absence(channel, stamp, reason),
    }
}
