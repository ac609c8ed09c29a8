//! Why a meter cannot be read at all, before anything is sent.

use super::profile::ProfileError;
use adapter_core::channel::ChannelId;
use device_line::serial::LineConflict;
use thiserror::Error;

/// An address or a profile that makes no meter.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum MeterError {
    /// The profile is not known or cannot be used.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// Ratios of transformers are given for a meter that counts them in.
    #[error("{meter} counts its transformers in: leave ct and pt out")]
    TransformersCounted {
        /// What the meter is called, as the profile writes it.
        meter: String,
    },
    /// Two values of the profile are the same channel.
    #[error("profile {profile} gives {channel} twice")]
    ChannelTwice {
        /// Name of the profile.
        profile: String,
        /// The channel that two values would be.
        channel: ChannelId,
    },
    /// No value of the profile is a channel.
    #[error("profile {profile} gives no channel")]
    NoChannel {
        /// Name of the profile.
        profile: String,
    },
    /// The registers lie so far apart that a poll would take too long.
    #[error("{requests} requests per poll; at most {most}, so make it two profiles")]
    TooManyRequests {
        /// Requests that one poll needs.
        requests: usize,
        /// The greatest number that is accepted.
        most: usize,
    },
    /// Another address uses the serial line at another speed or parity.
    #[error(transparent)]
    Line(#[from] LineConflict),
    /// Another address uses the same host and port with other frames.
    #[error("two addresses use {host}:{port} with different framing=; one connection has one of them")]
    Framing {
        /// The host that both name.
        host: String,
        /// The TCP port that both name.
        port: u16,
    },
}
