//! What sample channels and events have brought: how much, and whether a millisecond is missing.

use super::begin_time::ForeignClock;
use super::decode;
use super::sample::SampleBlock;
use adapter_core::driver::{Fact, SourceProblem};
use adapter_core::integer::widen_to_u64;
use serde_json::Value;
use std::collections::BTreeMap;

/// At most so many sample channels are followed.
const CHANNELS_MAX: usize = 64;
/// So many last events are kept.
const EVENTS_KEPT: usize = 32;

/// What has come of one sample channel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ChannelTrack {
    /// Messages of the channel so far.
    pub messages: u64,
    /// Instants: rows of the messages.
    pub instants: u64,
    /// Instants between two messages that neither holds.
    pub missing: u64,
    /// Messages that begin before the one before has ended.
    pub overlapping: u64,
    expected_ms: Option<f64>,
}

/// Every sample channel, and the last events.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampleTracks {
    channels: BTreeMap<String, ChannelTrack>,
    events: Vec<String>,
    event_count: u64,
    lost: u64,
    nonsense: u64,
    why: Option<String>,
    /// Is `why` that of the last message?
    why_stands: bool,
    /// How the device tells times, where that is not as the standard has it.
    clock: Option<ForeignClock>,
}

impl SampleTracks {
    /// Every sample channel by its name.
    pub fn channels(&self) -> impl Iterator<Item = (&str, &ChannelTrack)> {
        self.channels.iter().map(|(name, channel)| (name.as_str(), channel))
    }

    /// The last events, the newest last.
    #[must_use]
    pub fn events(&self) -> &[String] {
        &self.events
    }

    /// Events that have come so far, forgotten ones included.
    #[must_use]
    pub fn event_count(&self) -> u64 {
        self.event_count
    }

    /// Messages that were lost in this client or made no sense, and why the last of them did not.
    #[must_use]
    pub fn unusable_messages(&self) -> (u64, Option<&str>) {
        (self.lost + self.nonsense, self.why.as_deref())
    }

    /// The same as facts of the source: instants and missing instants of each sample channel, events, unusable messages.
    #[expect(clippy::cast_precision_loss, reason = "counts")]
    pub(super) fn collect_facts(&self) -> Vec<Fact> {
        let mut facts = Vec::new();
        for (name, channel) in &self.channels {
            facts.push(Fact::from_number(format!("{name}_instants"), channel.instants as f64));
            facts.push(Fact::from_number(format!("{name}_missing_instants"), channel.missing as f64));
        }
        facts.push(Fact::from_number("events", self.event_count as f64));
        facts.extend(self.events.last().map(|event| Fact::from_text("last_event", event)));
        facts.push(Fact::from_number("unusable_messages", self.unusable_messages().0 as f64));
        facts
    }

    /// What is wrong with what the device sends by itself at the moment.
    pub(super) fn list_problems(&self) -> Vec<SourceProblem> {
        let unusable = self.why.as_ref().filter(|_| self.why_stands).map(|why| SourceProblem {
            what: format!("what the device sends on its sample channels cannot be used: {why}"),
            next: "Correct the sample channel in the device's model or adapter; what is polled goes on without it"
                .to_owned(),
        });
        let clock = self.clock.map(|clock| SourceProblem {
            what: format!("the device tells the times of its samples {}, not in milliseconds", clock.describe_form()),
            next: "They are converted; the standard (GB/T 41970) has milliseconds since 1970 as \"beginTime\""
                .to_owned(),
        });
        unusable.into_iter().chain(clock).collect()
    }

    pub(super) fn lost_messages(&mut self, lost: u64) {
        self.lost = lost;
    }

    pub(super) fn record_nonsense(&mut self, why: String) {
        self.nonsense += 1;
        self.why = Some(why);
        self.why_stands = true;
    }

    /// A message that is dropped, and no fault of the device.
    pub(super) fn record_dropped(&mut self, why: &str) {
        self.nonsense += 1;
        self.why = Some(why.to_owned());
        self.why_stands = false;
    }

    pub(super) fn record_event(&mut self, message: &Value) {
        self.event_count += 1;
        let said = message.get("event").unwrap_or(message);
        let words = decode::format_alarms(said);
        let text = if words.is_empty() { said.to_string() } else { words };
        if self.events.len() >= EVENTS_KEPT {
            self.events.remove(0);
        }
        self.events.push(text.chars().take(200).collect());
    }

    pub(super) fn record_block(&mut self, block: &SampleBlock) {
        if self.channels.len() >= CHANNELS_MAX && !self.channels.contains_key(&block.channel) {
            return self.record_nonsense(format!("more than {CHANNELS_MAX} sample channels"));
        }
        (self.why_stands, self.clock) = (false, block.clock);
        self.channels.entry(block.channel.clone()).or_default().record_block(block);
    }
}

impl ChannelTrack {
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a positive count; milliseconds since 1970 fit a double"
    )]
    fn record_block(&mut self, block: &SampleBlock) {
        let begin_ms = block.begin_ms as f64;
        if let Some(expected_ms) = self.expected_ms {
            // Half an interval is the rounding of the device's own milliseconds.
            let gap = (begin_ms - expected_ms) / block.interval_ms;
            if gap > 0.5 {
                self.missing += gap.round() as u64;
            } else if gap < -0.5 {
                self.overlapping += 1;
            }
        }
        self.messages += 1;
        self.instants += widen_to_u64(block.instants);
        self.expected_ms = Some(begin_ms + block.duration_ms());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn block(begin_ms: i64, instants: usize) -> SampleBlock {
        SampleBlock { channel: "s".to_owned(), begin_ms, interval_ms: 1.0, instants, columns: Vec::new(), clock: None }
    }

    #[test]
    fn a_missing_millisecond_is_counted() {
        let mut track = SampleTracks::default();
        for (begin_ms, instants) in [(0, 200), (200, 200), (401, 200), (801, 200), (900, 10)] {
            track.record_block(&block(begin_ms, instants));
        }
        let (_, channel) = track.channels().next().expect("one");
        assert_eq!((channel.messages, channel.instants, channel.missing, channel.overlapping), (5, 810, 201, 1));
    }

    #[test]
    fn events_are_kept_as_words_and_bounded() {
        let mut track = SampleTracks::default();
        (0..100).for_each(|number| track.record_event(&json!({"event": {"number": number, "text": "x"}})));
        assert_eq!((track.event_count(), track.events().len()), (100, EVENTS_KEPT));
        assert_eq!(track.events().last().map(String::as_str), Some("99 x"));
    }
}
