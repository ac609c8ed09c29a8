//! Answers to channels: units, states, and a reason where there is no value. Pure.

use super::answer::{Answer, ItemError, Status};
use super::code::Consequence;
use super::dial::Dial;
use super::item::{Item, Position, Servo, Spindle};
use super::line::Asked;
use super::poll;
use super::states::{self, Signals};
use crate::channel::{ChannelId, on_path};
use crate::reading::{Absence, Reading, Stamp, Value};
use std::sync::Arc;

/// Channels of the quick group, in the order of [`fast`]. A further path has those of them that the table of channels
/// has for it.
pub const FAST: [&str; 29] = [
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
    "motion",
    "motor_temperature_c",
    "single_block",
    "dry_run",
    "feed_override_dial_pct",
];

/// The channel of threads: present only while one is cut, so that a recipe can name the operation otherwise.
pub const OPERATION: &str = "operation";

/// The power of the spindle drive, where the address names a diagnosis number for it.
pub const POWER: &str = "spindle_power_w";

/// Channels of the slow group, in the order of [`slow`].
/// Only values that hold between readings: one that is interpolated would keep all the others waiting for it.
pub const SLOW: [&str; 2] = ["part_count", "gear_stage"];

const MM_PER_INCH: f64 = 25.4;

type Found<T> = Result<T, Absence>;

/// The ids of channels by their names.
#[must_use]
pub fn ids<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<ChannelId> {
    names.into_iter().filter_map(ChannelId::of).collect()
}

/// Channels at their places in [`fast`], under the plain names or those of a further path; `None` where the table has
/// none. `names` come besides [`FAST`].
#[must_use]
pub fn columns<'a>(further: Option<u8>, names: impl IntoIterator<Item = &'a str>) -> Vec<Option<ChannelId>> {
    let named = |name: &str| further.map_or_else(|| ChannelId::of(name), |path| ChannelId::of(&on_path(name, path)));
    FAST.into_iter().chain([OPERATION]).chain(names).map(named).collect()
}

/// A look at the results of one poll.
struct View<'a> {
    asked: &'a Asked,
    path: u8,
}

fn absence(error: &ItemError) -> Absence {
    match error {
        ItemError::Refused(refusal) => match refusal.code.consequence() {
            Consequence::NotSupported | Consequence::Wrong => Absence::NotSupported,
            _ => Absence::Refused,
        },
        ItemError::Malformed(_) => Absence::OutOfRange,
        ItemError::NotOffered => Absence::NotSupported,
    }
}

impl View<'_> {
    fn answer(&self, item: Item) -> Found<&Answer> {
        match self.asked.on(item.on(self.path)) {
            Some(Ok(answer)) => Ok(answer),
            Some(Err(error)) => Err(absence(error)),
            None => Err(Absence::NotSupported),
        }
    }

    fn number(&self, item: Item) -> Found<f64> {
        match self.answer(item)? {
            Answer::Number(number) => number.ok_or(Absence::OutOfRange),
            Answer::Whole(whole) => Ok(f64::from(*whole)),
            Answer::Modal { value, flags } => Ok(f64::from(*value) / 10f64.powi(i32::from(flags[1] & 0x07))),
            Answer::Data { values, .. } => values.first().copied().flatten().ok_or(Absence::OutOfRange),
            Answer::Numbers(numbers) => numbers.first().copied().flatten().ok_or(Absence::NotSupported),
            _ => Err(Absence::OutOfRange),
        }
    }

    fn status(&self) -> Found<Status> {
        match self.answer(Item::Status)? {
            Answer::Status(status) => Ok(*status),
            _ => Err(Absence::OutOfRange),
        }
    }

    fn signals(&self) -> Signals {
        let bytes = |stretch| match self.answer(Item::Pmc(stretch)) {
            Ok(Answer::Memory(bytes)) => Some(bytes.as_slice()),
            _ => None,
        };
        Signals::new(bytes(poll::control_signals(self.path)), bytes(poll::ladder_signals(self.path)))
    }

    /// The operator's dial, %, where the address says in which byte it stands.
    fn dial(&self, dial: Option<Dial>) -> Found<f64> {
        let dial = dial.ok_or(Absence::NotSupported)?;
        match self.answer(Item::Pmc(dial.stretch()))? {
            Answer::Memory(bytes) => dial.read(bytes).map(|pct| f64::from(pct.percent())).ok_or(Absence::OutOfRange),
            _ => Err(Absence::OutOfRange),
        }
    }

    /// A quantity of the axis of this letter.
    fn axis(&self, item: Item, letter: &str) -> Found<f64> {
        let at = self.asked.facts.axes_of(self.path).iter().position(|name| name.eq_ignore_ascii_case(letter));
        let at = at.ok_or(Absence::NotSupported)?;
        match self.answer(item)? {
            Answer::Numbers(numbers) => numbers.get(at).copied().flatten().ok_or(Absence::NotSupported),
            _ => Err(Absence::OutOfRange),
        }
    }

    fn position_mm(&self, letter: &str) -> Found<f64> {
        let position = self.axis(Item::Position(Position::Machine, -1), letter)?;
        Ok(if self.asked.facts.inch { position * MM_PER_INCH } else { position })
    }

    /// Unit of the feed: 0 mm/min, 1 inch/min, 3 mm/rev, 4 inch/rev. Controls that cannot tell mean millimetres, or
    /// inches when the program is in inches.
    fn feed_unit(&self, signals: &Signals) -> f64 {
        let told = self.number(poll::FEED_UNIT).or_else(|_| self.number(poll::FEED_UNIT_OLDER));
        told.unwrap_or(f64::from(u8::from(signals.inch() == Some(true))))
    }

    fn feed_mm_min(&self, item: Item, signals: &Signals) -> Found<f64> {
        let (feed, unit) = (self.number(item)?, self.feed_unit(signals));
        let per_rev = unit >= 3.0;
        let inch = unit == 1.0 || unit == 4.0;
        let feed = if inch { feed * MM_PER_INCH } else { feed };
        Ok(if per_rev { feed * self.number(Item::SpindleSpeed)?.abs() } else { feed })
    }

    fn program(&self) -> Found<String> {
        match self.answer(Item::ProgramName) {
            Ok(Answer::Named { name, .. }) if !name.is_empty() => return Ok(name.clone()),
            Ok(Answer::Named { number, .. }) => return Ok(format!("O{number}")),
            _ => {}
        }
        match self.answer(Item::Program)? {
            Answer::Program { running, .. } => Ok(format!("O{running}")),
            _ => Err(Absence::OutOfRange),
        }
    }
}

