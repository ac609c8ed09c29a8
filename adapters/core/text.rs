//! Texts of devices: bytes in the character set of whoever built them.
//!
//! A control in a Chinese shop sends GBK, one in a Japanese shop Shift JIS, a newer one UTF-8, and none of them says so. The
//! address of a source names the set (`encoding=gbk`), or leaves it to be found out: what is UTF-8 is UTF-8; else the characters that come
//! out tell (`text_set`). Bytes that are no text in the set, or whose set is not known, are written as `\xB5`, so that they are never
//! lost: a text with such a mark in it gives its bytes back, and [`crate::plausibility`] tells of it.

use crate::text_set::find_text;
use encoding_rs::{Encoding, UTF_8};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use thiserror::Error;

/// The character set of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum TextEncoding {
    /// UTF-8 where it is that, else the set that its characters speak for.
    #[default]
    Found,
    /// This character set; UTF-8 is tried before it.
    Named(&'static Encoding),
}

impl TextEncoding {
    /// `auto`, or a label of the Encoding Standard: `gbk`, `shift_jis`, `windows-1252` and so on.
    #[must_use]
    pub fn of_label(label: &str) -> Option<Self> {
        if label == AUTO {
            return Some(Self::Found);
        }
        Encoding::for_label(label.as_bytes()).map(Self::Named)
    }

    /// The text up to the first NUL, without the blanks around it.
    #[must_use]
    pub fn decode_trimmed(self, bytes: &[u8]) -> String {
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
        self.decode_all(&bytes[..end]).trim().to_owned()
    }

    /// All of the bytes as text; what is none in this set as marks.
    #[must_use]
    pub fn decode_all(self, bytes: &[u8]) -> String {
        self.decode_strictly(bytes).map_or_else(|| mark_bytes(bytes), Cow::into_owned)
    }

    /// JSON in this set. Where a text in it does not fit the set, that text has marks and the rest is read.
    ///
    /// # Errors
    /// It is no JSON.
    pub fn parse_json(self, bytes: &[u8]) -> Result<serde_json::Value, serde_json::Error> {
        match self.decode_strictly(bytes) {
            Some(text) => serde_json::from_str(&text),
            None => serde_json::from_str(&marked_within(bytes)),
        }
    }

    fn decode_strictly(self, bytes: &[u8]) -> Option<Cow<'_, str>> {
        // A device that is set to another character set may send UTF-8 all the same; nothing else looks like UTF-8.
        let decode = |set: &'static Encoding| set.decode_without_bom_handling_and_without_replacement(bytes);
        decode(UTF_8).or_else(|| match self {
            Self::Found => find_text(bytes).map(Cow::Owned),
            Self::Named(set) => decode(set),
        })
    }
}

/// ASCII as it is, every other byte as a mark within a text of JSON, where a backslash is written twice.
fn marked_within(bytes: &[u8]) -> String {
    let mark = |byte: &u8| if byte.is_ascii() { char::from(*byte).to_string() } else { format!("\\\\x{byte:02X}") };
    bytes.iter().map(mark).collect()
}

/// What stands for finding out.
const AUTO: &str = "auto";

impl From<TextEncoding> for String {
    fn from(encoding: TextEncoding) -> Self {
        match encoding {
            TextEncoding::Found => AUTO.to_owned(),
            TextEncoding::Named(set) => set.name().to_owned(),
        }
    }
}

/// No character set has this label.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("no character set is called {0}")]
pub struct UnknownCharacterSet(pub String);

impl TryFrom<String> for TextEncoding {
    type Error = UnknownCharacterSet;

    fn try_from(label: String) -> Result<Self, UnknownCharacterSet> {
        Self::of_label(&label).ok_or(UnknownCharacterSet(label))
    }
}

/// ASCII as it is, every other byte and the backslash as marks.
fn mark_bytes(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len() + 16);
    for byte in bytes {
        match byte {
            b'\\' => text.push_str("\\x5C"),
            0x20..=0x7E | b'\n' | b'\t' | b'\r' => text.push(char::from(*byte)),
            other => text.push_str(&format!("\\x{other:02X}")),
        }
    }
    text
}

