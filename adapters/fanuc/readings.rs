//! Answers to channels: units, states, and a reason where there is no value. Pure.

use super::alarms;
use super::answer::{FocasAnswer, Status};
use super::dial::Dial;
use super::extra::Extra;
use super::item::{FocasItem, Position, Servo};
use super::line::Asked;
use super::poll;
use super::states::{self, OrAbsence};
use super::view::{View, to_flag_value, to_number_value, to_text_value, to_word_value};
use adapter_core::channel::{ChannelId, on_path};
use adapter_core::reading::{Absence, Reading, Stamp, Value};
use adapter_core::text::TextEncoding;
use std::sync::Arc;

/// Channels of the quick group, in the order of [`append_fast_readings`]. A further path has those of them that the table of channels
/// has for it.
pub const FAST: [&str; 33] = [
    "spindle_programmed_rpm",
    "feed_programmed_mm_min",
    "spindle_speed_rpm",
    "feed_mm_min",
    "feed_override_pct",
    "spindle_override_pct",
    "spindle_load_pct",
    "x_axis_position_mm",
    "y_axis_position_mm",
    "z_axis_position_mm",
    "x_axis_load_pct",
    "y_axis_load_pct",
    "z_axis_load_pct",
    "x_axis_current_a",
    "y_axis_current_a",
    "z_axis_current_a",
    "rapid",
    "drive_on",
    "mode",
    "execution",
    "program",
    "block",
    "tool",
    "alarm",
    "emergency_stop",
    "motion",
    "motor_temperature_c",
    "single_block",
    "dry_run",
    "feed_override_dial_pct",
    "control_warning",
    "rapid_override_pct",
    "jog_override_pct",
];

/// The channel of threads: present only while one is cut, so that a recipe can name the operation otherwise.
pub const OPERATION: &str = "operation";

/// The power of the spindle drive, where the address names a diagnosis number for it.
pub const POWER: &str = "spindle_power_w";

/// The ids of channels by their names.
#[must_use]
pub fn find_channel_ids<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<ChannelId> {
    names.into_iter().filter_map(ChannelId::from_name).collect()
}

/// Channels at their places in [`append_fast_readings`], under the plain names or those of a further path; `None` where the table has
/// none. `names` come besides [`FAST`].
#[must_use]
pub fn list_columns<'a>(further: Option<u8>, names: impl IntoIterator<Item = &'a str>) -> Vec<Option<ChannelId>> {
    let named = |name: &str| {
        further.map_or_else(|| ChannelId::from_name(name), |path| ChannelId::from_name(&on_path(name, path)))
    };
    FAST.into_iter().chain([OPERATION]).chain(names).map(named).collect()
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

/// How answers are read besides what they say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Manner {
    /// Path of the control, counted from 1.
    pub path: u8,
    /// Is the second feed override in use on this machine?
    pub second_override: bool,
    /// Diagnosis number of the power of the spindle drive.
    pub power_diagnosis: Option<u16>,
    /// Where the operator's dial stands.
    pub dial: Option<Dial>,
}

impl Manner {
    /// For a path that is read besides: what the address says of the second override, power and dial is
    /// said of the first.
    #[must_use]
    pub fn of_further(self, path: u8) -> Self {
        Self { path, second_override: false, power_diagnosis: None, dial: None }
    }
}

