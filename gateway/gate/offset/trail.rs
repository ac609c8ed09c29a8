//! What of the offsets goes into the audit: each change of what is proposed and of what becomes of it, and each write.

use super::order::{Moved, Order};
use super::{OffsetBound, OffsetOutcome, OffsetVerdict};
use crate::config;
use crate::gate::trail::{Pace, words};
use crate::history::Audit;
use adapters::offset::{Axis, Shifted};
use rules::script::OffsetProposal;

/// What was last recorded of the proposals for an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Known {
    asked_um: Option<i64>,
    outcome: OffsetOutcome,
    armed: bool,
    script: Option<u64>,
}

/// Remembers what was last recorded.
#[derive(Debug, Default)]
pub struct OffsetTrail {
    known: [Option<Known>; Axis::ALL.len()],
    pace: Pace,
}

impl OffsetTrail {
    /// The row of this axis at this tick, if the proposal or its fate is another than before.
    pub fn proposal(
        &mut self,
        proposal: Option<&OffsetProposal>,
        verdict: &OffsetVerdict,
        limits: &config::Offset,
    ) -> Option<Audit> {
        let known = Known {
            #[expect(clippy::cast_possible_truncation, reason = "saturates, and NaN becomes 0; only compared")]
            asked_um: verdict.wanted_um.map(|um| um.round() as i64),
            outcome: verdict.outcome,
            armed: verdict.armed,
            script: proposal.map(|proposal| proposal.version),
        };
        let last = &mut self.known[verdict.axis.index()];
        if *last == Some(known) {
            return None;
        }
        *last = Some(known);
        let left_out = self.pace.may_tell(verdict.at_ns)?;
        let wish = proposal.map_or("nothing is proposed any more".to_owned(), |it| words(&it.reason));
        Some(Audit {
            outcome: outcome(verdict).to_owned(),
            before: Some(verdict.shift_um),
            asked: verdict.wanted_um,
            after: Some(verdict.permitted_um),
            reason: format!("{wish}: {}{left_out}", reason(verdict, limits)),
            script: proposal.map_or(String::new(), |it| words(&it.script)),
            script_version: proposal.map_or(String::new(), |it| format!("{:016x}", it.version)),
            ..row("request", verdict.axis, verdict.at_ns)
        })
    }
}

/// `z_offset_request` and the like.
fn row(what: &str, axis: Axis, at_ns: adapters::clock::TimeNs) -> Audit {
    Audit { at_ns, kind: format!("{}_offset_{what}", axis.word()), unit: "um".to_owned(), ..Audit::default() }
}

fn outcome(verdict: &OffsetVerdict) -> &'static str {
    match verdict.outcome {
        OffsetOutcome::Held(_) => "held",
        OffsetOutcome::Refused | OffsetOutcome::NotAllowed => "refused",
        OffsetOutcome::Limited(_) => "limited",
        OffsetOutcome::Permitted if verdict.armed => "permitted",
        OffsetOutcome::Permitted => "shadow",
    }
}

/// Why, for the operator.
fn reason(verdict: &OffsetVerdict, limits: &config::Offset) -> String {
    match verdict.outcome {
        OffsetOutcome::Permitted if verdict.armed => "as proposed".to_owned(),
        OffsetOutcome::Permitted => "the gate is not armed for offsets: recorded, not written".to_owned(),
        OffsetOutcome::Limited(OffsetBound::Step) => {
            format!("at most {} um at a time; the rest follows", limits.step_um)
        }
        OffsetOutcome::Limited(OffsetBound::Total) => format!("at most {} um in all", limits.total_um),
        OffsetOutcome::Held(hold) => format!("nothing is moved: {hold}"),
        OffsetOutcome::NotAllowed => "`axes` under [gate.offset] does not name this axis".to_owned(),
        OffsetOutcome::Refused => "an offset is a number of micrometres; nothing is moved".to_owned(),
    }
}

/// An order that was carried out, or could not be. One that changed nothing is no news.
#[must_use]
pub fn moved(moved: &Moved) -> Option<Audit> {
    let (what, axis) = match moved.order {
        Order::Shift { axis, .. } => ("write", axis),
        Order::Restore(axis) => ("restore", axis),
    };
    let row = row(what, axis, moved.at_ns);
    match &moved.result {
        Ok(None) => None,
        Ok(Some(shifted)) => Some(Audit {
            outcome: if shifted.is_taken() { "written" } else { "failed" }.to_owned(),
            before: Some(shifted.before_um),
            asked: Some(shifted.asked_um),
            after: Some(shifted.after_um),
            reason: told(shifted),
            ..row
        }),
        Err(error) => {
            let outcome = if moved.fault().is_some() { "failed" } else { "refused" };
            Some(Audit { outcome: outcome.to_owned(), reason: words(&error.to_string()), ..row })
        }
    }
}

fn told(shifted: &Shifted) -> String {
    let others = if shifted.changed_by_others {
        "; somebody else had changed the offset, which is the new beginning"
    } else {
        ""
    };
    let taken = if shifted.is_taken() { "" } else { "; the control shows something else than was written" };
    format!("shift {:+.0} um from {:.0} um set by the operator{others}{taken}", shifted.shift_um(), shifted.base_um)
}
