//! What became of a request of the network in the end. Each request that is answered has exactly one outcome.

use super::RequestOrigin;
use adapter_core::clock::TimeNs;

/// Outcomes of one sink that wait to be told; where nobody fetches them, the audit alone holds what is beyond.
pub const OUTCOMES_MAX: usize = 64;

/// How outcomes come back to the sink that asked.
pub type OutcomeSender = tokio::sync::mpsc::Sender<RequestOutcome>;

/// How it ended, in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The control shows what was asked for; the machine was given back to its dial; the alarm counts as seen.
    Followed,
    /// The control shows another override than the one that was asked for.
    Limited,
    /// The time of the request is over, and the control has not shown it.
    NotFollowed,
    /// The gate is not armed, or its arming ended before the control has shown it.
    NotWritten,
    /// The control did not take what was written, or could not be reached.
    Failed,
    /// Whoever asked has asked for something else meanwhile.
    Replaced,
    /// Nobody has looked whether it could be done.
    Refused,
}

impl Ending {
    /// The word in messages and audit.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Followed => "followed",
            Self::Limited => "limited",
            Self::NotFollowed => "not_followed",
            Self::NotWritten => "not_written",
            Self::Failed => "failed",
            Self::Replaced => "replaced",
            Self::Refused => "refused",
        }
    }
}

/// The outcome of a request.
#[derive(Debug, Clone, PartialEq)]
pub struct RequestOutcome {
    /// Who has asked, as the message says.
    pub origin: RequestOrigin,
    /// How it ended, in one word.
    pub ending: Ending,
    /// Why, as a word for programs; empty where the ending says all.
    pub why: &'static str,
    /// The same for a person.
    pub text: String,
    /// The feed override that was asked for, percent.
    pub asked_pct: Option<f64>,
    /// The feed override that the control showed when it ended, percent.
    pub in_force_pct: Option<f64>,
    /// When it ended, ns since 1970.
    pub at_ns: TimeNs,
}
