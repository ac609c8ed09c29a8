//! What the scripts decided, as records: alarms raised and cleared, notes, and every change of what they ask for.

use adapter_core::clock::TimeNs;
use gateway_gate::Verdict;
use gateway_history::{Alarm, AlarmClear, Decision as DecisionRow, Event, Record};
use rules::script::{AlarmChange, Axis, Decision, OffsetProposal, OverrideRequest, StopRequest};
use std::collections::VecDeque;
use std::sync::Arc;

/// Changes kept for the page.
const RECENT: usize = 6;

/// What was asked for, in whole percent: finer changes are not recorded one by one.
#[derive(Debug, Clone, PartialEq)]
struct RoundedRequest {
    pct: i64,
    reason: Arc<str>,
    script: Arc<str>,
    outcome: &'static str,
}

impl RoundedRequest {
    fn from_request(request: &OverrideRequest, verdict: &Verdict) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "saturates, and NaN becomes 0; only compared")]
        let pct = request.pct.round() as i64;
        Self { pct, reason: request.reason.clone(), script: request.script.clone(), outcome: verdict.as_word() }
    }
}

/// A change worth showing.
#[derive(Debug, Clone, PartialEq)]
pub struct ShownChange {
    /// Time of the tick, ns since 1970.
    pub at_ns: TimeNs,
    /// The sentence that the page shows.
    pub text: String,
}

/// Remembers what was last recorded.
#[derive(Debug, Clone, Default)]
pub struct Decisions {
    asked: Option<RoundedRequest>,
    stops: Vec<StopRequest>,
    /// Whole micrometres: finer changes are not recorded one by one.
    offsets: Vec<(Axis, i64)>,
    recent: VecDeque<ShownChange>,
}

impl Decisions {
    /// The latest changes, newest first.
    pub fn recent_changes(&self) -> impl Iterator<Item = &ShownChange> {
        self.recent.iter()
    }

    /// Gives every record that this decision, and what the gate made of it, makes to `keep`.
    pub fn record_decision(&mut self, decision: &Decision, verdict: &Verdict, mut keep: impl FnMut(Record)) {
        for change in &decision.alarms {
            keep(build_alarm_record(change, decision.at_ns));
        }
        for note in &decision.notes {
            keep(build_event_record("note", &note.script, &note.text, decision.at_ns));
        }
        for problem in &decision.problems {
            keep(build_event_record("script_failed", &problem.file, &problem.to_string(), decision.at_ns));
        }
        self.record_stops(decision, &mut keep);
        self.record_offsets(decision, &mut keep);
        let asked = decision.request.as_ref().map(|request| RoundedRequest::from_request(request, verdict));
        if asked != self.asked {
            keep(self.note_change(decision, verdict, asked).into());
        }
    }

    /// A request to hold or to change the tool is recorded when it begins.
    fn record_stops(&mut self, decision: &Decision, keep: &mut impl FnMut(Record)) {
        for request in &decision.stops {
            if !self.stops.iter().any(|known| known.is_same_request(request) && known.script == request.script) {
                keep(stop_row(request, decision.at_ns).into());
                let text = format!("{} asked for ({})", request.stop.as_word(), request.reason);
                self.recent.push_front(ShownChange { at_ns: decision.at_ns, text });
                self.recent.truncate(RECENT);
            }
        }
        self.stops.clear();
        self.stops.extend_from_slice(&decision.stops);
    }

    /// A proposed offset is recorded when it has changed by a micrometre.
    fn record_offsets(&mut self, decision: &Decision, keep: &mut impl FnMut(Record)) {
        for proposal in &decision.offsets {
            #[expect(clippy::cast_possible_truncation, reason = "saturates, and NaN becomes 0; only compared")]
            let whole_um = proposal.offset_um.round() as i64;
            match self.offsets.iter_mut().find(|(axis, _)| *axis == proposal.axis) {
                Some((_, known)) if *known == whole_um => continue,
                Some((_, known)) => *known = whole_um,
                None => self.offsets.push((proposal.axis, whole_um)),
            }
            keep(offset_row(proposal, decision.at_ns).into());
        }
        self.offsets.retain(|(axis, _)| decision.offsets.iter().any(|proposal| proposal.axis == *axis));
    }

