//! Records into their tables.

use super::{audit, fact};
use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_records::{
    Alarm, AlarmClear, Command, Decision, Diagnosis, Event, Model, Part, ReactionTime, Record, StateChange,
};
use rusqlite::{Connection, OptionalExtension, Params, params};
use std::ops::Range;

/// Longest interval that is spread over `state_hours`. One of more than a year began before the clock was set (a box
/// without a battery wakes in 1970): its hours are nobody's, and are not counted.
const SPREAD_HOURS_MAX: i64 = 9_000;
const HOUR_NS: i64 = 3_600 * SECOND_NS;

/// Empty text as NULL.
fn none_if_empty(text: &str) -> Option<&str> {
    (!text.is_empty()).then_some(text)
}

/// One change of a table, by a statement that is prepared once.
fn execute_change(db: &Connection, sql: &str, values: impl Params) -> Result<(), rusqlite::Error> {
    db.prepare_cached(sql)?.execute(values).map(drop)
}

pub(crate) fn store_record(db: &Connection, record: &Record) -> Result<(), rusqlite::Error> {
    match record {
        Record::Event(event) => store_event(db, event),
        Record::Alarm(alarm) => raise_alarm(db, alarm),
        Record::AlarmClear(clear) => clear_alarm(db, clear),
        Record::State(change) => change_state(db, change),
        Record::Part(part) => store_part(db, part),
        Record::Decision(decision) => store_decision(db, decision),
        Record::Command(command) => store_command(db, command),
        Record::Model(model) => store_model(db, model),
        Record::Diagnosis(diagnosis) => store_diagnosis(db, diagnosis),
        Record::Audit(row) => audit::append_row(db, row),
        Record::Reaction(reaction) => store_reaction(db, reaction),
        Record::Fact(fact) => fact::store_fact(db, fact),
    }
}

fn store_event(db: &Connection, event: &Event) -> Result<(), rusqlite::Error> {
    execute_change(
        db,
        "INSERT INTO events (at_ns, kind, source, text, detail) VALUES (?1, ?2, ?3, ?4, ?5)",
        params![event.at_ns, event.kind, event.source, event.text, none_if_empty(&event.detail)],
    )
}

/// An alarm that stands already counts up where it says the same; where it says something else the row of the old text ends.
fn raise_alarm(db: &Connection, alarm: &Alarm) -> Result<(), rusqlite::Error> {
    execute_change(
        db,
        "UPDATE alarms SET cleared_ns = max(?1, raised_ns) WHERE source = ?2 AND code = ?3 AND cleared_ns IS NULL
         AND (severity, coalesce(en, ''), coalesce(zh, '')) <> (?4, ?5, ?6)",
        params![alarm.at_ns, alarm.source, alarm.code, alarm.severity, alarm.en, alarm.zh],
    )?;
    execute_change(
        db,
        "INSERT INTO alarms (code, source, severity, raised_ns, count, en, zh) VALUES (?1, ?2, ?3, ?4, 1, ?5, ?6)
         ON CONFLICT (source, code) WHERE cleared_ns IS NULL DO UPDATE SET count = count + 1",
        params![alarm.code, alarm.source, alarm.severity, alarm.at_ns, alarm.en, alarm.zh],
    )
}

fn clear_alarm(db: &Connection, clear: &AlarmClear) -> Result<(), rusqlite::Error> {
    execute_change(
        db,
        "UPDATE alarms SET cleared_ns = max(?1, raised_ns) WHERE source = ?2 AND code = ?3 AND cleared_ns IS NULL",
        params![clear.at_ns, clear.source, clear.code],
    )
}

fn change_state(db: &Connection, change: &StateChange) -> Result<(), rusqlite::Error> {
    close_state(db, change.at_ns, "change")?;
    execute_change(
        db,
        "INSERT INTO states (state, since_ns, program, tool) VALUES (?1, ?2, ?3, ?4)",
        params![change.state, change.at_ns, none_if_empty(&change.program), none_if_empty(&change.tool)],
    )
}

