//! A look at what one poll has answered about one path: every value typed, with the reason where there is none. Pure.

use super::answer::{Answer, SpeedUnit, Status};
use super::dial::Dial;
use super::item::{Item, Position, Stretch};
use super::line::Asked;
use super::poll;
use super::states::{Found, Signals};
use crate::reading::{Absence, Value};
use std::sync::Arc;

const MM_PER_INCH: f64 = 25.4;

/// A look at the results of one poll.
pub(super) struct View<'a> {
    pub(super) asked: &'a Asked,
    pub(super) path: u8,
}

impl View<'_> {
    pub(super) fn answer(&self, item: Item) -> Found<&Answer> {
        match self.asked.on(item.on(self.path)) {
            Some(Ok(answer)) => Ok(answer),
            Some(Err(error)) => Err(error.absence()),
            None => Err(Absence::NotSupported),
        }
    }

    pub(super) fn number(&self, item: Item) -> Found<f64> {
        match self.answer(item)? {
            Answer::Number(number) => number.ok_or(Absence::OutOfRange),
            Answer::Whole(whole) => Ok(f64::from(*whole)),
            Answer::Modal { value, flags } => Ok(f64::from(*value) / 10f64.powi(i32::from(flags[1] & 0x07))),
            Answer::Data { values, .. } => values.first().copied().flatten().ok_or(Absence::OutOfRange),
            Answer::Numbers(numbers) => numbers.first().copied().flatten().ok_or(Absence::NotSupported),
            _ => Err(Absence::OutOfRange),
        }
    }

    pub(super) fn status(&self) -> Found<Status> {
        match self.answer(Item::Status)? {
            Answer::Status(status) => Ok(*status),
            _ => Err(Absence::OutOfRange),
        }
    }

    pub(super) fn memory(&self, stretch: Stretch) -> Found<&[i32]> {
        match self.answer(Item::Pmc(stretch))? {
            Answer::Memory(bytes) => Ok(bytes.as_slice()),
            _ => Err(Absence::OutOfRange),
        }
    }

    pub(super) fn signals(&self) -> Signals {
        Signals::new(self.memory(poll::control_signals(self.path)), self.memory(poll::ladder_signals(self.path)))
    }

    /// The operator's dial, %, where the address says in which byte it stands.
    pub(super) fn dial(&self, dial: Option<Dial>) -> Found<f64> {
        let dial = dial.ok_or(Absence::NotSupported)?;
        let pct = dial.read(self.memory(dial.stretch())?).ok_or(Absence::OutOfRange)?;
        Ok(f64::from(pct.percent()))
    }

    /// The place of the axis of this name among the axes.
    pub(super) fn place(&self, name: &str) -> Found<usize> {
        let axes = self.asked.facts.axes_of(self.path)?;
        axes.iter().position(|known| known.eq_ignore_ascii_case(name)).ok_or(Absence::NotSupported)
    }

    /// A quantity of the axis of this name.
    pub(super) fn axis(&self, item: Item, name: &str) -> Found<f64> {
        let place = self.place(name)?;
        match self.answer(item)? {
            Answer::Numbers(numbers) => numbers.get(place).copied().flatten().ok_or(Absence::NotSupported),
            _ => Err(Absence::OutOfRange),
        }
    }

    /// A position of the axis of this name: in millimetres whatever the machine measures in, in degrees where the caller
    /// says that it turns. An axis of the other kind has no such position.
    pub(super) fn position(&self, which: Position, name: &str, rotary: bool) -> Found<f64> {
        let facts = &self.asked.facts;
        if facts.is_rotary(self.path, self.place(name)?)? != rotary {
            return Err(Absence::NotSupported);
        }
        let position = self.axis(Item::Position(which, -1), name)?;
        Ok(if !rotary && facts.inch? { position * MM_PER_INCH } else { position })
    }

    /// Is the program in inches? A control whose signals cannot be read says it by the unit of its feed.
    fn is_inch_program(&self, signals: &Signals) -> Found<bool> {
        match (signals.inch(), self.told_unit()) {
            (Err(Absence::NotSupported), Ok(unit)) => Ok(unit.is_inch()),
            (Err(Absence::NotSupported), Err(Absence::NotSupported)) => self.asked.facts.inch,
            (Err(Absence::NotSupported), Err(reason)) => Err(reason),
            (told, _) => told,
        }
    }

    /// The unit that the control tells for the feed.
    pub(super) fn told_unit(&self) -> Found<SpeedUnit> {
        match self.answer(Item::FeedUnit)? {
            Answer::Unit(SpeedUnit::Unknown(_) | SpeedUnit::Rpm) => Err(Absence::OutOfRange),
            Answer::Unit(unit) => Ok(*unit),
            _ => Err(Absence::OutOfRange),
        }
    }

    /// Is feed per revolution active?
    pub(super) fn is_per_revolution(&self) -> Found<bool> {
        match self.answer(poll::FEED_GROUP)? {
            Answer::Groups(groups) => {
                groups.first().map(|code| *code == poll::PER_REVOLUTION).ok_or(Absence::OutOfRange)
            }
            _ => Err(Absence::OutOfRange),
        }
    }

    /// Unit of the actual feed. A control that does not have the function means millimetres, or inches when the program
    /// is in inches; an older one shows it per revolution where parameter 3107 says so.
    pub(super) fn feed_unit(&self, signals: &Signals) -> Found<SpeedUnit> {
        let unit = match self.told_unit() {
            Err(Absence::NotSupported) if self.is_inch_program(signals)? => SpeedUnit::InchMin,
            Err(Absence::NotSupported) => SpeedUnit::MmMin,
            told => told?,
        };
        let per_revolution = self.asked.facts.feed_follows_mode? && self.is_per_revolution()?;
        Ok(if per_revolution { unit.per_revolution() } else { unit })
    }

    /// Unit of the F word: as the program has it, whatever the control shows for the actual feed. Without the modal group
    /// it is the unit of the actual feed.
    pub(super) fn programmed_unit(&self, signals: &Signals) -> Found<SpeedUnit> {
        let unit = match self.is_per_revolution() {
            Ok(per_revolution) => {
                let per_minute = if self.is_inch_program(signals)? { SpeedUnit::InchMin } else { SpeedUnit::MmMin };
                if per_revolution { per_minute.per_revolution() } else { per_minute }
            }
            Err(Absence::NotSupported) => self.feed_unit(signals)?,
            Err(reason) => return Err(reason),
        };
        Ok(unit)
    }

    pub(super) fn feed_mm_min(&self, item: Item, unit: Found<SpeedUnit>) -> Found<f64> {
        let (feed, unit) = (self.number(item)?, unit?);
        let feed = if unit.is_inch() { feed * MM_PER_INCH } else { feed };
        Ok(if unit.is_per_revolution() { feed * self.number(Item::SpindleSpeed)?.abs() } else { feed })
    }

    pub(super) fn program(&self) -> Found<String> {
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

pub(super) fn number(found: Found<f64>) -> Found<Value> {
    found.and_then(Value::number)
}

pub(super) fn flag(found: Found<bool>) -> Found<Value> {
    found.map(|on| Value::Number(f64::from(u8::from(on))))
}

pub(super) fn word(found: Found<Option<&str>>) -> Found<Value> {
    found.and_then(|word| word.map(|word| Value::Text(Arc::from(word))).ok_or(Absence::OutOfRange))
}

pub(super) fn text(found: Found<String>) -> Found<Value> {
    found.map(|text| Value::Text(Arc::from(text)))
}
