//! Every channel at one tick, each with its age.

use crate::channel::ChannelId;
use crate::clock::TimeNs;
use crate::reading::{Absence, Value};
use std::sync::Arc;

/// What is known of one channel at a tick.
#[derive(Debug, Clone, PartialEq)]
pub struct Slot {
    /// The value, or why there is none.
    pub value: Result<Value, Absence>,
    /// Tick minus the time the value was true; 0 when interpolated between two readings around the tick.
    pub age_ns: i64,
}

impl Slot {
    /// A channel that has no value for this reason.
    #[must_use]
    pub fn from_absence(reason: Absence) -> Self {
        Self { value: Err(reason), age_ns: 0 }
    }
}

/// Of a channel that was declared after the sample was made.
static NOT_PROVIDED: Slot = Slot { value: Err(Absence::NotProvided), age_ns: 0 };

/// Every channel of the table at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// The tick, nanoseconds since 1970 on the gateway's clock.
    pub at_ns: TimeNs,
    slots: Vec<Slot>,
}

impl Sample {
    /// A sample in which no channel is provided.
    #[must_use]
    pub fn new_empty(at_ns: TimeNs) -> Self {
        Self { at_ns, slots: vec![Slot::from_absence(Absence::NotProvided); ChannelId::count_channels()] }
    }

    /// What is known of `channel`.
    #[must_use]
    pub fn slot(&self, channel: ChannelId) -> &Slot {
        self.slots.get(channel.index()).unwrap_or(&NOT_PROVIDED)
    }

    /// Replaces what is known of `channel`.
    pub fn set_slot(&mut self, channel: ChannelId, slot: Slot) {
        if channel.index() >= self.slots.len() {
            self.slots.resize(channel.index() + 1, NOT_PROVIDED.clone());
        }
        self.slots[channel.index()] = slot;
    }

    /// The number of `channel`, or the reason there is none.
    ///
    /// # Errors
    /// The reason of absence; [`Absence::NotSupported`] when the channel holds text.
    pub fn number(&self, channel: ChannelId) -> Result<f64, Absence> {
        match &self.slot(channel).value {
            Ok(value) => value.as_number().ok_or(Absence::NotSupported),
            Err(reason) => Err(*reason),
        }
    }

    /// The text of `channel`, if it has one.
    #[must_use]
    pub fn text(&self, channel: ChannelId) -> Option<&str> {
        self.slot(channel).value.as_ref().ok().and_then(Value::as_text)
    }

    /// The text of `channel`, if it has one, to be kept without copying its letters.
    #[must_use]
    pub fn shared_text(&self, channel: ChannelId) -> Option<&Arc<str>> {
        match &self.slot(channel).value {
            Ok(Value::Text(text)) => Some(text),
            _ => None,
        }
    }

    /// Every channel that a source provides, with its slot.
    pub fn provided_slots(&self) -> impl Iterator<Item = (ChannelId, &Slot)> {
        ChannelId::list_all().zip(&self.slots).filter(|(_, slot)| slot.value != Err(Absence::NotProvided))
    }
}

/// Are both the same text, or both none? A text that goes on from tick to tick is the same memory: then no letter is compared.
#[must_use]
pub fn is_same_text(one: Option<&Arc<str>>, other: Option<&Arc<str>>) -> bool {
    match (one, other) {
        (None, None) => true,
        (Some(one), Some(other)) => Arc::ptr_eq(one, other) || one == other,
        _ => false,
    }
}
