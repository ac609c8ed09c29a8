//! What scripts ask of the ladder besides an override: a feed hold, a stop after this part. A request passes once; the ladder
//! latches it, and the machine's builder decides what it does.
//!
//! The same request does not pass again before two things have happened: the script has withdrawn it, and the operator has
//! seen to it at the machine (started again after a feed hold, or after the program stood) or has acknowledged it on the
//! box. A limit that chatters therefore stops the machine once and not fifty times. A request of its own (a second worn edge) that was
//! held back by the latch of another passes when that has been seen to, if a script still asks for it.

use super::hold::EXECUTION;
use adapter_core::request::{Stop, StopRequest};
use adapter_core::words::execution;
use adapter_core::{LadderRequest, Sample};
use std::sync::Arc;

/// A request of a script.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScriptRequest {
    /// A feed hold, or a stop after this part.
    pub request: LadderRequest,
    /// Why, in the script's words.
    pub reason: Arc<str>,
    /// File name of the script that asks.
    pub script: Arc<str>,
    /// Which version of it.
    pub version: u64,
}

impl ScriptRequest {
    /// What a script asks for, as the ladder knows it: a tool change is a stop after this part.
    #[must_use]
    pub fn from_stop(wanted: &StopRequest) -> Self {
        let StopRequest { stop, reason, script, version } = wanted.clone();
        let request = match stop {
            Stop::FeedHold => LadderRequest::FeedHold,
            Stop::ToolChange => LadderRequest::Stop,
        };
        Self { request, reason, script, version }
    }
}

/// What became of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AskOutcome {
    /// It goes to the ladder.
    Sent,
    /// The gate is not armed: recorded only.
    Shadow,
    /// Nobody has seen to the last one yet.
    Latched,
}

impl AskOutcome {
    /// The word in the history.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Sent => "written",
            Self::Shadow => "shadow",
            Self::Latched => "latched",
        }
    }
}

/// A request that a script repeats from tick to tick.
#[derive(Debug, Clone)]
struct StandingRequest {
    reason: Arc<str>,
    /// It waits until the one that is latched has been seen to.
    waits: bool,
}

/// One kind of request.
#[derive(Debug, Clone, Default)]
struct Latch {
    /// What scripts asked for at the last tick.
    standing: Vec<StandingRequest>,
    /// Was one sent, and has nobody seen to it?
    latched: bool,
    /// The reason of the one that was sent last.
    sent_reason: Option<Arc<str>>,
}

impl Latch {
    /// What becomes of a request at this tick; `None` where that has been said.
    fn judge_request(&self, known: Option<&StandingRequest>, armed: bool) -> Option<AskOutcome> {
        let outcome = match (self.latched, armed) {
            (true, _) => AskOutcome::Latched,
            (false, true) => AskOutcome::Sent,
            (false, false) => AskOutcome::Shadow,
        };
        let new = known.is_none_or(|known| known.waits && outcome == AskOutcome::Sent);
        new.then_some(outcome)
    }

    /// Does a latched request wait, because it is another one than the one that was sent?
    fn makes_wait(&self, ask: &ScriptRequest, outcome: AskOutcome) -> bool {
        let other = self.sent_reason.as_ref().is_none_or(|sent| !is_same_request(ask.request, sent, &ask.reason));
        outcome == AskOutcome::Latched && other
    }

    /// Takes what is asked for at this tick, at most one of each; gives what is new.
    fn take_requests(&mut self, asks: &[&ScriptRequest], armed: bool) -> Vec<(ScriptRequest, AskOutcome)> {
        let mut judged = Vec::new();
        let before = std::mem::take(&mut self.standing);
        for ask in asks {
            let same = |reason: &Arc<str>| is_same_request(ask.request, reason, &ask.reason);
            if self.standing.iter().any(|standing| same(&standing.reason)) {
                continue;
            }
            let known = before.iter().find(|standing| same(&standing.reason));
            let outcome = self.judge_request(known, armed);
            let waits = outcome.map_or(known.is_some_and(|known| known.waits), |outcome| self.makes_wait(ask, outcome));
            if outcome == Some(AskOutcome::Sent) {
                (self.latched, self.sent_reason) = (true, Some(ask.reason.clone()));
            }
            self.standing.push(StandingRequest { reason: ask.reason.clone(), waits });
            judged.extend(outcome.map(|outcome| ((*ask).clone(), outcome)));
        }
        judged
    }
}

/// Are two requests to the ladder one and the same? As scripts see it: [`Stop::is_same_request`].
fn is_same_request(request: LadderRequest, reason: &str, other: &str) -> bool {
    match request {
        LadderRequest::FeedHold => Stop::FeedHold.is_same_request(reason, other),
        LadderRequest::Stop => Stop::ToolChange.is_same_request(reason, other),
    }
}

#[derive(Debug)]
pub(super) struct Asks {
    latches: [Latch; 2],
    /// The machine has been in feed hold, has stood, since it last ran.
    held: bool,
    stood: bool,
}

impl Asks {
    pub(super) fn new() -> Self {
        Self { latches: Default::default(), held: false, stood: false }
    }

