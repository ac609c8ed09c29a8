//! What goes into the audit: each change of what is asked for and of what becomes of it, each write that is a change, each
//! arming. A script that asks for something else at every tick fills no disk: beyond ten rows a second its requests are counted,
//! and the next row says how many there were.

use super::arming::{Armed, Disarmed};
use super::ask::{AskOutcome, ScriptRequest};
use super::verdict::{GateOutcome, Verdict};
use super::write::{Occasion, Reaction, WriteRecord};
use crate::limits::{GateConfig, GateMode, OffsetConfig};
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::override_pct::OverridePct;
use adapter_core::request::OverrideRequest;
pub use gateway_records::RowRate;
use gateway_records::{Audit, Command, ReactionTime};
use std::collections::VecDeque;

/// A script's words in the audit are cut at so many characters.
const WORDS_MAX: usize = 200;
/// What went wrong begins with the address of the source, and ends with what to do.
const FAULT_MAX: usize = 600;

/// What was last recorded of requests.
#[derive(Debug, Clone, PartialEq)]
struct LastRequest {
    asked: Option<i64>,
    outcome: GateOutcome,
    armed: bool,
    script: Option<u64>,
}

/// Whose wish it was.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Author {
    pub(super) script: String,
    pub(super) version: String,
    pub(super) reason: String,
}

impl Author {
    pub(super) fn new(script: &str, version: u64, reason: &str) -> Self {
        Self { script: truncate_text(script), version: format!("{version:016x}"), reason: truncate_text(reason) }
    }
}

/// A write is told at most so many changes of what is asked for after the one that led to it.
const AUTHORS_MAX: usize = 32;

/// What the audit holds of requests, writes and arming, with a limit on the rows per second.
#[derive(Debug, Default)]
pub struct Trail {
    last_request: Option<LastRequest>,
    /// Who has asked since when, the newest at the end.
    authors: VecDeque<(TimeNs, Author)>,
    row_rate: RowRate,
}

impl Trail {
    /// The row of this tick's request, if it or its fate is another than before.
    pub fn audit_override(&mut self, request: Option<&OverrideRequest>, verdict: &Verdict) -> Option<Audit> {
        let told = LastRequest {
            #[expect(clippy::cast_possible_truncation, reason = "saturates, and NaN becomes 0; only compared")]
            asked: request.map(|request| request.pct.round() as i64),
            outcome: verdict.outcome,
            armed: verdict.armed,
            script: request.map(|request| request.version),
        };
        // Nothing asked for, nothing in the way of it: not worth a first row.
        let quiet = self.last_request.is_none() && request.is_none();
        if self.last_request.as_ref() == Some(&told) || quiet {
            return None;
        }
        let author = request.map_or(Author::default(), |it| Author::new(&it.script, it.version, &it.reason));
        self.record_author(verdict.at_ns, &author);
        self.last_request = Some(told);
        let also = self.row_rate.may_tell(verdict.at_ns)?;
        let wanted =
            request.map_or("nothing is asked for any more".to_owned(), |request| truncate_text(&request.reason));
        Some(Audit {
            outcome: outcome_word(verdict).to_owned(),
            asked: request.map(|request| request.pct),
            after: Some(to_percent(verdict.permitted)),
            reason: format!("{wanted}: {}{also}", verdict.reason()),
            script: author.script,
            script_version: author.version,
            ..new_row("request", verdict.at_ns)
        })
    }

    fn record_author(&mut self, at_ns: TimeNs, author: &Author) {
        if self.authors.back().is_some_and(|(_, last)| last == author) {
            return;
        }
        if self.authors.len() >= AUTHORS_MAX {
            self.authors.pop_front();
        }
        self.authors.push_back((at_ns, author.clone()));
    }

    /// Who asked for what this write came from; nobody when the machine was given back.
    fn find_author(&self, written: &WriteRecord) -> Author {
        let before = self.authors.iter().rev().find(|(at_ns, _)| *at_ns <= written.sample_ns);
        let author = before.filter(|_| !matches!(written.occasion, Occasion::Release | Occasion::Leftover));
        author.map_or(Author::default(), |(_, author)| author.clone())
    }

