//! What became of a request, as the gate and the control show it. Pure.

use super::{PendingRequest, STANDS_S, is_within};
use gateway_control::Ending;
use gateway_gate::{Disarmed, GateOutcome, Occasion, Reaction, Verdict, WriteRecord};

/// Overrides are whole percents at the control: this much less or more than was asked for is the same.
const ROUNDED_PCT: f64 = 0.5;

/// The override at the control, as far as the writer has told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum ControlState {
    /// Nothing is enabled: the dial counts.
    #[default]
    AtDial,
    /// Written, and not seen in force yet.
    Written,
    /// Seen in force by the writer.
    Shows(Reaction),
}

impl ControlState {
    /// What a write makes of it. A sign of life changes nothing.
    #[must_use]
    pub fn after_write(self, written: &WriteRecord) -> Self {
        match written.occasion {
            Occasion::Change => Self::Written,
            Occasion::SignOfLife => self,
            Occasion::Release | Occasion::Leftover => Self::AtDial,
        }
    }
}

/// The gate and the control at one tick, as far as they say what became of a request.
#[derive(Debug, Clone, Copy)]
pub struct GateSituation<'a> {
    /// What the gate has decided.
    pub verdict: &'a Verdict,
    /// Why no override is written, if so.
    pub why_disarmed: Option<Disarmed>,
    /// The override at the control.
    pub control: ControlState,
    /// The gate lets the override change step by step and is not at its end.
    pub ramping: bool,
    /// Who asks for what was decided about.
    pub author: Option<&'a str>,
}

/// How one request ended.
#[derive(Debug, PartialEq)]
pub(super) struct RequestEnding {
    pub(super) ending: Ending,
    pub(super) why: &'static str,
    pub(super) text: String,
    pub(super) in_force_pct: Option<f64>,
}

impl RequestEnding {
    pub(super) fn new(ending: Ending, why: &'static str, text: impl Into<String>, in_force_pct: Option<f64>) -> Self {
        Self { ending, why, text: text.into(), in_force_pct }
    }
}

pub(super) fn settle_unarmed(why: Disarmed) -> RequestEnding {
    let ending = if matches!(why, Disarmed::ReadBack | Disarmed::Line) { Ending::Failed } else { Ending::NotWritten };
    RequestEnding::new(ending, why.as_word(), format!("nothing is written any more: {why}"), None)
}

pub(super) fn settle_request(pending: &PendingRequest, situation: &GateSituation<'_>) -> Option<RequestEnding> {
    let GateSituation { verdict, why_disarmed, .. } = situation;
    if let Some(why) = why_disarmed {
        return Some(settle_unarmed(*why));
    }
    if !is_within(pending.until_ns, verdict.at_ns) {
        let text = format!("the control has not shown it within {STANDS_S} s; {}", verdict.reason());
        return Some(RequestEnding::new(Ending::NotFollowed, verdict.as_word(), text, None));
    }
    settle_by_control(pending, situation)
}

/// What the control shows, once it is what the gate has let through in the end.
fn settle_by_control(pending: &PendingRequest, situation: &GateSituation<'_>) -> Option<RequestEnding> {
    let GateSituation { verdict, control, author, ramping, .. } = situation;
    if *ramping || matches!(verdict.outcome, GateOutcome::Held(_) | GateOutcome::Refused) {
        return None;
    }
    let shown = match control {
        ControlState::AtDial => return settle_at_dial(pending, verdict),
        ControlState::Written => return None,
        ControlState::Shows(shown) => Some(shown).filter(|shown| shown.asked == verdict.permitted)?,
    };
    let found_pct = f64::from(shown.found.percent());
    let text = format!("the control shows {found_pct} %");
    if (found_pct - pending.pct).abs() <= ROUNDED_PCT {
        return Some(RequestEnding::new(Ending::Followed, "", text, Some(found_pct)));
    }
    let counts = verdict.wanted_pct.is_some_and(|wanted_pct| (wanted_pct - pending.pct).abs() <= ROUNDED_PCT);
    let (why, because) = match author {
        Some(author) if !counts => ("less_is_asked_for", format!("{author} asks for less")),
        _ if verdict.outcome == GateOutcome::Permitted => {
            ("dead_band", "what was asked for differs by less than the dead band".to_owned())
        }
        _ => ("limited", verdict.reason()),
    };
    Some(RequestEnding::new(Ending::Limited, why, format!("{text}: {because}"), Some(found_pct)))
}

/// Nothing is asked of the machine: that is what was wanted, or the dial stands below it, or it is still to be written.
fn settle_at_dial(pending: &PendingRequest, verdict: &Verdict) -> Option<RequestEnding> {
    match verdict.outcome {
        GateOutcome::DialCounts(dial) if pending.pct < 100.0 => {
            Some(RequestEnding::new(Ending::Limited, "dial", verdict.reason(), Some(f64::from(dial.percent()))))
        }
        _ if verdict.has_request() => None,
        _ if pending.pct < 100.0 => Some(RequestEnding::new(Ending::Limited, "limited", verdict.reason(), None)),
        _ => Some(RequestEnding::new(Ending::Followed, "", "nothing is asked of the machine: its dial counts", None)),
    }
}
