//! What the machine is doing, as one word.

use serde::{Deserialize, Serialize};
use std::fmt;

/// The state of the machine. The first five are those of the source (tool-wear patent, state machine); the last three
/// are states that the source forgets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// No power: the main switch is off.
    Off,
    /// Powered, the spindle stands still.
    Standby,
    /// The spindle was started and has not settled yet.
    SpindleStart,
    /// The spindle turns at a steady speed without visible load.
    Idle,
    /// The spindle carries a load that stands out of its no-load power while the feed is on.
    Cutting,
    /// What is measured does not tell; never a synonym for off.
    Unknown,
    /// The spindle changes from one speed, direction or gear stage to another, or slows down to a stop.
    SpeedChange,
    /// Rapid traverse with the spindle turning.
    Rapid,
}

impl State {
    /// Every state, in the order of the codes.
    pub const ALL: [Self; 8] = [
        Self::Off,
        Self::Standby,
        Self::SpindleStart,
        Self::Idle,
        Self::Cutting,
        Self::Unknown,
        Self::SpeedChange,
        Self::Rapid,
    ];

    /// The word used in SQL, scripts, JSON and CSV.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Standby => "standby",
            Self::SpindleStart => "spindle_start",
            Self::Idle => "idle",
            Self::Cutting => "cutting",
            Self::Unknown => "unknown",
            Self::SpeedChange => "speed_change",
            Self::Rapid => "rapid",
        }
    }

    /// The state written as `word`, if there is one.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.as_word() == word)
    }

    /// A small stable number for compact storage.
    #[must_use]
    pub fn to_code(self) -> u8 {
        self as u8
    }

    /// The state with this code.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
    }

    /// Does the spindle turn in this state? `None` where the state does not tell.
    #[must_use]
    pub fn spindle_on(self) -> Option<bool> {
        match self {
            Self::Off | Self::Standby => Some(false),
            Self::SpindleStart | Self::Idle | Self::Cutting | Self::SpeedChange | Self::Rapid => Some(true),
            Self::Unknown => None,
        }
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_word())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_survives_its_word_its_code_and_json() {
        for state in State::ALL {
            assert_eq!(State::from_word(state.as_word()), Some(state));
            assert_eq!(State::from_code(state.to_code()), Some(state));
            assert_eq!(serde_json::to_value(state).expect("a word"), state.as_word());
        }
    }
}
