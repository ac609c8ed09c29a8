//! One channel, one time, a value or a reason for none.

use crate::channel::ChannelId;
use crate::clock::TimeNs;
use crate::text::limit_text;
use std::fmt;
use std::sync::Arc;

/// Why there is no value. The text is what an operator reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Absence {
    /// No source of this machine delivers the channel.
    NotProvided,
    /// The source has not answered yet since the gateway started.
    NotYetRead,
    /// The machine is switched off; a normal state.
    MachineOff,
    /// The source is not connected.
    Disconnected,
    /// The source did not answer in time.
    Timeout,
    /// The device answered and refused.
    Refused,
    /// This device does not have the value (model, option or firmware).
    NotSupported,
    /// The device answered with something outside the channel's physical range.
    OutOfRange,
    /// The last value is older than two periods of its source.
    Stale,
    /// The recording holds an empty cell.
    NotRecorded,
    /// The device gives it in a unit that is not known, or that measures something else.
    UnknownUnit,
}

impl Absence {
    /// Every reason, in the order of their codes.
    pub const ALL: [Self; 11] = [
        Self::NotProvided,
        Self::NotYetRead,
        Self::MachineOff,
        Self::Disconnected,
        Self::Timeout,
        Self::Refused,
        Self::NotSupported,
        Self::OutOfRange,
        Self::Stale,
        Self::NotRecorded,
        Self::UnknownUnit,
    ];

    /// The word used in `<channel>_missing` columns, JSON and SQL.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::NotProvided => "not_provided",
            Self::NotYetRead => "not_yet_read",
            Self::MachineOff => "machine_off",
            Self::Disconnected => "disconnected",
            Self::Timeout => "timeout",
            Self::Refused => "refused",
            Self::NotSupported => "not_supported",
            Self::OutOfRange => "out_of_range",
            Self::Stale => "stale",
            Self::NotRecorded => "not_recorded",
            Self::UnknownUnit => "unknown_unit",
        }
    }

    /// The reason written as `word`, if there is one.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|absence| absence.as_word() == word)
    }

    /// A small stable number for compact storage.
    #[must_use]
    pub fn as_code(self) -> u8 {
        self as u8
    }

    /// The reason with this code.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
    }
}

impl fmt::Display for Absence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_word())
    }
}

/// A value of a channel: a finite number in the channel's unit, or a state word.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Finite, in the unit of the channel table.
    Number(f64),
    /// A state word, program name or similar; cloning does not allocate.
    Text(Arc<str>),
}

impl Value {
    /// A finite number as a value; NaN and infinities are an [`Absence::OutOfRange`].
    ///
    /// # Errors
    /// [`Absence::OutOfRange`] for a number that is not finite.
    pub fn from_number(number: f64) -> Result<Self, Absence> {
        if number.is_finite() { Ok(Self::Number(number)) } else { Err(Absence::OutOfRange) }
    }

    /// The number, if it is one.
    #[must_use]
    pub fn as_number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Text(_) => None,
        }
    }

    /// The text, if it is one.
    #[must_use]
    pub fn as_text(&self) -> Option<&str> {
        match self {
            Self::Number(_) => None,
            Self::Text(text) => Some(text),
        }
    }
}

/// When a value was true: the middle of the request and half its duration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp {
    /// Middle of the request on the gateway's clock.
    pub mid_ns: TimeNs,
    /// Half the round trip: the value is from `mid_ns` plus or minus this.
    pub half_width_ns: i64,
}

impl Stamp {
    /// The stamp of a request that began and ended at these times.
    #[must_use]
    pub fn of_request(began_ns: TimeNs, ended_ns: TimeNs) -> Self {
        let half_width_ns = (ended_ns - began_ns).max(0) / 2;
        Self { mid_ns: began_ns + half_width_ns, half_width_ns }
    }

    /// A stamp known exactly, as in a recording.
    #[must_use]
    pub fn from_exact_time(mid_ns: TimeNs) -> Self {
        Self { mid_ns, half_width_ns: 0 }
    }
}

/// One channel, one time, a value or a reason for none.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// The channel that the value belongs to.
    pub channel: ChannelId,
    /// The time for which the value holds.
    pub stamp: Stamp,
    /// What, or why not.
    pub value: Result<Value, Absence>,
    /// What the device said, where it is not believed.
    pub implausible: Option<f64>,
    /// How long the text of the device was, bytes, where only its beginning is kept. Not public: no reading with a text is made but
    /// by [`Reading::from_text`].
    cut_from_bytes: Option<usize>,
}

