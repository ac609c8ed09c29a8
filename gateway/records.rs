//! What the history holds besides samples, as rows of JSON: the same for the API and the command line.

use crate::history::{AlarmEntry, Command, Decision, Event, HistoryError, Part, Reader, RecordSpan, StateInterval};
use crate::pipeline::PartDetail;
use adapters::clock::TimeNs;
use serde_json::{Value, json};

/// Intervals looked at when only one state is wanted.
const FILTERED_MAX: u32 = 100_000;

/// One kind of record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum RecordKind {
    /// Intervals of machine state.
    States,
    /// Alarms, raised and cleared.
    Alarms,
    /// What scripts wanted and what the gate made of it.
    Decisions,
    /// Commands to the machine.
    Commands,
    /// What happened to the box and its sources.
    Events,
    /// Finished parts.
    Parts,
}

impl RecordKind {
    /// Name of the kind, as in addresses and schemas.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::States => "states",
            Self::Alarms => "alarms",
            Self::Decisions => "decisions",
            Self::Commands => "commands",
            Self::Events => "events",
            Self::Parts => "parts",
        }
    }
}

/// Which records.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordQuery {
    /// From this time on.
    pub from_ns: TimeNs,
    /// Before this time.
    pub to_ns: TimeNs,
    /// Only this state; for [`RecordKind::States`].
    pub state: Option<String>,
    /// At most so many, the newest ones.
    pub limit: u32,
}

/// Rows in the order of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Records {
    /// Name and value per column; times in milliseconds since 1970.
    pub rows: Vec<Value>,
    /// There were more; the oldest were left out.
    pub truncated: bool,
}

/// Reads records.
///
/// # Errors
/// What `SQLite` says.
pub fn records(reader: &Reader, kind: RecordKind, query: &RecordQuery) -> Result<Records, HistoryError> {
    let filtered = query.state.is_some();
    let limit = if filtered { FILTERED_MAX } else { query.limit.saturating_add(1) };
    let span = RecordSpan::between(query.from_ns, query.to_ns, limit);
    let mut rows: Vec<Value> = match kind {
        RecordKind::States => states(reader, span)?,
        RecordKind::Alarms => reader.alarms(span)?.iter().map(alarm).collect(),
        RecordKind::Decisions => reader.decisions(span)?.iter().map(decision).collect(),
        RecordKind::Commands => reader.commands(span)?.iter().map(command).collect(),
        RecordKind::Events => reader.events(span)?.iter().map(event).collect(),
        RecordKind::Parts => reader.parts(span)?.iter().map(part).collect(),
    };
    let mut truncated = rows.len() >= limit as usize;
    if let Some(state) = &query.state {
        rows.retain(|row| row["state"] == state.as_str());
    }
    let surplus = rows.len().saturating_sub(query.limit as usize);
    truncated |= surplus > 0;
    rows.drain(..surplus);
    Ok(Records { rows, truncated })
}

/// The answer as a document.
#[must_use]
pub fn document(kind: RecordKind, query: &RecordQuery, found: Records) -> Value {
    json!({
        "schema": format!("{}/1", kind.name()),
        "from_ms": ms(query.from_ns),
        "to_ms": ms(query.to_ns),
        "truncated": found.truncated,
        "rows": found.rows,
    })
}

fn ms(at_ns: TimeNs) -> i64 {
    at_ns.div_euclid(1_000_000)
}

/// Text that may be unknown.
fn known(text: &str) -> Option<&str> {
    (!text.is_empty()).then_some(text)
}

fn states(reader: &Reader, span: RecordSpan) -> Result<Vec<Value>, HistoryError> {
    let newest_ns = reader.present()?.map_or(span.to_ns, |(_, newest_ns)| newest_ns);
    Ok(reader.states(span)?.iter().map(|interval| state(interval, newest_ns)).collect())
}

fn state(interval: &StateInterval, newest_ns: TimeNs) -> Value {
    let until_ns = interval.until_ns.unwrap_or(newest_ns).max(interval.since_ns);
    #[expect(clippy::cast_precision_loss, reason = "microseconds suffice beyond a hundred days")]
    let seconds = (until_ns - interval.since_ns) as f64 / 1e9;
    json!({
        "state": interval.state,
        "from_ms": ms(interval.since_ns),
        "to_ms": interval.until_ns.map(ms),
        "seconds": seconds,
        "program": known(&interval.program),
        "tool": known(&interval.tool),
        "ended_by": known(&interval.ended_by),
    })
}

fn alarm(alarm: &AlarmEntry) -> Value {
    let AlarmEntry { code, source, severity, raised_ns, cleared_ns, count, en, zh } = alarm;
    json!({
        "code": code, "source": source, "severity": severity, "raised_ms": ms(*raised_ns),
        "cleared_ms": cleared_ns.map(ms), "count": count, "en": en, "zh": zh,
    })
}

fn decision(decision: &Decision) -> Value {
    json!({
        "at_ms": ms(decision.at_ns),
        "script": decision.script,
        "script_version": decision.script_version,
        "wanted": decision.wanted,
        "value": decision.value,
        "unit": decision.unit,
        "reason": decision.reason,
        "outcome": decision.outcome,
        "outcome_reason": decision.outcome_reason,
    })
}

fn command(command: &Command) -> Value {
    json!({
        "at_ms": ms(command.at_ns),
        "command": command.command,
        "target": command.target,
        "before": command.before,
        "asked": command.asked,
        "after": command.after,
        "unit": command.unit,
        "outcome": command.outcome,
        "reason": command.reason,
        "script": known(&command.script),
        "script_version": known(&command.script_version),
    })
}

fn event(event: &Event) -> Value {
    let Event { at_ns, kind, source, text, detail } = event;
    json!({ "at_ms": ms(*at_ns), "kind": kind, "source": source, "text": text, "detail": known(detail) })
}

/// Parts of an older version carry no detail.
fn part(part: &Part) -> Value {
    let detail: Option<PartDetail> = serde_json::from_str(&part.detail).ok();
    json!({
        "from_ms": ms(part.began_ns),
        "to_ms": ms(part.ended_ns),
        "part": known(&part.part),
        "program": known(&part.program),
        "count": part.count,
        "cutting_s": part.cutting_s,
        "energy_j": part.energy_j,
        "seconds": detail.as_ref().map(|it| &it.seconds),
        "peak_power_w": detail.as_ref().and_then(|it| it.peak_power_w),
        "tools": detail.as_ref().map(|it| &it.tools),
    })
}
