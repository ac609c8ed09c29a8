//! The external work offset of one axis: what a thermal compensation shifts, between programs, by small steps, and
//! gives back. Only the gate may hold one.
//!
//! The offset is in the coordinate of every work offset G54 to G59 and takes effect for blocks that are not yet
//! buffered; hence only while no program runs. The operator may use the external offset too: what was there is kept
//! and the shift is added to it, and a value that somebody changed in between is the new starting point.

use super::answer::{Answer, Status};
use super::item::{Item, Write};
use super::line::Line;
use crate::clock::Clock;
use crate::driver::SourceError;

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
    /// What the operator had set, and what was written last.
    known: Option<(i32, i32)>,
}

impl ExternalOffset {
    /// Of this axis from 1. The address must allow `EXT`.
    #[must_use]
    pub fn new(name: &str, line: Line, axis: i16, limits: ShiftLimits) -> Self {
        Self { name: name.to_owned(), line, axis, limits, known: None }
    }

    /// Shifts towards `wanted_um` from what the operator had set, by one step at most.
    ///
    /// # Errors
    /// A program runs, the machine measures in inches, the control refuses, or what is read back is not what was
    /// written.
    pub fn shift(&mut self, clock: &dyn Clock, wanted_um: f64) -> Result<Shifted, SourceError> {
        let before = self.at_rest(clock)?;
        let (base, changed_by_others) = match self.known {
            Some((base, written)) if written == before => (base, false),
            Some(_) => (before, true),
            None => (before, false),
        };
        let total = increments(self.limits.total_um);
        let wanted = base.saturating_add(increments(wanted_um).clamp(-total, total));
        let step = increments(self.limits.step_um).max(1);
        let after = before.saturating_add(wanted.saturating_sub(before).clamp(-step, step));
        self.write(clock, before, after)?;
        self.known = Some((base, after));
        Ok(Shifted { before, after, shift: after - base, changed_by_others })
    }

    /// Gives back what the operator had set, in one step, unless somebody changed it.
    ///
    /// # Errors
    /// As for [`ExternalOffset::shift`].
    pub fn restore(&mut self, clock: &dyn Clock) -> Result<Option<Shifted>, SourceError> {
        let Some((base, written)) = self.known else { return Ok(None) };
        let before = self.at_rest(clock)?;
        let changed_by_others = before != written;
        let after = if changed_by_others { before } else { base };
        self.write(clock, before, after)?;
        self.known = None;
        Ok(Some(Shifted { before, after, shift: 0, changed_by_others }))
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

    fn write(&self, clock: &dyn Clock, before: i32, after: i32) -> Result<(), SourceError> {
        if after == before {
            return Ok(());
        }
        self.line.write(clock, &Write::WorkOffset { number: 0, axis: self.axis, value: after })?;
        let item = Item::WorkOffset(0, self.axis);
        let asked = self.line.ask(clock, &[item])?;
        let found = self.increments(asked.of(item).and_then(|result| result.as_ref().ok()))?;
        if found == after {
            return Ok(());
        }
        Err(self.refused(&format!("{after} µm was written and {found} µm is there"), "Look who else writes it"))
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
