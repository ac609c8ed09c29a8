//! A recording as a source: a peer of the real drivers.
//!
//! Times are mapped onto an increasing clock: `time_s` counts from an origin; where it restarts at a new run the pause is
//! unknown, and [`UNKNOWN_PAUSE_S`] is left so that nothing bridges it.

use crate::channel::ChannelId;
use crate::clock::{Clock, SECOND_NS, TimeNs};
use crate::driver::{Pull, Source, SourceError};
use crate::reading::{Absence, Reading, Stamp};
use crate::recording::{Cells, Numbers, Recording, Words};
use crate::words::find_canonical_word;
use std::sync::Arc;
use std::time::Duration;

/// Seconds left between two runs when the recording does not tell the pause.
pub const UNKNOWN_PAUSE_S: f64 = 60.0;

enum Filled {
    Numbers(Numbers),
    /// Codes of rows and the words ready to hand out.
    Words(Words, Vec<Arc<str>>),
}

struct ReplayedColumn {
    channel: ChannelId,
    cells: Filled,
    /// Reasons from `<channel>_missing`.
    missing: Option<Words>,
}

/// The rows of a recording as readings, one row at a time, with exact stamps.
pub struct Replay {
    name: String,
    channels: Vec<ChannelId>,
    ignored: Vec<String>,
    columns: Vec<ReplayedColumn>,
    times_ns: Vec<TimeNs>,
    period: Duration,
    row: usize,
}

impl Replay {
    /// The recording from its first row. A recording with `time_utc` keeps its times; one with `time_s` begins at
    /// `origin_ns`. `name` is the address.
    #[must_use]
    pub fn new(name: impl Into<String>, recording: &Recording, origin_ns: TimeNs) -> Self {
        let origin_ns = recording.start_ns.unwrap_or(origin_ns);
        let times_ns = compute_times_ns(recording, origin_ns);
        let (columns, ignored) = split_columns(recording);
        let channels = columns.iter().map(|column| column.channel).collect();
        let period = median_period(&times_ns);
        Self { name: name.into(), channels, ignored, columns, times_ns, period, row: 0 }
    }

    /// Columns of the recording that are no channel of the gateway and are therefore not replayed.
    #[must_use]
    pub fn ignored_columns(&self) -> &[String] {
        &self.ignored
    }

    /// How many rows there are.
    #[must_use]
    pub fn count_rows(&self) -> usize {
        self.times_ns.len()
    }

    /// Time of a row on the mapped clock.
    #[must_use]
    pub fn time_ns(&self, row: usize) -> Option<TimeNs> {
        self.times_ns.get(row).copied()
    }

    /// Appends the next row, stamped `at_ns`.
    fn take_row(&mut self, at_ns: TimeNs, out: &mut Vec<Reading>) {
        let (row, stamp) = (self.row, Stamp::from_exact_time(at_ns));
        out.extend(self.columns.iter().map(|column| column.build_reading(row, stamp)));
        self.row += 1;
    }

    fn build_end_error(&self) -> SourceError {
        SourceError::End { source_name: self.name.clone() }
    }
}

impl Pull for Replay {
    fn name(&self) -> &str {
        &self.name
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn next_ns(&self) -> Option<TimeNs> {
        self.time_ns(self.row)
    }

    fn pull_readings(&mut self, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let at_ns = self.next_ns().ok_or_else(|| self.build_end_error())?;
        self.take_row(at_ns, out);
        Ok(())
    }
}

/// A recording replayed against the clock: its first row is now, and it runs `speed` times as fast as it was recorded.
pub struct LiveReplay {
    replay: Replay,
    speed: f64,
    anchor: Option<(TimeNs, TimeNs)>,
    period: Duration,
}

impl LiveReplay {
    /// `speed` times real time; anything but a positive number counts as 1.
    #[must_use]
    pub fn new(replay: Replay, speed: f64) -> Self {
        let speed = if speed.is_finite() && speed > 0.0 { speed } else { 1.0 };
        let period = replay.period.div_f64(speed).max(Duration::from_millis(1));
        Self { replay, speed, anchor: None, period }
    }

    /// When a row is due on the clock.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "a replay spans less than 2^53 ns"
    )]
    fn due_ns(&self, row_ns: TimeNs, anchor: (TimeNs, TimeNs)) -> TimeNs {
        anchor.0 + ((row_ns - anchor.1) as f64 / self.speed) as i64
    }
}

impl Source for LiveReplay {
    fn name(&self) -> &str {
        &self.replay.name
    }

    fn channels(&self) -> &[ChannelId] {
        &self.replay.channels
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let now_ns = clock.now_ns();
        let first_ns = self.replay.next_ns().ok_or_else(|| self.replay.build_end_error())?;
        let anchor = *self.anchor.get_or_insert((now_ns, first_ns));
        while let Some(row_ns) = self.replay.next_ns() {
            let due_ns = self.due_ns(row_ns, anchor);
            if due_ns > now_ns {
                break;
            }
            self.replay.take_row(due_ns, out);
        }
        Ok(())
    }
}

