//! What a computer on the network may ask of the gate, on its way to the tick.
//!
//! Less than a person: it cannot arm, cannot disarm, and cannot let a second feed hold pass. What it asks is judged by the
//! gate like the request of a script, at every tick, and only while the configuration of its sink says `allow_requests`.

use std::fmt;
use thiserror::Error;

/// Letters of a reason or of a name that are kept.
const WORDS_MAX: usize = 120;
/// The gate of a machine that others can reach over the network may be slowed by them and never sped up.
const GREATEST_PCT: f64 = 100.0;

/// Why a message of the network asks for nothing. Whoever asked is told, and the audit holds it.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RequestRefusal {
    /// A feed override that nobody may ask for over the network.
    #[error(
        "{pct} % cannot be asked for over the network: write a number from 0 to {GREATEST_PCT}; the gate does not go below min_pct"
    )]
    NotAllowedPct {
        /// What was asked for.
        pct: f64,
    },
    /// The sink takes no requests.
    #[error(
        "{what}: the sink {sink} takes no requests; write allow_requests = true under its [[sink]] to let them reach the gate"
    )]
    ClosedSink {
        /// Its name in the configuration.
        sink: String,
        /// What was asked for, in words.
        what: String,
    },
    /// The document is longer than a request can be.
    #[error("a message of {bytes} bytes is no request: at most {most}")]
    TooLong {
        /// Length of the document, bytes.
        bytes: usize,
        /// The greatest length that is read, bytes.
        most: usize,
    },
    /// The document cannot be read.
    #[error("this is no request: {error}; {forms}")]
    Unreadable {
        /// What the reader of JSON says.
        error: String,
        /// How requests are written.
        forms: &'static str,
    },
    /// The document asks for nothing that is known.
    #[error("this is no request; {forms}")]
    Unknown {
        /// How requests are written.
        forms: &'static str,
    },
    /// The broker has kept the message: it would come again at every connection, long after whoever asked has gone.
    #[error("a retained message is no request: publish it without the retain flag, and remove the retained one")]
    RetainedMessage,
    /// The same of a command of Sparkplug.
    #[error("a retained command is no request: publish it without the retain flag")]
    RetainedCommand,
    /// Nobody can say whether it is an old one.
    #[error(
        "when was this asked for? Add \"issued_at\":\"2026-01-31T08:15:00Z\" and an \"id\" of its own, so that a message that comes late or twice is not obeyed"
    )]
    WithoutOrigin,
    /// It comes too late, or from a clock that is ahead.
    #[error(
        "issued {age_s:.0} s before now by the clock of this box, and at most {most_s} s are waited for: ask again, and compare the clocks"
    )]
    NotFresh {
        /// By how much it is older than now, s; negative where it is of the future.
        age_s: f64,
        /// The greatest age, s.
        most_s: i64,
    },
    /// It may have been obeyed before the box was started.
    #[error("issued before this run of the box began: ask again")]
    BeforeStart,
    /// The same id has come before.
    #[error("the request {id:?} has come before: give each one an id of its own")]
    Repeated {
        /// The mark by which the asker tells its requests apart.
        id: String,
    },
    /// A metric that a host may not write.
    #[error(
        "{metric} cannot be written over the network: only request/feed_override_pct and request/acknowledge_alarm"
    )]
    NotWritable {
        /// Name of the metric at the broker.
        metric: String,
    },
    /// A command that asks for more than is looked at.
    #[error("a command of {count} metrics asks for too much at once: at most {most} are looked at")]
    TooMany {
        /// Metrics of the command that are requests.
        count: usize,
        /// As many are looked at.
        most: usize,
    },
    /// A metric that must be a number.
    #[error("{metric} is no number")]
    NoNumber {
        /// Name of the metric at the broker.
        metric: &'static str,
    },
    /// A metric that must be a text.
    #[error("{metric} is no text")]
    NoText {
        /// Name of the metric at the broker.
        metric: &'static str,
    },
}

impl RequestRefusal {
    /// The word for programs: several refusals of one kind have the same.
    #[must_use]
    pub fn as_word(&self) -> &'static str {
        match self {
            Self::NotAllowedPct { .. } | Self::NotWritable { .. } => "not_allowed",
            Self::ClosedSink { .. } => "closed",
            Self::TooLong { .. }
            | Self::Unreadable { .. }
            | Self::Unknown { .. }
            | Self::TooMany { .. }
            | Self::NoNumber { .. }
            | Self::NoText { .. } => "malformed",
            Self::RetainedMessage | Self::RetainedCommand => "retained",
            Self::WithoutOrigin => "without_origin",
            Self::NotFresh { .. } | Self::BeforeStart => "expired",
            Self::Repeated { .. } => "replayed",
        }
    }
}

