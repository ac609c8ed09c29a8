//! The world, in units: controllers, meters and recordings, read into one vocabulary.
//!
//! An adapter turns what a device says into [`Reading`]s: one channel, one time, a value or a typed reason for its
//! absence. Readings of all sources are merged onto the gateway's tick as a [`Sample`], and samples over time are a
//! [`Recording`].
//!
//! | crate | what | uses |
//! |---|---|---|
//! | [`adapter_core`] | channels, readings, merging, what every driver needs | |
//! | [`device_line`] | TLS, serial lines, child processes around a vendor's library | `adapter_core` |
//! | [`recording`](mod@recording) | recordings in every format that is read | `adapter_core`, `mtconnect` |
//! | [`simulated`] | the built-in machine | `adapter_core` |
//! | [`mqtt`] | a client of MQTT | `adapter_core` |
//! | [`mtconnect`] | controls behind an MTConnect agent | `adapter_core` |
//! | [`modbus`] | meters by Modbus | `adapter_core` |
//! | [`modbus_server`] | the simulated machine as a meter | `modbus`, `simulated` |
//! | [`fanuc`] | FANUC controllers, natively and through the vendor's library | `adapter_core` |
//! | [`fanuc_server`] | the simulated machine as a FANUC control | `fanuc`, `simulated` |
//! | [`nclink`] | Huazhong controllers by NC-Link | `adapter_core`, `mqtt` |
//! | [`nclink_device`] | the simulated machine as an NC-Link device | `nclink`, `simulated` |
//! | [`hnc`] | Huazhong controllers through the vendor's library | `adapter_core`, `nclink` |
//!
//! This crate reads addresses, opens what they name and runs the threads that poll it.
//!
//! What is deliberately absent here:
//! - no estimation: an adapter reports, it never infers;
//! - no tokio: a driver is synchronous and lives on its own thread;
//! - no NaN: a missing value is an [`Absence`] with a reason;
//! - no `unsafe` outside files named `ffi.rs`.

pub mod address;
pub mod eda9033a;
pub mod open;
pub mod replay;
pub mod temperature;
pub mod waveform;
pub mod worker;

pub use adapter_core::{
    bilingual, channel, clock, conversion, driver, electric, histogram, merge, offset, override_pct, own, plausibility,
    reading, sample, text, threads, unique_id, words,
};
pub use device_line;
pub use fanuc;
pub use fanuc_server;
pub use hnc;
pub use modbus;
pub use modbus_server;
pub use mqtt;
pub use mtconnect;
pub use nclink;
pub use nclink_device;
pub use recording;
pub use simulated;

pub use adapter_core::{
    Absence, Actuator, Axis, Channel, ChannelId, Fact, FactValue, LadderRequest, LadderRule, Offer, OffsetSink, Pull,
    Reading, Sample, Slot, Source, SourceError, SourceProblem, Stamp, Value,
};
pub use address::Address;
pub use recording::Recording;
