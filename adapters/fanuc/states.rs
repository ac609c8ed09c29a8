//! Signals and status words as states. Pure.
//!
//! Signals: B-63943EN, "Signal address list" (F000 to F004 from the control, G006 to G030 to it).

use super::answer::Status;
use super::feed_override;
use adapter_core::override_pct::OverridePct;
use adapter_core::reading::Absence;
use adapter_core::words::{execution, mode, operation};

/// A signal, or why it is not known.
pub type OrAbsence<T> = Result<T, Absence>;

/// Bytes F000 to F004 and G006 to G030 of a path, each with the reason where they could not be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Signals {
    control: OrAbsence<[u8; 5]>,
    ladder: OrAbsence<[u8; 25]>,
    /// Byte G096: the rapid override in steps of one percent, and whether it is in force.
    rapid_steps: OrAbsence<u8>,
}

impl Signals {
    /// From the two stretches, where they could be read.
    #[must_use]
    pub fn new(control: OrAbsence<&[i32]>, ladder: OrAbsence<&[i32]>, rapid_steps: OrAbsence<&[i32]>) -> Self {
        let rapid_steps = rapid_steps.and_then(convert_bytes).map(|[byte]: [u8; 1]| byte);
        Self { control: control.and_then(convert_bytes), ladder: ladder.and_then(convert_bytes), rapid_steps }
    }

    fn read_control_bit(&self, byte: usize, bit: u8) -> OrAbsence<bool> {
        self.control.map(|bytes| bytes[byte] >> bit & 1 == 1)
    }

    fn read_ladder_byte(&self, byte: usize) -> OrAbsence<u8> {
        self.ladder.map(|bytes| bytes[byte - 6])
    }

    /// F000.6 SA: the drives are ready.
    ///
    /// # Errors
    /// Why it is not known, here and below.
    pub fn drives_ready(&self) -> OrAbsence<bool> {
        self.read_control_bit(0, 6)
    }

    /// F001.5 TAP: tapping.
    ///
    /// # Errors
    /// As above.
    pub fn is_tapping(&self) -> OrAbsence<bool> {
        self.read_control_bit(1, 5)
    }

    /// F002.0 INCH: the program is in inches.
    ///
    /// # Errors
    /// As above.
    pub fn is_inch(&self) -> OrAbsence<bool> {
        self.read_control_bit(2, 0)
    }

    /// F002.1 RPDO: rapid traverse.
    ///
    /// # Errors
    /// As above.
    pub fn is_rapid(&self) -> OrAbsence<bool> {
        self.read_control_bit(2, 1)
    }

    /// F002.7 MDRN: dry run is on.
    ///
    /// # Errors
    /// As above.
    pub fn dry_run(&self) -> OrAbsence<bool> {
        self.read_control_bit(2, 7)
    }

    /// F002.3 THRD: a thread is cut.
    ///
    /// # Errors
    /// As above.
    pub fn is_threading(&self) -> OrAbsence<bool> {
        self.read_control_bit(2, 3)
    }

    /// F004.3 MSBK: single block is on.
    ///
    /// # Errors
    /// As above.
    pub fn single_block(&self) -> OrAbsence<bool> {
        self.read_control_bit(4, 3)
    }

    /// G006.4 OVC: overrides are cancelled.
    ///
    /// # Errors
    /// As above.
    pub fn override_cancelled(&self) -> OrAbsence<bool> {
        self.read_ladder_byte(6).map(|byte| byte >> 4 & 1 == 1)
    }

    /// The feed override in force, %: G012, and G013 where the machine has the second one; 100 where the control takes
    /// none.
    ///
    /// # Errors
    /// As above.
    pub fn feed_override(&self, second: bool) -> OrAbsence<f64> {
        let first = self.read_ladder_byte(12)?;
        if self.override_cancelled() == Ok(true) || self.is_tapping() == Ok(true) || self.is_threading() == Ok(true) {
            return Ok(100.0);
        }
        let percent = |byte| f64::from(feed_override::decode(byte).percent());
        let second = if second { percent(self.read_ladder_byte(13)?) } else { 100.0 };
        Ok((percent(first) * second / 100.0).min(f64::from(u8::MAX - 1)))
    }

    /// G030: spindle override, %, straight binary.
    ///
    /// # Errors
    /// As above.
    pub fn spindle_override(&self) -> OrAbsence<f64> {
        let pct = OverridePct::new(self.read_ladder_byte(30)?).ok_or(Absence::OutOfRange)?;
        Ok(f64::from(pct.percent()))
    }