    /// A write; a sign of life is no news unless it failed.
    #[must_use]
    pub fn write(&self, written: &WriteRecord) -> Option<Audit> {
        if written.occasion == Occasion::SignOfLife && written.fault.is_none() {
            return None;
        }
        let Author { script, version, reason } = self.find_author(written);
        // Read right after a withdrawal, the machine still shows what it is about to leave: that is not what came of it.
        let returned = matches!(written.occasion, Occasion::Release | Occasion::Leftover) && written.fault.is_none();
        let after = written.after.filter(|after| !returned || Some(*after) != written.before);
        Some(Audit {
            outcome: if written.fault.is_some() { "failed" } else { "written" }.to_owned(),
            before: written.before.map(to_percent),
            asked: Some(to_percent(written.asked)),
            after: after.map(to_percent),
            reason: describe_reason(written, &reason),
            script,
            script_version: version,
            ..new_row("write", written.at_ns)
        })
    }

    /// The same for the table of commands.
    #[must_use]
    pub fn command_from_write(&self, written: &WriteRecord, target: &str) -> Option<Command> {
        let outcome = if written.fault.is_some() { "failed" } else { "done" };
        Some(self.write(written)?.as_command("feed_override_pct", target, outcome))
    }
}

/// Why it was written, and by whose words; or what went wrong.
fn describe_reason(written: &WriteRecord, reason: &str) -> String {
    match &written.fault {
        Some(fault) => fault.to_string().chars().take(FAULT_MAX).collect(),
        None if reason.is_empty() => written.occasion.as_words().to_owned(),
        None => format!("{}: {reason}", written.occasion.as_words()),
    }
}

fn outcome_word(verdict: &Verdict) -> &'static str {
    match verdict.outcome {
        GateOutcome::Held(_) => "held",
        GateOutcome::Refused => "refused",
        GateOutcome::Limited(_) | GateOutcome::DialCounts(_) => "limited",
        GateOutcome::Permitted if verdict.armed => "permitted",
        GateOutcome::Permitted => "shadow",
    }
}

fn new_row(kind: &str, at_ns: TimeNs) -> Audit {
    Audit { at_ns, kind: kind.to_owned(), unit: "%".to_owned(), ..Audit::default() }
}

pub(super) fn truncate_text(text: &str) -> String {
    text.chars().take(WORDS_MAX).collect()
}

fn to_percent(pct: OverridePct) -> f64 {
    f64::from(pct.percent())
}

/// The box has started with these limits.
#[must_use]
pub fn audit_start(limits: &GateConfig, at_ns: TimeNs) -> Audit {
    let GateConfig { min_pct, max_pct, slew_up_pct_per_s: up, slew_down_pct_per_s: down, above_dial, .. } = limits;
    let target = limits.source.as_deref().unwrap_or("no source");
    let dial = if *above_dial { ", may exceed the dial" } else { "" };
    let offsets = describe_offsets(&limits.offset);
    let reason = format!("disarmed; {target}, {min_pct} to {max_pct} %, +{up} and -{down} %/s{dial}{offsets}");
    Audit { outcome: limits.mode.as_word().to_owned(), reason, ..new_row("started", at_ns) }
}

/// What may be shifted, if anything.
fn describe_offsets(limits: &OffsetConfig) -> String {
    if limits.mode == GateMode::Off {
        return String::new();
    }
    let axes: Vec<&str> = limits.axes.iter().map(|axis| axis.as_word()).collect();
    let OffsetConfig { step_um, total_um, .. } = limits;
    format!("; offsets of {} {}, by {step_um} um up to {total_um} um", axes.join(" "), limits.mode.as_word())
}

/// A step was seen to be in force.
#[must_use]
pub fn audit_reaction(reaction: &Reaction) -> Audit {
    let times = reaction_times(reaction);
    let reason = format!("seen in force {:.1} ms after it was written", times.write_to_seen_ms);
    Audit {
        outcome: "seen".to_owned(),
        asked: Some(times.asked_pct),
        after: Some(times.found_pct),
        reason,
        ..new_row("reaction", reaction.seen_ns)
    }
}

/// The times of a step.
#[must_use]
pub fn reaction_times(reaction: &Reaction) -> ReactionTime {
    let ms = |from_ns: TimeNs, to_ns: TimeNs| (to_ns - from_ns) as f64 / 1e6;
    ReactionTime {
        at_ns: reaction.seen_ns,
        asked_pct: to_percent(reaction.asked),
        found_pct: to_percent(reaction.found),
        sample_to_write_ms: ms(reaction.sample_ns, reaction.issued_ns),
        write_to_seen_ms: ms(reaction.issued_ns, reaction.seen_ns),
        ..ReactionTime::default()
    }
}