/// Has this text a byte in it that is no text in its set, or whose set is not known?
#[must_use]
pub fn has_byte_mark(text: &str) -> bool {
    let is_mark = |at: usize| {
        let digits = text.as_bytes().get(at + 2..at + 4);
        digits.is_some_and(|digits| digits.iter().all(|byte| byte.is_ascii_digit() || (b'A'..=b'F').contains(byte)))
    };
    text.match_indices("\\x").any(|(at, _)| is_mark(at))
}

/// Longest text of a channel, of a fact or of an error, bytes: 256 characters of three bytes, as a Chinese one takes. Chosen by hand: no
/// longer name, message or block of a control has been seen. What a shorter limit would cost is the end of a real message, what a longer one costs
/// is room in every row of the history.
pub const TEXT_BYTES_MAX: usize = 768;

/// The beginning of `text` that is at most [`TEXT_BYTES_MAX`] bytes long, up to the end of a character.
#[must_use]
pub fn limit_text(text: &str) -> &str {
    &text[..text.floor_char_boundary(TEXT_BYTES_MAX)]
}

/// The same for a text that is told and not stored: what was cut off is shown by `...`.
#[must_use]
pub fn shorten_text(text: String) -> String {
    if text.len() <= TEXT_BYTES_MAX { text } else { format!("{}...", limit_text(&text)) }
}

/// What stands behind the last `/` or `\\` of a path.
#[must_use]
pub fn last_part(path: &str) -> &str {
    path.trim().rsplit(['/', '\\']).next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(label: &str) -> TextEncoding {
        TextEncoding::of_label(label).expect("a label")
    }

    #[test]
    fn the_set_is_found_or_named() {
        // 急停 in GBK, UTF-8 and Shift JIS, by hand.
        let (gbk, utf8, sjis) = (b"\xBC\xB1\xCD\xA3 1\0rest", "急停 1".as_bytes(), b"\x8B\x7D\x92\xE2 1");
        assert_eq!(of("auto").decode_trimmed(gbk), "急停 1");
        assert_eq!(of("auto").decode_trimmed(utf8), "急停 1");
        assert_eq!(of("gbk").decode_trimmed(gbk), "急停 1");
        assert_eq!(of("shift_jis").decode_trimmed(sjis), "急停 1");
        assert_eq!(of("auto").decode_trimmed(b"  SERVO ALARM \0"), "SERVO ALARM");
        assert_eq!(TextEncoding::of_label("klingon"), None);
    }

    #[test]
    fn bytes_that_fit_no_set_are_kept() {
        assert_eq!(of("utf-8").decode_trimmed(b"a\\\xB5\xFF b"), "a\\x5C\\xB5\\xFF b");
        assert_eq!(of("auto").decode_trimmed(&[0xFF, 0xFF]), "\\xFF\\xFF");
    }

    #[test]
    fn one_text_that_fits_no_set_costs_itself_and_no_other() {
        let gbk = [&b"{\"a\":1,\"t\":\""[..], b"\xBC\xB1\xCD\xA3", b"\"}"].concat();
        let read = of("auto").parse_json(&gbk).expect("JSON");
        assert_eq!((&read["a"], &read["t"]), (&serde_json::json!(1), &serde_json::json!("急停")));
        let broken = [&b"{\"a\":1,\"t\":\"x"[..], b"\xFF\xFE", b"\"}"].concat();
        let read = of("auto").parse_json(&broken).expect("JSON");
        assert_eq!((&read["a"], &read["t"]), (&serde_json::json!(1), &serde_json::json!("x\\xFF\\xFE")));
        assert!(of("auto").parse_json(b"no JSON").is_err());
    }

    #[test]
    fn it_survives_the_way_to_the_child() {
        for label in ["auto", "gbk", "shift_jis"] {
            let json = serde_json::to_string(&of(label)).expect("JSON");
            assert_eq!(serde_json::from_str::<TextEncoding>(&json).expect("back"), of(label));
        }
    }
}
