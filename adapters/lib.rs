//! The world, in units: controllers, meters and recordings, read into one vocabulary.
//!
//! An adapter turns what a device says into [`Reading`]s: one channel, one time, a value or a typed reason for its
//! absence. Readings of all sources are merged onto the gateway's tick as a [`Sample`], and samples over time are a
//! [`Recording`].
//!
//! What is deliberately absent here:
//! - no estimation: an adapter reports, it never infers;
//! - no tokio: a driver is synchronous and lives on its own thread;
//! - no NaN: a missing value is an [`Absence`] with a reason;
//! - no `unsafe` outside files named `ffi.rs`.

pub mod address;
pub mod bilingual;
pub mod channel;
pub mod child;
pub mod clock;
pub mod conversion;
pub mod driver;
pub mod eda9033a;
pub mod electric;
pub mod fanuc;
pub mod histogram;
pub mod hnc;
pub mod merge;
pub mod modbus;
pub mod mqtt;
pub mod nclink;
pub mod offset;
pub mod open;
pub mod own;
pub mod plausibility;
pub mod reading;
pub mod recording;
pub mod replay;
pub mod sample;
pub mod serial;
pub mod simulated;
pub(crate) mod stream;
pub mod temperature;
pub mod text;
pub mod tls;
pub mod units;
pub mod waveform;
pub mod words;
pub mod worker;

pub use address::Address;
pub use channel::{Channel, ChannelId};
pub use driver::{
    Actuator, Fact, FactValue, LadderRequest, LadderRule, Offer, Pull, Source, SourceError, SourceProblem,
};
pub use offset::{Axis, OffsetSink};
pub use reading::{Absence, Reading, Stamp, Value};
pub use recording::Recording;
pub use sample::{Sample, Slot};
