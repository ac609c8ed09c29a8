//! The external work offset of a FANUC control: what a thermal compensation shifts between programs and gives back. Only
//! the gate may hold one.
//!
//! The offset is in the coordinate of every work offset G54 to G59 and takes effect for blocks that are not yet
//! buffered; hence only while no program runs. The operator may use the external offset too: what was there is kept
//! and the shift is added to it, and a value that somebody changed in between is the new starting point.

use super::answer::{Answer, Status};
use super::item::{Item, Write};
use super::line::Line;
use crate::clock::Clock;
use crate::driver::SourceError;
use crate::offset::{Axis, Ledger, Left, OffsetSink};
use std::collections::BTreeMap;

/// Least input increment, µm (increment system IS-B, millimetres).
const INCREMENT_UM: f64 = 1.0;

/// Limits of a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftLimits {
    /// Largest change at a time, µm.
    pub step_um: f64,
    /// Largest shift from what the operator had set, µm.
    pub total_um: f64,
}

/// What a shift came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shifted {
    /// The offset before, increments.
    pub before: i32,
    /// What was written, increments.
    pub asked: i32,
    /// The offset now, as read back, increments.
    pub after: i32,
    /// The shift in force, increments.
    pub shift: i32,
    /// Had somebody else changed the offset?
    pub changed_by_others: bool,
}

/// The external offset of one axis.
pub struct ExternalOffset {
    name: String,
    line: Line,
    axis: i16,
    limits: ShiftLimits,
    ledger: Ledger,
}

impl ExternalOffset {
    /// Of this axis from 1. The address must allow `EXT`.
    #[must_use]
    pub fn new(name: &str, line: Line, axis: i16, limits: ShiftLimits) -> Self {
        Self { name: name.to_owned(), line, axis, limits, ledger: Ledger::default() }
    }

    /// Shifts towards `wanted_um` from what the operator had set, by one step at most. What was read back may be something
    /// else than what was asked for: whoever holds this has to compare.
    ///
    /// # Errors
    /// A program runs, the machine measures in inches, the control refuses, or the line failed.
    pub fn shift(&mut self, clock: &dyn Clock, wanted_um: f64) -> Result<Shifted, SourceError> {
        let before = self.at_rest(clock)?;
        let (base_um, changed_by_others) = self.ledger.base(f64::from(before));
        let (base, total) = (increments(base_um), increments(self.limits.total_um));
        let wanted = base.saturating_add(increments(wanted_um).clamp(-total, total));
        let step = increments(self.limits.step_um).max(1);
        let asked = before.saturating_add(wanted.saturating_sub(before).clamp(-step, step));
        let after = self.write(clock, before, asked)?;
        self.ledger.note(base_um, f64::from(after));
        Ok(Shifted { before, asked, after, shift: after - base, changed_by_others })
    }

    /// Gives back what the operator had set, in one step, unless somebody changed it.
    ///
    /// # Errors
    /// As for [`ExternalOffset::shift`].
    pub fn restore(&mut self, clock: &dyn Clock) -> Result<Option<Shifted>, SourceError> {
        if !self.ledger.is_shifted() {
            return Ok(None);
        }
        let before = self.at_rest(clock)?;
        let (base_um, changed_by_others) = self.ledger.base(f64::from(before));
        let asked = increments(base_um);
        let after = self.write(clock, before, asked)?;
        self.ledger.clear();
        Ok(Some(Shifted { before, asked, after, shift: after - asked, changed_by_others }))
    }

    /// The offset, when it may be changed now.
    fn at_rest(&self, clock: &dyn Clock) -> Result<i32, SourceError> {
        let item = Item::WorkOffset(0, self.axis);
        let asked = self.line.ask(clock, &[Item::Status, item])?;
        if asked.facts.inch {
            return Err(self.refused("the machine measures in inches", "Only machines in millimetres are shifted"));
        }
        match asked.of(Item::Status) {
            Some(Ok(Answer::Status(Status { run: 0, .. }))) => {}
            Some(Ok(Answer::Status(_))) => {
                return Err(self.refused("a program runs", "It is done between two programs"));
            }
            _ => return Err(self.refused("the state of the control is unknown", "See doctor")),
        }
        self.increments(asked.of(item).and_then(|result| result.as_ref().ok()))
    }

    fn increments(&self, answer: Option<&Answer>) -> Result<i32, SourceError> {
        let Some(Answer::Number(Some(mm))) = answer else {
            return Err(self.refused("the external offset cannot be read", "See doctor"));
        };
        let um = mm * 1000.0;
        if (um - um.round()).abs() > 1e-6 {
            return Err(self.refused("the least increment is not 1 µm", "Only increment system IS-B is shifted"));
        }
        Ok(increments(um))
    }

