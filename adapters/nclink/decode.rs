//! State words, alarms and names out of what an HNC-8 says.

use super::liberal::{field, number, text};
use crate::words::{execution, mode, operation};
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

    fn is(self, bit: i64) -> bool {
        self.0 & bit != 0
    }

    /// Bits 0 to 2: 0 reset, 1 automatic, 2 jog, 3 step, 4 handwheel, 5 reference, 6 PLC, 7 single commands.
    pub(super) fn mode(self) -> &'static str {
        match self.0 & 7 {
            1 if self.is(Self::SINGLE) => mode::SEMI_AUTOMATIC,
            1 => mode::AUTOMATIC,
            7 => mode::MANUAL_DATA_INPUT,
            _ => mode::MANUAL,
        }
    }

    pub(super) fn execution(self) -> &'static str {
        match () {
            () if self.is(Self::RESETTING) => execution::STOPPED,
            () if self.is(Self::HOLDING) => execution::FEED_HOLD,
            () if self.is(Self::VERIFYING) => execution::READY,
            () if self.is(Self::CYCLING) => execution::ACTIVE,
            () => execution::READY,
        }
    }

    /// Nothing runs, nothing is held, nothing is being reset.
    pub(super) fn at_rest(self) -> bool {
        !self.is(Self::CYCLING | Self::HOLDING | Self::RESETTING)
    }

    pub(super) fn threading(self) -> bool {
        self.is(Self::THREADING)
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
pub(super) fn alarm(value: &Value) -> String {
    match value {
        Value::String(text) => text.trim().to_owned(),
        Value::Array(list) => {
            let each: Vec<String> = list.iter().map(alarm).filter(|text| !text.is_empty()).collect();
            each.join("; ")
        }
        Value::Object(_) => one_alarm(value),
        Value::Number(_) if number(value).is_some_and(|number| number != 0.0) => value.to_string(),
        _ => String::new(),
    }
}

fn one_alarm(alarm: &Value) -> String {
    let parts = [["number", "code", "no"], ["text", "message", "content"]];
    let words: Vec<String> =
        parts.iter().filter_map(|names| text(alarm, names)).filter(|text| !text.is_empty()).collect();
    match field(alarm, &["alarms", "warnings"]) {
        Some(list) if words.is_empty() => self::alarm(list),
        _ => words.join(" "),
    }
}

/// What stands behind the last `/` or `\\` of a path.
pub(crate) fn last_part(path: &str) -> &str {
    path.trim().rsplit(['/', '\\']).next().unwrap_or_default()
}

/// The name of a program without its directory: `../prog/O1234` is `O1234`.
pub(super) fn program(value: &Value) -> Option<String> {
    let text = match value {
        Value::String(text) => last_part(text).to_owned(),
        other => number(other).map(|number| format!("O{number}"))?,
    };
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_channel_word_gives_mode_and_execution() {
        let words = |word| (ChannelWord(word).mode(), ChannelWord(word).execution());
        assert_eq!(words(0x21), (mode::AUTOMATIC, execution::ACTIVE));
        assert_eq!(words(0x31), (mode::AUTOMATIC, execution::FEED_HOLD));
        assert_eq!(words(0x29), (mode::SEMI_AUTOMATIC, execution::ACTIVE));
        assert_eq!(words(0x821), (mode::AUTOMATIC, execution::READY), "a check of the program moves nothing");
        assert_eq!(words(0x4001), (mode::AUTOMATIC, execution::STOPPED));
        assert_eq!(words(0x02), (mode::MANUAL, execution::READY));
        assert_eq!(words(0x07), (mode::MANUAL_DATA_INPUT, execution::READY));
        assert!(ChannelWord(0x221).threading() && !ChannelWord(0x21).threading());
        assert_eq!(words(-1).1, execution::STOPPED, "a register read as a negative number");
    }

    #[test]
    fn alarms_are_read_in_every_form() {
        assert_eq!(
            alarm(&json!([{"number": "01010101", "text": "overtravel"}, {"text": "oil"}])),
            "01010101 overtravel; oil"
        );
        assert_eq!(alarm(&json!("  doors open ")), "doors open");
        for none in [json!(null), json!([]), json!(""), json!(0), json!({}), json!([{}, ""])] {
            assert_eq!(alarm(&none), "", "{none}");
        }
    }

    #[test]
    fn programs_lose_their_directory_and_status_numbers_are_not_guessed() {
        assert_eq!(program(&json!("../prog/O1234")).as_deref(), Some("O1234"));
        assert_eq!(program(&json!(77)).as_deref(), Some("O77"));
        assert_eq!(program(&json!([])), None);
        assert_eq!(status_word(&json!("Running")), Some(execution::ACTIVE));
        assert_eq!(status_word(&json!(2)), None);
    }
}
