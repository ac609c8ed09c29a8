//! The user's own channels, the same for every kind of source: a name, a unit, a range, what is read, and how that becomes the
//! value. What can be read is asked of the kind: each one has a type for it that reads the text behind `read =`.
//!
//! | source | `read =` | type |
//! |---|---|---|
//! | `fanuc://` | `macro 500`, `pmc D20 word`, `diagnosis 301 axis 1`, `pmc D100 text 20`, ... | `fanuc::OwnItem` |
//! | `nclink://` | `AXIS@5/MOTOR/TEMPERATURE`, `CONTROLLER/VARIABLE@REG_D 120` | `nclink::OwnPath` |
//! | `hncnet://` | `register D120`, `channel 7 real`, `axis 5 29 real` | `hnc::OwnValue` |
//! | `mtconnect://` | `Xload` | `mtconnect::OwnDataItem` |
//! | `modbus-tcp://`, `modbus-rtu://` | `input 52 f32`, `holding 0x34 i16` | `modbus::OwnRegister` |
//!
//! A name of the table of channels may be given to what a source has and does not deliver by itself; it keeps the unit and the
//! range of the table.

use crate::channel::{CHANNELS, ChannelId, DeclareError, Kind, NewChannel, declare_channel};
use crate::reading::{Absence, Reading, Stamp, Value};
use crate::text::TextEncoding;
use std::fmt;
use std::sync::Arc;
use thiserror::Error;

/// With which group a channel is read, where a source has two.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadWith {
    /// With motion and states.
    Fast,
    /// With parts and times.
    Slow,
}

/// One of the user's own channels.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnChannel {
    /// Name, unit and range; a text has no unit.
    pub new: NewChannel,
    /// What is read, as it is written.
    pub read: String,
    /// Factor by which what is read becomes the unit.
    pub scale: f64,
    /// Added after the factor, in the unit.
    pub offset: f64,
    /// The group with which the channel is read.
    pub pace: ReadWith,
    /// Path from 1; `None` is the one that is written to.
    pub path: Option<u8>,
    /// Character set of a text, where it is not that of the source.
    pub encoding: Option<TextEncoding>,
}

/// Why a channel of the user's cannot be added.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnChannelError {
    /// Name of the channel.
    pub channel: String,
    /// The key that is wrong.
    pub key: &'static str,
    /// What is wrong with it.
    pub what: String,
}

impl fmt::Display for OwnChannelError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "channel {}: {}", self.channel, self.what)
    }
}

/// A text after `read =` that names nothing of its source.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("`{text}` is nothing that can be read; write {examples}")]
pub struct UnreadableItem {
    /// The text as written.
    pub text: String,
    /// [`OwnRead::EXAMPLES`] of the source.
    pub examples: &'static str,
}

/// A kind of item that a source can be asked for by the user.
pub trait OwnRead: Sized {
    /// Examples of every form that a text may have, as they stand in a message.
    const EXAMPLES: &'static str;

    /// The item that a text of a configuration names; `None` when it names none.
    fn parse(text: &str) -> Option<Self>;

    /// The same with what to write instead.
    ///
    /// # Errors
    /// The text names nothing of this source.
    fn read(text: &str) -> Result<Self, UnreadableItem> {
        Self::parse(text).ok_or_else(|| UnreadableItem { text: text.to_owned(), examples: Self::EXAMPLES })
    }

    /// Is it a text? `None`: what comes may be either, and the unit of the channel says what it is taken for.
    fn is_text(&self) -> Option<bool> {
        Some(false)
    }
}

/// A channel with its item, in the words of its source.
#[derive(Debug, Clone, PartialEq)]
pub struct Own<T> {
    /// The channel as the user described it.
    pub channel: OwnChannel,
    /// Its place in the table of channels.
    pub id: ChannelId,
    /// The item that `read` of the channel names.
    pub item: T,
}

impl<T: OwnRead> Own<T> {
    /// All of these channels, each one declared. `delivered` are those that the source delivers by itself.
    ///
    /// # Errors
    /// The first one that cannot be added.
    pub fn declare_all(channels: Vec<OwnChannel>, delivered: &[ChannelId]) -> Result<Vec<Self>, OwnChannelError> {
        channels.into_iter().map(|channel| Self::new(channel, delivered)).collect()
    }

    fn new(channel: OwnChannel, delivered: &[ChannelId]) -> Result<Self, OwnChannelError> {
        let refused = |key, what| OwnChannelError { channel: channel.new.name.clone(), key, what };
        let item = T::read(&channel.read).map_err(|what| refused("read", what.to_string()))?;
        let as_text = channel.new.kind == Kind::Text;
        if item.is_text().is_some_and(|is_text| is_text != as_text) {
            let what =
                if !as_text { "a text is read: write unit = \"text\"" } else { "a number is read: give its unit" };
            return Err(refused("unit", what.to_owned()));
        }
        let id = channel.resolve_channel(delivered).map_err(|error| refused("name", error.to_string()))?;
        if id.channel().unit != channel.new.unit {
            let unit = id.channel().unit;
            return Err(refused(
                "unit",
                format!("the channel {id} has the unit {unit}; give the scale that makes it so"),
            ));
        }
        Ok(Self { channel, id, item })
    }
}

impl OwnChannel {
    fn resolve_channel(&self, delivered: &[ChannelId]) -> Result<ChannelId, DeclareError> {
        let known = CHANNELS.iter().any(|known| known.name == self.new.name);
        match ChannelId::from_name(&self.new.name).filter(|id| known && !delivered.contains(id)) {
            Some(id) => Ok(id),
            None => declare_channel(&self.new),
        }
    }

    /// The value of a number that was read.
    #[must_use]
    pub fn scale_value(&self, raw: f64) -> f64 {
        raw * self.scale + self.offset
    }
}

impl<T> Own<T> {
    /// The reading of what was read.
    #[must_use]
    pub fn to_reading(&self, stamp: Stamp, found: Result<Value, Absence>) -> Reading {
        let is_text = self.channel.new.kind == Kind::Text;
        match found {
            Ok(Value::Number(raw)) if !is_text => Reading::from_number(self.id, stamp, self.channel.scale_value(raw)),
            Ok(Value::Text(text)) if is_text => Reading::from_text(self.id, stamp, Arc::clone(&text)),
            Ok(_) => Reading::from_absence(self.id, stamp, Absence::OutOfRange),
            Err(reason) => Reading::from_absence(self.id, stamp, reason),
        }
    }
}
