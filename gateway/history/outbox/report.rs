//! Which values of a tick are worth sending: those that have changed by more than their dead band, at every n-th tick,
//! and all of them once in a while, so that a receiver that came late knows everything soon.

use super::item::{Cell, Reading, SeriesInfo};
use crate::reason::{NOT_PROVIDED, PRESENT, Reasons};
use crate::rounding::round_to_decimals;
use crate::rows::{Column, SeriesRows, Word};
use crate::series::Series;
use crate::tail::{append_comma, put_missing, put_number};
use adapter_core::clock::TimeNs;
use gateway_base::convert::saturate_to_ns;
use serde_json::Value as Json;
use std::fmt::Write;
use std::sync::Arc;
use std::time::Duration;

/// What is gathered for the sinks, and how much of it is kept.
#[derive(Debug, Clone, PartialEq)]
pub struct OutboxSettings {
    /// Only every so many ticks are looked at; 1 looks at each.
    pub every_nth: u32,
    /// A value that differs from the one sent last by at most this, in the unit of the series, is not sent again. A
    /// series that is not named here is sent when it differs at all in the digits that the history keeps.
    pub dead_bands: Vec<(String, f64)>,
    /// Least and greatest value of a series on this machine, in its unit, for receivers that draw scales.
    pub ranges: Vec<(String, (f64, f64))>,
    /// All values are sent this often even if none has changed.
    pub refresh: Duration,
    /// Time between two ticks.
    pub tick: Duration,
    /// At the end the sinks may take so long to deliver what waits.
    pub drain: Duration,
    /// Greatest size of what waits, bytes on disk.
    pub max_bytes: u64,
    /// Greatest age of what waits.
    pub max_age: Duration,
}

impl Default for OutboxSettings {
    fn default() -> Self {
        Self {
            every_nth: 1,
            dead_bands: Vec::new(),
            ranges: Vec::new(),
            refresh: Duration::from_secs(60),
            tick: Duration::from_millis(100),
            drain: Duration::from_secs(5),
            max_bytes: 1_000_000_000,
            max_age: Duration::from_secs(7 * 86_400),
        }
    }
}

impl OutboxSettings {
    /// The range of a series on this machine; `None` where nobody has said.
    #[must_use]
    pub fn range_of(&self, series: &SeriesInfo) -> Option<(f64, f64)> {
        let named = self.ranges.iter().find(|(name, _)| **name == *series.name);
        named.map(|(_, range)| *range).or(series.range)
    }
}

/// What a receiver knows of a series.
#[derive(Debug, Clone, PartialEq)]
enum Last {
    Number(f64),
    Text(Arc<str>),
    Missing(u8),
}

#[derive(Debug)]
pub(super) struct OutboxReport {
    every_nth: u64,
    refresh_ns: i64,
    bands: Vec<f64>,
    last: Vec<Last>,
    ticks: u64,
    whole_at: Option<TimeNs>,
}

impl OutboxReport {
    pub(super) fn new(settings: &OutboxSettings, series: &[Series]) -> Self {
        let band = |series: &Series| {
            let named = settings.dead_bands.iter().find(|(name, _)| **name == *series.name);
            named.map_or(0.0, |(_, band)| *band)
        };
        Self {
            every_nth: u64::from(settings.every_nth.max(1)),
            refresh_ns: saturate_to_ns(settings.refresh),
            bands: series.iter().map(band).collect(),
            last: vec![Last::Missing(NOT_PROVIDED); series.len()],
            ticks: 0,
            whole_at: None,
        }
    }

    /// The receiver knows nothing any more: the next tick tells everything.
    pub(super) fn begin_anew(&mut self) {
        self.last.fill(Last::Missing(NOT_PROVIDED));
        self.whole_at = None;
    }

    /// The line of a tick, where it has something to tell.
    pub(super) fn report_tick(
        &mut self,
        rows: &SeriesRows,
        row: usize,
        series: &[Series],
        reasons: &Reasons,
    ) -> Option<String> {
        let at_ns = rows.at_ns[row];
        // A clock that went back begins anew as well.
        let whole = self.whole_at.is_none_or(|since| at_ns < since || at_ns - since >= self.refresh_ns);
        let due = whole || self.ticks.is_multiple_of(self.every_nth);
        self.ticks += 1;
        if !due {
            return None;
        }
        if whole {
            self.whole_at = Some(at_ns);
        }
        self.format_line(rows, row, whole, series, reasons)
    }

    fn format_line(
        &mut self,
        rows: &SeriesRows,
        row: usize,
        whole: bool,
        series: &[Series],
        reasons: &Reasons,
    ) -> Option<String> {
        let mut out = String::new();
        let mut count = 0;
        for (index, (series, column)) in series.iter().zip(&rows.columns).enumerate() {
            let now = read_cell(column, row, series.decimals);
            let known = &self.last[index];
            let same = is_same(known, &now, self.bands[index]);
            let never = matches!(now, Last::Missing(NOT_PROVIDED));
            if same && (!whole || never) {
                continue;
            }
            append_comma(&mut out, count);
            count += 1;
            // Writing to a string cannot fail, here and below.
            let _ = write!(out, "\"{}\":", series.id);
            put_cell(&mut out, &now, reasons);
            self.last[index] = now;
        }
        (count > 0).then(|| format!("{{\"t\":{},\"s\":{{{out}}}}}", rows.at_ns[row]))
    }