    fn note_change(&mut self, decision: &Decision, verdict: &Verdict, asked: Option<RoundedRequest>) -> DecisionRow {
        let at_ns = decision.at_ns;
        let before = std::mem::replace(&mut self.asked, asked);
        let (text, row) = match &decision.request {
            Some(request) => {
                let text = format!("{:.0} % ({}): {}", request.pct, request.reason, verdict.reason());
                (text, row_of(request, at_ns))
            }
            None => {
                let script = before.map(|asked| asked.script.to_string()).unwrap_or_default();
                let reason = "nothing is asked for any more".to_owned();
                let row = DecisionRow { at_ns, script, reason, ..empty_row() };
                ("the programmed feed, 100 %".to_owned(), row)
            }
        };
        self.recent.push_front(ShownChange { at_ns, text });
        self.recent.truncate(RECENT);
        DecisionRow { outcome: verdict.as_word().to_owned(), outcome_reason: verdict.reason(), ..row }
    }
}

fn empty_row() -> DecisionRow {
    DecisionRow { wanted: "feed_override_pct".to_owned(), unit: "%".to_owned(), ..DecisionRow::default() }
}

fn row_of(request: &OverrideRequest, at_ns: TimeNs) -> DecisionRow {
    DecisionRow {
        at_ns,
        script: request.script.to_string(),
        script_version: format!("{:016x}", request.version),
        value: request.pct.is_finite().then_some(request.pct),
        reason: request.reason.to_string(),
        ..empty_row()
    }
}

/// What became of it is the gate's to say.
const ASKED: &str = "asked";

fn stop_row(request: &StopRequest, at_ns: TimeNs) -> DecisionRow {
    DecisionRow {
        at_ns,
        script: request.script.to_string(),
        script_version: format!("{:016x}", request.version),
        wanted: request.stop.as_word().to_owned(),
        reason: request.reason.to_string(),
        outcome: ASKED.to_owned(),
        ..DecisionRow::default()
    }
}

fn offset_row(proposal: &OffsetProposal, at_ns: TimeNs) -> DecisionRow {
    DecisionRow {
        at_ns,
        script: proposal.script.to_string(),
        script_version: format!("{:016x}", proposal.version),
        wanted: format!("{}_offset_um", proposal.axis.as_word()),
        value: proposal.offset_um.is_finite().then_some(proposal.offset_um),
        unit: "um".to_owned(),
        reason: proposal.reason.to_string(),
        outcome: ASKED.to_owned(),
        outcome_reason: String::new(),
    }
}

fn build_alarm_record(change: &AlarmChange, at_ns: TimeNs) -> Record {
    let (code, source) = (change.name.to_string(), change.script.to_string());
    if !change.raised {
        return AlarmClear { at_ns, code, source }.into();
    }
    let severity = change.level.as_word().to_owned();
    Alarm { at_ns, code, source, severity, en: change.en.to_string(), zh: change.zh.to_string() }.into()
}

fn build_event_record(kind: &str, source: &str, text: &str, at_ns: TimeNs) -> Record {
    Event { at_ns, kind: kind.to_owned(), source: source.to_owned(), text: text.to_owned(), detail: String::new() }
        .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asking(at_ns: TimeNs, pct: Option<f64>) -> Decision {
        let request =
            pct.map(|pct| OverrideRequest { pct, reason: "test".into(), script: "a.rhai".into(), version: 7 });
        Decision { at_ns, request, ..Decision::default() }
    }

    fn verdict(at_ns: TimeNs) -> Verdict {
        let permitted = adapter_core::override_pct::OverridePct::FULL;
        Verdict { at_ns, wanted_pct: None, permitted, outcome: gateway_gate::GateOutcome::Permitted, armed: false }
    }

    #[test]
    fn only_changes_of_a_whole_percent_are_recorded() {
        let mut decisions = Decisions::default();
        let mut rows = Vec::new();
        for (at_ns, pct) in
            [(1, Some(90.0)), (2, Some(90.3)), (3, Some(89.0)), (4, Some(f64::NAN)), (5, None), (6, None)]
        {
            decisions.record_decision(&asking(at_ns, pct), &verdict(at_ns), |record| rows.push(record));
        }
        let values: Vec<_> =
            rows.iter().map(|row| matches!(row, Record::Decision(row) if row.value.is_some())).collect();
        assert_eq!(values, [true, true, false, false]);
        assert_eq!(decisions.recent_changes().next().map(|change| change.at_ns), Some(5));
    }
}
