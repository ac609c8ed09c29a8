//! What scripts ask of the ladder besides an override: a feed hold, a stop after this part. A request passes once; the ladder
//! latches it, and the machine's builder decides what it does.
//!
//! The same request does not pass again before two things have happened: the script has withdrawn it, and the operator has
//! seen to it at the machine (started again after a feed hold, or after the program stood) or has acknowledged it on the
//! box. A limit that chatters therefore stops the machine once and not fifty times.

use adapter_core::words::execution;
use adapter_core::{ChannelId, LadderRequest, Sample};
use rules::script::{Stop, StopRequest};
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

const EXECUTION: ChannelId = ChannelId::named("execution");

/// One kind of request.
#[derive(Debug, Clone, Copy, Default)]
struct Latch {
    /// Did a script ask for it at the last tick?
    wanted: bool,
    /// Was it sent, and has nobody seen to it?
    latched: bool,
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
            let ask = asks.iter().find(|ask| ask.request == request);
            let wanted_before = std::mem::replace(&mut latch.wanted, ask.is_some());
            let Some(ask) = ask.filter(|_| !wanted_before) else { continue };
            let outcome = match (latch.latched, armed) {
                (true, _) => AskOutcome::Latched,
                (false, true) => AskOutcome::Sent,
                (false, false) => AskOutcome::Shadow,
            };
            latch.latched |= outcome == AskOutcome::Sent;
            judged.push((ask.clone(), outcome));
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
    use adapter_core::{Slot, Value};

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
}
