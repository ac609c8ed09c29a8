//! What can be asked of the gate. A request is only a wish: nothing has been checked, and the gate decides.

use crate::offset::Axis;
use std::sync::Arc;

/// A request to the gate. Nothing has been checked: the number may be anything, NaN included.
#[derive(Debug, Clone, PartialEq)]
pub struct OverrideRequest {
    /// Percent of the programmed feed.
    pub pct: f64,
    /// Why, in the script's words.
    pub reason: Arc<str>,
    /// File name of the script that asks.
    pub script: Arc<str>,
    /// Which version of it.
    pub version: u64,
}

impl OverrideRequest {
    /// The least of several requests; one that is no number goes first, because the gate must see and refuse it.
    pub fn find_least<'a>(requests: impl Iterator<Item = &'a Self>) -> Option<&'a Self> {
        let key = |request: &Self| if request.pct.is_finite() { request.pct } else { f64::NEG_INFINITY };
        requests.min_by(|a, b| key(a).total_cmp(&key(b)))
    }
}

/// What a script can ask the operator's machine to do besides another feed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stop {
    /// A feed hold, through the ladder.
    FeedHold,
    /// Change the tool, at the next occasion that the ladder allows.
    ToolChange,
}

impl Stop {
    /// The word in the history and in JSON.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::FeedHold => "feed_hold",
            Self::ToolChange => "tool_change",
        }
    }

    /// Are two requests of this kind, with these reasons, one and the same? A feed hold holds the whole machine, whatever the reason;
    /// a tool change is for one edge, which the reason names, so another reason is another request.
    #[must_use]
    pub fn is_same_request(self, reason: &str, other: &str) -> bool {
        match self {
            Self::FeedHold => true,
            Self::ToolChange => reason == other,
        }
    }
}

/// A request to hold the feed or to change the tool. Whether it is passed on, latched and only once, is the gate's.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StopRequest {
    /// Feed hold or tool change.
    pub stop: Stop,
    /// Why, in the script's words.
    pub reason: Arc<str>,
    /// File name of the script that asks.
    pub script: Arc<str>,
    /// Which version of it.
    pub version: u64,
}

impl StopRequest {
    /// Do both ask for the same?
    #[must_use]
    pub fn is_same_request(&self, other: &Self) -> bool {
        self.stop == other.stop && self.stop.is_same_request(&self.reason, &other.reason)
    }
}

/// An offset that would compensate the thermal error of an axis. Nothing has been checked: the number may be anything,
/// NaN included.
#[derive(Debug, Clone, PartialEq)]
pub struct OffsetProposal {
    /// The axis whose position is to be corrected.
    pub axis: Axis,
    /// The whole offset, not an increment, um.
    pub offset_um: f64,
    /// Why, in the script's words.
    pub reason: Arc<str>,
    /// File name of the script that proposes it.
    pub script: Arc<str>,
    /// Which version of it.
    pub version: u64,
}
