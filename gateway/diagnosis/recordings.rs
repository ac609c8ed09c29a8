//! The recordings that a command is given: CSV, gzipped CSV, Parquet, or a range of a history, read and put together.

use super::{history, join, parquet};
use adapters::Recording;
use adapters::recording::{self, ReadRecording};
use std::path::Path;

/// Share of refused rows beyond which a recording is not used: what was lost then is no longer a few bad samples.
const REFUSED_SHARE_MAX: f64 = 0.01;
/// Refused rows that are listed, per file.
const LISTED_MAX: usize = 10;

/// What the user gave, read.
#[derive(Debug)]
pub struct InputRecordings {
    /// Every recording, one after the other.
    pub recording: Recording,
    /// Rows that were refused, over all files.
    pub refused: usize,
    /// Column of the first refused row, where one cell was to blame.
    pub refused_column: Option<String>,
    /// For the user, on standard error: what was refused although the rest is used.
    pub warnings: Vec<String>,
}

/// Reads every recording and puts them together in the order given.
///
/// # Errors
/// Everything that makes any of them unusable, at once.
pub fn read_recordings(sources: &[String]) -> Result<InputRecordings, Vec<String>> {
    let mut problems = Vec::new();
    let mut read = Vec::new();
    for source in sources {
        match read_one(source) {
            Ok(one) => read.push((source, one)),
            Err(problem) => problems.push(problem),
        }
    }
    let mut warnings = Vec::new();
    for (source, one) in &read {
        if let Some(text) = refusals(source, one) {
            if is_too_much(one) { problems.push(text) } else { warnings.push(text) }
        }
    }
    if !problems.is_empty() {
        return Err(problems);
    }
    let refused = read.iter().map(|(_, one)| usize::try_from(one.refused).unwrap_or(usize::MAX)).sum();
    let refused_column = read.iter().find_map(|(_, one)| one.problems.first()?.column.clone());
    let recording = join(read.into_iter().map(|(_, one)| one.recording).collect()).map_err(|problem| vec![problem])?;
    Ok(InputRecordings { recording, refused, refused_column, warnings })
}

fn read_one(source: &str) -> Result<ReadRecording, String> {
    if let Some(address) = source.strip_prefix("history:") {
        return history::read(address).map(whole);
    }
    let path = Path::new(source);
    if source.to_lowercase().ends_with(".parquet") {
        return parquet::read(path);
    }
    recording::read_path(path).map_err(|error| match error {
        recording::RecordingError::Empty { file, problems } => {
            let lines: Vec<String> = problems.iter().take(LISTED_MAX).map(|problem| format!("\n  {problem}")).collect();
            format!("{file}: no usable row{}", lines.concat())
        }
        other => other.to_string(),
    })
}

/// A recording of which nothing was refused.
fn whole(recording: Recording) -> ReadRecording {
    ReadRecording { recording, problems: Vec::new(), refused: 0 }
}

#[expect(clippy::cast_precision_loss, reason = "numbers of rows are far below 2^53")]
fn is_too_much(read: &ReadRecording) -> bool {
    let refused = read.refused as f64;
    refused > REFUSED_SHARE_MAX * (refused + read.recording.rows() as f64)
}

fn refusals(source: &str, read: &ReadRecording) -> Option<String> {
    if read.refused == 0 {
        return None;
    }
    let all = read.refused + read.recording.rows() as u64;
    let verdict = if is_too_much(read) {
        "more than 1 %: correct the file or record again"
    } else {
        "these rows are left out, the rest is used"
    };
    let mut text = format!("{source}: {} of {all} rows refused; {verdict}", read.refused);
    for problem in read.problems.iter().take(LISTED_MAX) {
        text.push_str(&format!("\n  {source}, {problem}"));
    }
    if read.refused > LISTED_MAX as u64 {
        text.push_str(&format!("\n  and {} more", read.refused - LISTED_MAX as u64));
    }
    Some(text)
}
