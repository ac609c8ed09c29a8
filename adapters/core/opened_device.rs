//! What an address of one device opens.

use crate::driver::{Actuator, Source};
use crate::offset::OffsetSink;
use thiserror::Error;

/// The sources of a device and the ways to write to it.
pub struct OpenedDevice {
    /// In the order of precedence.
    pub sources: Vec<Box<dyn Source>>,
    /// The way to the feed override, where there is one. Only the gate may hold it.
    pub actuator: Option<Box<dyn Actuator>>,
    /// The way to the external work offsets, where there is one. Only the gate may hold it.
    pub offsets: Option<Box<dyn OffsetSink>>,
}

/// A file with a password cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{file}: the password cannot be read: {what}")]
pub struct UnreadableSecret {
    /// The file named in the address.
    pub file: String,
    /// What the system said.
    pub what: String,
}