/// Ends the state the machine is in, if any, and counts its time by the hour.
pub(crate) fn close_state(db: &Connection, until_ns: TimeNs, ended_by: &str) -> Result<(), rusqlite::Error> {
    let open: Option<(i64, String, TimeNs)> = db
        .prepare_cached("SELECT id, state, since_ns FROM states WHERE until_ns IS NULL")?
        .query_row([], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)))
        .optional()?;
    let Some((id, state, since_ns)) = open else { return Ok(()) };
    let until_ns = until_ns.max(since_ns);
    execute_change(
        db,
        "UPDATE states SET until_ns = ?1, ended_by = ?2 WHERE id = ?3",
        params![until_ns, ended_by, id],
    )?;
    add_to_state_hours(db, &state, since_ns..until_ns, 1.0)
}

/// Adds the time of a state to its hours `times` times; -1 takes it away again.
pub(crate) fn add_to_state_hours(
    db: &Connection,
    state: &str,
    Range { start: since_ns, end: until_ns }: Range<TimeNs>,
    times: f64,
) -> Result<(), rusqlite::Error> {
    let mut add = db.prepare_cached(
        "INSERT INTO state_hours (hour, state, seconds) VALUES (?1, ?2, ?3)
         ON CONFLICT DO UPDATE SET seconds = seconds + excluded.seconds",
    )?;
    let first = since_ns.div_euclid(HOUR_NS);
    let last = until_ns.div_euclid(HOUR_NS);
    if last - first > SPREAD_HOURS_MAX {
        return Ok(());
    }
    for hour in first..=last {
        let from_ns = since_ns.max(hour.saturating_mul(HOUR_NS));
        let to_ns = until_ns.min((hour + 1).saturating_mul(HOUR_NS));
        if to_ns > from_ns {
            add.execute(params![hour, state, times * (to_ns - from_ns) as f64 / SECOND_NS as f64])?;
        }
    }
    Ok(())
}

fn store_part(db: &Connection, part: &Part) -> Result<(), rusqlite::Error> {
    execute_change(
        db,
        "INSERT INTO parts (began_ns, ended_ns, part, program, count, cutting_s, energy_j, detail)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
        params![
            part.began_ns,
            part.ended_ns,
            none_if_empty(&part.part),
            none_if_empty(&part.program),
            part.count,
            part.cutting_s,
            part.energy_j,
            none_if_empty(&part.detail)
        ],
    )
}

fn store_decision(db: &Connection, decision: &Decision) -> Result<(), rusqlite::Error> {
    execute_change(
        db,
        "INSERT INTO decisions (at_ns, script, script_version, wanted, value, unit,
         reason, outcome, outcome_reason)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)",
        params![
            decision.at_ns,
            decision.script,
            decision.script_version,
            decision.wanted,
            decision.value,
            decision.unit,
            decision.reason,
            decision.outcome,
            decision.outcome_reason
        ],
    )
}

fn store_command(db: &Connection, command: &Command) -> Result<(), rusqlite::Error> {
    execute_change(
        db,
        "INSERT INTO commands (at_ns, command, target, before, asked, after, unit,
         outcome, reason, script, script_version)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)",
        params![
            command.at_ns,
            command.command,
            command.target,
            command.before,
            command.asked,
            command.after,
            command.unit,
            command.outcome,
            command.reason,
            none_if_empty(&command.script),
            none_if_empty(&command.script_version)
        ],
    )
}

fn store_model(db: &Connection, model: &Model) -> Result<(), rusqlite::Error> {
    execute_change(
        db,
        "INSERT INTO models (at_ns, name, origin, toml) VALUES (?1, ?2, ?3, ?4)",
        params![model.at_ns, model.name, model.origin, model.toml],
    )
}

fn store_diagnosis(db: &Connection, diagnosis: &Diagnosis) -> Result<(), rusqlite::Error> {
    execute_change(
        db,
        "INSERT INTO diagnoses (at_ns, from_ns, to_ns, verdict, summary, json) VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
        params![
            diagnosis.at_ns,
            diagnosis.from_ns,
            diagnosis.to_ns,
            diagnosis.verdict,
            diagnosis.summary,
            diagnosis.json
        ],
    )
}

fn store_reaction(db: &Connection, reaction: &ReactionTime) -> Result<(), rusqlite::Error> {
    execute_change(
        db,
        "INSERT INTO reactions (at_ns, asked_pct, found_pct, sample_to_write_ms, write_to_seen_ms,
         program, block, tool)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
        params![
            reaction.at_ns,
            reaction.asked_pct,
            reaction.found_pct,
            reaction.sample_to_write_ms,
            reaction.write_to_seen_ms,
            reaction.program,
            reaction.block,
            reaction.tool
        ],
    )
}
