//! The machine builder's ladder between the gateway's mailbox and the feed: a dozen rungs, as the builder is asked to write
//! them (manual of the controls: a second override behind the operator's dial, dropped when the sign of life stops).
//!
//! | what the gateway posts | what the ladder does |
//! |---|---|
//! | an override | it counts from a few scans later on, combined with the dial by [`LadderRule`]; each letter is a sign of life |
//! | nothing for [`LadderSettings::heartbeat`] | the dial alone counts again |
//! | release | the same at once |
//! | feed hold | the axes stop and stay so until the operator acknowledges |
//! | stop | after the part that is running the program stands until the operator acknowledges |
//!
//! The dial is the operator's; nothing that is posted turns it.

use adapter_core::clock::TimeNs;
use adapter_core::driver::{LadderRequest, LadderRule};
use adapter_core::integer::saturate_to_wait_ns;
use adapter_core::override_pct::OverridePct;
use std::collections::VecDeque;
use std::time::Duration;

/// At most so many letters wait for their scan; the newest then takes the place of the one before.
const LETTERS_MAX: usize = 1024;

/// How the ladder is built.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LadderSettings {
    /// How the override in the mailbox and the dial become one.
    pub rule: LadderRule,
    /// Without a letter for this long the dial alone counts.
    pub heartbeat: Duration,
    /// From the letter to its effect: three scans of 8 ms.
    pub scan: Duration,
    /// After a feed hold or a stop the operator comes, looks (after a stop: changes the edge) and acknowledges.
    pub attended_after: Duration,
}

impl Default for LadderSettings {
    fn default() -> Self {
        Self {
            rule: LadderRule::Least,
            heartbeat: Duration::from_secs(1),
            scan: Duration::from_millis(24),
            attended_after: Duration::from_secs(45),
        }
    }
}

/// What the gateway has posted since the machine began, counted by the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LadderCounts {
    /// Overrides, signs of life among them.
    pub overrides: u64,
    /// Releases of the override by the gateway.
    pub releases: u64,
    /// Requests for a feed hold.
    pub feed_holds: u64,
    /// Requests for a stop.
    pub stops: u64,
    /// Writes of an external work offset, which the ladder passes on to the control.
    pub offsets: u64,
    /// Times that the sign of life failed while an override was in force.
    pub heartbeats_lost: u64,
}

impl LadderCounts {
    /// Everything that was ever written to the controller.
    #[must_use]
    pub fn count_writes(&self) -> u64 {
        self.overrides + self.releases + self.feed_holds + self.stops + self.offsets
    }
}

/// What comes into the ladder from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum LadderInput {
    Override(OverridePct),
    Release,
    Ask(LadderRequest),
    /// The operator turns the dial; no letter of the gateway.
    Dial(OverridePct),
}

/// What stands in the mailbox.
#[derive(Debug, Clone, Copy)]
struct Mail {
    override_pct: OverridePct,
    /// The newest sign of life.
    alive_ns: TimeNs,
}

#[derive(Debug, Clone, Copy)]
struct Latch {
    since_ns: TimeNs,
}

#[derive(Debug)]
pub(super) struct Ladder {
    settings: LadderSettings,
    dial: OverridePct,
    mail: Option<Mail>,
    inputs: VecDeque<(TimeNs, LadderInput)>,
    feed_hold: Option<Latch>,
    stop: Option<Latch>,
    counts: LadderCounts,
}

impl Ladder {
    pub(super) fn new(settings: LadderSettings) -> Self {
        Self {
            settings,
            dial: OverridePct::FULL,
            mail: None,
            inputs: VecDeque::new(),
            feed_hold: None,
            stop: None,
            counts: LadderCounts::default(),
        }
    }

    /// Takes a letter; it has its effect a few scans later, in the order in which letters came.
    pub(super) fn post_letter(&mut self, at_ns: TimeNs, letter: LadderInput) {
        match letter {
            LadderInput::Override(_) => self.counts.overrides += 1,
            LadderInput::Release => self.counts.releases += 1,
            LadderInput::Ask(LadderRequest::FeedHold) => self.counts.feed_holds += 1,
            LadderInput::Ask(LadderRequest::Stop) => self.counts.stops += 1,
            LadderInput::Dial(_) => {}
        }
        if self.inputs.len() >= LETTERS_MAX {
            self.inputs.pop_back();
        }
        let due_ns = at_ns.saturating_add(saturate_to_wait_ns(self.settings.scan));
        let earliest_ns = self.inputs.back().map_or(due_ns, |(due_ns, _)| *due_ns);
        self.inputs.push_back((due_ns.max(earliest_ns), letter));
    }

    pub(super) fn run_scan(&mut self, at_ns: TimeNs) {
        while let Some((due_ns, letter)) = self.inputs.pop_front_if(|(due_ns, _)| *due_ns <= at_ns) {
            self.apply_letter(due_ns, letter);
        }
        let heartbeat_ns = saturate_to_wait_ns(self.settings.heartbeat);
        if self.mail.is_some_and(|mail| at_ns - mail.alive_ns >= heartbeat_ns) {
            self.mail = None;
            self.counts.heartbeats_lost += 1;
        }
    }

