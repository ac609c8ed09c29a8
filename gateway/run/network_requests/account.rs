//! Rows of the audit and messages about requests of the network. Pure.

use adapters::clock::TimeNs;
use gateway_control::{Ending, NetworkRequest, OutcomeSender, Reply, RequestOutcome, RequestedChange};
use gateway_history::Audit;

/// Letters of the reason of a row. Who asks stands first, so that it is never cut.
pub(super) const REASON_MAX: usize = 600;

/// What is answered to a request, and how it ended where that is known already, with the word of the reason.
#[derive(Debug, Clone, PartialEq)]
pub struct RequestJudgement {
    /// What is answered at once.
    pub reply: Reply,
    /// How it ended, and why; `None`: the control has to show it.
    pub ending: Option<(Ending, &'static str)>,
}

impl RequestJudgement {
    /// Refused, for the reason of this word.
    #[must_use]
    pub fn from_refusal(why: &'static str, text: String) -> Self {
        Self { reply: Reply::from_refusal(text), ending: Some((Ending::Refused, why)) }
    }
}

/// An outcome that is known now, with the way back.
#[derive(Debug)]
pub struct SettledRequest {
    pub(super) sink: String,
    pub(super) outcome: RequestOutcome,
    pub(super) outcomes: OutcomeSender,
}

/// How a sink is named where scripts and persons are.
#[must_use]
pub fn format_author(sink: &str) -> String {
    format!("sink {sink}")
}

/// The row of a message, with how it ended where that is known.
#[must_use]
pub fn build_audit_row(request: &NetworkRequest, judgement: &RequestJudgement, at_ns: TimeNs) -> Audit {
    let RequestJudgement { reply, ending } = judgement;
    let what = request.change.as_ref().map_or_else(ToString::to_string, |change| format!("{change}: {}", reply.text));
    let also = match request.left_out {
        0 => String::new(),
        count => format!("; {count} messages before it came too fast and were thrown away"),
    };
    let asked = match request.change {
        Ok(RequestedChange::FeedOverride { pct, .. }) => Some(pct),
        _ => None,
    };
    let (outcome, why) = match ending {
        None => ("accepted", ""),
        Some((Ending::Followed, why)) => ("done", *why),
        Some((ending, why)) => (ending.as_word(), *why),
    };
    let why = if why.is_empty() { String::new() } else { format!("{why}: ") };
    let reason = format!("{}{also}; {why}{what}", request.origin);
    build_row("network_request", (outcome, reason), &request.sink, asked, at_ns)
}

fn build_row(kind: &str, (outcome, reason): (&str, String), sink: &str, asked: Option<f64>, at_ns: TimeNs) -> Audit {
    Audit {
        at_ns,
        kind: kind.to_owned(),
        outcome: outcome.to_owned(),
        asked,
        unit: if asked.is_some() { "%".to_owned() } else { String::new() },
        reason: reason.chars().take(REASON_MAX).collect(),
        script: format_author(sink),
        ..Audit::default()
    }
}

/// The outcome of a message that was answered, where it is known at once.
#[must_use]
pub fn build_outcome(request: &NetworkRequest, judgement: &RequestJudgement, at_ns: TimeNs) -> Option<RequestOutcome> {
    let (ending, why) = judgement.ending?;
    let (origin, text) = (request.origin.clone(), judgement.reply.text.clone());
    let asked_pct = match request.change {
        Ok(RequestedChange::FeedOverride { pct, .. }) => Some(pct),
        _ => None,
    };
    Some(RequestOutcome { origin, ending, why, text, asked_pct, in_force_pct: None, at_ns })
}

impl SettledRequest {
    /// The second row of its request.
    #[must_use]
    pub fn build_audit_row(&self) -> Audit {
        let RequestOutcome { origin, ending, text, asked_pct, in_force_pct, at_ns, .. } = &self.outcome;
        let row = build_row(
            "network_outcome",
            (ending.as_word(), format!("{origin}; {text}")),
            &self.sink,
            *asked_pct,
            *at_ns,
        );
        Audit { after: *in_force_pct, ..row }
    }

    /// Tells whoever asked; where nobody fetches it the audit alone holds it.
    pub fn tell_asker(self) {
        let _nobody = self.outcomes.try_send(self.outcome);
    }
}