fn number(found: Found<f64>) -> Found<Value> {
    found.and_then(Value::number)
}

fn flag(found: Option<bool>) -> Found<Value> {
    found.map(|on| Value::Number(f64::from(u8::from(on)))).ok_or(Absence::NotSupported)
}

fn word(found: Found<Option<&str>>) -> Found<Value> {
    found.and_then(|word| word.map(|word| Value::Text(Arc::from(word))).ok_or(Absence::OutOfRange))
}

fn text(found: Found<String>) -> Found<Value> {
    found.map(|text| Value::Text(Arc::from(text)))
}

/// Does the answer say that alarms of this path have to be asked for?
#[must_use]
pub fn alarmed(asked: &Asked, path: u8) -> bool {
    matches!(asked.on(Item::Status.on(path)), Some(Ok(Answer::Status(status))) if states::alarmed(status))
}

/// How answers are read besides what they say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Manner {
    /// Path from 1.
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

/// The readings of the quick group of one path, at the places of [`columns`]. `alarms` are the results of asking for
/// alarms, when they were.
pub fn fast(
    columns: &[Option<ChannelId>],
    asked: &Asked,
    alarms: Option<&Asked>,
    manner: Manner,
    out: &mut Vec<Reading>,
) {
    let view = View { asked, path: manner.path };
    let signals = view.signals();
    let pct = signals.feed_override(manner.second_override);
    let status = view.status();
    let axes = ["X", "Y", "Z"];
    let position = axes.map(|letter| number(view.position_mm(letter)));
    let load = axes.map(|letter| number(view.axis(Item::Servos(Servo::Load), letter)));
    let current = axes.map(|letter| number(view.axis(Item::Servos(Servo::Current), letter)));
    let single_block = signals.single_block() == Some(true);
    let values = [
        number(view.number(poll::MODAL_S)),
        number(view.feed_mm_min(poll::MODAL_F, &signals)),
        number(view.number(Item::SpindleSpeed)),
        number(view.feed_mm_min(Item::Feed, &signals)),
        number(pct.ok_or(Absence::NotSupported)),
        number(signals.spindle_override().ok_or(Absence::NotSupported)),
        number(view.number(Item::Spindles(Spindle::Load))),
    ];
    let words = [
        flag(signals.rapid()),
        flag(signals.drives_ready()),
        word(status.map(|status| states::mode(&status, single_block))),
        word(status.map(|status| states::execution(&status, pct))),
        text(view.program()),
        text(view.number(Item::Sequence).map(|number| format!("N{number}"))),
        text(view.number(poll::MODAL_T).map(|number| format!("T{number}"))),
        text(status.map(|status| alarm_text(&status, &view, alarms))),
        word(status.map(|status| states::motion(&status))),
        number(view.number(poll::MOTOR_TEMPERATURE)),
        flag(signals.single_block()),
        flag(signals.dry_run()),
        number(view.dial(manner.dial)),
    ];
    let stamp = Stamp::of_request(asked.began_ns, asked.ended_ns);
    let all = values.into_iter().chain(position).chain(load).chain(current).chain(words);
    let operation = signals.operation().map(Arc::from).map(Value::Text).ok_or(Absence::NotSupported);
    let power = number(manner.power_diagnosis.ok_or(Absence::NotSupported).and_then(|at| view.number(poll::power(at))));
    let named = columns.iter().zip(all.chain([operation, power]));
    out.extend(named.filter_map(|(channel, value)| channel.map(|channel| reading(channel, stamp, value))));
}

fn alarm_text(status: &Status, view: &View<'_>, alarms: Option<&Asked>) -> String {
    let found = alarms.and_then(|alarms| alarms.on(poll::ALARMS.on(view.path)));
    let alarms = match found {
        Some(Ok(Answer::Alarms(alarms))) => alarms.as_slice(),
        _ => &[],
    };
    states::alarm(status, alarms, view.asked.facts.axes_of(view.path))
}

/// The readings of the slow group.
pub fn slow(channels: &[ChannelId], asked: &Asked, out: &mut Vec<Reading>) {
    let view = View { asked, path: asked.path };
    let values = [poll::PART_COUNT, poll::GEAR].map(|item| number(view.number(item)));
    let stamp = Stamp::of_request(asked.began_ns, asked.ended_ns);
    out.extend(channels.iter().zip(values).map(|(channel, value)| reading(*channel, stamp, value)));
}

fn reading(channel: ChannelId, stamp: Stamp, value: Found<Value>) -> Reading {
    match value {
        Ok(Value::Number(value)) => Reading::number(channel, stamp, value),
        Ok(Value::Text(text)) => Reading::text(channel, stamp, text),
        Err(reason) => Reading::absent(channel, stamp, reason),
    }
}
