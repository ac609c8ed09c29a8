//! Values to words and text.

use super::answer::{HncAnswer, HncItemError, HncItemResult};
use super::item::{HncItem, channel, define_whole_item};
use adapter_core::reading::Absence;
use adapter_core::text::TextEncoding;
use adapter_core::words::{execution, mode, operation};

/// Text up to the first zero, out of GBK; bytes that are none stay as marks.
pub(super) fn text_of(bytes: &[u8]) -> String {
    TextEncoding::Named(encoding_rs::GBK).decode_trimmed(bytes)
}

/// The whole number of an answer.
pub(super) fn extract_whole(result: &HncItemResult) -> Result<i32, Absence> {
    match result {
        Ok(HncAnswer::Whole(number)) => Ok(*number),
        Ok(_) => Err(Absence::OutOfRange),
        Err(error) => Err(error.to_absence()),
    }
}

/// The number of an answer.
pub(super) fn extract_number(result: &HncItemResult) -> Result<f64, Absence> {
    match result {
        Ok(HncAnswer::Real(number)) => Ok(*number),
        other => extract_whole(other).map(f64::from),
    }
}

/// The text of an answer.
pub(super) fn extract_text(result: &HncItemResult) -> Result<&str, Absence> {
    match result {
        Ok(HncAnswer::Text(text)) => Ok(text),
        Ok(_) => Err(Absence::OutOfRange),
        Err(error) => Err(error.to_absence()),
    }
}

/// The alarms as one text, empty without any.
pub(super) fn format_alarms(result: &HncItemResult) -> Result<String, Absence> {
    match result {
        Ok(HncAnswer::Alarms(alarms)) => {
            let each: Vec<String> = alarms.iter().map(|(number, text)| format!("{number} {text}")).collect();
            Ok(each.join("; "))
        }
        Ok(_) => Err(Absence::OutOfRange),
        Err(error) => Err(error.to_absence()),
    }
}

/// Answers by item; what was not asked for is not offered.
pub(super) trait Answers {
    /// The answer to an item.
    fn find_answer(&self, item: HncItem) -> HncItemResult;

    /// A whole number of the channel.
    fn find_number(&self, kind: i32) -> Result<i32, Absence> {
        extract_whole(&self.find_answer(define_whole_item(kind)))
    }

    /// Is a flag set? A flag that the controller does not have is not.
    fn is_flag_set(&self, kind: i32) -> Result<bool, Absence> {
        match self.find_answer(define_whole_item(kind)) {
            Err(HncItemError::NotOffered | HncItemError::Refused(-2)) => Ok(false),
            other => extract_whole(&other).map(|flag| flag != 0),
        }
    }

    /// The word of the channel `mode`.
    fn find_mode(&self) -> Result<&'static str, Absence> {
        Ok(match self.find_number(channel::MODE)? {
            _ if self.is_flag_set(channel::IS_MDI)? => mode::MANUAL_DATA_INPUT,
            1 => mode::AUTOMATIC,
            7 => mode::SEMI_AUTOMATIC,
            _ => mode::MANUAL,
        })
    }

    /// The word of the channel `execution`.
    fn find_execution(&self) -> Result<&'static str, Absence> {
        let cycle = self.find_number(channel::CYCLE)? != 0;
        let hold = self.find_number(channel::HOLD)? != 0;
        Ok(match () {
            () if self.is_flag_set(channel::IS_ESTOP)? || self.is_flag_set(channel::IS_RESETTING)? => {
                execution::STOPPED
            }
            () if hold => execution::FEED_HOLD,
            () if cycle && self.is_flag_set(channel::VERIFY)? => execution::READY,
            () if cycle => execution::ACTIVE,
            () => execution::READY,
        })
    }

    /// Does the feed follow the spindle? The controller does not name operations otherwise.
    fn find_operation(&self) -> Result<&'static str, Absence> {
        if self.is_flag_set(channel::IS_THREADING)? {
            return Ok(operation::THREADING);
        }
        if self.is_flag_set(channel::IS_RIGID)? { Ok(operation::TAPPING) } else { Err(Absence::NotSupported) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    impl Answers for HashMap<i32, i32> {
        fn find_answer(&self, item: HncItem) -> HncItemResult {
            let HncItem::Channel(kind, ..) = item else { return Err(HncItemError::NotOffered) };
            self.get(&kind).map(|value| HncAnswer::Whole(*value)).ok_or(HncItemError::NotOffered)
        }
    }

    fn machine(flags: &[(i32, i32)]) -> HashMap<i32, i32> {
        let base = [(channel::MODE, 1), (channel::CYCLE, 1), (channel::HOLD, 0)];
        base.iter().chain(flags).copied().collect()
    }

    #[test]
    fn flags_become_words() {
        let words = |flags: &[(i32, i32)]| {
            let machine = machine(flags);
            (machine.find_mode().expect("known"), machine.find_execution().expect("known"))
        };
        assert_eq!(words(&[]), (mode::AUTOMATIC, execution::ACTIVE));
        assert_eq!(words(&[(channel::HOLD, 1)]), (mode::AUTOMATIC, execution::FEED_HOLD));
        assert_eq!(words(&[(channel::CYCLE, 0), (channel::MODE, 2)]), (mode::MANUAL, execution::READY));
        assert_eq!(words(&[(channel::VERIFY, 1)]).1, execution::READY);
        assert_eq!(words(&[(channel::IS_ESTOP, 1)]).1, execution::STOPPED);
        assert_eq!(words(&[(channel::MODE, 7), (channel::IS_MDI, 1)]).0, mode::MANUAL_DATA_INPUT);
        assert_eq!(words(&[(channel::MODE, 7)]).0, mode::SEMI_AUTOMATIC);
        assert_eq!(machine(&[(channel::IS_RIGID, 1)]).find_operation(), Ok(operation::TAPPING));
        assert_eq!(machine(&[]).find_operation(), Err(Absence::NotSupported));
        assert_eq!(HashMap::new().find_mode(), Err(Absence::NotSupported));
    }

    #[test]
    fn texts_come_out_of_gbk() {
        assert_eq!(text_of(b"\xbb\xfa\xb4\xb2\xc5\xdc\xb7\xc9\xb3\xb5\0rest"), "机床跑飞车");
        assert_eq!(text_of(b" O1234 "), "O1234");
        assert_eq!(text_of(&[0xff; 3]), "\\xFF\\xFF\\xFF", "nothing is lost");
    }

    #[test]
    fn not_yet_is_no_zero() {
        assert_eq!(extract_number(&Err(HncItemError::NotYet)), Err(Absence::NotYetRead));
        assert_eq!(extract_number(&Err(HncItemError::Refused(-1))), Err(Absence::Refused));
        assert_eq!(extract_number(&Ok(HncAnswer::Real(2.5))), Ok(2.5));
        assert_eq!(
            format_alarms(&Ok(HncAnswer::Alarms(vec![(7, "a".into()), (8, "b".into())]))),
            Ok("7 a; 8 b".to_owned())
        );
    }
}
