//! Items of a stretch of the history once more, for a receiver that came later or has lost them: made from what the history holds, so that
//! the stretch may be older than anything the outbox keeps.
//!
//! They are of an epoch of their own, [`RESENT_EPOCH`], and their numbers follow from their times: whoever sends a stretch twice
//! sends the same items. A value is told where it differs from the one before it by more than its dead band, and all of them once in a
//! while, as for a live receiver.

use super::epoch::RESENT_EPOCH;
use super::item::{Cell, Content, Gap, Item, Reading, SeriesInfo};
use super::line;
use super::means;
use super::report::OutboxSettings;
use crate::levels::LEVELS;
use crate::list::{AlarmEntry, RecordSpan, StateInterval};
use crate::query::{Chunk, Query};
use crate::schema::known_series;
use crate::{HistoryError, Reader};
use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_base::convert::saturate_to_ns;
use gateway_records::{Alarm, AlarmClear, Record, StateChange};
use std::collections::{BTreeSet, HashMap};
use std::ops::{ControlFlow, Range};
use std::sync::Arc;

/// A piece that is made at a time: what a box makes in an hour fits into memory.
const PIECE_NS: i64 = 3600 * SECOND_NS;
/// A number is a time in steps of a tenth of a millisecond, and the place of an item in its step: below 2^53 until the year 2081.
const STEP_NS: i64 = 100_000;
const PLACES: u64 = 256;
/// Ticks that are further apart than this, and than three ticks, have a gap between them.
const GAP_NS: i64 = 2 * SECOND_NS;

/// Makes items of a stretch of a history, piece by piece.
#[derive(Debug)]
pub struct ResentItems<'a> {
    reader: &'a Reader,
    settings: &'a OutboxSettings,
    series: HashMap<Arc<str>, Arc<SeriesInfo>>,
    by_number: line::SeriesByNumber,
    /// What a receiver knows of each series.
    known: HashMap<Arc<str>, Cell>,
    whole_ns: Option<TimeNs>,
    last_ns: Option<TimeNs>,
    ticks: u64,
}

