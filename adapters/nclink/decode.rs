//! State words, alarms and names out of what an HNC-8 says.

use super::lenient_json::{find_field, find_text, parse_number};
use adapter_core::text::last_part;
use adapter_core::words::{execution, mode, operation};
use serde_json::Value;

/// The channel's first F word (HNC-8 register map, configuration HNC-30: F2560; HNC-80: F6400).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ChannelWord(pub(super) i64);

impl ChannelWord {
    /// Bit 3: single block in automatic, single commands elsewhere.
    const SINGLE: i64 = 0x08;
    const HOLDING: i64 = 0x10;
    const CYCLING: i64 = 0x20;
    const THREADING: i64 = 0x200;
    /// The program is only checked, nothing moves.
    const VERIFYING: i64 = 0x800;
    const RESETTING: i64 = 0x4000;

    fn has_bit(self, bit: i64) -> bool {
        self.0 & bit != 0
    }

    /// Bits 0 to 2: 0 reset, 1 automatic, 2 jog, 3 step, 4 handwheel, 5 reference, 6 PLC, 7 single commands.
    pub(super) fn name_mode(self) -> &'static str {
        match self.0 & 7 {
            1 if self.has_bit(Self::SINGLE) => mode::SEMI_AUTOMATIC,
            1 => mode::AUTOMATIC,
            7 => mode::MANUAL_DATA_INPUT,
            _ => mode::MANUAL,
        }
    }

    pub(super) fn name_execution(self) -> &'static str {
        match () {
            () if self.has_bit(Self::RESETTING) => execution::STOPPED,
            () if self.has_bit(Self::HOLDING) => execution::FEED_HOLD,
            () if self.has_bit(Self::VERIFYING) => execution::READY,
            () if self.has_bit(Self::CYCLING) => execution::ACTIVE,
            () => execution::READY,
        }
    }

    /// Nothing runs, nothing is held, nothing is being reset.
    pub(super) fn at_rest(self) -> bool {
        !self.has_bit(Self::CYCLING | Self::HOLDING | Self::RESETTING)
    }

    pub(super) fn is_threading(self) -> bool {
        self.has_bit(Self::THREADING)
    }
}

/// The word of the gate and the scripts for feed that follows the spindle.
pub(super) fn locked_operation(threading: bool, tapping: bool) -> Option<&'static str> {
    if threading {
        return Some(operation::THREADING);
    }
    tapping.then_some(operation::TAPPING)
}

/// The status item where it is a word. Its numbers are not published; they are not guessed.
pub(super) fn status_word(value: &Value) -> Option<&'static str> {
    let word = value.as_str()?.trim().to_ascii_lowercase();
    match word.as_str() {
        "free" | "idle" | "ready" | "standby" => Some(execution::READY),
        "run" | "running" | "working" | "active" => Some(execution::ACTIVE),
        "hold" | "holding" | "feed_hold" | "pause" | "paused" => Some(execution::FEED_HOLD),
        "alarm" | "stop" | "stopped" | "estop" | "emergency" | "reset" => Some(execution::STOPPED),
        _ => None,
    }
}

/// The text of the alarms, empty without one: a list of `{"number", "text"}`, one of them, or plain text.
pub(super) fn format_alarms(value: &Value) -> String {
    match value {
        Value::String(text) => text.trim().to_owned(),
        Value::Array(list) => {
            let each: Vec<String> = list.iter().map(format_alarms).filter(|text| !text.is_empty()).collect();
            each.join("; ")
        }
        Value::Object(_) => one_alarm(value),
        Value::Number(_) if parse_number(value).is_some_and(|number| number != 0.0) => value.to_string(),
        _ => String::new(),
    }
}

fn one_alarm(alarm: &Value) -> String {
    let parts = [["number", "code", "no"], ["text", "message", "content"]];
    let words: Vec<String> =
        parts.iter().filter_map(|names| find_text(alarm, names)).filter(|text| !text.is_empty()).collect();
    match find_field(alarm, &["alarms", "warnings"]) {
        Some(list) if words.is_empty() => self::format_alarms(list),
        _ => words.join(" "),
    }
}

/// The name of a program without its directory: `../prog/O1234` is `O1234`.
pub(super) fn parse_program_name(value: &Value) -> Option<String> {
    let text = match value {
        Value::String(text) => last_part(text).to_owned(),
        other => parse_number(other).map(|number| format!("O{number}"))?,
    };
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_channel_word_gives_mode_and_execution() {
        let words = |word| (ChannelWord(word).name_mode(), ChannelWord(word).name_execution());
        assert_eq!(words(0x21), (mode::AUTOMATIC, execution::ACTIVE));
        assert_eq!(words(0x31), (mode::AUTOMATIC, execution::FEED_HOLD));
        assert_eq!(words(0x29), (mode::SEMI_AUTOMATIC, execution::ACTIVE));
        assert_eq!(words(0x821), (mode::AUTOMATIC, execution::READY), "a check of the program moves nothing");
        assert_eq!(words(0x4001), (mode::AUTOMATIC, execution::STOPPED));
        assert_eq!(words(0x02), (mode::MANUAL, execution::READY));
        assert_eq!(words(0x07), (mode::MANUAL_DATA_INPUT, execution::READY));
        assert!(ChannelWord(0x221).is_threading() && !ChannelWord(0x21).is_threading());
        assert_eq!(words(-1).1, execution::STOPPED, "a register read as a negative number");
    }

    #[test]
    fn alarms_are_read_in_every_form() {
        assert_eq!(
            format_alarms(&json!([{"number": "01010101", "text": "overtravel"}, {"text": "oil"}])),
            "01010101 overtravel; oil"
        );
        assert_eq!(format_alarms(&json!("  doors open ")), "doors open");
        for none in [json!(null), json!([]), json!(""), json!(0), json!({}), json!([{}, ""])] {
            assert_eq!(format_alarms(&none), "", "{none}");
        }
    }

    #[test]
    fn programs_lose_their_directory_and_status_numbers_are_not_guessed() {
        assert_eq!(parse_program_name(&json!("../prog/O1234")).as_deref(), Some("O1234"));
        assert_eq!(parse_program_name(&json!(77)).as_deref(), Some("O77"));
        assert_eq!(parse_program_name(&json!([])), None);
        assert_eq!(status_word(&json!("Running")), Some(execution::ACTIVE));
        assert_eq!(status_word(&json!(2)), None);
    }
}
