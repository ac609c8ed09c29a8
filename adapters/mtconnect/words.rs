//! What an observation says, in the words and units of the channels.

use adapter_core::channel::ChannelId;
use adapter_core::conversion::Conversion;
use adapter_core::reading::{Absence, Reading, Stamp};
use adapter_core::text::last_part;
use adapter_core::words::{execution, find_canonical_word};
use std::sync::Arc;

/// How the text of an observation becomes a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ObservationForm {
    Number,
    /// A number, of an item that belongs to a composition of this kind only.
    OfComposition(&'static str),
    /// One of three numbers, from 0.
    Coordinate(usize),
    Text,
    /// A name without its directory.
    Program,
    Tool,
    Block,
    Execution,
    Mode,
    EmergencyStop,
}

impl ObservationForm {
    /// Is the conversion of units needed?
    pub(crate) fn is_number(self) -> bool {
        matches!(self, Self::Number | Self::OfComposition(_) | Self::Coordinate(_))
    }

    /// The reading of a text that is not `UNAVAILABLE`.
    pub(crate) fn build_reading(
        self,
        channel: ChannelId,
        stamp: Stamp,
        text: &str,
        conversion: Option<Conversion>,
    ) -> Reading {
        let of_text = |text: &str| Reading::from_text(channel, stamp, Arc::from(text));
        let of_word = |word: Option<&str>| match word {
            Some(word) => of_text(word),
            None => Reading::from_absence(channel, stamp, Absence::OutOfRange),
        };
        match self {
            Self::Text => of_text(text),
            Self::Program => of_text(last_part(text)),
            Self::Tool => of_text(&with_letter(text, 'T')),
            Self::Block => of_text(&with_letter(text, 'N')),
            Self::Execution => of_word(find_execution(text)),
            Self::Mode => of_word(find_canonical_word("mode", text)),
            Self::EmergencyStop => match text {
                "TRIGGERED" => Reading::from_number(channel, stamp, 1.0),
                "ARMED" => Reading::from_number(channel, stamp, 0.0),
                _ => of_word(None),
            },
            Self::Number | Self::OfComposition(_) => convert(channel, stamp, text, conversion),
            Self::Coordinate(place) => {
                convert(channel, stamp, text.split_whitespace().nth(place).unwrap_or_default(), conversion)
            }
        }
    }
}

fn convert(channel: ChannelId, stamp: Stamp, text: &str, conversion: Option<Conversion>) -> Reading {
    let Some(conversion) = conversion else { return Reading::from_absence(channel, stamp, Absence::UnknownUnit) };
    match text.trim().parse::<f64>() {
        Ok(number) => Reading::from_number(channel, stamp, conversion.convert_number(number)),
        Err(_) => Reading::from_absence(channel, stamp, Absence::OutOfRange),
    }
}

/// `7` is `T7`, as other controls name it; what is no number stays as it is.
fn with_letter(text: &str, letter: char) -> String {
    let is_number = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if is_number { format!("{letter}{text}") } else { text.to_owned() }
}

/// Words that the standard has besides those of the channel, and what they mean there. Source: Part 2, Execution.
const STANDING: [(&str, &str); 6] = [
    ("OPTIONAL_STOP", execution::STOPPED),
    ("PROGRAM_STOPPED", execution::STOPPED),
    ("PROGRAM_OPTIONAL_STOP", execution::STOPPED),
    ("WAIT", execution::INTERRUPTED),
    ("IDLE", execution::READY),
    ("PROGRAM_COMPLETE", execution::PROGRAM_COMPLETED),
];

fn find_execution(text: &str) -> Option<&'static str> {
    let others = || STANDING.iter().find(|(word, _)| word.eq_ignore_ascii_case(text.trim())).map(|(_, word)| *word);
    find_canonical_word("execution", text).or_else(others)
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::reading::Value;

    fn read(form: ObservationForm, channel: &str, text: &str) -> Result<Value, Absence> {
        let channel = ChannelId::from_name(channel).expect("in the table");
        form.build_reading(channel, Stamp::from_exact_time(0), text, Some(Conversion { scale: 60.0, offset: 0.0 }))
            .value
    }

    #[test]
    fn states_become_the_words_of_the_channels() {
        let word =
            |form, channel, text| read(form, channel, text).ok().and_then(|value| value.as_text().map(str::to_owned));
        for (text, wanted) in [
            ("ACTIVE", Some("ACTIVE")),
            ("FEED_HOLD", Some("FEED_HOLD")),
            ("OPTIONAL_STOP", Some("STOPPED")),
            ("PROGRAM_STOPPED", Some("STOPPED")),
            ("WAIT", Some("INTERRUPTED")),
            ("PROGRAM_COMPLETED", Some("PROGRAM_COMPLETED")),
            ("BUSY", None),
        ] {
            assert_eq!(word(ObservationForm::Execution, "execution", text).as_deref(), wanted, "{text}");
        }
        assert_eq!(word(ObservationForm::Mode, "mode", "MANUAL_DATA_INPUT").as_deref(), Some("MANUAL_DATA_INPUT"));
        assert_eq!(word(ObservationForm::Mode, "mode", "MEM"), None);
        assert_eq!(word(ObservationForm::Tool, "tool", "07").as_deref(), Some("T07"));
        assert_eq!(word(ObservationForm::Tool, "tool", "DRILL 8").as_deref(), Some("DRILL 8"));
        assert_eq!(word(ObservationForm::Block, "block", "30").as_deref(), Some("N30"));
        assert_eq!(word(ObservationForm::Program, "program", "//CNC_MEM/USER/O1234").as_deref(), Some("O1234"));
    }

    #[test]
    fn numbers_are_converted_and_what_is_none_has_no_value() {
        assert_eq!(read(ObservationForm::Number, "feed_mm_min", "20"), Ok(Value::Number(1200.0)));
        assert_eq!(read(ObservationForm::Number, "feed_mm_min", "2e1"), Ok(Value::Number(1200.0)));
        assert_eq!(read(ObservationForm::Coordinate(2), "z_axis_position_mm", "1 2 -3"), Ok(Value::Number(-180.0)));
        for nothing in ["", "x", "NaN", "inf", "1 2"] {
            assert_eq!(read(ObservationForm::Number, "feed_mm_min", nothing), Err(Absence::OutOfRange), "{nothing}");
        }
        assert_eq!(read(ObservationForm::Coordinate(2), "z_axis_position_mm", "1 2"), Err(Absence::OutOfRange));
        assert_eq!(read(ObservationForm::EmergencyStop, "emergency_stop", "TRIGGERED"), Ok(Value::Number(1.0)));
        assert_eq!(read(ObservationForm::EmergencyStop, "emergency_stop", "ARMED"), Ok(Value::Number(0.0)));
        assert_eq!(read(ObservationForm::EmergencyStop, "emergency_stop", "?"), Err(Absence::OutOfRange));
    }
}
