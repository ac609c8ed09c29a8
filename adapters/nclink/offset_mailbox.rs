//! Eight registers through which the gateway asks the ladder to shift axes, and what the ladder has made of it.
//!
//! A Huazhong controller compensates an axis in real time by two G registers of the axis (words 36 and 37 in the vendor's
//! register map). Written from outside, one half of the number could be taken without the other, and the unit is not
//! published. So the builder of the machine is asked for a few rungs, which read whole micrometres from free registers (W or
//! D; R is too short, B keeps its contents without power), scale them, and limit how far and how fast they go:
//!
//! | register | written by | what |
//! |---|---|---|
//! | +0, +1, +2 | gateway | wanted shift of X, Y and Z, µm, with sign |
//! | +3 | gateway | number of the letter, 1 to 100 and around; written last |
//! | +4, +5, +6 | ladder | shift in force, µm |
//! | +7 | ladder | number of the letter that it has taken |
//!
//! The ladder takes a letter whose number is another one than in +7 while no program runs and none is held, and copies the
//! number when the shift is in force. There is no heartbeat: a shift that jumped back because a network broke would be
//! worse than one that nobody follows up. When the power comes on nothing is shifted. A letter that is not taken within a
//! second is withdrawn (+3 gets the number in +7), so that it is not taken at some later time.

use super::mailbox::ControllerRegister;
use adapter_core::clock::Clock;
use adapter_core::driver::SourceError;
use adapter_core::offset::{Axis, OffsetSink};

/// Between two looks whether the letter was taken, ns.
const SETTLE_NS: i64 = 100_000_000;
/// The registers are looked at this often before a letter counts as not taken.
const LOOKS: u32 = 10;

/// Registers of a controller, however they are reached.
pub trait RegisterAccess: Send {
    /// The address, as in the configuration.
    fn name(&self) -> &str;

    /// These registers from the first on; and is nothing running and nothing held, where the controller says so?
    ///
    /// # Errors
    /// The controller refuses, or the line failed.
    fn read_registers(
        &mut self,
        first: ControllerRegister,
        count: u32,
    ) -> Result<(Vec<i64>, Option<bool>), SourceError>;

    /// Writes registers, in this order.
    ///
    /// # Errors
    /// The controller refuses, or the line failed.
    fn write(&mut self, words: &[(ControllerRegister, i64)]) -> Result<(), SourceError>;
}

/// Where the registers lie, and what is in them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OffsetMailbox {
    first: ControllerRegister,
}

/// What stands in the registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Letters {
    /// Offsets of X, Y and Z that are wanted, µm.
    pub wanted_um: [i64; 3],
    /// Number of the letter.
    pub number: i64,
    /// Offsets of X, Y and Z in force, µm.
    pub in_force_um: [i64; 3],
    /// Number of the letter taken.
    pub taken: i64,
}

impl OffsetMailbox {
    /// Number of the letter.
    const NUMBER: u32 = 3;
    /// The first of the ladder's registers.
    pub const LADDERS: u32 = 4;
    /// Registers of the mailbox in all.
    pub const LENGTH: u32 = 8;

    /// The mailbox that begins at this register.
    #[must_use]
    pub fn new(first: ControllerRegister) -> Self {
        Self { first }
    }

    /// Can one begin there? It must be memory for numbers with a sign that clients may write and that forgets without power.
    #[must_use]
    pub fn may_begin(at: ControllerRegister) -> bool {
        matches!(at.kind, 'W' | 'D')
    }

    /// The register this far behind the first.
    #[must_use]
    pub fn register_at(&self, offset: u32) -> ControllerRegister {
        ControllerRegister { index: self.first.index + offset, ..self.first }
    }

    /// Its first register and its last.
    #[must_use]
    pub fn end_registers(&self) -> [ControllerRegister; 2] {
        [self.first, self.register_at(Self::LENGTH - 1)]
    }

    /// A register as a number with a sign: some interfaces tell W registers, which have 16 bits, and D registers, which
    /// have 32, without it.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "the low part is meant")]
    pub fn decode_signed(&self, word: i64) -> i64 {
        if self.first.kind == 'W' { i64::from(word as i16) } else { i64::from(word as i32) }
    }

    /// What these eight values say.
    #[must_use]
    pub fn read(words: &[i64]) -> Option<Letters> {
        let [x, y, z, number, in_x, in_y, in_z, taken] = *words else { return None };
        Some(Letters { wanted_um: [x, y, z], number, in_force_um: [in_x, in_y, in_z], taken })
    }