/// What is asked for.
#[derive(Debug, Clone, PartialEq)]
pub enum RequestedChange {
    /// Another feed override, percent, for a limited time.
    FeedOverride {
        /// From 0 to 100; the limits of the gate come after that.
        pct: f64,
        /// Why, in the words of whoever asks.
        reason: String,
    },
    /// The last feed override that was asked for is over.
    Withdraw,
    /// An alarm has been seen; it stands until its reason has gone.
    AcknowledgeAlarm {
        /// Code of the alarm that was seen.
        code: String,
    },
}

impl RequestedChange {
    /// A feed override, checked; the words are cut and freed of control characters.
    ///
    /// # Errors
    /// Why it cannot be asked for, and what can.
    pub fn feed_override(pct: f64, reason: &str) -> Result<Self, RequestRefusal> {
        if !(0.0..=GREATEST_PCT).contains(&pct) {
            return Err(RequestRefusal::NotAllowedPct { pct });
        }
        Ok(Self::FeedOverride { pct, reason: clean_text(reason) })
    }

    /// An alarm that has been seen.
    #[must_use]
    pub fn acknowledge_alarm(code: &str) -> Self {
        Self::AcknowledgeAlarm { code: clean_text(code) }
    }
}

impl fmt::Display for RequestedChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FeedOverride { pct, reason } if reason.is_empty() => write!(f, "feed override {pct} %"),
            Self::FeedOverride { pct, reason } => write!(f, "feed override {pct} % ({reason})"),
            Self::Withdraw => f.write_str("no feed override any more"),
            Self::AcknowledgeAlarm { code } => write!(f, "acknowledge alarm {code}"),
        }
    }
}

/// Who asks, as the message says; nothing of it is verified.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RequestOrigin {
    /// The asker's own mark of the request.
    pub id: Option<String>,
    /// What the asker calls himself.
    pub asker: Option<String>,
    /// When it was asked for, by the asker's clock, ns since 1970.
    pub issued_ns: Option<i64>,
}

impl RequestOrigin {
    /// Of these words, cut and freed of control characters.
    #[must_use]
    pub fn from_words(id: Option<&str>, asker: Option<&str>, issued_ns: Option<i64>) -> Self {
        let clean = |text: &str| Some(clean_text(text)).filter(|text| !text.is_empty());
        Self { id: id.and_then(clean), asker: asker.and_then(clean), issued_ns }
    }
}

impl fmt::Display for RequestOrigin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.asker, &self.id) {
            (Some(asker), Some(id)) => write!(f, "asked by {asker:?}, id {id:?}"),
            (Some(asker), None) => write!(f, "asked by {asker:?}"),
            (None, Some(id)) => write!(f, "id {id:?}"),
            (None, None) => f.write_str("nobody says who asks"),
        }
    }
}

/// A change that is asked for, or why a message is none, with where it came from.
#[derive(Debug, Clone, PartialEq)]
pub struct NetworkRequest {
    /// Name of the sink in the configuration.
    pub sink: String,
    /// Who asks, as the message says.
    pub origin: RequestOrigin,
    /// What is asked for, or why it is refused before anybody looks at it.
    pub change: Result<RequestedChange, RequestRefusal>,
    /// So many messages before it came too fast and were thrown away.
    pub left_out: u64,
}

/// Text of somebody else, as it may stand in the audit and on the page.
fn clean_text(text: &str) -> String {
    text.chars().filter(|letter| !letter.is_control()).take(WORDS_MAX).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_number_that_slows_can_be_asked_for() {
        for pct in [0.0, 55.5, 100.0] {
            assert!(RequestedChange::feed_override(pct, "").is_ok(), "{pct}");
        }
        for pct in [-1.0, 100.5, 254.0, f64::NAN, f64::INFINITY] {
            let refused = RequestedChange::feed_override(pct, "").expect_err("refused");
            assert!(refused.to_string().contains("from 0 to 100"), "{refused}");
        }
    }

    #[test]
    fn words_of_others_are_cut() {
        let Ok(RequestedChange::FeedOverride { reason, .. }) =
            RequestedChange::feed_override(80.0, &"a\n\u{1b}".repeat(500))
        else {
            panic!("allowed")
        };
        assert_eq!(reason, "a".repeat(WORDS_MAX));
    }

    #[test]
    fn a_refusal_says_what_was_wrong_and_what_to_do() {
        let told = |refusal: RequestRefusal| refusal.to_string();
        assert_eq!(
            told(RequestRefusal::NotAllowedPct { pct: 254.0 }),
            "254 % cannot be asked for over the network: write a number from 0 to 100; the gate does not go below min_pct"
        );
        assert_eq!(
            told(RequestRefusal::ClosedSink { sink: "plant".to_owned(), what: RequestedChange::Withdraw.to_string() }),
            "no feed override any more: the sink plant takes no requests; write allow_requests = true under its \
             [[sink]] to let them reach the gate"
        );
        assert_eq!(
            told(RequestRefusal::TooLong { bytes: 9000, most: 2048 }),
            "a message of 9000 bytes is no request: at most 2048"
        );
        let metric = "request/feed_override_pct";
        assert_eq!(told(RequestRefusal::NoNumber { metric }), "request/feed_override_pct is no number");
    }
}
