//! A look at what one poll has answered about one path: every value typed, with the reason where there is none. Pure.

use super::answer::{FocasAnswer, PositionUnit, SpeedUnit, Status};
use super::dial::Dial;
use super::item::{FocasItem, Position, Servo, Spindle, Stretch};
use super::line::Asked;
use super::poll;
use super::states::{OrAbsence, Signals};
use adapter_core::reading::{Absence, Value};
use std::sync::Arc;

const MM_PER_INCH: f64 = 25.4;

/// A look at the results of one poll.
pub(super) struct View<'a> {
    pub(super) asked: &'a Asked,
    pub(super) path: u8,
}

impl View<'_> {
    pub(super) fn find_answer(&self, item: FocasItem) -> OrAbsence<&FocasAnswer> {
        match self.asked.find_question_result(item.to_question(self.path)) {
            Some(Ok(answer)) => Ok(answer),
            Some(Err(error)) => Err(error.to_absence()),
            None => Err(Absence::NotSupported),
        }
    }

    pub(super) fn find_number(&self, item: FocasItem) -> OrAbsence<f64> {
        match self.find_answer(item)? {
            FocasAnswer::Number(number) => number.ok_or(Absence::OutOfRange),
            FocasAnswer::Whole(whole) => Ok(f64::from(*whole)),
            FocasAnswer::Modal { value, places: places @ 0..=9, .. } => {
                Ok(f64::from(*value) / 10f64.powi(i32::from(*places)))
            }
            FocasAnswer::Data { values, .. } => values.first().copied().flatten().ok_or(Absence::OutOfRange),
            FocasAnswer::Numbers(numbers) => numbers.first().copied().flatten().ok_or(Absence::NotSupported),
            _ => Err(Absence::OutOfRange),
        }
    }

    pub(super) fn find_status(&self) -> OrAbsence<Status> {
        match self.find_answer(FocasItem::Status)? {
            FocasAnswer::Status(status) => Ok(*status),
            _ => Err(Absence::OutOfRange),
        }
    }

    pub(super) fn find_memory(&self, stretch: Stretch) -> OrAbsence<&[i32]> {
        match self.find_answer(FocasItem::Pmc(stretch))? {
            FocasAnswer::Memory(bytes) => Ok(bytes.as_slice()),
            _ => Err(Absence::OutOfRange),
        }
    }

    pub(super) fn find_signals(&self) -> Signals {
        Signals::new(
            self.find_memory(poll::control_signals(self.path)),
            self.find_memory(poll::ladder_signals(self.path)),
            self.find_memory(poll::rapid_steps(self.path)),
        )
    }

    /// The operator's dial, %, where the address says in which byte it stands.
    pub(super) fn find_dial_pct(&self, dial: Option<Dial>) -> OrAbsence<f64> {
        let dial = dial.ok_or(Absence::NotSupported)?;
        let pct = dial.read(self.find_memory(dial.to_stretch())?).ok_or(Absence::OutOfRange)?;
        Ok(f64::from(pct.percent()))
    }

    /// The place of the axis of this name among the axes.
    pub(super) fn find_axis_place(&self, name: &str) -> OrAbsence<usize> {
        let axes = self.asked.facts.axes_of(self.path)?;
        axes.iter().position(|known| known.eq_ignore_ascii_case(name)).ok_or(Absence::NotSupported)
    }

    /// A quantity of the axis of this name.
    pub(super) fn find_axis_value(&self, item: FocasItem, name: &str) -> OrAbsence<f64> {
        let place = self.find_axis_place(name)?;
        match self.find_answer(item)? {
            FocasAnswer::Numbers(numbers) => numbers.get(place).copied().flatten().ok_or(Absence::NotSupported),
            _ => Err(Absence::OutOfRange),
        }
    }

    /// Load of the drive of the axis of this name: its size, as the load meter shows it. The vendor's library takes the sign
    /// off; natively it is there, and would give the same channel two meanings.
    pub(super) fn axis_load(&self, name: &str) -> OrAbsence<f64> {
        self.find_axis_value(FocasItem::Servos(Servo::Load), name).map(f64::abs)
    }

    /// Load of the spindle at this place, counted from 0: its size, for the same reason.
    pub(super) fn spindle_load(&self, place: usize) -> OrAbsence<f64> {
        self.find_number_at(FocasItem::Spindles(Spindle::Load), place).map(f64::abs)
    }

    /// The number at a place of an answer that has one per axis or spindle.
    pub(super) fn find_number_at(&self, item: FocasItem, place: usize) -> OrAbsence<f64> {
        match self.find_answer(item)? {
            FocasAnswer::Numbers(values) | FocasAnswer::Data { values, .. } => {
                values.get(place).copied().flatten().ok_or(Absence::NotSupported)
            }
            _ => Err(Absence::OutOfRange),
        }
    }

    /// A position of the axis of this name: in millimetres whatever the machine measures in, in degrees where the caller
    /// says that it turns. An axis of the other kind has no such position.
    pub(super) fn find_position(&self, which: Position, name: &str, rotary: bool) -> OrAbsence<f64> {
        let position = self.find_axis_value(FocasItem::Position(which, -1), name)?;
        match (self.position_unit(which, self.find_axis_place(name)?)?, rotary) {
            (PositionUnit::Degrees, true) | (PositionUnit::Mm, false) => Ok(position),
            (PositionUnit::Inch, false) => Ok(position * MM_PER_INCH),
            _ => Err(Absence::NotSupported),
        }
    }

    /// The unit of a position of the axis at this place: what the control says beside the position. A control that does not
    /// say it has it in parameters: 1001 for the machine, 1006 for axes that turn.
    fn position_unit(&self, which: Position, place: usize) -> OrAbsence<PositionUnit> {
        match self.find_answer(FocasItem::PositionUnit(which.frame())) {
            Ok(FocasAnswer::Units(units)) => {
                units.get(place).and_then(|number| PositionUnit::of_number(*number)).ok_or(Absence::OutOfRange)
            }
            Ok(_) => Err(Absence::OutOfRange),
            Err(Absence::NotSupported) => {
                let facts = &self.asked.facts;
                Ok(match (facts.is_rotary(self.path, place)?, facts.inch?) {
                    (true, _) => PositionUnit::Degrees,
                    (_, true) => PositionUnit::Inch,
                    _ => PositionUnit::Mm,
                })
            }
            Err(reason) => Err(reason),
        }
    }

    /// Is the program in inches? A control whose signals cannot be read says it by the unit of its feed.
    fn is_inch_program(&self, signals: &Signals) -> OrAbsence<bool> {
        match (signals.is_inch(), self.told_unit()) {
            (Err(Absence::NotSupported), Ok(unit)) => Ok(unit.is_inch()),
            (Err(Absence::NotSupported), Err(Absence::NotSupported)) => self.asked.facts.inch,
            (Err(Absence::NotSupported), Err(reason)) => Err(reason),
            (told, _) => told,
        }
    }

    /// The unit that the control tells for the feed.
    pub(super) fn told_unit(&self) -> OrAbsence<SpeedUnit> {
        match self.find_answer(FocasItem::FeedUnit)? {
            FocasAnswer::Unit(SpeedUnit::Unknown(_) | SpeedUnit::Rpm) => Err(Absence::OutOfRange),
            FocasAnswer::Unit(unit) => Ok(*unit),
            _ => Err(Absence::OutOfRange),
        }
    }

    /// Is feed per revolution active?
    pub(super) fn is_per_revolution(&self) -> OrAbsence<bool> {
        match self.find_answer(poll::FEED_GROUP)? {
            FocasAnswer::Groups(groups) => {
                groups.first().map(|code| *code == poll::PER_REVOLUTION).ok_or(Absence::OutOfRange)
            }
            _ => Err(Absence::OutOfRange),
        }
    }

    /// Unit of the actual feed. A control that does not have the function means millimetres, or inches when the program
    /// is in inches; an older one shows it per revolution where parameter 3107 says so.
    pub(super) fn feed_unit(&self, signals: &Signals) -> OrAbsence<SpeedUnit> {
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
    pub(super) fn programmed_unit(&self, signals: &Signals) -> OrAbsence<SpeedUnit> {
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

    pub(super) fn feed_mm_min(&self, item: FocasItem, unit: OrAbsence<SpeedUnit>) -> OrAbsence<f64> {
        let (feed, unit) = (self.find_number(item)?, unit?);
        let feed = if unit.is_inch() { feed * MM_PER_INCH } else { feed };
        Ok(if unit.is_per_revolution() { feed * self.find_number(FocasItem::SpindleSpeed)?.abs() } else { feed })
    }

    pub(super) fn find_program_name(&self) -> OrAbsence<String> {
        match self.find_answer(FocasItem::ProgramName) {
            Ok(FocasAnswer::Named { name, .. }) if !name.is_empty() => return Ok(name.clone()),
            Ok(FocasAnswer::Named { number, .. }) => return Ok(format!("O{number}")),
            _ => {}
        }
        match self.find_answer(FocasItem::Program)? {
            FocasAnswer::Program { running, .. } => Ok(format!("O{running}")),
            _ => Err(Absence::OutOfRange),
        }
    }
}

pub(super) fn to_number_value(found: OrAbsence<f64>) -> OrAbsence<Value> {
    found.and_then(Value::from_number)
}

pub(super) fn to_flag_value(found: OrAbsence<bool>) -> OrAbsence<Value> {
    found.map(|on| Value::Number(f64::from(u8::from(on))))
}

pub(super) fn to_word_value(found: OrAbsence<Option<&str>>) -> OrAbsence<Value> {
    found.and_then(|word| word.map(|word| Value::Text(Arc::from(word))).ok_or(Absence::OutOfRange))
}

pub(super) fn to_text_value(found: OrAbsence<String>) -> OrAbsence<Value> {
    found.map(|text| Value::Text(Arc::from(text)))
}