    /// The rapid override in %. G096.7 HROV says whether the steps of one percent count, G096.0 to .6 *HROV0 to *HROV6 (inverted);
    /// else G014.0 and .1, ROV1 and ROV2. F0 is a speed and no share, so it is *not supported*. A control without G096 has no
    /// such steps; one that refuses the byte for now leaves open which of the two count.
    ///
    /// # Errors
    /// As above.
    pub fn rapid_override(&self) -> OrAbsence<f64> {
        let steps = match self.rapid_steps {
            Err(Absence::NotSupported) => 0,
            steps => steps?,
        };
        if steps & 0x80 != 0 {
            let percent = !steps & 0x7F;
            return if percent <= 100 { Ok(f64::from(percent)) } else { Err(Absence::OutOfRange) };
        }
        match self.read_ladder_byte(14)? & 0b11 {
            0b00 => Ok(100.0),
            0b01 => Ok(50.0),
            0b10 => Ok(25.0),
            _ => Err(Absence::NotSupported),
        }
    }

    /// G010 and G011, *JV0 to *JV15: override of the feed in manual operation, %; inverted hundredths of a percent. All bits
    /// 0 count like all bits 1: 0 %.
    ///
    /// # Errors
    /// As above.
    pub fn jog_override(&self) -> OrAbsence<f64> {
        let hundredths = !u16::from_le_bytes([self.read_ladder_byte(10)?, self.read_ladder_byte(11)?]);
        Ok(if hundredths == u16::MAX { 0.0 } else { f64::from(hundredths) / 100.0 })
    }

    /// What the feed follows the spindle in.
    ///
    /// # Errors
    /// As above; nothing of the kind is *not supported*.
    pub fn find_operation(&self) -> OrAbsence<&'static str> {
        match (self.is_threading()?, self.is_tapping()?) {
            (_, true) => Ok(operation::TAPPING),
            (true, _) => Ok(operation::THREADING),
            _ => Err(Absence::NotSupported),
        }
    }
}

fn convert_bytes<const N: usize>(values: &[i32]) -> OrAbsence<[u8; N]> {
    let bytes: Vec<u8> = values.iter().filter_map(|value| u8::try_from(*value).ok()).collect();
    bytes.try_into().map_err(|_| Absence::OutOfRange)
}

/// The word of the channel `mode`; `None` when the control shows none.
#[must_use]
pub fn name_mode(status: &Status, single_block: bool) -> Option<&'static str> {
    match status.automatic {
        1 | 10 if single_block => Some(mode::SEMI_AUTOMATIC),
        1 | 10 => Some(mode::AUTOMATIC),
        0 => Some(mode::MANUAL_DATA_INPUT),
        3 => Some(mode::EDIT),
        4..=9 => Some(mode::MANUAL),
        _ => None,
    }
}

/// The word of the channel `execution`.
#[must_use]
pub fn name_execution(status: &Status, feed_override_pct: Option<f64>) -> Option<&'static str> {
    if status.emergency != 0 {
        return Some(execution::STOPPED);
    }
    match status.run {
        0 => Some(execution::READY),
        1 => Some(execution::STOPPED),
        2 => Some(execution::FEED_HOLD),
        3 if feed_override_pct == Some(0.0) => Some(execution::INTERRUPTED),
        3 | 4 => Some(execution::ACTIVE),
        _ => None,
    }
}

