//! What a driver can do: read, and separately command. Small traits, one verb each.

use crate::channel::ChannelId;
use crate::clock::{Clock, TimeNs};
use crate::override_pct::OverridePct;
use crate::reading::{Absence, Reading};
use crate::text::shorten_text;
use std::time::Duration;
use thiserror::Error;

/// What to do next where only the control itself can tell more.
pub const SEE_DOCTOR: &str = "Look at what the control answers: cnc-gateway doctor with this address";

/// Why a source gave nothing. A failed line, a refusing machine, an answer that makes no sense and a machine that is
/// switched off are four different things to the person standing in front of it.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SourceError {
    /// The connection failed or broke; worth trying again.
    #[error("{source_name}: the line failed: {what}. {next}")]
    Line {
        /// Which source, as its address.
        source_name: String,
        /// What the system or the driver says of the line, in words.
        what: String,
        /// What to do next.
        next: String,
    },
    /// The device did not answer in time; worth trying again.
    #[error("{source_name}: no answer to {request} within {deadline_ms} ms. {next}")]
    Timeout {
        /// Which source, as its address.
        source_name: String,
        /// What was asked for, in words that fit into the message.
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
        /// What was asked for, in words that fit into the message.
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
        /// What was asked for, in words that fit into the message.
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
    /// The same with what the device said cut to the length that is told of it.
    #[must_use]
    pub fn with_short_texts(mut self) -> Self {
        let cut = |text: &mut String| *text = shorten_text(std::mem::take(text));
        match &mut self {
            Self::Line { what, .. } | Self::Refused { what, .. } | Self::Decode { what, .. } => cut(what),
            Self::Timeout { .. } | Self::Off { .. } | Self::End { .. } => {}
        }
        self
    }

    /// The reason that every channel of the source gets while this lasts.
    #[must_use]
    pub fn to_absence(&self) -> Absence {
        match self {
            Self::Line { .. } | Self::End { .. } => Absence::Disconnected,
            Self::Timeout { .. } => Absence::Timeout,
            Self::Refused { .. } => Absence::Refused,
            Self::Decode { .. } => Absence::OutOfRange,
            Self::Off { .. } => Absence::MachineOff,
        }
    }
}

/// What a source knows of itself besides its readings: which device answers, how often it refreshes, how long the wire
/// takes. Shown beside the source; never an input of anything.
#[derive(Debug, Clone, PartialEq)]
pub struct Fact {
    /// What it is; a number's name ends in its unit.
    pub name: String,
    /// The number or text that is shown beside the name.
    pub value: FactValue,
}

/// What a [`Fact`] says.
#[derive(Debug, Clone, PartialEq)]
pub enum FactValue {
    /// Finite, in the unit of the name.
    Number(f64),
    /// A name or a sentence.
    Text(String),
}

impl Fact {
    /// A number; its name ends in the unit.
    #[must_use]
    pub fn from_number(name: impl Into<String>, number: f64) -> Self {
        Self { name: name.into(), value: FactValue::Number(number) }
    }

    /// A name or a sentence.
    #[must_use]
    pub fn from_text(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self { name: name.into(), value: FactValue::Text(shorten_text(text.into())) }
    }
}

/// Something that is wrong with a source although it answers.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct SourceProblem {
    /// What, in words, with the channels that it costs.
    pub what: String,
    /// What to do next.
    pub next: String,
}

impl SourceProblem {
    /// The same with what the device said cut to the length that is told of it.
    #[must_use]
    pub fn with_short_texts(self) -> Self {
        Self { what: shorten_text(self.what), next: shorten_text(self.next) }
    }
}

/// Something that a device offers, whether a channel takes it or not.
#[derive(Debug, Clone, PartialEq)]
pub struct Offer {
    /// What it is called there; written after `read =` it makes a channel of it, where that is possible.
    pub name: String,
    /// What it says now, with its unit as the device tells it; or why it says nothing.
    pub says: Result<String, String>,
    /// The channel that takes it.
    pub channel: Option<ChannelId>,
}

/// Something that can be read.
pub trait Source: Send {
    /// The address, as in the configuration.
    fn name(&self) -> &str;

    /// The channels this source can deliver.
    fn channels(&self) -> &[ChannelId];

    /// The pace at which it wants to be read.
    fn period(&self) -> Duration;

    /// The pace that the device can keep, asked for after every read: at least [`Source::period`], longer where the device
    /// takes its time. What is older than two of these counts as stale. It is read sooner where this is long, to notice that the device
    /// is quick again: a source that says so bounds by itself how much it asks of its device.
    fn achievable_period(&self) -> Duration {
        self.period()
    }

    /// Who answers, as far as it is known after a successful read: pairs of a word and a text. May ask the device; for
    /// what is shown all the time there are [`Source::collect_facts`].
    fn query_identity(&self) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// Reads everything once and appends it to `out`. Blocks no longer than the source's own deadline. A value that
    /// could not be had is a reading with a reason; an error means that the whole poll failed.
    ///
    /// # Errors
    /// See [`SourceError`].
    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError>;

    /// What it has found out about itself so far. Asked for about once a second; does not talk to the device.
    fn collect_facts(&self) -> Vec<Fact> {
        Vec::new()
    }

    /// What is wrong although it answers, as of the last read. Asked for after every read; does not talk to the device. The
    /// same trouble has the same words as long as it lasts.
    fn list_problems(&self) -> Vec<SourceProblem> {
        Vec::new()
    }