impl ReplayedColumn {
    fn build_reading(&self, row: usize, stamp: Stamp) -> Reading {
        let value = match &self.cells {
            Filled::Numbers(numbers) => {
                numbers.get(row).map(|number| Reading::from_number(self.channel, stamp, number))
            }
            Filled::Words(words, ready) => {
                let word = words.find_code(row).and_then(|code| ready.get(usize::try_from(code).ok()?));
                word.map(|word| Reading::from_text(self.channel, stamp, word.clone()))
            }
        };
        value.unwrap_or_else(|| Reading::from_absence(self.channel, stamp, self.find_absence(row)))
    }

    fn find_absence(&self, row: usize) -> Absence {
        let word = self.missing.as_ref().and_then(|missing| missing.get(row));
        word.and_then(Absence::from_word).unwrap_or(Absence::NotRecorded)
    }
}

fn split_columns(recording: &Recording) -> (Vec<ReplayedColumn>, Vec<String>) {
    let mut columns = Vec::new();
    let mut ignored = Vec::new();
    for column in recording.columns() {
        let missing = column.name.strip_suffix("_missing").and_then(ChannelId::from_name).is_some();
        match ChannelId::from_name(&column.name).and_then(|channel| convert_cells(channel, &column.cells)) {
            Some((channel, cells)) => {
                let missing = recording.find_words(&format!("{}_missing", column.name)).cloned();
                columns.push(ReplayedColumn { channel, cells, missing });
            }
            None if missing => {}
            None => ignored.push(column.name.clone()),
        }
    }
    (columns, ignored)
}

/// The cells, if they are of the channel's kind.
fn convert_cells(channel: ChannelId, cells: &Cells) -> Option<(ChannelId, Filled)> {
    let text = channel.channel().kind == crate::channel::Kind::Text;
    let filled = match cells {
        Cells::Numbers(numbers) if !text => Filled::Numbers(numbers.clone()),
        Cells::Words(words) if text => {
            // The gate and the scripts compare letter by letter; a recording may have been written by other hands.
            let ready = |word: &String| Arc::from(find_canonical_word(channel.name(), word).unwrap_or(word));
            Filled::Words(words.clone(), words.words().iter().map(ready).collect())
        }
        _ => return None,
    };
    Some((channel, filled))
}

/// `time_s` onto an increasing clock.
fn compute_times_ns(recording: &Recording, origin_ns: TimeNs) -> Vec<TimeNs> {
    let mut shift_s = -recording.time_s.first().copied().unwrap_or(0.0).min(f64::MAX);
    if recording.start_ns.is_some() {
        shift_s = 0.0;
    }
    let mut last_s = f64::NEG_INFINITY;
    let mapped = recording.time_s.iter().map(|time_s| {
        if time_s + shift_s < last_s {
            shift_s = last_s + UNKNOWN_PAUSE_S - time_s;
        }
        last_s = time_s + shift_s;
        origin_ns.saturating_add(to_ns(last_s))
    });
    mapped.collect()
}

#[expect(clippy::cast_possible_truncation, reason = "the cast saturates, and centuries fit")]
fn to_ns(seconds: f64) -> i64 {
    (seconds * SECOND_NS as f64).round() as i64
}

