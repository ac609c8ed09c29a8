//! What the library answers, and why there is no value.

use adapter_core::reading::Absence;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The value of an item, by its kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum HncAnswer {
    /// A whole number of 32 bits.
    Whole(i32),
    /// A real number; always finite.
    Real(f64),
    /// A text, already out of GBK.
    Text(String),
    /// Alarms: number and text.
    Alarms(Vec<(i32, String)>),
}

/// Why there is none.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum HncItemError {
    /// Return code 1: the value has not arrived yet. Ask again; there is no value now.
    NotYet,
    /// Another return code of the library than 0 and 1.
    Refused(i32),
    /// The library has not the function.
    NotOffered,
    /// An overrun, or a number that is none.
    Malformed(String),
    /// The child ended or hung in this question.
    Failed(String),
}

impl HncItemError {
    /// The reason for the channel.
    #[must_use]
    pub fn to_absence(&self) -> Absence {
        match self {
            Self::NotYet => Absence::NotYetRead,
            Self::Refused(-2) | Self::NotOffered => Absence::NotSupported,
            Self::Refused(_) => Absence::Refused,
            Self::Malformed(_) => Absence::OutOfRange,
            Self::Failed(_) => Absence::Disconnected,
        }
    }
}

/// The value of one item, or why it has none.
pub type HncItemResult = Result<HncAnswer, HncItemError>;

/// A return code of opening or writing, in words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct HncReturnCode(pub i32);

impl fmt::Display for HncReturnCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = match self.0 {
            0 => "all well",
            1 => "the value has not arrived yet",
            1009 => "the local port is taken, perhaps by another program that uses the library",
            -1 => "a bad argument, or no socket",
            -2 => "not provided by this controller",
            -3 => "no such bit, or no network",
            -4 => "may only be read",
            -5 => "nothing to write",
            -10 => "the library is not initialised",
            -11 => "no such client number",
            -101 | -102 => "no such alarm",
            _ => return write!(f, "code {}", self.0),
        };
        write!(f, "{words} (code {})", self.0)
    }
}