/// The word of the channel `motion`.
#[must_use]
pub fn name_motion(status: &Status) -> Option<&'static str> {
    match status.motion {
        0 => Some("NONE"),
        1 => Some("MOTION"),
        2 => Some("DWELL"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(automatic: i16, run: i16) -> Status {
        Status { automatic, run, ..Status::default() }
    }

    fn signals(changes: &[(char, usize, u8)]) -> Signals {
        let (mut control, mut ladder) = ([0; 5], [0; 25]);
        ladder[6] = i32::from(feed_override::encode(OverridePct::FULL));
        ladder[24] = 100;
        for (letter, byte, value) in changes {
            let place = if *letter == 'F' { &mut control[*byte] } else { &mut ladder[byte - 6] };
            *place = i32::from(*value);
        }
        Signals::new(Ok(&control), Ok(&ladder), Ok(&[0]))
    }

    #[test]
    fn every_mode_word_has_a_state() {
        let words: Vec<_> = (0..=10).map(|word| name_mode(&status(word, 0), false)).collect();
        let manual = Some("MANUAL");
        let expected = [Some("MANUAL_DATA_INPUT"), Some("AUTOMATIC"), None, Some("EDIT")];
        assert_eq!(words[..4], expected);
        assert_eq!(words[4..10], [manual; 6]);
        assert_eq!(words[10], Some("AUTOMATIC"));
        assert_eq!(name_mode(&status(1, 0), true), Some("SEMI_AUTOMATIC"));
        assert_eq!(name_mode(&status(77, 0), false), None);
    }

    #[test]
    fn every_run_word_has_a_state() {
        let words: Vec<_> = (0..=5).map(|word| name_execution(&status(1, word), Some(100.0))).collect();
        assert_eq!(words, [Some("READY"), Some("STOPPED"), Some("FEED_HOLD"), Some("ACTIVE"), Some("ACTIVE"), None]);
        assert_eq!(name_execution(&status(1, 3), Some(0.0)), Some("INTERRUPTED"));
        assert_eq!(name_execution(&Status { emergency: 1, ..status(1, 3) }, None), Some("STOPPED"));
    }

    #[test]
    fn overrides_as_the_signals_give_them() {
        assert_eq!(signals(&[]).feed_override(false), Ok(100.0));
        assert_eq!(signals(&[('G', 12, 0xAF)]).feed_override(false), Ok(80.0));
        assert_eq!(signals(&[('G', 12, 0x00)]).feed_override(false), Ok(0.0), "all bits 0 are 0 %, not 255 %");
        assert_eq!(signals(&[('G', 12, 0xFF)]).feed_override(false), Ok(0.0));
        assert_eq!(signals(&[('G', 12, 0xAF), ('G', 13, 0xCD)]).feed_override(true), Ok(40.0));
        assert_eq!(signals(&[('G', 12, 0xAF), ('G', 6, 0x10)]).feed_override(false), Ok(100.0), "cancelled");
        assert_eq!(signals(&[('G', 12, 0xAF), ('F', 2, 0x08)]).feed_override(false), Ok(100.0), "threading");
        assert_eq!(signals(&[]).spindle_override(), Ok(100.0));
        assert_eq!(
            Signals::new(Err(Absence::Refused), Err(Absence::Refused), Ok(&[0])).feed_override(false),
            Err(Absence::Refused)
        );
    }

    #[test]
    fn threads_and_single_block_are_told_by_signals() {
        assert_eq!(signals(&[('F', 1, 0x20)]).find_operation(), Ok("tapping"));
        assert_eq!(signals(&[('F', 2, 0x08)]).find_operation(), Ok("threading"));
        assert_eq!(signals(&[]).find_operation(), Err(Absence::NotSupported));
        assert_eq!(signals(&[('F', 4, 0x08)]).single_block(), Ok(true));
        assert_eq!(signals(&[('F', 2, 0x02)]).is_rapid(), Ok(true));
    }

    #[test]
    fn rapid_and_jog_overrides_as_the_signals_give_them() {
        let rapid = |byte| signals(&[('G', 14, byte)]).rapid_override();
        assert_eq!([rapid(0), rapid(1), rapid(2)], [Ok(100.0), Ok(50.0), Ok(25.0)]);
        assert_eq!(rapid(3), Err(Absence::NotSupported), "F0 is a speed");
        let with_steps = |steps: OrAbsence<i32>| {
            let ladder = [0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
            let steps = steps.map(|byte| [byte]);
            Signals::new(Ok(&[0; 5]), Ok(&ladder), steps.as_ref().map(|byte| &byte[..]).map_err(|why| *why))
                .rapid_override()
        };
        assert_eq!([with_steps(Ok(0xE1)), with_steps(Ok(0xFF)), with_steps(Ok(0x9B))], [Ok(30.0), Ok(0.0), Ok(100.0)]);
        assert_eq!(with_steps(Ok(0x61)), Ok(50.0), "HROV is off");
        assert_eq!(with_steps(Ok(0x80)), Err(Absence::OutOfRange), "127 %");
        assert_eq!(with_steps(Err(Absence::NotSupported)), Ok(50.0), "a control without them");
        assert_eq!(with_steps(Err(Absence::Refused)), Err(Absence::Refused), "nobody knows which of them count");
        let jog = |low, high| signals(&[('G', 10, low), ('G', 11, high)]).jog_override();
        // 100.00 % is 10000 hundredths, 0x2710; inverted 0xD8EF, the low byte first.
        assert_eq!([jog(0xEF, 0xD8), jog(0xFF, 0xFF), jog(0, 0)], [Ok(100.0), Ok(0.0), Ok(0.0)]);
    }
}
