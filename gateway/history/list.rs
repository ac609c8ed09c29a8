//! States, alarms, events and the like of a time range, oldest first.

use super::error::{Doing, HistoryError};
use super::reader::Reader;
use adapter_core::clock::TimeNs;
use gateway_records::{Command, Decision, Diagnosis, Event, Model, Part};
use rusqlite::{Params, Row, params};
use serde::Serialize;

/// Which records: those that touch the time from `from_ns` to before `to_ns`, the newest `limit` of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RecordSpan {
    /// From this time on.
    pub from_ns: TimeNs,
    /// Before this time, ns since 1970.
    pub to_ns: TimeNs,
    /// At most this many.
    pub limit: u32,
}

impl RecordSpan {
    /// The newest `limit` records of all time.
    #[must_use]
    pub fn newest(limit: u32) -> Self {
        Self { from_ns: TimeNs::MIN, to_ns: TimeNs::MAX, limit }
    }

    /// The newest `limit` records of a time range.
    #[must_use]
    pub fn between(from_ns: TimeNs, to_ns: TimeNs, limit: u32) -> Self {
        Self { from_ns, to_ns, limit }
    }
}

/// A stretch of time in one machine state.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StateInterval {
    /// Word of the state: `idle`, `cutting`, ...
    pub state: String,
    /// Beginning of the stretch, ns since 1970.
    pub since_ns: TimeNs,
    /// Until when; `None` while it lasts.
    pub until_ns: Option<TimeNs>,
    /// Programme at its beginning; empty when unknown.
    pub program: String,
    /// Tool at its beginning; empty when unknown.
    pub tool: String,
    /// `change`, or `stop` when the gateway stopped in it; empty while it lasts.
    pub ended_by: String,
}

/// An alarm, over or not.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AlarmEntry {
    /// Identifies it together with the source.
    pub code: String,
    /// Who raised it: the controller, a script, `gateway`.
    pub source: String,
    /// One of `info`, `warning`, `critical`.
    pub severity: String,
    /// When it was raised first, ns since 1970.
    pub raised_ns: TimeNs,
    /// Until when; `None` while it lasts.
    pub cleared_ns: Option<TimeNs>,
    /// How often it was raised meanwhile.
    pub count: i64,
    /// For the operator, English.
    pub en: String,
    /// For the operator, Chinese.
    pub zh: String,
}

/// Time in one state within one hour.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StateHour {
    /// Beginning of the hour.
    pub start_ns: TimeNs,
    /// Word of the state: `idle`, `cutting`, ...
    pub state: String,
    /// Time in the state within the hour, s.
    pub seconds: f64,
}

fn read_text_or_empty(row: &Row<'_>, column: usize) -> Result<String, rusqlite::Error> {
    Ok(row.get::<_, Option<String>>(column)?.unwrap_or_default())
}

fn read_event(row: &Row<'_>) -> Result<Event, rusqlite::Error> {
    Ok(Event {
        at_ns: row.get(0)?,
        kind: row.get(1)?,
        source: row.get(2)?,
        text: row.get(3)?,
        detail: read_text_or_empty(row, 4)?,
    })
}