    /// What a receiver of everything knows by now.
    pub(super) fn latest_readings(&self, known: &[Arc<SeriesInfo>], reasons: &Reasons) -> Vec<Reading> {
        let reading = |(series, last): (&Arc<SeriesInfo>, &Last)| {
            let value = match last {
                Last::Number(number) => Cell::Number(*number),
                Last::Text(text) => Cell::Text(text.clone()),
                Last::Missing(code) => Cell::Missing(reasons.find_word(*code).unwrap_or("not_provided").into()),
            };
            Reading { series: series.clone(), value }
        };
        known.iter().zip(&self.last).map(reading).collect()
    }
}

fn read_cell(column: &Column, row: usize, decimals: Option<u8>) -> Last {
    match column {
        Column::Numbers { values, missing } => match missing.get(row) {
            Some(&PRESENT) => {
                Last::Number(decimals.map_or(values[row], |places| round_to_decimals(values[row], places)))
            }
            Some(code) => Last::Missing(*code),
            None => Last::Missing(NOT_PROVIDED),
        },
        Column::Words(changes) => {
            let after = changes.partition_point(|(from, _)| *from <= row);
            match after.checked_sub(1).map(|index| &changes[index].1) {
                Some(Word::Is(text)) => Last::Text(text.clone()),
                Some(Word::Missing(code)) => Last::Missing(*code),
                None => Last::Missing(NOT_PROVIDED),
            }
        }
    }
}

fn is_same(known: &Last, now: &Last, band: f64) -> bool {
    match (known, now) {
        (Last::Number(known), Last::Number(now)) => (known - now).abs() <= band,
        (known, now) => known == now,
    }
}

fn put_cell(out: &mut String, cell: &Last, reasons: &Reasons) {
    match cell {
        Last::Number(number) => put_number(out, *number),
        Last::Text(text) => {
            let _ = write!(out, "{}", Json::from(&**text));
        }
        Last::Missing(code) => put_missing(out, *code, reasons),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::stored_series;
    use crate::{ExtraSeries, ExtraValue, Fidelity};
    use adapter_core::{Absence, ChannelId, Sample, Slot, Value};

    fn series() -> Vec<Series> {
        let extras = vec![ExtraSeries::new_text("state", "", "")];
        let mut series = stored_series(Fidelity::Resolution, &extras).expect("fine");
        (1..).zip(&mut series).for_each(|(id, series)| series.id = id);
        series
    }

    /// Power 100.0, 100.0, 100.4, stale, 100.4, ... a tenth of a second apart, and a state that changes once.
    fn rows(powers: &[Option<f64>]) -> SeriesRows {
        let mut rows = SeriesRows::for_series(&series());
        let mut reasons = Reasons::default();
        let power = ChannelId::from_name("spindle_power_w").expect("in the table");
        for (row, watts) in powers.iter().enumerate() {
            let mut sample = Sample::new_empty(row as i64 * 100_000_000);
            let slot = watts.map_or(Slot::from_absence(Absence::Stale), |watts| Slot {
                value: Ok(Value::Number(watts)),
                age_ns: 0,
            });
            sample.set_slot(power, slot);
            let state = if row < 2 { "idle" } else { "cutting" };
            rows.push(&sample, &[ExtraValue::Text(state)], &mut reasons);
        }
        rows
    }

    fn lines(settings: &OutboxSettings, powers: &[Option<f64>]) -> Vec<(usize, Json)> {
        let series = series();
        let mut found = Vec::new();
        let mut report = OutboxReport::new(settings, &series);
        let rows = rows(powers);
        for row in 0..rows.len() {
            let Some(line) = report.report_tick(&rows, row, &series, &Reasons::default()) else { continue };
            let line: Json = serde_json::from_str(&line).expect("JSON");
            found.push((row, line["s"].clone()));
        }
        found
    }

    const POWERS: [Option<f64>; 6] = [Some(100.0), Some(100.0), Some(100.4), None, Some(100.4), Some(100.4)];

    #[test]
    fn what_does_not_change_is_not_sent_again() {
        let found = lines(&OutboxSettings::default(), &POWERS);
        let rows: Vec<usize> = found.iter().map(|(row, _)| *row).collect();
        assert_eq!(rows, [0, 2, 3, 4], "{found:?}");
        assert_eq!(found[0].1.as_object().map(Map::len), Some(2), "power and state: nobody provides the rest");
        assert_eq!(found[2].1.as_object().map(Map::len), Some(1), "{found:?}");
        assert!(found[2].1.to_string().contains("stale"), "an absent value is news: {found:?}");
    }

    use serde_json::Map;

    #[test]
    fn a_dead_band_and_every_nth_tick_thin_out() {
        let banded =
            OutboxSettings { dead_bands: vec![("spindle_power_w".to_owned(), 0.5)], ..OutboxSettings::default() };
        let found = lines(&banded, &POWERS[..3]);
        assert!(!found[1].1.to_string().contains("100.4"), "within the band; only the state changed: {found:?}");
        let thinned = OutboxSettings { every_nth: 3, ..OutboxSettings::default() };
        let rows: Vec<usize> = lines(&thinned, &POWERS).iter().map(|(row, _)| *row).collect();
        assert_eq!(rows, [0, 3]);
    }

    #[test]
    fn everything_is_sent_again_once_in_a_while() {
        let often = OutboxSettings { refresh: Duration::from_millis(300), ..OutboxSettings::default() };
        let found = lines(&often, &[Some(1.0); 7]);
        let whole: Vec<usize> = found
            .iter()
            .filter(|(_, cells)| cells.as_object().is_some_and(|cells| cells.len() == 2))
            .map(|it| it.0)
            .collect();
        assert_eq!(whole, [0, 3, 6]);
    }
}
