//! The external work offsets of a FANUC control: what a thermal compensation shifts between programs and gives back. Only
//! the gate may hold them.
//!
//! The offset is in the coordinate of every work offset G54 to G59 and takes effect for blocks that are not yet
//! buffered; hence only while no program runs. The operator may use the external offset too; whose is which part of it is
//! the gate's account ([`adapter_core::offset::OffsetShares`]). Increment system IS-B in millimetres only, where an increment is a
//! micrometre.

use super::answer::{FocasAnswer, Status};
use super::item::{FocasItem, Write};
use super::line::{Asked, FanucLine};
use adapter_core::clock::Clock;
use adapter_core::driver::{SEE_DOCTOR, SourceError};
use adapter_core::offset::{Axis, OffsetSink};

/// The external offsets of the axes that the control names with the letters X, Y and Z.
pub struct ExternalOffsets {
    name: String,
    line: FanucLine,
    /// Numbers from 1, once known.
    numbers: [Option<i16>; Axis::ALL.len()],
}

impl ExternalOffsets {
    /// Of the axes of this line's path. The address must allow `EXT`.
    #[must_use]
    pub fn new(name: &str, line: FanucLine) -> Self {
        Self { name: name.to_owned(), line, numbers: Default::default() }
    }

    /// The number of this axis, which the control tells by the order of its names.
    fn find_axis_number(&mut self, clock: &dyn Clock, axis: Axis) -> Result<i16, SourceError> {
        if let Some(number) = self.numbers[axis.index()] {
            return Ok(number);
        }
        let facts = self.line.ask_items(clock, &[FocasItem::Status])?.facts;
        let not_told = |_| self.build_refusal(axis, "the control has not told the names of its axes", SEE_DOCTOR);
        let axes = facts.axes_of(self.line.path()).map_err(not_told)?;
        let place = axes.iter().position(|name| name.eq_ignore_ascii_case(axis.as_word()));
        let number = place.and_then(|place| i16::try_from(place + 1).ok());
        let next = format!("Its axes are {}; correct `axes` under [gate.offset]", axes.join(", "));
        self.numbers[axis.index()] = number;
        number.ok_or_else(|| self.build_refusal(axis, "the control has no axis of this name", &next))
    }

    fn offset_um(&self, axis: Axis, item: FocasItem, asked: &Asked) -> Result<f64, SourceError> {
        let Some(Ok(FocasAnswer::Number(Some(mm)))) = asked.find_item_result(item) else {
            return Err(self.build_refusal(axis, "the external offset cannot be read", SEE_DOCTOR));
        };
        let um = mm * 1000.0;
        if (um - um.round()).abs() > 1e-6 {
            return Err(self.build_refusal(
                axis,
                "the least increment is not 1 µm",
                "Only increment system IS-B is shifted",
            ));
        }
        Ok(um.round())
    }
}

impl OffsetSink for ExternalOffsets {
    fn name(&self) -> &str {
        &self.name
    }

    fn offset_name(&self) -> &'static str {
        "the external work offset"
    }

    fn at_rest(&mut self, clock: &dyn Clock, axis: Axis) -> Result<f64, SourceError> {
        let item = FocasItem::WorkOffset(0, self.find_axis_number(clock, axis)?);
        let asked = self.line.ask_items(clock, &[FocasItem::Status, item])?;
        let unit = match asked.facts.inch {
            Ok(false) => Ok(()),
            Ok(true) => Err(("the machine measures in inches", "Only machines in millimetres are shifted")),
            Err(_) => Err(("the control has not told whether it measures in inches", "It is asked again by itself")),
        };
        unit.map_err(|(what, next)| self.build_refusal(axis, what, next))?;
        let at_rest = match asked.find_item_result(FocasItem::Status) {
            Some(Ok(FocasAnswer::Status(Status { run, .. }))) => Some(*run == 0),
            _ => None,
        };
        self.check_movable(axis, at_rest)?;
        self.offset_um(axis, item, &asked)
    }

    /// Looks once more before it writes: a program may have been started, and the operator may have set something else.
    fn write(&mut self, clock: &dyn Clock, axis: Axis, found_um: f64, wanted_um: f64) -> Result<f64, SourceError> {
        let now_um = self.at_rest(clock, axis)?;
        self.check_unchanged(axis, now_um, found_um)?;
        let number = self.find_axis_number(clock, axis)?;
        #[expect(clippy::cast_possible_truncation, reason = "saturates; an increment is a micrometre")]
        let value = wanted_um.round() as i32;
        self.line.write(clock, &Write::WorkOffset { number: 0, axis: number, value })?;
        let item = FocasItem::WorkOffset(0, number);
        self.offset_um(axis, item, &self.line.ask_items(clock, &[item])?)
    }
}
