//! Shifts of axes through the vendor's library: by registers that the ladder reads, or by the channel's external zero
//! offset.
//!
//! The external zero offset (coordinate type 9 of the vendor's headers, in counts) is taken up with the next program. What a
//! count is has to be compared once at the panel and is said in the address; it must be what the control itself calls the
//! unit of its positions. On a lathe X is shifted in what the control shows of X, which may be a diameter. Nothing is saved
//! in the control: the power should take it back to what the operator has saved.

use super::answer::{HncAnswer, HncItemError, HncItemResult};
use super::decode::{extract_text, extract_whole};
use super::item::{self, HncItem, HncWidth, axis, channel, define_register, define_whole_item};
use super::line::HncLine;
use adapter_core::clock::Clock;
use adapter_core::driver::{SEE_DOCTOR, SourceError};
use adapter_core::offset::{Axis, OffsetSink};
use nclink::mailbox::ControllerRegister;
use nclink::offset_mailbox::RegisterAccess;

/// Axes whose names are asked for.
const AXES: i32 = 3;

/// Nothing runs and nothing is held; `None` where the controller does not say.
const STATE: [HncItem; 2] = [define_whole_item(channel::CYCLE), define_whole_item(channel::HOLD)];

fn at_rest(state: &[HncItemResult]) -> Option<bool> {
    let flags: Result<Vec<i32>, _> = state.iter().map(extract_whole).collect();
    flags.ok().map(|flags| flags.iter().all(|flag| *flag == 0))
}

/// The registers of the ladder.
pub(super) struct HncRegisters(pub(super) HncLine);

impl RegisterAccess for HncRegisters {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn read_registers(
        &mut self,
        first: ControllerRegister,
        count: u32,
    ) -> Result<(Vec<i64>, Option<bool>), SourceError> {
        let register =
            |offset| define_register(ControllerRegister { index: first.index.checked_add(offset)?, ..first });
        let registers: Option<Vec<HncItem>> = (0..count).map(register).collect();
        let Some(registers) = registers else {
            return Err(self.0.refuse_register(&format!("reading {count} registers from {first}")));
        };
        let items: Vec<HncItem> = STATE.into_iter().chain(registers).collect();
        let mut results = self.0.read_each(&items)?;
        let words = results.split_off(STATE.len());
        let words = words.iter().filter_map(|word| extract_whole(word).ok()).map(i64::from).collect();
        Ok((words, at_rest(&results)))
    }

    fn write(&mut self, words: &[(ControllerRegister, i64)]) -> Result<(), SourceError> {
        self.0.write(words)
    }
}

/// The channel's external zero offsets.
pub(super) struct ZeroOffsets {
    line: HncLine,
    /// What a count is, µm.
    unit_um: f64,
    /// Logical axes, once known.
    numbers: [Option<i32>; Axis::ALL.len()],
}

impl ZeroOffsets {
    pub(super) fn new(line: HncLine, unit_um: f64) -> Self {
        Self { line, unit_um, numbers: Default::default() }
    }

    /// The logical axis of this letter, which the control is asked for once.
    fn find_axis_number(&mut self, axis: Axis) -> Result<i32, SourceError> {
        if let Some(number) = self.numbers[axis.index()] {
            return Ok(number);
        }
        let names: Vec<HncItem> = (0..AXES).map(|number| HncItem::Axis(axis::NAME, number, HncWidth::Text)).collect();
        let found = self.line.read_each(&names)?;
        let named = |name: &HncItemResult| {
            extract_text(name).is_ok_and(|name| Axis::from_word(name.get(..1).unwrap_or("")) == Some(axis))
        };
        let number = found.iter().position(named).and_then(|at| i32::try_from(at).ok());
        self.numbers[axis.index()] = number;
        number.ok_or_else(|| {
            self.build_refusal(axis, "the control has no axis of this name", "Correct `axes` under [gate.offset].")
        })
    }

    /// What the address says a count is must be what the control says of its positions.
    fn same_unit(&self, axis: Axis, per_mm: &HncItemResult) -> Result<(), SourceError> {
        let unit_um = extract_whole(per_mm).ok().filter(|per_mm| *per_mm > 0).map(|per_mm| 1000.0 / f64::from(per_mm));
        match unit_um {
            Some(unit_um) if (unit_um / self.unit_um - 1.0).abs() < 1e-6 => Ok(()),
            Some(unit_um) => {
                let what = format!("a count is {unit_um} µm for the control and {} µm in the address", self.unit_um);
                Err(self.build_refusal(axis, &what, "Compare one shift at the panel and correct offset_unit_um=."))
            }
            None => Err(self.build_refusal(axis, "the control does not say what a count is", SEE_DOCTOR)),
        }
    }

    fn offset_um(&self, axis: Axis, found: &HncItemResult) -> Result<f64, SourceError> {
        let what = match found {
            Ok(HncAnswer::Whole(counts)) => return self.whole_um(axis, *counts),
            Err(HncItemError::NotOffered) => "the library has no HNC_CrdsGetValue".to_owned(),
            other => format!("the external zero offset cannot be read ({other:?})"),
        };
        Err(self.build_refusal(axis, &what, "Write offset=D110 in the address, with rungs in the ladder."))
    }

    fn whole_um(&self, axis: Axis, counts: i32) -> Result<f64, SourceError> {
        let um = f64::from(counts) * self.unit_um;
        if (um - um.round()).abs() < 1e-3 {
            return Ok(um.round());
        }
        let next = "Round the external zero offset to whole micrometres at the panel.";
        Err(self.build_refusal(axis, &format!("the operator has set {um} µm, which is not whole"), next))
    }
}

impl OffsetSink for ZeroOffsets {
    fn name(&self) -> &str {
        self.line.name()
    }

    fn offset_name(&self) -> &'static str {
        "the external zero offset"
    }

    fn at_rest(&mut self, _: &dyn Clock, axis: Axis) -> Result<f64, SourceError> {
        let zero = HncItem::ExternalZero(self.find_axis_number(axis)?);
        let [cycle, hold] = STATE;
        let found = self.line.read_each(&[cycle, hold, item::MOVE_UNIT, zero])?;
        let [state @ .., per_mm, zero] = found.as_slice() else {
            return Err(self.build_refusal(axis, "the control does not answer", SEE_DOCTOR));
        };
        self.check_movable(axis, at_rest(state))?;
        self.same_unit(axis, per_mm)?;
        self.offset_um(axis, zero)
    }

    /// Looks once more before it writes: a program may have been started, and the operator may have set something else.
    fn write(&mut self, clock: &dyn Clock, axis: Axis, found_um: f64, wanted_um: f64) -> Result<f64, SourceError> {
        let now_um = self.at_rest(clock, axis)?;
        self.check_unchanged(axis, now_um, found_um)?;
        let number = self.find_axis_number(axis)?;
        #[expect(clippy::cast_possible_truncation, reason = "saturates; the gate has limited it")]
        let counts = (wanted_um / self.unit_um).round() as i32;
        self.line.write_zero(number, counts)?;
        let found = self.line.read(HncItem::ExternalZero(number))?;
        self.offset_um(axis, &found)
    }
}