    /// A letter that wants these shifts, as registers in the order in which they are to be written.
    #[must_use]
    pub fn build_letter(&self, wanted_um: [i64; 3], found: &Letters) -> [(ControllerRegister, i64); 4] {
        let [x, y, z] = wanted_um;
        let number = found.taken.rem_euclid(100) + 1;
        [
            (self.register_at(0), x),
            (self.register_at(1), y),
            (self.register_at(2), z),
            (self.register_at(Self::NUMBER), number),
        ]
    }

    /// What the ladder writes when it has taken a letter.
    #[must_use]
    pub fn build_ladder_answer(&self, in_force_um: [i64; 3], number: i64) -> [(ControllerRegister, i64); 4] {
        let [x, y, z] = in_force_um;
        let at = |offset| self.register_at(Self::LADDERS + offset);
        [(at(0), x), (at(1), y), (at(2), z), (at(3), number)]
    }
}

/// The shifts of X, Y and Z behind such a mailbox. Nobody but the gateway writes them: what the operator has set is
/// elsewhere, and here it is 0.
pub struct LadderOffsets<R> {
    registers: R,
    mailbox: OffsetMailbox,
}

impl<R: RegisterAccess> LadderOffsets<R> {
    /// A mailbox that begins at this register.
    pub fn new(registers: R, first: ControllerRegister) -> Self {
        Self { registers, mailbox: OffsetMailbox::new(first) }
    }

    /// What stands there; and is nothing running? Values that have not arrived yet are waited for.
    fn read_letters(&mut self, clock: &dyn Clock, axis: Axis) -> Result<(Letters, Option<bool>), SourceError> {
        for look in 0..LOOKS {
            if look > 0 {
                clock.sleep_until(clock.now_ns().saturating_add(SETTLE_NS));
            }
            let (words, at_rest) = self.registers.read_registers(self.mailbox.register_at(0), OffsetMailbox::LENGTH)?;
            let words: Vec<i64> = words.iter().map(|word| self.mailbox.decode_signed(*word)).collect();
            if let Some(letters) = OffsetMailbox::read(&words) {
                return Ok((letters, at_rest));
            }
        }
        let [first, last] = self.mailbox.end_registers();
        let next = "Name eight free registers with offset= in the address.";
        Err(self.build_refusal(axis, &format!("{first} to {last} cannot be read"), next))
    }

    /// What stands there while nothing runs.
    fn read_letters_at_rest(&mut self, clock: &dyn Clock, axis: Axis) -> Result<Letters, SourceError> {
        let (letters, at_rest) = self.read_letters(clock, axis)?;
        self.check_movable(axis, at_rest).map(|()| letters)
    }

    fn not_taken(&self, axis: Axis) -> SourceError {
        let [first, last] = self.mailbox.end_registers();
        let what = format!("not held: no ladder takes the letter in {first} to {last}");
        self.build_refusal(axis, &what, "Let the machine's maker add the rungs, or compare offset= with the ladder.")
    }
}

impl<R: RegisterAccess> OffsetSink for LadderOffsets<R> {
    fn name(&self) -> &str {
        self.registers.name()
    }

    fn offset_name(&self) -> &'static str {
        "the offset"
    }

    fn at_rest(&mut self, clock: &dyn Clock, axis: Axis) -> Result<f64, SourceError> {
        self.read_letters_at_rest(clock, axis).map(|letters| to_micrometres(letters.in_force_um[axis.index()]))
    }

    /// Looks once more before it writes: a program may have been started.
    fn write(&mut self, clock: &dyn Clock, axis: Axis, found_um: f64, wanted_um: f64) -> Result<f64, SourceError> {
        let found = self.read_letters_at_rest(clock, axis)?;
        self.check_unchanged(axis, to_micrometres(found.in_force_um[axis.index()]), found_um)?;
        let mut wanted = found.in_force_um;
        #[expect(clippy::cast_possible_truncation, reason = "saturates; the gate has limited it")]
        let whole_um = wanted_um.round() as i64;
        wanted[axis.index()] = whole_um;
        let letter = self.mailbox.build_letter(wanted, &found);
        self.registers.write(&letter)?;
        let (number_at, number) = letter[3];
        for _ in 0..LOOKS {
            clock.sleep_until(clock.now_ns().saturating_add(SETTLE_NS));
            let (letters, _) = self.read_letters(clock, axis)?;
            if letters.taken == number {
                return Ok(to_micrometres(letters.in_force_um[axis.index()]));
            }
        }
        self.registers.write(&[(number_at, found.taken)])?;
        Err(self.not_taken(axis))
    }
}