/// The middle one of the distances between rows: robust against pauses.
fn median_period(times_ns: &[TimeNs]) -> Duration {
    let mut steps: Vec<i64> = times_ns.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0).collect();
    if steps.is_empty() {
        return Duration::from_secs(1);
    }
    let middle = steps.len() / 2;
    let (_, median, _) = steps.select_nth_unstable(middle);
    Duration::from_nanos(median.unsigned_abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::ManualClock;
    use crate::merge::{Delay, Lockstep};
    use crate::reading::Value;
    use crate::recording::read_csv;
    use crate::sample::Sample;

    fn value_of(readings: &[Reading], name: &str) -> Option<Result<Value, Absence>> {
        let channel = ChannelId::from_name(name)?;
        readings.iter().find(|reading| reading.channel == channel).map(|reading| reading.value.clone())
    }

    fn recording(text: &str) -> Recording {
        read_csv(text.as_bytes(), "test.csv").expect("readable").recording
    }

    #[test]
    fn every_row_comes_with_its_own_time_and_then_the_end() {
        let text = "time_s,spindle_speed_rpm,program,odd_v\n10,800,O1,1\n10.5,,O1,2\n11,810,,3\n";
        let mut replay = Replay::new("replay:test.csv", &recording(text), 1_000);
        assert_eq!(replay.ignored_columns(), ["odd_v"]);
        assert_eq!(Pull::period(&replay), Duration::from_millis(500));
        let mut out = Vec::new();
        assert_eq!(replay.next_ns(), Some(1_000));
        replay.pull_readings(&mut out).expect("first row");
        assert_eq!(value_of(&out, "spindle_speed_rpm"), Some(Ok(Value::Number(800.0))));
        out.clear();
        assert_eq!(replay.next_ns(), Some(500_001_000));
        replay.pull_readings(&mut out).expect("second row");
        assert_eq!(value_of(&out, "spindle_speed_rpm"), Some(Err(Absence::NotRecorded)));
        replay.pull_readings(&mut out).expect("third row");
        assert_eq!(replay.next_ns(), None);
        assert!(matches!(replay.pull_readings(&mut out), Err(SourceError::End { .. })));
    }

    #[test]
    fn a_recorded_reason_of_absence_is_given_again() {
        let text = "time_s,spindle_speed_rpm,spindle_speed_rpm_missing\n0,1,\n1,,timeout\n";
        let mut replay = Replay::new("replay:test.csv", &recording(text), 0);
        let mut out = Vec::new();
        replay.pull_readings(&mut out).and_then(|()| replay.pull_readings(&mut out)).expect("two rows");
        assert_eq!(out[1].value, Err(Absence::Timeout));
        assert!(replay.ignored_columns().is_empty());
    }

    #[test]
    fn a_restart_of_time_leaves_a_pause_that_nothing_bridges() {
        let replay = Replay::new("r", &recording("time_s,run,engaged\n0,a,1\n1,a,1\n0,b,1\n1,b,1\n"), 0);
        let times: Vec<_> = (0..4).filter_map(|row| replay.time_ns(row)).collect();
        assert_eq!(times, [0, SECOND_NS, 61 * SECOND_NS, 62 * SECOND_NS]);
    }

    /// The folder of real recordings: `CNC_GATEWAY_SHARED`, or beside the checkout.
    fn real(path: &str) -> Option<std::path::PathBuf> {
        let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared").to_owned();
        let shared = std::env::var("CNC_GATEWAY_SHARED").unwrap_or(beside);
        let path = std::path::Path::new(&shared).join("data").join(path);
        path.exists().then_some(path)
    }

    #[test]
    fn every_cell_of_a_real_recording_reaches_its_sample() {
        let Some(path) = real("milling/recording.csv.gz") else {
            return eprintln!("SKIPPED: no real recordings; set CNC_GATEWAY_SHARED to their folder");
        };
        let recording = crate::recording::read_path(&path).expect("readable").recording;
        let replay = Replay::new("replay:milling", &recording, 0);
        let channels = Pull::channels(&replay).to_vec();
        let mut lockstep = Lockstep::new(vec![Box::new(replay)], Delay::Fixed(Duration::ZERO));
        let (mut sample, mut row) = (Sample::new_empty(0), 0);
        while let Some(at_ns) = lockstep.next_ns() {
            lockstep.sample_into(&mut sample, at_ns);
            for channel in &channels {
                let recorded = recording.find_numbers(channel.name()).and_then(|numbers| numbers.get(row));
                assert_eq!(sample.number(*channel).ok(), recorded, "{channel} in row {row}");
                let word = recording.find_words(channel.name()).and_then(|words| words.get(row));
                assert_eq!(sample.text(*channel), word, "{channel} in row {row}");
                assert_eq!(sample.slot(*channel).age_ns, 0);
            }
            row += 1;
        }
        assert_eq!((row, recording.count_rows()), (13_757, 13_757));
    }

    #[test]
    fn utc_times_are_kept() {
        let text = "time_utc,engaged\n2026-01-31T08:15:00Z,1\n2026-01-31T08:15:01Z,0\n";
        let recording = recording(text);
        let replay = Replay::new("r", &recording, 5);
        assert_eq!(replay.time_ns(0), recording.start_ns);
    }

    #[test]
    fn a_live_replay_gives_what_is_due() {
        let replay = Replay::new("r", &recording("time_s,engaged\n0,1\n1,0\n2,1\n"), 0);
        let mut live = LiveReplay::new(replay, 2.0);
        let clock = ManualClock::with_time(100);
        let mut out = Vec::new();
        live.read(&clock, &mut out).expect("first row");
        assert_eq!(out.len(), 1);
        clock.set_time(100 + SECOND_NS);
        live.read(&clock, &mut out).expect("the rest");
        let stamps: Vec<_> = out.iter().map(|reading| reading.stamp.mid_ns).collect();
        assert_eq!(stamps, [100, 100 + SECOND_NS / 2, 100 + SECOND_NS]);
        assert!(matches!(live.read(&clock, &mut out), Err(SourceError::End { .. })));
    }
}
