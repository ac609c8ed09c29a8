//! What parent and child say, as JSON.

use super::answer::{HncItemResult, HncReturnCode};
use super::item::HncItem;
use super::sampling::{Columns, SampledItem};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum HncRequest {
    /// Load the library, listen, connect.
    Open {
        vendor_library: PathBuf,
        /// Number of this computer in the controller's network.
        local_host: String,
        /// Port of the library's own listener.
        local_port: u16,
        host: String,
        port: u16,
        /// Bytes of `Bit32` in arrays.
        long_bytes: usize,
    },
    /// Is the connection alive, and what has happened since?
    Alive,
    /// Read these, one answer for each as soon as it is there. After an answer that cannot be trusted, or a link that is
    /// dead, no other comes.
    Read(Vec<HncItem>),
    /// Write one register: type, index, value.
    Write(i32, i32, i64),
    /// Write the channel's external zero offset: logical axis, counts.
    WriteZero(i32, i32),
    Sample(Vec<SampledItem>),
    /// What has been sampled since.
    Sampled,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum HncReply {
    Opened,
    /// The library could not be loaded, or lacks what nothing works without.
    Unloadable(String),
    /// A return code of this function.
    Code(String, HncReturnCode),
    /// `HNC_NetIsConnect`, and how often an event told of a connection and of a loss.
    Alive {
        /// 0 connected, otherwise a code.
        code: i32,
        connected: u64,
        lost: u64,
    },
    Read(HncItemResult),
    /// A call took so long, ms, that the link must be dead.
    DeadLink(u64),
    /// Written, or sampling.
    Done,
    Sampled(Columns),
    /// The request made no sense, or there is no connection.
    Confused(String),
}