    fn apply_letter(&mut self, at_ns: TimeNs, letter: LadderInput) {
        match letter {
            LadderInput::Override(override_pct) => self.mail = Some(Mail { override_pct, alive_ns: at_ns }),
            LadderInput::Release => self.mail = None,
            LadderInput::Ask(LadderRequest::FeedHold) => _ = self.feed_hold.get_or_insert(Latch { since_ns: at_ns }),
            LadderInput::Ask(LadderRequest::Stop) => _ = self.stop.get_or_insert(Latch { since_ns: at_ns }),
            LadderInput::Dial(dial) => self.dial = dial,
        }
    }

    /// The operator turns the dial, now.
    pub(super) fn turn_dial(&mut self, dial: OverridePct) {
        self.dial = dial;
    }

    pub(super) fn dial(&self) -> OverridePct {
        self.dial
    }

    /// The override that the feed obeys.
    pub(super) fn in_force(&self) -> OverridePct {
        self.mail.map_or(self.dial, |mail| self.settings.rule.combine_overrides(self.dial, mail.override_pct))
    }

    /// Do the axes stand because of a feed hold? The operator ends it when his time has come.
    pub(super) fn is_holding_feed(&mut self, at_ns: TimeNs) -> bool {
        let attended_ns = saturate_to_wait_ns(self.settings.attended_after);
        self.feed_hold = self.feed_hold.filter(|latch| at_ns - latch.since_ns < attended_ns);
        self.feed_hold.is_some()
    }

    /// Does the program have to stand after this part?
    pub(super) fn stop_asked(&self) -> bool {
        self.stop.is_some()
    }

    /// The program stands since `stood_s`; true when the operator has come and acknowledged.
    pub(super) fn acknowledge_stop(&mut self, stood_s: f64) -> bool {
        let attended = stood_s >= self.settings.attended_after.as_secs_f64();
        if attended {
            self.stop = None;
        }
        attended
    }

    /// An offset was written; it is the control's, and only counted here.
    pub(super) fn count_offset(&mut self) {
        self.counts.offsets += 1;
    }

    pub(super) fn counts(&self) -> LadderCounts {
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::clock::SECOND_NS;

    fn pct(percent: u8) -> OverridePct {
        OverridePct::new(percent).expect("not 255")
    }

    const MS_NS: i64 = 1_000_000;

    #[test]
    fn an_override_counts_after_a_few_scans_and_as_long_as_the_sign_of_life_lasts() {
        let mut ladder = Ladder::new(LadderSettings::default());
        let at = |ladder: &mut Ladder, ms: i64| {
            ladder.run_scan(ms * MS_NS);
            ladder.in_force().percent()
        };
        ladder.post_letter(0, LadderInput::Override(pct(70)));
        assert_eq!((at(&mut ladder, 23), at(&mut ladder, 24), at(&mut ladder, 1023)), (100, 70, 70));
        assert_eq!(at(&mut ladder, 1024), 100, "the sign of life has stopped");
        ladder.post_letter(2000 * MS_NS, LadderInput::Override(pct(70)));
        ladder.post_letter(2500 * MS_NS, LadderInput::Override(pct(70)));
        assert_eq!((at(&mut ladder, 3400), at(&mut ladder, 3524)), (70, 100));
        assert_eq!((ladder.counts().overrides, ladder.counts().heartbeats_lost), (3, 2));
    }

    #[test]
    fn the_dial_is_the_operators() {
        let mut ladder = Ladder::new(LadderSettings::default());
        ladder.turn_dial(pct(60));
        ladder.post_letter(0, LadderInput::Override(pct(120)));
        ladder.run_scan(SECOND_NS / 2);
        assert_eq!(ladder.in_force(), pct(60), "the lesser one counts");
        let product = LadderSettings { rule: LadderRule::Product, ..LadderSettings::default() };
        let mut ladder = Ladder::new(product);
        ladder.turn_dial(pct(50));
        ladder.post_letter(0, LadderInput::Override(pct(120)));
        ladder.run_scan(SECOND_NS / 2);
        assert_eq!(ladder.in_force(), pct(60));
        ladder.turn_dial(pct(0));
        assert_eq!(ladder.in_force(), pct(0), "a dial at zero stops the feed whatever was posted");
    }

    #[test]
    fn a_request_is_latched_once_until_the_operator_comes() {
        let mut ladder = Ladder::new(LadderSettings::default());
        ladder.post_letter(0, LadderInput::Ask(LadderRequest::FeedHold));
        ladder.post_letter(SECOND_NS, LadderInput::Ask(LadderRequest::FeedHold));
        ladder.run_scan(2 * SECOND_NS);
        assert!(
            ladder.is_holding_feed(2 * SECOND_NS)
                && ladder.is_holding_feed(44 * SECOND_NS)
                && !ladder.is_holding_feed(46 * SECOND_NS)
        );
        ladder.post_letter(50 * SECOND_NS, LadderInput::Ask(LadderRequest::Stop));
        ladder.run_scan(51 * SECOND_NS);
        assert!(
            ladder.stop_asked()
                && !ladder.acknowledge_stop(44.0)
                && ladder.acknowledge_stop(45.0)
                && !ladder.stop_asked()
        );
        assert_eq!(ladder.counts().count_writes(), 3);
    }
}
