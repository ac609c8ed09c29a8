//! The vocabulary of all devices: channels, readings with a time and a typed absence, and what every driver needs.
//!
//! A driver is a [`Source`]: it delivers [`Reading`]s. [`merge`] puts the readings of all sources onto the gateway's tick as
//! a [`Sample`]. What one kind of device needs stands in its own crate; nothing here knows of any.

pub mod address;
pub mod bilingual;
pub mod channel;
pub mod clock;
pub mod conversion;
pub mod driver;
pub mod electric;
pub mod energy_count;
pub mod histogram;
pub mod integer;
pub mod merge;
pub mod model_library;
pub mod offset;
pub mod opened_device;
pub mod override_pct;
pub mod own;
pub mod percent;
pub mod plausibility;
pub mod reading;
pub mod request;
pub mod sample;
pub mod state;
pub mod stream;
pub mod text;
mod text_set;
pub mod threads;
pub mod tool_name;
pub mod unique_id;
pub mod words;

pub use channel::{Channel, ChannelId};
pub use driver::{
    Actuator, Fact, FactValue, LadderRequest, LadderRule, Offer, Pull, Source, SourceError, SourceProblem,
};
pub use offset::{Axis, OffsetSink};
pub use opened_device::{OpenedDevice, UnreadableSecret};
pub use reading::{Absence, Reading, Stamp, Value};
pub use sample::{Sample, Slot, is_same_text};