#[expect(clippy::cast_precision_loss, reason = "a shift has few digits")]
fn to_micrometres(count: i64) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::clock::ScaledClock;
    use std::sync::{Arc, Mutex};

    const FIRST: ControllerRegister = ControllerRegister { kind: 'D', index: 110 };

    /// Registers with rungs that work, unless they are deaf.
    #[derive(Clone, Default)]
    struct Control(Arc<Mutex<Inner>>);

    #[derive(Default)]
    struct Inner {
        words: [i64; 8],
        running: bool,
        deaf: bool,
    }

    impl RegisterAccess for Control {
        fn name(&self) -> &str {
            "nclink://x"
        }

        fn read_registers(
            &mut self,
            first: ControllerRegister,
            count: u32,
        ) -> Result<(Vec<i64>, Option<bool>), SourceError> {
            assert_eq!((first, count), (FIRST, OffsetMailbox::LENGTH));
            let mut inner = self.0.lock().expect("whole");
            if !inner.deaf && !inner.running && inner.words[3] != inner.words[7] {
                inner.words.copy_within(0..4, 4);
            }
            Ok((inner.words.to_vec(), Some(!inner.running)))
        }

        fn write(&mut self, words: &[(ControllerRegister, i64)]) -> Result<(), SourceError> {
            let mut inner = self.0.lock().expect("whole");
            words.iter().for_each(|(at, value)| inner.words[usize::try_from(at.index - 110).expect("ours")] = *value);
            Ok(())
        }
    }

    #[test]
    fn shifts_are_taken_one_axis_at_a_time() {
        let (control, clock) = (Control::default(), ScaledClock::new(1000.0));
        let mut sink = LadderOffsets::new(control.clone(), FIRST);
        assert_eq!(sink.at_rest(&clock, Axis::X), Ok(0.0));
        assert_eq!(sink.write(&clock, Axis::X, 0.0, -4.0), Ok(-4.0));
        assert_eq!(sink.write(&clock, Axis::Z, 0.0, 7.4), Ok(7.0));
        assert_eq!(control.0.lock().expect("whole").words, [-4, 0, 7, 2, -4, 0, 7, 2]);
        assert_eq!(sink.write(&clock, Axis::Z, 7.0, 0.0), Ok(0.0));
        assert_eq!(control.0.lock().expect("whole").words[4..7], [-4, 0, 0], "X stays");
        let error = sink.write(&clock, Axis::X, 0.0, 1.0).expect_err("it stands at -4").to_string();
        assert!(error.contains("somebody has just changed it"), "{error}");
    }

    #[test]
    fn nothing_is_written_in_a_program_and_a_letter_that_nobody_takes_is_withdrawn() {
        let (control, clock) = (Control::default(), ScaledClock::new(1000.0));
        let mut sink = LadderOffsets::new(control.clone(), FIRST);
        control.0.lock().expect("whole").running = true;
        sink.at_rest(&clock, Axis::Z).expect_err("a program");
        let error = sink.write(&clock, Axis::Z, 0.0, 5.0).expect_err("a program").to_string();
        assert!(error.contains("a program runs") && control.0.lock().expect("whole").words == [0; 8], "{error}");
        (control.0.lock().expect("whole").running, control.0.lock().expect("whole").deaf) = (false, true);
        let error = sink.write(&clock, Axis::Z, 0.0, 5.0).expect_err("no rungs").to_string();
        assert!(error.contains("D110 to D117") && error.contains("rungs"), "{error}");
        control.0.lock().expect("whole").deaf = false;
        assert_eq!(sink.write(&clock, Axis::X, 0.0, 3.0), Ok(3.0));
        assert_eq!(control.0.lock().expect("whole").words[4..7], [3, 0, 0], "the letter for Z was withdrawn");
    }

    #[test]
    fn w_registers_have_sixteen_bits_with_a_sign() {
        let signed = |kind, word| OffsetMailbox::new(ControllerRegister { kind, index: 0 }).decode_signed(word);
        assert_eq!((signed('W', 65_531), signed('D', 65_531), signed('D', 0xFFFF_FFFB)), (-5, 65_531, -5));
    }
}