/// The readings of the quick group of one path, at the places of [`list_columns`]. `alarms` are the results of asking for
/// alarms, when they were.
pub fn append_fast_readings(
    columns: &[Option<ChannelId>],
    asked: &Asked,
    alarms: Option<&Asked>,
    manner: Manner,
    out: &mut Vec<Reading>,
) {
    let view = View { asked, path: manner.path };
    let signals = view.find_signals();
    let pct = signals.feed_override(manner.second_override);
    let status = view.find_status();
    let axes = ["X", "Y", "Z"];
    let position = axes.map(|letter| to_number_value(view.find_position(Position::Machine, letter, false)));
    let load = axes.map(|letter| to_number_value(view.axis_load(letter)));
    let current = axes.map(|letter| to_number_value(view.find_axis_value(FocasItem::Servos(Servo::Current), letter)));
    let single_block = signals.single_block() == Ok(true);
    let values = [
        to_number_value(view.find_number(poll::MODAL_S)),
        to_number_value(view.feed_mm_min(poll::MODAL_F, view.programmed_unit(&signals))),
        to_number_value(view.find_number(FocasItem::SpindleSpeed)),
        to_number_value(view.feed_mm_min(FocasItem::Feed, view.feed_unit(&signals))),
        to_number_value(pct),
        to_number_value(signals.spindle_override()),
        to_number_value(view.spindle_load(0)),
    ];
    let words = [
        to_flag_value(signals.is_rapid()),
        to_flag_value(signals.drives_ready()),
        to_word_value(status.map(|status| states::name_mode(&status, single_block))),
        to_word_value(status.map(|status| states::name_execution(&status, pct.ok()))),
        to_text_value(view.find_program_name()),
        to_text_value(view.find_number(FocasItem::Sequence).map(|number| format!("N{number}"))),
        to_text_value(view.find_number(poll::MODAL_T).map(|number| format!("T{number}"))),
        to_text_value(status.map(|status| alarm_text(&status, &view, alarms))),
        to_flag_value(status.map(|status| status.emergency == 1)),
        to_word_value(status.map(|status| states::name_motion(&status))),
        to_number_value(view.find_number(poll::MOTOR_TEMPERATURE)),
        to_flag_value(signals.single_block()),
        to_flag_value(signals.dry_run()),
        to_number_value(view.find_dial_pct(manner.dial)),
        to_text_value(
            status.map(|status| alarms::describe_warning(&status).map(|(warning, _)| warning).unwrap_or_default()),
        ),
        to_number_value(signals.rapid_override()),
        to_number_value(signals.jog_override()),
    ];
    let stamp = Stamp::of_request(asked.began_ns, asked.ended_ns);
    let all = values.into_iter().chain(position).chain(load).chain(current).chain(words);
    let operation = signals.find_operation().map(Arc::from).map(Value::Text);
    let power = to_number_value(
        manner.power_diagnosis.ok_or(Absence::NotSupported).and_then(|at| view.find_number(poll::build_power_item(at))),
    );
    let named = columns.iter().zip(all.chain([operation, power]));
    out.extend(named.filter_map(|(channel, value)| channel.map(|channel| build_reading(channel, stamp, value))));
}

fn alarm_text(status: &Status, view: &View<'_>, alarms: Option<&Asked>) -> String {
    let found = alarms.and_then(|alarms| alarms.find_question_result(poll::ALARMS.to_question(view.path)));
    let alarms = match found {
        Some(Ok(FocasAnswer::Alarms(alarms))) => alarms.as_slice(),
        _ => &[],
    };
    let facts = &view.asked.facts;
    alarms::format_alarms(status, alarms, facts.axes_of(view.path).unwrap_or_default(), facts.alarm_table())
}

/// The readings of channels that an address or a configuration adds.
pub(super) fn append_extra_readings(extras: &[Extra], asked: &Asked, encoding: TextEncoding, out: &mut Vec<Reading>) {
    let stamp = Stamp::of_request(asked.began_ns, asked.ended_ns);
    out.extend(extras.iter().map(|extra| extra.to_reading(asked, stamp, encoding)));
}

pub(super) fn build_reading(channel: ChannelId, stamp: Stamp, value: OrAbsence<Value>) -> Reading {
    match value {
        Ok(Value::Number(value)) => Reading::from_number(channel, stamp, value),
        Ok(Value::Text(text)) => Reading::from_text(channel, stamp, text),
        Err(reason) => Reading::from_absence(channel, stamp, reason),
    }
}
