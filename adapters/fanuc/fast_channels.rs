//! The channels of the quick group: each row is a name and how its value is found, so that the two cannot come apart. Pure.

use super::alarms;
use super::answer::{FocasAnswer, Status};
use super::item::{FocasItem, Position, Servo};
use super::line::Asked;
use super::manner::Manner;
use super::poll;
use super::states::{self, OrAbsence, Signals};
use super::view::{View, to_flag_value, to_number_value, to_text_value, to_word_value};
use adapter_core::reading::{Absence, Value};
use std::sync::Arc;

/// The answers of one poll of one path, with what several channels are made from.
pub(super) struct FastAnswers<'a> {
    view: View<'a>,
    signals: Signals,
    status: OrAbsence<Status>,
    /// Results of asking for alarms, when they were asked for.
    alarms: Option<&'a Asked>,
    manner: Manner,
}

impl<'a> FastAnswers<'a> {
    pub(super) fn new(asked: &'a Asked, alarms: Option<&'a Asked>, manner: Manner) -> Self {
        let view = View { asked, path: manner.path };
        let (signals, status) = (view.find_signals(), view.find_status());
        Self { view, signals, status, alarms, manner }
    }

    fn read_number(&self, item: FocasItem) -> OrAbsence<Value> {
        to_number_value(self.view.find_number(item))
    }

    fn read_position(&self, letter: &str) -> OrAbsence<Value> {
        to_number_value(self.view.find_position(Position::Machine, letter, false))
    }

    fn read_load(&self, letter: &str) -> OrAbsence<Value> {
        to_number_value(self.view.axis_load(letter))
    }

    fn read_current(&self, letter: &str) -> OrAbsence<Value> {
        to_number_value(self.view.find_axis_value(FocasItem::Servos(Servo::Current), letter))
    }

    fn read_feed_override(&self) -> OrAbsence<f64> {
        self.signals.feed_override(self.manner.second_override)
    }

    fn name_mode(&self) -> OrAbsence<Value> {
        let single_block = self.signals.single_block() == Ok(true);
        to_word_value(self.status.map(|status| states::name_mode(&status, single_block)))
    }

    fn name_execution(&self) -> OrAbsence<Value> {
        to_word_value(self.status.map(|status| states::name_execution(&status, self.read_feed_override().ok())))
    }

    fn format_number(&self, letter: char, item: FocasItem) -> OrAbsence<Value> {
        to_text_value(self.view.find_number(item).map(|number| format!("{letter}{number}")))
    }

    fn describe_alarms(&self) -> OrAbsence<Value> {
        to_text_value(self.status.map(|status| self.format_alarms(&status)))
    }

    fn format_alarms(&self, status: &Status) -> String {
        let path = self.view.path;
        let found = self.alarms.and_then(|alarms| alarms.find_question_result(poll::ALARMS.to_question(path)));
        let alarms = match found {
            Some(Ok(FocasAnswer::Alarms(alarms))) => alarms.as_slice(),
            _ => &[],
        };
        let facts = &self.view.asked.facts;
        alarms::format_alarms(status, alarms, facts.axes_of(path).unwrap_or_default(), facts.alarm_table())
    }

    fn describe_warning(&self) -> OrAbsence<Value> {
        let describe = |status: Status| alarms::describe_warning(&status).map(|(warning, _)| warning);
        to_text_value(self.status.map(|status| describe(status).unwrap_or_default()))
    }

    /// Of threads: present only while one is cut, so that a recipe can name the operation otherwise.
    fn name_operation(&self) -> OrAbsence<Value> {
        self.signals.find_operation().map(Arc::from).map(Value::Text)
    }
}

/// One channel of the quick group.
pub(super) struct FastChannel {
    pub(super) name: &'static str,
    pub(super) find: fn(&FastAnswers<'_>) -> OrAbsence<Value>,
}

const fn define_channel(name: &'static str, find: fn(&FastAnswers<'_>) -> OrAbsence<Value>) -> FastChannel {
    FastChannel { name, find }
}

/// The power of the spindle drive, where the address names a diagnosis number for it.
pub(super) static POWER: FastChannel = define_channel("spindle_power_w", |found| {
    let number = found.manner.power_diagnosis.ok_or(Absence::NotSupported)?;
    found.read_number(poll::build_power_item(number))
});

/// In the order of their readings. A further path has those of them that the table of channels has for it.
#[rustfmt::skip]
pub(super) static FAST: [FastChannel; 34] = [
    define_channel("spindle_programmed_rpm", |found| found.read_number(poll::MODAL_S)),
    define_channel("feed_programmed_mm_min", |found| {
        to_number_value(found.view.feed_mm_min(poll::MODAL_F, found.view.programmed_unit(&found.signals)))
    }),
    define_channel("spindle_speed_rpm", |found| found.read_number(FocasItem::SpindleSpeed)),
    define_channel("feed_mm_min", |found| {
        to_number_value(found.view.feed_mm_min(FocasItem::Feed, found.view.feed_unit(&found.signals)))
    }),
    define_channel("feed_override_pct", |found| to_number_value(found.read_feed_override())),
    define_channel("spindle_override_pct", |found| to_number_value(found.signals.spindle_override())),
    define_channel("spindle_load_pct", |found| to_number_value(found.view.spindle_load(0))),
    define_channel("x_axis_position_mm", |found| found.read_position("X")),
    define_channel("y_axis_position_mm", |found| found.read_position("Y")),
    define_channel("z_axis_position_mm", |found| found.read_position("Z")),
    define_channel("x_axis_load_pct", |found| found.read_load("X")),
    define_channel("y_axis_load_pct", |found| found.read_load("Y")),
    define_channel("z_axis_load_pct", |found| found.read_load("Z")),
    define_channel("x_axis_current_a", |found| found.read_current("X")),
    define_channel("y_axis_current_a", |found| found.read_current("Y")),
    define_channel("z_axis_current_a", |found| found.read_current("Z")),
    define_channel("rapid", |found| to_flag_value(found.signals.is_rapid())),
    define_channel("drive_on", |found| to_flag_value(found.signals.drives_ready())),
    define_channel("mode", |found| found.name_mode()),
    define_channel("execution", |found| found.name_execution()),
    define_channel("program", |found| to_text_value(found.view.find_program_name())),
    define_channel("block", |found| found.format_number('N', FocasItem::Sequence)),
    define_channel("tool", |found| found.format_number('T', poll::MODAL_T)),
    define_channel("alarm", |found| found.describe_alarms()),
    define_channel("emergency_stop", |found| to_flag_value(found.status.map(|status| status.emergency == 1))),
    define_channel("motion", |found| to_word_value(found.status.map(|status| states::name_motion(&status)))),
    define_channel("motor_temperature_c", |found| found.read_number(poll::MOTOR_TEMPERATURE)),
    define_channel("single_block", |found| to_flag_value(found.signals.single_block())),
    define_channel("dry_run", |found| to_flag_value(found.signals.dry_run())),
    define_channel("feed_override_dial_pct", |found| to_number_value(found.view.find_dial_pct(found.manner.dial))),
    define_channel("control_warning", |found| found.describe_warning()),
    define_channel("rapid_override_pct", |found| to_number_value(found.signals.rapid_override())),
    define_channel("jog_override_pct", |found| to_number_value(found.signals.jog_override())),
    define_channel("operation", |found| found.name_operation()),
];
