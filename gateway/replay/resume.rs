//! What a history already holds of a recording, so that a replay that was broken off stores nothing twice.

use crate::history::{HistoryError, Reader, Record, RecordSpan, SQL_WITHIN, SqlValue, StateChange};
use adapters::Sample;
use adapters::clock::{SECOND_NS, TimeNs};
use rules::estimators::Estimates;
use std::fs::File;
use std::io::Read;
use std::ops::ControlFlow;
use std::path::Path;

/// Records this long before the last stored row are compared one by one: more than any estimator looks back.
const LOOK_BACK_NS: i64 = 120 * SECOND_NS;
/// A pause between what the history holds and a recording without dates.
const PAUSE_NS: i64 = 60 * SECOND_NS;
/// At most so many records lie around the end of a broken-off replay.
const RECORDS_MAX: u32 = 100_000;

/// The name under which a recording stands in the history: its file name and what is in it.
pub(super) fn origin_of(path: &Path) -> std::io::Result<String> {
    let mut file = File::open(path)?;
    let mut buffer = vec![0; 1 << 16];
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            break;
        }
        // FNV-1a
        hash = buffer[..count].iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3));
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(format!("replay:{name}#{hash:016x}"))
}

#[derive(Debug, Default)]
pub(super) struct Before {
    /// Where the recording began, when some of it is there.
    pub(super) origin_ns: Option<TimeNs>,
    /// The first time after everything in the history.
    pub(super) free_ns: TimeNs,
    rows: u64,
    records: Vec<Record>,
    /// A state was ended although the recording goes on in it.
    state_ended: bool,
}

impl Before {
    /// Reads what `path` holds of the recording called `origin`.
    pub(super) fn read(path: &Path, origin: &str) -> Result<Self, HistoryError> {
        // A replay that was killed before its first commit leaves an empty file.
        if std::fs::metadata(path).map_or(0, |metadata| metadata.len()) == 0 {
            return Ok(Self::default());
        }
        let reader = Reader::open(path)?;
        let free_ns = reader.read_span()?.map_or(0, |(_, newest_ns)| newest_ns + PAUSE_NS);
        let (rows, first_ns, last_ns) = read_stored_span(&reader, origin)?;
        if rows == 0 {
            return Ok(Self { free_ns, ..Self::default() });
        }
        let records = read_records(&reader, RecordSpan::between(last_ns - LOOK_BACK_NS, TimeNs::MAX, RECORDS_MAX))?;
        Ok(Self { origin_ns: Some(first_ns), free_ns, rows, records, state_ended: !state_open(&reader)? })
    }

    /// How many rows are there.
    pub(super) fn rows(&self) -> u64 {
        self.rows
    }

    /// Is the row with this number (from 1) there?
    pub(super) fn has_row(&self, row: u64) -> bool {
        row <= self.rows
    }

    /// Is this record of that row there? Records of earlier rows are; around the last one they are compared.
    pub(super) fn has_record(&self, row: u64, record: &Record) -> bool {
        row < self.rows || self.records.contains(record)
    }

    /// Somebody else has written this history in between and ended the state that the replay was in; this begins it
    /// again at the first new row.
    pub(super) fn continue_state(&mut self, row: u64, sample: &Sample, estimates: &Estimates) -> Option<Record> {
        if !self.state_ended || row <= self.rows {
            return None;
        }
        self.state_ended = false;
        if estimates.since_ns >= sample.at_ns {
            return None;
        }
        let (state, at_ns) = (estimates.state.as_word().to_owned(), sample.at_ns);
        Some(StateChange { at_ns, state, program: String::new(), tool: String::new() }.into())
    }
}

/// Rows of this origin, the time of the first and of the last one.
fn read_stored_span(reader: &Reader, origin: &str) -> Result<(u64, TimeNs, TimeNs), HistoryError> {
    let origin = origin.replace('\'', "''");
    let statement = format!(
        "WITH own AS (SELECT id FROM segments WHERE origin = '{origin}'),
         sealed AS (SELECT coalesce(max(first_row + rows), 0) AS next FROM blocks),
         parts AS (SELECT rows, start_ns, end_ns FROM blocks WHERE segment IN own
           UNION ALL SELECT rows, start_ns, end_ns FROM tail, sealed WHERE segment IN own AND first_row >= next)
         SELECT coalesce(sum(rows), 0), coalesce(min(start_ns), 0), coalesce(max(end_ns), 0) FROM parts"
    );
    let mut found = (0, 0, 0);
    reader.run_sql(&statement, SQL_WITHIN, |_, row| {
        if let [SqlValue::Integer(rows), SqlValue::Integer(first_ns), SqlValue::Integer(last_ns)] = row {
            found = (rows.unsigned_abs(), *first_ns, *last_ns);
        }
        ControlFlow::Continue(())
    })?;
    Ok(found)
}

/// Is there a state that has not ended?
fn state_open(reader: &Reader) -> Result<bool, HistoryError> {
    let mut open = false;
    reader.run_sql("SELECT 1 FROM states WHERE until_ns IS NULL", SQL_WITHIN, |_, _| {
        open = true;
        ControlFlow::Break(())
    })?;
    Ok(open)
}

/// Everything recorded in this time, as it was handed in.
fn read_records(reader: &Reader, span: RecordSpan) -> Result<Vec<Record>, HistoryError> {
    let mut records: Vec<Record> = Vec::new();
    records.extend(reader.read_events(span)?.into_iter().map(Record::from));
    records.extend(reader.read_parts(span)?.into_iter().map(Record::from));
    records.extend(reader.read_decisions(span)?.into_iter().map(Record::from));
    for interval in reader.read_states(span)? {
        let (at_ns, state) = (interval.since_ns, interval.state);
        records.push(StateChange { at_ns, state, program: interval.program, tool: interval.tool }.into());
    }
    for entry in reader.read_alarms(span)? {
        let crate::history::AlarmEntry { code, source, severity, raised_ns, cleared_ns, en, zh, .. } = entry;
        if let Some(at_ns) = cleared_ns {
            records.push(crate::history::AlarmClear { at_ns, code: code.clone(), source: source.clone() }.into());
        }
        records.push(crate::history::Alarm { at_ns: raised_ns, code, source, severity, en, zh }.into());
    }
    Ok(records)
}
