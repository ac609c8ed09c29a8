//! The recordings that a command is given: a file of any kind that people have, or a range of a history, read and put together.

use super::order::{Copies, compare_names, order_recordings};
use super::{history, join_recordings};
use adapter_core::bilingual::Bilingual;
use recording::Recording;
use recording::{self, Mapping, NoteKind, ReadRecording, RecordingError};
use std::path::{Path, PathBuf};

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
    /// For the user, on standard error: how each file was understood, and what was refused although the rest is used.
    pub warnings: Vec<Bilingual>,
}

/// Reads every recording and puts them together in the order of time. A file is read under the map that lies beside it, if there is one.
///
/// # Errors
/// Everything that makes any of them unusable, at once.
pub fn read_recordings(sources: &[String], copies: Copies) -> Result<InputRecordings, Vec<String>> {
    read_recordings_as(sources, None, copies)
        .map_err(|problems| problems.into_iter().map(|problem| problem.en).collect())
}

/// The same, each file under this map where one is given.
///
/// # Errors
/// Everything that makes any of them unusable, at once, in both languages.
pub fn read_recordings_as(
    sources: &[String],
    map: Option<&PathBuf>,
    copies: Copies,
) -> Result<InputRecordings, Vec<Bilingual>> {
    let mapping = map.map(|path| Mapping::read(path)).transpose();
    let mapping = mapping.map_err(|wrong| vec![Bilingual::new(wrong.to_string(), wrong.to_string())])?;
    let mut problems = Vec::new();
    let mut read = Vec::new();
    let mut sources: Vec<&String> = sources.iter().collect();
    // The words about them are the same for every order in which they are named.
    sources.sort_by(|a, b| compare_names(a, b));
    for source in sources {
        match read_one(source, mapping.as_ref()) {
            Ok(one) => read.push((source, one)),
            Err(problem) => problems.push(problem),
        }
    }
    let mut warnings = Vec::new();
    for (source, one) in &read {
        warnings.extend(describe_reading(source, one));
        if let Some(text) = describe_refusals(source, one) {
            if is_too_much(one) { problems.push(text) } else { warnings.push(text) }
        }
    }
    if !problems.is_empty() {
        return Err(problems);
    }
    let refused = read.iter().map(|(_, one)| gateway_base::convert::clamp_to_length(one.refused)).sum();
    let refused_column = read.iter().find_map(|(_, one)| one.problems.first()?.column.clone());
    let ordered = order_recordings(read.into_iter().map(|(_, one)| one.recording).collect(), copies);
    warnings.extend(ordered.remarks);
    let recording = join_recordings(ordered.recordings)
        .map_err(|problem| vec![Bilingual::new(problem.to_string(), problem.to_string())])?;
    Ok(InputRecordings { recording, refused, refused_column, warnings })
}

fn read_one(source: &str, mapping: Option<&Mapping>) -> Result<ReadRecording, Bilingual> {
    if let Some(address) = source.strip_prefix("history:") {
        return history::read(address)
            .map(to_read_recording)
            .map_err(|problem| Bilingual::new(problem.to_string(), problem.to_string()));
    }
    let path = Path::new(source);
    let read = mapping.map_or_else(|| recording::read_path(path), |mapping| recording::read_path_as(path, mapping));
    read.map_err(|error| match &error {
        RecordingError::Empty { file, problems } => {
            let lines: Vec<String> = problems.iter().take(LISTED_MAX).map(|problem| format!("\n  {problem}")).collect();
            Bilingual::new(
                format!("{file}: no usable row{}", lines.concat()),
                format!("{file}：没有可用的行{}", lines.concat()),
            )
        }
        other => Bilingual::new(other.to_string(), other.describe_in_chinese()),
    })
}

/// A recording of which nothing was refused.
fn to_read_recording(recording: Recording) -> ReadRecording {
    ReadRecording { recording, problems: Vec::new(), refused: 0, notes: Vec::new() }
}

/// How a file was understood, line by line; nothing for a file that is written as the contract says.
#[must_use]
pub fn describe_reading(source: &str, read: &ReadRecording) -> Vec<Bilingual> {
    let mut lines = Vec::new();
    let statement = read.describe_assumptions();
    if !statement.en.is_empty() {
        lines.push(Bilingual::new(format!("{source}: {}", statement.en), format!("{source}：{}", statement.zh)));
    }
    for note in read.notes.iter().filter(|note| note.kind != NoteKind::Assumption) {
        let (en, zh) = (&note.text.en, &note.text.zh);
        let (word, word_zh) = if note.kind == NoteKind::Doubt { ("unsure: ", "存疑：") } else { ("", "") };
        lines.push(Bilingual::new(format!("  {word}{en}"), format!("  {word_zh}{zh}")));
    }
    lines
}

#[expect(clippy::cast_precision_loss, reason = "numbers of rows are far below 2^53")]
fn is_too_much(read: &ReadRecording) -> bool {
    let refused = read.refused as f64;
    refused > REFUSED_SHARE_MAX * (refused + read.recording.count_rows() as f64)
}

fn describe_refusals(source: &str, read: &ReadRecording) -> Option<Bilingual> {
    if read.refused == 0 {
        return None;
    }
    let all = read.refused + read.recording.count_rows() as u64;
    let (verdict, verdict_zh) = if is_too_much(read) {
        ("more than 1 %: correct the file or record again", "超过1 %：请改正文件或重新记录")
    } else {
        ("these rows are left out, the rest is used", "这些行未使用，其余照常使用")
    };
    let mut list = String::new();
    for problem in read.problems.iter().take(LISTED_MAX) {
        list.push_str(&format!("\n  {source}, {problem}"));
    }
    let more = read.refused.saturating_sub(LISTED_MAX as u64);
    let (more, more_zh) =
        if more > 0 { (format!("\n  and {more} more"), format!("\n  另有{more}行")) } else { Default::default() };
    Some(Bilingual::new(
        format!("{source}: {} of {all} rows refused; {verdict}{list}{more}", read.refused),
        format!("{source}：{all}行中有{}行被拒绝；{verdict_zh}{list}{more_zh}", read.refused),
    ))
}