/// A request to the ladder, and what the machine said to it where it was sent.
#[must_use]
pub fn audit_ladder_request(ask: &ScriptRequest, outcome: AskOutcome, failed: Option<&str>, at_ns: TimeNs) -> Audit {
    let more = match (outcome, failed) {
        (_, Some(failed)) => truncate_text(failed),
        (AskOutcome::Sent, None) => "handed to the ladder".to_owned(),
        (AskOutcome::Shadow, None) => "the gate is not armed: recorded, not written".to_owned(),
        (AskOutcome::Latched, None) => "nobody has seen to the last one yet".to_owned(),
    };
    Audit {
        outcome: if failed.is_some() { "failed" } else { outcome.as_word() }.to_owned(),
        reason: format!("{}: {more}", truncate_text(&ask.reason)),
        script: truncate_text(&ask.script),
        script_version: format!("{:016x}", ask.version),
        unit: String::new(),
        ..new_row(ask.request.as_word(), at_ns)
    }
}

/// Somebody armed the gate.
#[must_use]
pub fn audit_arming(armed: &Armed) -> Audit {
    let seconds = (armed.until_ns - armed.since_ns) / SECOND_NS;
    Audit {
        outcome: "armed".to_owned(),
        reason: format!("for {seconds} s"),
        person: truncate_text(&armed.by),
        unit: String::new(),
        ..new_row("armed", armed.since_ns)
    }
}

/// The arming has ended.
#[must_use]
pub fn audit_disarming(why: Disarmed, by: &str, at_ns: TimeNs) -> Audit {
    Audit {
        outcome: why.as_word().to_owned(),
        reason: why.to_string(),
        person: truncate_text(by),
        unit: String::new(),
        ..new_row("disarmed", at_ns)
    }
}

/// Somebody wanted something of the gate that it refused, or has seen to a request.
#[must_use]
pub fn audit_order(kind: &str, outcome: &str, reason: &str, by: &str, at_ns: TimeNs) -> Audit {
    Audit {
        outcome: outcome.to_owned(),
        reason: truncate_text(reason),
        person: truncate_text(by),
        unit: String::new(),
        ..new_row(kind, at_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(at_ns: TimeNs, outcome: GateOutcome) -> Verdict {
        Verdict { at_ns, wanted_pct: None, permitted: OverridePct::FULL, outcome, armed: true }
    }

    fn asking(pct: f64) -> OverrideRequest {
        OverrideRequest { pct, reason: "x".repeat(5000).as_str().into(), script: "a.rhai".into(), version: 7 }
    }

    #[test]
    fn a_request_is_recorded_when_it_or_its_fate_changes() {
        let mut trail = Trail::default();
        assert_eq!(
            trail.audit_override(None, &verdict(0, GateOutcome::Permitted)),
            None,
            "nothing has ever been asked for"
        );
        let first = trail.audit_override(Some(&asking(80.0)), &verdict(1, GateOutcome::Permitted)).expect("new");
        assert_eq!((first.asked, first.outcome.as_str()), (Some(80.0), "permitted"));
        assert!(first.reason.len() < 300, "a script's words are cut");
        assert_eq!(trail.audit_override(Some(&asking(80.2)), &verdict(2, GateOutcome::Permitted)), None);
        let refused = trail.audit_override(Some(&asking(f64::NAN)), &verdict(3, GateOutcome::Refused)).expect("new");
        assert_eq!(refused.outcome, "refused");
        assert!(trail.audit_override(None, &verdict(4, GateOutcome::Permitted)).is_some_and(|row| row.asked.is_none()));
    }

    #[test]
    fn a_script_that_never_rests_is_counted_instead() {
        let mut trail = Trail::default();
        let mut rows = Vec::new();
        for tick in 0..100_000 {
            let at_ns = tick * SECOND_NS / 1000;
            rows.extend(
                trail.audit_override(Some(&asking(60.0 + (tick % 50) as f64)), &verdict(at_ns, GateOutcome::Permitted)),
            );
        }
        assert!((1000..1300).contains(&rows.len()), "{} rows in 100 s", rows.len());
        assert!(rows.last().is_some_and(|row| row.reason.contains("were left out")));
    }
}