impl Reader {
    /// Intervals of machine states that touch the range.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_states(&self, span: RecordSpan) -> Result<Vec<StateInterval>, HistoryError> {
        let select = "SELECT state, since_ns, until_ns, program, tool, ended_by FROM states
            WHERE since_ns < ?2 AND (until_ns IS NULL OR until_ns > ?1) ORDER BY since_ns DESC, id DESC LIMIT ?3";
        self.read_records(select, span, |row| {
            Ok(StateInterval {
                state: row.get(0)?,
                since_ns: row.get(1)?,
                until_ns: row.get(2)?,
                program: read_text_or_empty(row, 3)?,
                tool: read_text_or_empty(row, 4)?,
                ended_by: read_text_or_empty(row, 5)?,
            })
        })
    }

    /// Seconds per state and hour, for the share of time over long ranges. The state that lasts is not in it yet.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn state_hours(&self, span: RecordSpan) -> Result<Vec<StateHour>, HistoryError> {
        let select = "SELECT hour * 3600000000000, state, seconds FROM state_hours
            WHERE hour * 3600000000000 < ?2 AND (hour + 1) * 3600000000000 > ?1 ORDER BY hour DESC, state DESC LIMIT ?3";
        self.read_records(select, span, |row| {
            Ok(StateHour { start_ns: row.get(0)?, state: row.get(1)?, seconds: row.get(2)? })
        })
    }

    /// Alarms that were up in the range.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_alarms(&self, span: RecordSpan) -> Result<Vec<AlarmEntry>, HistoryError> {
        let select = "SELECT code, source, severity, raised_ns, cleared_ns, count, en, zh FROM alarms
            WHERE raised_ns < ?2 AND (cleared_ns IS NULL OR cleared_ns >= ?1) ORDER BY raised_ns DESC, id DESC LIMIT ?3";
        self.read_records(select, span, |row| {
            Ok(AlarmEntry {
                code: row.get(0)?,
                source: row.get(1)?,
                severity: row.get(2)?,
                raised_ns: row.get(3)?,
                cleared_ns: row.get(4)?,
                count: row.get(5)?,
                en: row.get(6)?,
                zh: row.get(7)?,
            })
        })
    }

    /// Events of the range.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_events(&self, span: RecordSpan) -> Result<Vec<Event>, HistoryError> {
        let select = "SELECT at_ns, kind, source, text, detail FROM events
            WHERE at_ns >= ?1 AND at_ns < ?2 ORDER BY at_ns DESC, id DESC LIMIT ?3";
        self.read_records(select, span, read_event)
    }

    /// Events of this kind in the range.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn events_of(&self, kind: &str, span: RecordSpan) -> Result<Vec<Event>, HistoryError> {
        let select = "SELECT at_ns, kind, source, text, detail FROM events
            WHERE at_ns >= ?1 AND at_ns < ?2 AND kind = ?4 ORDER BY at_ns DESC, id DESC LIMIT ?3";
        self.list_with(select, params![span.from_ns, span.to_ns, span.limit, kind], read_event)
    }

    /// Parts finished in the range.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_parts(&self, span: RecordSpan) -> Result<Vec<Part>, HistoryError> {
        let select = "SELECT began_ns, ended_ns, part, program, count, cutting_s, energy_j, detail FROM parts
            WHERE ended_ns >= ?1 AND ended_ns < ?2 ORDER BY ended_ns DESC, id DESC LIMIT ?3";
        self.read_records(select, span, |row| {
            Ok(Part {
                began_ns: row.get(0)?,
                ended_ns: row.get(1)?,
                part: read_text_or_empty(row, 2)?,
                program: read_text_or_empty(row, 3)?,
                count: row.get(4)?,
                cutting_s: row.get(5)?,
                energy_j: row.get(6)?,
                detail: read_text_or_empty(row, 7)?,
            })
        })
    }

    /// Decisions of the range.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_decisions(&self, span: RecordSpan) -> Result<Vec<Decision>, HistoryError> {
        let select = "SELECT at_ns, script, script_version, wanted, value, unit, reason, outcome, outcome_reason
            FROM decisions WHERE at_ns >= ?1 AND at_ns < ?2 ORDER BY at_ns DESC, id DESC LIMIT ?3";
        self.read_records(select, span, |row| {
            Ok(Decision {
                at_ns: row.get(0)?,
                script: row.get(1)?,
                script_version: row.get(2)?,
                wanted: row.get(3)?,
                value: row.get(4)?,
                unit: row.get(5)?,
                reason: row.get(6)?,
                outcome: row.get(7)?,
                outcome_reason: row.get(8)?,
            })
        })
    }

    /// Commands sent in the range.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_commands(&self, span: RecordSpan) -> Result<Vec<Command>, HistoryError> {
        let select =
            "SELECT at_ns, command, target, before, asked, after, unit, outcome, reason, script, script_version
            FROM commands WHERE at_ns >= ?1 AND at_ns < ?2 ORDER BY at_ns DESC, id DESC LIMIT ?3";
        self.read_records(select, span, |row| {
            Ok(Command {
                at_ns: row.get(0)?,
                command: row.get(1)?,
                target: row.get(2)?,
                before: row.get(3)?,
                asked: row.get(4)?,
                after: row.get(5)?,
                unit: row.get(6)?,
                outcome: row.get(7)?,
                reason: row.get(8)?,
                script: read_text_or_empty(row, 9)?,
                script_version: read_text_or_empty(row, 10)?,
            })
        })
    }

    /// Models that came into force in the range.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_models(&self, span: RecordSpan) -> Result<Vec<Model>, HistoryError> {
        let select = "SELECT at_ns, name, origin, toml FROM models
            WHERE at_ns >= ?1 AND at_ns < ?2 ORDER BY at_ns DESC, id DESC LIMIT ?3";
        self.read_records(select, span, |row| {
            Ok(Model { at_ns: row.get(0)?, name: row.get(1)?, origin: row.get(2)?, toml: row.get(3)? })
        })
    }

    /// Diagnoses finished in the range.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn read_diagnoses(&self, span: RecordSpan) -> Result<Vec<Diagnosis>, HistoryError> {
        let select = "SELECT at_ns, from_ns, to_ns, verdict, summary, json FROM diagnoses
            WHERE at_ns >= ?1 AND at_ns < ?2 ORDER BY at_ns DESC, id DESC LIMIT ?3";
        self.read_records(select, span, |row| {
            Ok(Diagnosis {
                at_ns: row.get(0)?,
                from_ns: row.get(1)?,
                to_ns: row.get(2)?,
                verdict: row.get(3)?,
                summary: row.get(4)?,
                json: row.get(5)?,
            })
        })
    }

    pub(crate) fn read_records<T>(
        &self,
        select: &str,
        span: RecordSpan,
        read: impl FnMut(&Row<'_>) -> Result<T, rusqlite::Error>,
    ) -> Result<Vec<T>, HistoryError> {
        self.list_with(select, params![span.from_ns, span.to_ns, span.limit], read)
    }

    fn list_with<T>(
        &self,
        select: &str,
        values: impl Params,
        read: impl FnMut(&Row<'_>) -> Result<T, rusqlite::Error>,
    ) -> Result<Vec<T>, HistoryError> {
        let mut statement = self.db.prepare_cached(select).with_activity("reading records")?;
        let rows = statement.query_map(values, read);
        let mut records: Vec<T> = rows.and_then(Iterator::collect).with_activity("reading records")?;
        records.reverse();
        Ok(records)
    }
}