    pub(super) fn judge_requests(
        &mut self,
        asks: &[ScriptRequest],
        sample: &Sample,
        armed: bool,
    ) -> Vec<(ScriptRequest, AskOutcome)> {
        self.seen_to(sample);
        let mut judged = Vec::new();
        for (latch, request) in self.latches.iter_mut().zip(LadderRequest::ALL) {
            let of_kind: Vec<&ScriptRequest> = asks.iter().filter(|ask| ask.request == request).collect();
            judged.extend(latch.take_requests(&of_kind, armed));
        }
        judged
    }

    pub(super) fn acknowledge_requests(&mut self) {
        self.latches.iter_mut().for_each(|latch| latch.latched = false);
    }

    /// The operator has started again after a feed hold, or after the program stood.
    fn seen_to(&mut self, sample: &Sample) {
        let Some(word) = sample.text(EXECUTION) else { return };
        self.held |= word == execution::FEED_HOLD;
        self.stood |= word == execution::STOPPED;
        if word != execution::ACTIVE {
            return;
        }
        if std::mem::take(&mut self.held) {
            self.release_request(LadderRequest::FeedHold);
        }
        if std::mem::take(&mut self.stood) {
            self.release_request(LadderRequest::Stop);
        }
    }

    fn release_request(&mut self, request: LadderRequest) {
        let each = self.latches.iter_mut().zip(LadderRequest::ALL);
        each.filter(|(_, kind)| *kind == request).for_each(|(latch, _)| latch.latched = false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::{ChannelId, Slot, Value};

    fn sample(word: &str) -> Sample {
        let mut sample = Sample::new_empty(0);
        let slot = Slot { value: Ok(Value::Text(word.into())), age_ns: 0 };
        sample.set_slot(ChannelId::from_name("execution").expect("a channel"), slot);
        sample
    }

    fn hold() -> Vec<ScriptRequest> {
        vec![ScriptRequest {
            request: LadderRequest::FeedHold,
            reason: "load".into(),
            script: "a.rhai".into(),
            version: 1,
        }]
    }

    #[test]
    fn a_request_passes_once_until_it_is_withdrawn_and_seen_to() {
        let mut asks = Asks::new();
        let mut judge = |wanted: bool, word: &str| {
            let asked = if wanted { hold() } else { Vec::new() };
            asks.judge_requests(&asked, &sample(word), true).first().map(|(_, outcome)| *outcome)
        };
        assert_eq!(judge(true, execution::ACTIVE), Some(AskOutcome::Sent));
        assert_eq!(judge(true, execution::FEED_HOLD), None);
        assert_eq!(
            (judge(false, execution::FEED_HOLD), judge(true, execution::FEED_HOLD)),
            (None, Some(AskOutcome::Latched))
        );
        assert_eq!(judge(true, execution::ACTIVE), None, "still asked for: started again, but not withdrawn");
        assert_eq!((judge(false, execution::ACTIVE), judge(true, execution::ACTIVE)), (None, Some(AskOutcome::Sent)));
    }

    #[test]
    fn a_program_that_stood_or_an_acknowledgement_releases_a_stop() {
        let stop = vec![ScriptRequest { request: LadderRequest::Stop, ..hold().remove(0) }];
        let mut asks = Asks::new();
        let mut judge = |wanted: bool, word: &str| {
            let asked: &[ScriptRequest] = if wanted { &stop } else { &[] };
            asks.judge_requests(asked, &sample(word), true).first().map(|(_, outcome)| *outcome)
        };
        let active = execution::ACTIVE;
        assert_eq!((judge(true, active), judge(false, active)), (Some(AskOutcome::Sent), None));
        assert_eq!((judge(true, active), judge(false, active)), (Some(AskOutcome::Latched), None));
        assert_eq!((judge(false, execution::STOPPED), judge(false, execution::READY)), (None, None));
        assert_eq!((judge(true, active), judge(false, active)), (Some(AskOutcome::Sent), None));
        asks.acknowledge_requests();
        assert_eq!(asks.judge_requests(&stop, &sample(active), true)[0].1, AskOutcome::Sent);
        assert_eq!(asks.judge_requests(&hold(), &sample(active), false)[0].1, AskOutcome::Shadow);
    }

    #[test]
    fn each_worn_edge_has_a_request_that_passes() {
        let edge = |name: &str| ScriptRequest {
            request: LadderRequest::Stop,
            reason: format!("edge {name} is worn").into(),
            ..hold().remove(0)
        };
        let (one, both, third) = ([edge("T1")], [edge("T1"), edge("T3")], [edge("T3")]);
        let mut asks = Asks::new();
        let mut judge = |wanted: &[ScriptRequest], word: &str| -> Vec<(String, AskOutcome)> {
            let judged = asks.judge_requests(wanted, &sample(word), true);
            judged.into_iter().map(|(ask, outcome)| (ask.reason.to_string(), outcome)).collect()
        };
        let told = |name: &str, outcome| vec![(format!("edge {name} is worn"), outcome)];
        assert_eq!(judge(&one, execution::ACTIVE), told("T1", AskOutcome::Sent));
        assert_eq!(judge(&both, execution::ACTIVE), told("T3", AskOutcome::Latched), "T1 has not been seen to");
        assert_eq!(judge(&both, execution::STOPPED), []);
        assert_eq!(judge(&third, execution::ACTIVE), told("T3", AskOutcome::Sent), "T1 was changed, T3 was not");
        assert_eq!(judge(&third, execution::ACTIVE), []);
    }
}
