//! What of the offsets goes into the audit: each change of what is proposed and of what becomes of it, and each write.

use super::order::{Moved, OffsetOrder, Shifted};
use super::{OffsetBound, OffsetOutcome, OffsetVerdict};
use crate::audit::{Author, truncate_text};
use crate::limits::OffsetConfig;
use adapter_core::offset::{Axis, LastWrite};
use adapter_core::request::OffsetProposal;
use gateway_records::Audit;
use gateway_records::RowRate;

/// What was last recorded of the proposals for an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LastProposal {
    asked_um: Option<i64>,
    outcome: OffsetOutcome,
    armed: bool,
    script: Option<u64>,
}

/// Remembers what was last recorded.
#[derive(Debug, Default)]
pub struct OffsetTrail {
    last_proposals: [Option<LastProposal>; Axis::ALL.len()],
    /// Who proposed what was ordered last.
    authors: [Author; Axis::ALL.len()],
    row_rate: RowRate,
}

impl OffsetTrail {
    /// The row of this axis at this tick, if the proposal or its fate is another than before.
    pub fn audit_proposal(
        &mut self,
        proposal: Option<&OffsetProposal>,
        verdict: &OffsetVerdict,
        limits: &OffsetConfig,
    ) -> Option<Audit> {
        if verdict.order.is_some() {
            self.authors[verdict.axis.index()] =
                proposal.map_or(Author::default(), |it| Author::new(&it.script, it.version, &it.reason));
        }
        let known = LastProposal {
            #[expect(clippy::cast_possible_truncation, reason = "saturates, and NaN becomes 0; only compared")]
            asked_um: verdict.wanted_um.map(|um| um.round() as i64),
            outcome: verdict.outcome,
            armed: verdict.armed,
            script: proposal.map(|proposal| proposal.version),
        };
        let last = &mut self.last_proposals[verdict.axis.index()];
        if *last == Some(known) {
            return None;
        }
        *last = Some(known);
        let left_out = self.row_rate.may_tell(verdict.at_ns)?;
        let wanted = proposal.map_or("nothing is proposed any more".to_owned(), |it| truncate_text(&it.reason));
        Some(Audit {
            outcome: outcome_word(verdict).to_owned(),
            before: Some(verdict.shift_um),
            asked: verdict.wanted_um,
            after: Some(verdict.permitted_um),
            reason: format!("{wanted}: {}{left_out}", describe_reason(verdict, limits)),
            script: proposal.map_or(String::new(), |it| truncate_text(&it.script)),
            script_version: proposal.map_or(String::new(), |it| format!("{:016x}", it.version)),
            ..new_row("request", verdict.axis, verdict.at_ns)
        })
    }

    /// The row of an order that was carried out, or could not be. One that changed nothing and found nothing is no news.
    #[must_use]
    pub fn audit_move(&self, moved: &Moved) -> Option<Audit> {
        let axis = moved.order.axis();
        let author = &self.authors[axis.index()];
        let (script, script_version) = match moved.order {
            OffsetOrder::Shift { .. } => (author.script.clone(), author.version.clone()),
            OffsetOrder::Restore(_) | OffsetOrder::Look(_) => (String::new(), String::new()),
        };
        let signed = |row: Audit| Audit { script, script_version, ..row };
        match &moved.result {
            Ok(None) => None,
            Ok(Some(shifted)) if shifted.is_written() => Some(signed(audit_write(moved, shifted, &author.reason))),
            Ok(Some(shifted)) => audit_finding(moved, shifted),
            Err(error) => {
                let outcome = if moved.fault().is_some() { "failed" } else { "refused" };
                let open = if moved.is_open() { "; whether it was taken is looked at next" } else { "" };
                let reason = format!("{}{open}", truncate_text(&error.to_string()));
                Some(signed(Audit {
                    outcome: outcome.to_owned(),
                    reason,
                    ..new_row(order_verb(moved.order), axis, moved.at_ns)
                }))
            }
        }
    }
}

fn order_verb(order: OffsetOrder) -> &'static str {
    match order {
        OffsetOrder::Shift { .. } => "write",
        OffsetOrder::Restore(_) => "restore",
        OffsetOrder::Look(_) => "found",
    }
}

fn audit_write(moved: &Moved, shifted: &Shifted, why: &str) -> Audit {
    let (base_um, shift_um) = (shifted.base_um, shifted.shift_um());
    let taken = if shifted.is_taken() { "" } else { "; the control shows something else than was written" };
    let why = if why.is_empty() || matches!(moved.order, OffsetOrder::Restore(_)) {
        String::new()
    } else {
        format!("{why}: ")
    };
    Audit {
        outcome: if shifted.is_taken() { "written" } else { "failed" }.to_owned(),
        before: Some(shifted.before_um),
        asked: Some(shifted.asked_um),
        after: Some(shifted.after_um),
        reason: format!("{why}shift {shift_um:+.0} um from {base_um:.0} um set by the operator{taken}"),
        ..new_row(order_verb(moved.order), moved.order.axis(), moved.at_ns)
    }
}

/// Nothing was written; what was found may be news.
fn audit_finding(moved: &Moved, shifted: &Shifted) -> Option<Audit> {
    let (outcome, of_last) = match shifted.last {
        LastWrite::InForce if !matches!(moved.order, OffsetOrder::Look(_)) => return None,
        LastWrite::InForce => ("settled", "as was known"),
        LastWrite::Taken => ("settled", "the write before, whose end nobody saw, was taken"),
        LastWrite::NotTaken => ("settled", "the write before, whose end nobody saw, was not taken"),
        LastWrite::Replaced => ("replaced", "somebody else had changed the offset, which is the new beginning"),
    };
    let (base_um, shift_um) = (shifted.base_um, shifted.shift_um());
    Some(Audit {
        outcome: outcome.to_owned(),
        before: Some(shifted.before_um),
        after: Some(shifted.after_um),
        reason: format!("shift {shift_um:+.0} um from {base_um:.0} um set by the operator; {of_last}"),
        ..new_row("found", moved.order.axis(), moved.at_ns)
    })
}

/// `z_offset_request` and the like.
fn new_row(what: &str, axis: Axis, at_ns: adapter_core::clock::TimeNs) -> Audit {
    Audit { at_ns, kind: format!("{}_offset_{what}", axis.as_word()), unit: "um".to_owned(), ..Audit::default() }
}

fn outcome_word(verdict: &OffsetVerdict) -> &'static str {
    match verdict.outcome {
        OffsetOutcome::Held(_) => "held",
        OffsetOutcome::Refused | OffsetOutcome::NotAllowed => "refused",
        OffsetOutcome::Limited(_) => "limited",
        OffsetOutcome::Permitted if verdict.armed => "permitted",
        OffsetOutcome::Permitted => "shadow",
    }
}

/// Why, for the operator.
fn describe_reason(verdict: &OffsetVerdict, limits: &OffsetConfig) -> String {
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