impl Reading {
    /// A number that is believed if the channel can have it. What is not believed is [`Absence::OutOfRange`], never a value
    /// that was cut off; what the device said stays beside it, to be counted and told by [`crate::plausibility`].
    #[must_use]
    pub fn from_number(channel: ChannelId, stamp: Stamp, number: f64) -> Self {
        if channel.channel().accepts_number(number) {
            return Self::from_value(channel, stamp, Value::from_number(number));
        }
        Self::from_implausible(channel, stamp, number)
    }

    /// A number that is not believed: the channel cannot have it, or something beside it in the same answer tells against it.
    #[must_use]
    pub fn from_implausible(channel: ChannelId, stamp: Stamp, number: f64) -> Self {
        Self { implausible: Some(number), ..Self::from_absence(channel, stamp, Absence::OutOfRange) }
    }

    /// A text, of which at most the first [`TEXT_BYTES_MAX`](crate::text::TEXT_BYTES_MAX) bytes are kept; that it was longer is told by
    /// [`crate::plausibility`].
    #[must_use]
    pub fn from_text(channel: ChannelId, stamp: Stamp, text: Arc<str>) -> Self {
        let kept = limit_text(&text);
        if kept.len() == text.len() {
            return Self::from_value(channel, stamp, Ok(Value::Text(text)));
        }
        let cut_from_bytes = Some(text.len());
        Self { cut_from_bytes, ..Self::from_value(channel, stamp, Ok(Value::Text(Arc::from(kept)))) }
    }

    fn from_value(channel: ChannelId, stamp: Stamp, value: Result<Value, Absence>) -> Self {
        Self { channel, stamp, value, implausible: None, cut_from_bytes: None }
    }

    /// How long the text of the device was, bytes, where only its beginning is kept.
    #[must_use]
    pub fn cut_from_bytes(&self) -> Option<usize> {
        self.cut_from_bytes
    }

    /// No value, with the reason.
    #[must_use]
    pub fn from_absence(channel: ChannelId, stamp: Stamp, reason: Absence) -> Self {
        Self::from_value(channel, stamp, Err(reason))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::TEXT_BYTES_MAX;

    proptest::proptest! {
        /// Of every text channel: any text, of any length, with NUL and from right to left.
        #[test]
        fn a_text_is_kept_up_to_its_limit(
            part in "\\PC{1,40}|\\x00{1,9}|[\u{5d0}-\u{5ea}]{1,20}", times in 1_usize..4000, index in 0_usize..64,
        ) {
            let texts: Vec<ChannelId> = ChannelId::list_all().filter(|id| id.channel().kind == crate::channel::Kind::Text).collect();
            let text = part.repeat(times);
            let reading = Reading::from_text(texts[index % texts.len()], Stamp::from_exact_time(0), text.as_str().into());
            let value = reading.value.clone().expect("a text");
            let kept = value.as_text().expect("a text");
            proptest::prop_assert!(text.starts_with(kept) && kept.len() <= TEXT_BYTES_MAX && kept.len() + 3 >= text.len().min(TEXT_BYTES_MAX));
            proptest::prop_assert_eq!(reading.cut_from_bytes(), (kept.len() < text.len()).then_some(text.len()));
        }
    }

    #[test]
    fn every_absence_survives_its_word_and_its_code() {
        for absence in Absence::ALL {
            assert_eq!(Absence::from_word(absence.as_word()), Some(absence));
            assert_eq!(Absence::from_code(absence.as_code()), Some(absence));
        }
    }

    #[test]
    fn a_number_that_is_none_becomes_an_absence() {
        let channel = ChannelId::from_name("spindle_speed_rpm").expect("in the table");
        let reading = Reading::from_number(channel, Stamp::from_exact_time(0), f64::NAN);
        assert_eq!(reading.value, Err(Absence::OutOfRange));
    }

    #[test]
    fn the_stamp_is_the_middle_of_the_request() {
        assert_eq!(Stamp::of_request(10, 30), Stamp { mid_ns: 20, half_width_ns: 10 });
    }
}