    /// Writes, and tells what is there then.
    fn write(&self, clock: &dyn Clock, before: i32, after: i32) -> Result<i32, SourceError> {
        if after == before {
            return Ok(after);
        }
        self.line.write(clock, &Write::WorkOffset { number: 0, axis: self.axis, value: after })?;
        let item = Item::WorkOffset(0, self.axis);
        let asked = self.line.ask(clock, &[item])?;
        self.increments(asked.of(item).and_then(|result| result.as_ref().ok()))
    }

    fn refused(&self, what: &str, next: &str) -> SourceError {
        SourceError::Refused {
            source_name: self.name.clone(),
            request: format!("the external work offset of axis {}", self.axis),
            what: what.to_owned(),
            next: next.to_owned(),
        }
    }
}

fn increments(um: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "saturates; limits are applied afterwards")]
    let whole = (um / INCREMENT_UM).round() as i32;
    whole
}

/// No gate may ask for more than this, whatever its configuration says.
const BOUNDS: ShiftLimits = ShiftLimits { step_um: 1000.0, total_um: 1000.0 };

/// The external offsets of the axes that the control names with the letters X, Y and Z.
pub struct ExternalOffsets {
    name: String,
    line: Line,
    axes: BTreeMap<Axis, ExternalOffset>,
    left: BTreeMap<Axis, Left>,
}

impl ExternalOffsets {
    /// Of the axes of this line's path. The address must allow `EXT`.
    #[must_use]
    pub fn new(name: &str, line: Line) -> Self {
        Self { name: name.to_owned(), line, axes: BTreeMap::new(), left: BTreeMap::new() }
    }

    /// The offset of this axis, whose number the control tells by the order of its names.
    fn of(&mut self, clock: &dyn Clock, axis: Axis) -> Result<&mut ExternalOffset, SourceError> {
        if !self.axes.contains_key(&axis) {
            let number = self.number(clock, axis)?;
            let mut offset = ExternalOffset::new(&self.name, self.line.clone(), number, BOUNDS);
            offset.ledger = self.left.get(&axis).map_or(Ledger::default(), |left| Ledger::with(*left));
            self.axes.insert(axis, offset);
        }
        self.axes.get_mut(&axis).ok_or_else(|| self::refused(&self.name, axis, "there is no such axis", "See doctor"))
    }

    fn number(&self, clock: &dyn Clock, axis: Axis) -> Result<i16, SourceError> {
        let facts = self.line.ask(clock, &[Item::Status])?.facts;
        let place = facts.axes.iter().position(|name| name.eq_ignore_ascii_case(axis.word()));
        let number = place.and_then(|place| i16::try_from(place + 1).ok());
        let next = format!("Its axes are {}; correct `axes` under [gate.offset]", facts.axes.join(", "));
        number.ok_or_else(|| refused(&self.name, axis, "the control has no axis of this name", &next))
    }
}

fn refused(name: &str, axis: Axis, what: &str, next: &str) -> SourceError {
    SourceError::Refused {
        source_name: name.to_owned(),
        request: format!("the external work offset of {}", axis.word()),
        what: what.to_owned(),
        next: next.to_owned(),
    }
}

/// The same in micrometres; an increment is one.
fn in_um(Shifted { before, asked, after, shift, changed_by_others }: Shifted) -> crate::offset::Shifted {
    let [before_um, asked_um, after_um, base_um] = [before, asked, after, after - shift].map(f64::from);
    crate::offset::Shifted { before_um, base_um, asked_um, after_um, changed_by_others }
}

impl OffsetSink for ExternalOffsets {
    fn name(&self) -> &str {
        &self.name
    }

    fn shift(&mut self, clock: &dyn Clock, axis: Axis, wanted_um: f64) -> Result<crate::offset::Shifted, SourceError> {
        self.of(clock, axis)?.shift(clock, wanted_um).map(in_um)
    }

    fn restore(&mut self, clock: &dyn Clock, axis: Axis) -> Result<Option<crate::offset::Shifted>, SourceError> {
        if !self.axes.contains_key(&axis) && !self.left.contains_key(&axis) {
            return Ok(None);
        }
        let restored = self.of(clock, axis)?.restore(clock)?;
        self.left.remove(&axis);
        Ok(restored.map(in_um))
    }

    fn resume(&mut self, axis: Axis, left: Left) {
        self.left.insert(axis, left);
        self.axes.remove(&axis);
    }
}
