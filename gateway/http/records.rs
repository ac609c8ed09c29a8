//! What the history holds besides samples, as rows of JSON: the same for the API and the command line.

use adapters::clock::TimeNs;
use gateway_history::{
    AlarmEntry, Command, Decision, Event, Fact, HistoryError, Part, Reader, RecordSpan, StateInterval,
};
use gateway_pipeline::PartDetail;
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
    /// What the plant has told: orders, scrap, reasons, persons, planned time.
    Facts,
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
            Self::Facts => "facts",
        }
    }
}

/// The time range, and which of the records in it are wanted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordQuery {
    /// From this time on.
    pub from_ns: TimeNs,
    /// Before this time, ns since 1970.
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
pub fn read_records(reader: &Reader, kind: RecordKind, query: &RecordQuery) -> Result<Records, HistoryError> {
    let filtered = query.state.is_some();
    let limit = if filtered { FILTERED_MAX } else { query.limit.saturating_add(1) };
    let span = RecordSpan::between(query.from_ns, query.to_ns, limit);
    let mut rows: Vec<Value> = match kind {
        RecordKind::States => read_states(reader, span)?,
        RecordKind::Alarms => reader.read_alarms(span)?.iter().map(build_alarm_row).collect(),
        RecordKind::Decisions => reader.read_decisions(span)?.iter().map(build_decision_row).collect(),
        RecordKind::Commands => reader.read_commands(span)?.iter().map(build_command_row).collect(),
        RecordKind::Events => reader.read_events(span)?.iter().map(build_event_row).collect(),
        RecordKind::Parts => reader.read_parts(span)?.iter().map(build_part_row).collect(),
        RecordKind::Facts => reader.read_facts(span)?.iter().map(build_fact_row).collect(),
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
pub fn build_document(kind: RecordKind, query: &RecordQuery, found: Records) -> Value {
    json!({
        "schema": format!("{}/1", kind.name()),
        "from_ms": to_milliseconds(query.from_ns),
        "to_ms": to_milliseconds(query.to_ns),
        "truncated": found.truncated,
        "rows": found.rows,
    })
}

fn to_milliseconds(at_ns: TimeNs) -> i64 {
    at_ns.div_euclid(1_000_000)
}

/// Text that may be unknown.
fn non_empty_text(text: &str) -> Option<&str> {
    (!text.is_empty()).then_some(text)
}

fn read_states(reader: &Reader, span: RecordSpan) -> Result<Vec<Value>, HistoryError> {
    let newest_ns = reader.read_present_span()?.map_or(span.to_ns, |(_, newest_ns)| newest_ns);
    Ok(reader.read_states(span)?.iter().map(|interval| build_state_row(interval, newest_ns)).collect())
}

fn build_state_row(interval: &StateInterval, newest_ns: TimeNs) -> Value {
    let until_ns = interval.until_ns.unwrap_or(newest_ns).max(interval.since_ns);
    #[expect(clippy::cast_precision_loss, reason = "microseconds suffice beyond a hundred days")]
    let seconds = (until_ns - interval.since_ns) as f64 / 1e9;
    json!({
        "state": interval.state,
        "from_ms": to_milliseconds(interval.since_ns),
        "to_ms": interval.until_ns.map(to_milliseconds),
        "seconds": seconds,
        "program": non_empty_text(&interval.program),
        "tool": non_empty_text(&interval.tool),
        "ended_by": non_empty_text(&interval.ended_by),
    })
}

fn build_alarm_row(alarm: &AlarmEntry) -> Value {
    let AlarmEntry { code, source, severity, raised_ns, cleared_ns, count, en, zh } = alarm;
    json!({
        "code": code, "source": source, "severity": severity, "raised_ms": to_milliseconds(*raised_ns),
        "cleared_ms": cleared_ns.map(to_milliseconds), "count": count, "en": en, "zh": zh,
    })
}

fn build_decision_row(decision: &Decision) -> Value {
    json!({
        "at_ms": to_milliseconds(decision.at_ns),
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

fn build_command_row(command: &Command) -> Value {
    json!({
        "at_ms": to_milliseconds(command.at_ns),
        "command": command.command,
        "target": command.target,
        "before": command.before,
        "asked": command.asked,
        "after": command.after,
        "unit": command.unit,
        "outcome": command.outcome,
        "reason": command.reason,
        "script": non_empty_text(&command.script),
        "script_version": non_empty_text(&command.script_version),
    })
}

fn build_event_row(event: &Event) -> Value {
    let Event { at_ns, kind, source, text, detail } = event;
    json!({ "at_ms": to_milliseconds(*at_ns), "kind": kind, "source": source, "text": text, "detail": non_empty_text(detail) })
}

fn build_fact_row(fact: &Fact) -> Value {
    json!({
        "from_ms": to_milliseconds(fact.from_ns), "to_ms": fact.until_ns.map(to_milliseconds), "fact": fact.fact.as_word(),
        "value": non_empty_text(&fact.value), "parts": fact.parts, "id": fact.mark, "way": fact.way,
        "author": non_empty_text(&fact.author), "told_ms": to_milliseconds(fact.at_ns),
    })
}

/// Parts of an older version carry no detail.
fn build_part_row(part: &Part) -> Value {
    let detail: Option<PartDetail> = serde_json::from_str(&part.detail).ok();
    json!({
        "from_ms": to_milliseconds(part.began_ns),
        "to_ms": to_milliseconds(part.ended_ns),
        "part": non_empty_text(&part.part),
        "program": non_empty_text(&part.program),
        "count": part.count,
        "cutting_s": part.cutting_s,
        "energy_j": part.energy_j,
        "seconds": detail.as_ref().map(|it| &it.seconds),
        "peak_power_w": detail.as_ref().and_then(|it| it.peak_power_w),
        "tools": detail.as_ref().map(|it| &it.tools),
    })
}