impl<'a> ResentItems<'a> {
    /// Of this history.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn new(reader: &'a Reader, settings: &'a OutboxSettings) -> Result<Self, HistoryError> {
        let by_number: line::SeriesByNumber =
            known_series(&reader.db)?.iter().map(|series| (series.id, Arc::new(SeriesInfo::from(series)))).collect();
        let series = by_number.values().map(|info| (info.name.clone(), info.clone())).collect();
        let known = HashMap::new();
        Ok(Self { reader, settings, series, by_number, known, whole_ns: None, last_ns: None, ticks: 0 })
    }

    /// Hands the items from `from_ns` to before `to_ns`, in the order of their times, to `each`, an hour at a time.
    ///
    /// # Errors
    /// What `SQLite` says.
    pub fn for_each_piece(
        &mut self,
        from_ns: TimeNs,
        to_ns: TimeNs,
        mut each: impl FnMut(Vec<Item>) -> ControlFlow<()>,
    ) -> Result<(), HistoryError> {
        let mut start_ns = from_ns;
        while start_ns < to_ns {
            let end_ns = (start_ns.div_euclid(PIECE_NS) + 1).saturating_mul(PIECE_NS).min(to_ns);
            let items = self.make_piece(&(start_ns..end_ns))?;
            start_ns = end_ns;
            if !items.is_empty() && each(items).is_break() {
                break;
            }
        }
        Ok(())
    }

    fn make_piece(&mut self, piece: &Range<TimeNs>) -> Result<Vec<Item>, HistoryError> {
        let mut contents = self.make_records(piece)?;
        contents.extend(self.make_samples(piece)?);
        contents.extend(self.make_means(piece)?);
        contents.sort_by_key(|one| one.at_ns);
        let mut next = 0;
        for item in &mut contents {
            // More items of one step than it has places take those of the steps after it.
            item.sequence = next.max(item.at_ns.div_euclid(STEP_NS).unsigned_abs() * PLACES);
            next = item.sequence + 1;
        }
        Ok(contents)
    }

    fn make_samples(&mut self, piece: &Range<TimeNs>) -> Result<Vec<Item>, HistoryError> {
        let (reader, mut items) = (self.reader, Vec::new());
        // Also of those that have no value in the piece: the first of it tells why.
        let mut series: Vec<&Arc<SeriesInfo>> = self.by_number.values().collect();
        series.sort_unstable_by_key(|info| info.id);
        let names: Vec<Arc<str>> = series.into_iter().map(|info| info.name.clone()).collect();
        let query = Query::between(piece.start, piece.end).with_series(names.iter().map(|name| &**name));
        reader.for_each_chunk(&query, |chunk| {
            (0..chunk.at_ns.len()).for_each(|row| self.make_tick(chunk, row, &mut items));
            ControlFlow::Continue(())
        })?;
        Ok(items)
    }

    fn make_tick(&mut self, chunk: &Chunk<'_>, row: usize, items: &mut Vec<Item>) {
        let at_ns = chunk.at_ns[row];
        let tick_ns = saturate_to_ns(self.settings.tick);
        if let Some(last_ns) = self.last_ns.replace(at_ns)
            && at_ns - last_ns > GAP_NS.max(tick_ns.saturating_mul(3))
        {
            let gap = Gap { until_ns: Some(at_ns), reason: "no_samples".into() };
            items.push(build_item(last_ns + tick_ns, Content::Gap(gap)));
            self.known.clear();
            self.whole_ns = None;
        }
        let refresh_ns = saturate_to_ns(self.settings.refresh);
        let whole = self.whole_ns.is_none_or(|since_ns| at_ns < since_ns || at_ns - since_ns >= refresh_ns);
        let due = whole || self.ticks.is_multiple_of(u64::from(self.settings.every_nth.max(1)));
        self.ticks += 1;
        if !due {
            return;
        }
        if whole {
            self.whole_ns = Some(at_ns);
        }
        let readings: Vec<Reading> =
            (0..chunk.columns.len()).filter_map(|column| self.report_cell(chunk, column, row, whole)).collect();
        if !readings.is_empty() {
            items.push(build_item(at_ns, Content::Sample(readings)));
        }
    }

    /// The cell, where it is worth telling.
    fn report_cell(&mut self, chunk: &Chunk<'_>, column: usize, row: usize, whole: bool) -> Option<Reading> {
        let series = self.series.get(&chunk.series[column].name)?.clone();
        let cells = &chunk.columns[column];
        let value = match (cells.number_at(row), cells.word_at(row)) {
            (Some(number), _) => Cell::Number(number),
            (_, Some(word)) => Cell::Text(word.into()),
            _ => Cell::Missing(chunk.missing_reason(column, row).unwrap_or("not_provided").into()),
        };
        let never = matches!(&value, Cell::Missing(reason) if **reason == *"not_provided");
        let band =
            self.settings.dead_bands.iter().find(|(name, _)| **name == *series.name).map_or(0.0, |(_, band)| *band);
        let same = match (self.known.get(&series.name), &value) {
            (None, _) => never,
            (Some(Cell::Number(known)), Cell::Number(now)) => (known - now).abs() <= band,
            (Some(known), now) => known == now,
        };
        if same && (!whole || never) {
            return None;
        }
        self.known.insert(series.name.clone(), value.clone());
        Some(Reading { series, value })
    }

    /// What begins or ends in the piece.
    fn make_records(&self, piece: &Range<TimeNs>) -> Result<Vec<Item>, HistoryError> {
        let (reader, span) = (self.reader, RecordSpan::between(piece.start, piece.end, u32::MAX));
        let mut records: Vec<Record> = reader.read_states(span)?.into_iter().map(begin_state).collect();
        records.extend(reader.read_parts(span)?.into_iter().map(Record::from));
        records.extend(reader.read_alarms(span)?.into_iter().flat_map(split_alarm));
        records.extend(reader.read_events(span)?.into_iter().map(Record::from));
        records.extend(reader.read_decisions(span)?.into_iter().map(Record::from));
        records.extend(reader.read_diagnoses(span)?.into_iter().map(Record::from));
        records.extend(reader.read_facts_told(span)?.into_iter().map(Record::from));
        let within = records.into_iter().filter(|record| piece.contains(&record.at_ns()));
        Ok(within.map(|record| build_item(record.at_ns(), Content::Record(Box::new(record)))).collect())
    }

    fn make_means(&self, piece: &Range<TimeNs>) -> Result<Vec<Item>, HistoryError> {
        let begins_within =
            |(level, bucket): &(usize, i64)| piece.contains(&bucket.saturating_mul(LEVELS[*level].width_ns));
        let of_level = |level: usize| {
            (LEVELS[level].bucket_at(piece.start)..=LEVELS[level].bucket_at(piece.end))
                .map(move |bucket| (level, bucket))
        };
        let due: BTreeSet<(usize, i64)> = (0..LEVELS.len()).flat_map(of_level).filter(begins_within).collect();
        let _view = self.reader.begin_view()?;
        let lines = means::format_lines(&self.reader.db, &due, self.settings.tick)?;
        let item = |(_, text): (TimeNs, String)| Some(line::parse(&text)?.into_item(0, RESENT_EPOCH, &self.by_number));
        Ok(lines.into_iter().filter_map(item).collect())
    }
}

fn build_item(at_ns: TimeNs, content: Content) -> Item {
    Item { sequence: 0, epoch: RESENT_EPOCH, redated_ns: 0, at_ns, content }
}

fn begin_state(interval: StateInterval) -> Record {
    let StateInterval { state, since_ns, program, tool, .. } = interval;
    StateChange { at_ns: since_ns, state, program, tool }.into()
}

fn split_alarm(entry: AlarmEntry) -> impl Iterator<Item = Record> {
    let AlarmEntry { code, source, severity, raised_ns, cleared_ns, en, zh, .. } = entry;
    let clear = cleared_ns.map(|at_ns| AlarmClear { at_ns, code: code.clone(), source: source.clone() }.into());
    let raised = Alarm { at_ns: raised_ns, code, source, severity, en, zh };
    std::iter::once(raised.into()).chain(clear)
}
