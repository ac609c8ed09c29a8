//! What a replay amounts to, in words and as JSON (`replay/1`).

use super::Motion;
use crate::history::Record;
use adapters::recording::ReadRecording;
use rules::estimators::VisibilityVerdict;
use serde_json::{Map, Value, json};
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Refused rows described in words.
const PROBLEMS_SHOWN: usize = 10;

/// Sums of one or several files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ReplayCounts {
    /// Rows that went through the pipeline.
    pub rows: u64,
    /// Rows that were stored now.
    pub stored: u64,
    /// Number of alarms that were raised.
    pub alarms: u64,
    /// Changes of what the scripts ask for.
    pub decisions: u64,
    /// Number of changes of the machine state.
    pub state_changes: u64,
}

impl ReplayCounts {
    pub(super) fn count_record(&mut self, record: &Record) {
        match record {
            Record::Alarm(_) => self.alarms += 1,
            Record::Decision(_) => self.decisions += 1,
            Record::State(_) => self.state_changes += 1,
            _ => {}
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.rows += other.rows;
        self.stored += other.stored;
        self.alarms += other.alarms;
        self.decisions += other.decisions;
        self.state_changes += other.state_changes;
    }
}

/// Words of the machine described in words.
const WORDS_SHOWN: usize = 20;

/// What became of the rows of one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct FileSummary {
    /// Path of the recording as it was given.
    pub file: PathBuf,
    /// Rows that could be used.
    pub rows: u64,
    /// Rows that could not.
    pub refused: u64,
    /// Why not, at most a hundred of them.
    pub problems: Vec<String>,
}

impl FileSummary {
    /// What was read from `file`.
    #[must_use]
    pub fn from_recording(file: &Path, read: &ReadRecording) -> Self {
        let name = file.display();
        let problems = read.problems.iter().map(|problem| format!("{name}, {problem}")).collect();
        Self { file: file.to_owned(), rows: read.recording.count_rows() as u64, refused: read.refused, problems }
    }

    fn to_json(&self) -> Value {
        let Self { file, rows, refused, problems } = self;
        json!({ "file": file.display().to_string(), "rows": rows, "refused_rows": refused, "problems": problems })
    }
}

/// Where the rows went.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredRows {
    /// Path of the database that was written.
    pub path: PathBuf,
    /// Rows that this replay has stored.
    pub stored: u64,
    /// Rows that were there already.
    pub already: u64,
}

impl StoredRows {
    pub(super) fn from_counts(path: &Path, counts: &ReplayCounts) -> Self {
        Self { path: path.to_owned(), stored: counts.stored, already: counts.rows - counts.stored }
    }
}

/// What a replay ends with: rows, seconds per state, parts, alarms, refused rows, visibility of the cut.
#[derive(Debug)]
pub struct ReplaySummary {
    /// One row for each recording, in order.
    pub files: Vec<FileSummary>,
    /// Sums over all of them.
    pub counts: ReplayCounts,
    /// Where the rows went.
    pub stored_rows: Option<StoredRows>,
    /// Machine time in each state, s.
    pub seconds_per_state: Vec<(&'static str, f64)>,
    /// Number of finished parts.
    pub parts: u64,
    /// Could cutting be seen?
    pub visibility: VisibilityVerdict,
    /// Agreement with the machine's own words.
    pub motion: Motion,
    /// How long it took.
    pub took: Duration,
}

impl ReplaySummary {
    fn count_refused(&self) -> u64 {
        self.files.iter().map(|file| file.refused).sum()
    }

    #[expect(clippy::cast_precision_loss, reason = "a rate")]
    fn rows_per_s(&self) -> f64 {
        self.counts.rows as f64 / self.took.as_secs_f64().max(1e-9)
    }

    /// The document that `replay --json` prints.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let seconds: Map<String, Value> = self
            .seconds_per_state
            .iter()
            .map(|(word, s)| ((*word).to_owned(), json!((s * 1e3).round() / 1e3)))
            .collect();
        let kept = self.stored_rows.as_ref().map(|kept| {
            json!({ "path": kept.path.display().to_string(), "stored_rows": kept.stored, "rows_already_there": kept.already })
        });
        json!({
            "schema": "replay/1",
            "files": self.files.iter().map(FileSummary::to_json).collect::<Vec<_>>(),
            "rows": self.counts.rows,
            "refused_rows": self.count_refused(),
            "seconds_per_state": seconds,
            "state_changes": self.counts.state_changes,
            "parts": self.parts,
            "alarms": self.counts.alarms,
            "decisions": self.counts.decisions,
            "visibility": { "verdict": self.visibility.as_word(), "text": self.visibility.to_string() },
            "spindle_edges": { "all": self.motion.edges, "right": self.motion.right },
            "motion": self.motion.to_json(),
            "history": kept,
            "took_s": self.took.as_secs_f64(),
            "rows_per_s": self.rows_per_s().round(),
        })
    }
}

impl fmt::Display for ReplaySummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (rows, took, rate) = (self.counts.rows, self.took.as_secs_f64(), self.rows_per_s());
        writeln!(f, "{rows} rows in {took:.2} s ({rate:.0} rows/s), {} refused", self.count_refused())?;
        let problems: Vec<&String> = self.files.iter().flat_map(|file| &file.problems).collect();
        problems.iter().take(PROBLEMS_SHOWN).try_for_each(|problem| writeln!(f, "  {problem}"))?;
        for (word, seconds) in self.seconds_per_state.iter().filter(|(_, seconds)| *seconds > 0.0) {
            writeln!(f, "{word:>14} {seconds:>12.1} s")?;
        }
        let Self { parts, counts, .. } = self;
        writeln!(f, "parts {parts}, alarms {}, decisions {}", counts.alarms, counts.decisions)?;
        if self.motion.edges > 0 {
            let Motion { right, edges, .. } = &self.motion;
            writeln!(f, "spindle on and off: {right} of {edges} edges right at the very row")?;
        }
        writeln!(f, "{}", self.visibility)?;
        let words = self.motion.format_lines();
        if !words.is_empty() {
            writeln!(f, "what the machine itself calls its motion, and the states of these rows:")?;
        }
        words.iter().take(WORDS_SHOWN).try_for_each(|line| writeln!(f, "  {line}"))?;
        if let Some(StoredRows { path, stored, already }) = &self.stored_rows {
            writeln!(f, "{}: {stored} rows stored, {already} were there already", path.display())?;
        }
        Ok(())
    }
}