    /// Everything that the device offers, for whoever wants to make channels of it. Talks to the device and may take its
    /// time; a kind that cannot tell gives nothing.
    ///
    /// # Errors
    /// See [`SourceError`].
    fn list_offers(&mut self, _clock: &dyn Clock) -> Result<Vec<Offer>, SourceError> {
        Ok(Vec::new())
    }
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
    fn pull_readings(&mut self, out: &mut Vec<Reading>) -> Result<(), SourceError>;
}

/// How the ladder makes one override of the operator's dial and the gateway's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LadderRule {
    /// The lesser one: the gateway never raises the feed above the dial.
    #[default]
    Least,
    /// One of the other: dial 50 % and gateway 120 % are 60 %. A dial at zero still stops the feed.
    Product,
    /// The gateway's override takes the place of the dial while it is enabled. Such ladders exist and nobody should build
    /// one: the operator's dial is without effect meanwhile. Only served and recognised, never configured.
    Replace,
}

impl LadderRule {
    /// What is in force with this dial and this override in the mailbox.
    #[must_use]
    pub fn combine_overrides(self, dial: OverridePct, mailbox: OverridePct) -> OverridePct {
        match self {
            Self::Least => dial.min(mailbox),
            Self::Replace => mailbox,
            Self::Product => {
                let product = u32::from(dial.percent()) * u32::from(mailbox.percent()) / 100;
                u8::try_from(product).ok().and_then(OverridePct::new).unwrap_or(OverridePct::GREATEST)
            }
        }
    }
}

/// What the ladder can be asked for besides an override. It latches the request and acts as the machine's builder decided;
/// the operator ends it at the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum LadderRequest {
    /// The axes stop now; the spindle turns on.
    FeedHold,
    /// The program stops after the part that is running.
    Stop,
}

impl LadderRequest {
    /// Every request: feed hold, then stop.
    pub const ALL: [Self; 2] = [Self::FeedHold, Self::Stop];

    /// The word in the history and in scripts.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::FeedHold => "feed_hold",
            Self::Stop => "stop",
        }
    }
}

/// Something that accepts a feed override. Only the gate holds one.
pub trait Actuator: Send {
    /// The address, as in the configuration.
    fn name(&self) -> &str;

    /// Writes the override; the same one again is the sign of life that the ladder waits for.
    ///
    /// # Errors
    /// See [`SourceError`].
    fn write_feed_override(&mut self, clock: &dyn Clock, wanted: OverridePct) -> Result<(), SourceError>;

    /// Reads back the override in force.
    ///
    /// # Errors
    /// See [`SourceError`].
    fn read_feed_override(&mut self, clock: &dyn Clock) -> Result<OverridePct, SourceError>;

    /// Reads the operator's dial; `None` where the machine does not tell it apart from the override in force.
    ///
    /// # Errors
    /// See [`SourceError`].
    fn read_dial(&mut self, _clock: &dyn Clock) -> Result<Option<OverridePct>, SourceError> {
        Ok(None)
    }

    /// Gives the machine back to its dial. A machine without such a letter gets 100 %.
    ///
    /// # Errors
    /// See [`SourceError`].
    fn release_override(&mut self, clock: &dyn Clock) -> Result<(), SourceError> {
        self.write_feed_override(clock, OverridePct::FULL)
    }

    /// Withdraws an override that an earlier run has left enabled, and tells whether there was one. A way of writing that
    /// cannot tell says that there was none.
    ///
    /// # Errors
    /// See [`SourceError`].
    fn withdraw_leftover(&mut self, _clock: &dyn Clock) -> Result<bool, SourceError> {
        Ok(false)
    }

    /// Asks the ladder for a feed hold or a stop.
    ///
    /// # Errors
    /// See [`SourceError`]; a driver that has no way to ask refuses.
    fn ask_ladder(&mut self, _clock: &dyn Clock, request: LadderRequest) -> Result<(), SourceError> {
        Err(SourceError::Refused {
            source_name: self.name().to_owned(),
            request: request.as_word().to_owned(),
            what: "this driver has no way to ask the ladder for it".to_owned(),
            next: "raise an alarm instead, and let the operator stop the machine".to_owned(),
        })
    }

    /// The machine may take this long to show what was written.
    fn settles_within(&self) -> Duration {
        Duration::from_secs(1)
    }
}

impl<A: Actuator + ?Sized> Actuator for Box<A> {
    fn name(&self) -> &str {
        (**self).name()
    }

    fn write_feed_override(&mut self, clock: &dyn Clock, wanted: OverridePct) -> Result<(), SourceError> {
        (**self).write_feed_override(clock, wanted)
    }

    fn read_feed_override(&mut self, clock: &dyn Clock) -> Result<OverridePct, SourceError> {
        (**self).read_feed_override(clock)
    }

    fn read_dial(&mut self, clock: &dyn Clock) -> Result<Option<OverridePct>, SourceError> {
        (**self).read_dial(clock)
    }

    fn release_override(&mut self, clock: &dyn Clock) -> Result<(), SourceError> {
        (**self).release_override(clock)
    }

    fn withdraw_leftover(&mut self, clock: &dyn Clock) -> Result<bool, SourceError> {
        (**self).withdraw_leftover(clock)
    }

    fn ask_ladder(&mut self, clock: &dyn Clock, request: LadderRequest) -> Result<(), SourceError> {
        (**self).ask_ladder(clock, request)
    }

    fn settles_within(&self) -> Duration {
        (**self).settles_within()
    }
}
