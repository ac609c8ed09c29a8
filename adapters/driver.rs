//! What a driver can do: read, and separately command. Small traits, one verb each.

use crate::channel::ChannelId;
use crate::clock::{Clock, TimeNs};
use crate::reading::{Absence, Reading};
use crate::units::OverridePct;
use std::time::Duration;
use thiserror::Error;

/// Why a source gave nothing. A failed line, a refusing machine, an answer that makes no sense and a machine that is
/// switched off are four different things to the person standing in front of it.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SourceError {
    /// The connection failed or broke; worth trying again.
    #[error("{source_name}: the line failed: {what}. {next}")]
    Line {
        /// Which source, as its address.
        source_name: String,
        /// What happened.
        what: String,
        /// What to do next.
        next: String,
    },
    /// The device did not answer in time; worth trying again.
    #[error("{source_name}: no answer to {request} within {deadline_ms} ms. {next}")]
    Timeout {
        /// Which source, as its address.
        source_name: String,
        /// What was asked.
        request: String,
        /// How long was waited.
        deadline_ms: u64,
        /// What to do next.
        next: String,
    },
    /// The device answered and said no.
    #[error("{source_name}: the machine refused {request}: {what}. {next}")]
    Refused {
        /// Which source, as its address.
        source_name: String,
        /// What was asked.
        request: String,
        /// What it answered, in words.
        what: String,
        /// What to do next.
        next: String,
    },
    /// The device answered with something that cannot be understood.
    #[error("{source_name}: the answer to {request} makes no sense: {what}")]
    Decode {
        /// Which source, as its address.
        source_name: String,
        /// What was asked.
        request: String,
        /// What was found instead.
        what: String,
    },
    /// The machine is switched off. A normal state, not a fault.
    #[error("{source_name}: the machine is off")]
    Off {
        /// Which source, as its address.
        source_name: String,
    },
    /// Nothing more will come: the end of a recording.
    #[error("{source_name}: the end of the recording")]
    End {
        /// Which source, as its address.
        source_name: String,
    },
}

impl SourceError {
    /// The reason that every channel of the source gets while this lasts.
    #[must_use]
    pub fn absence(&self) -> Absence {
        match self {
            Self::Line { .. } | Self::End { .. } => Absence::Disconnected,
            Self::Timeout { .. } => Absence::Timeout,
            Self::Refused { .. } => Absence::Refused,
            Self::Decode { .. } => Absence::OutOfRange,
            Self::Off { .. } => Absence::MachineOff,
        }
    }
}

/// Something that can be read.
pub trait Source: Send {
    /// The address, as in the configuration.
    fn name(&self) -> &str;

    /// The channels this source can deliver.
    fn channels(&self) -> &[ChannelId];

    /// The pace at which it wants to be read.
    fn period(&self) -> Duration;

    /// Reads everything once and appends it to `out`. Blocks no longer than the source's own deadline. A value that
    /// could not be had is a reading with a reason; an error means that the whole poll failed.
    ///
    /// # Errors
    /// See [`SourceError`].
    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError>;
}

/// A source that brings its own time: a recording or the simulated machine, read as fast as the pipeline takes it.
pub trait Pull: Send {
    /// The address, as in the configuration.
    fn name(&self) -> &str;

    /// The channels this source can deliver.
    fn channels(&self) -> &[ChannelId];

    /// The pace of its readings.
    fn period(&self) -> Duration;

    /// When the next answer is there; `None` at the end.
    fn next_ns(&self) -> Option<TimeNs>;

    /// Appends the next answer to `out`.
    ///
    /// # Errors
    /// See [`SourceError`]. After a failure [`Pull::next_ns`] has moved on; a source whose time stands still is given up.
    fn pull(&mut self, out: &mut Vec<Reading>) -> Result<(), SourceError>;
}

/// Something that accepts a feed override. Only the gate holds one.
pub trait Actuator: Send {
    /// The address, as in the configuration.
    fn name(&self) -> &str;

    /// Writes the override.
    ///
    /// # Errors
    /// See [`SourceError`].
    fn write_feed_override(&mut self, clock: &dyn Clock, wanted: OverridePct) -> Result<(), SourceError>;

    /// Reads back the override in force.
    ///
    /// # Errors
    /// See [`SourceError`].
    fn read_feed_override(&mut self, clock: &dyn Clock) -> Result<OverridePct, SourceError>;
}
