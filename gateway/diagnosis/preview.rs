//! How a file that somebody brought is understood: read by a child process with limits, so that no file can take the memory or the time
//! of the box. The answer is kept beside the file, and so is that a file has broken its child: neither is worked out twice.

use super::child_process::start_child;
use super::clicked_map::ClickedMap;
use super::map_file::{MapProposal, ProposedColumn};
use adapter_core::bilingual::Bilingual;
use gateway_base::files::{read_text, replace_file};
use gateway_base::limits::{MEMORY_TOLD_MB, TimeLimits, limit_memory_and_time};
use recording::read::{Preview, preview_recording, preview_rows};
use recording::{Mapping, NoteKind, RecordingError};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use thiserror::Error;

/// Rows that are shown.
const ROWS_SHOWN: usize = 6;
/// The longest answer of a child, bytes.
const ANSWER_MAX: u64 = 16 << 20;

/// A file to be understood.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PreviewJob {
    /// Where it lies; its map lies beside it.
    preview: PathBuf,
    /// What it is called in messages.
    name: String,
    /// A map that a person clicked, to be read back; without it the file is described.
    #[serde(default)]
    clicked_map: Option<ClickedMap>,
}

/// The child: reads the file and writes one line.
pub(super) fn run_job(job: &PreviewJob) -> std::io::Result<()> {
    limit_memory_and_time(time_limits(&job.preview))?;
    let document = match &job.clicked_map {
        Some(clicked) => propose_map(&job.preview, clicked),
        None => build_document(&job.preview, &job.name),
    };
    let mut out = std::io::stdout().lock();
    writeln!(out, "{document}")?;
    out.flush()
}

fn time_limits(path: &Path) -> TimeLimits {
    TimeLimits::from_bytes(std::fs::metadata(path).map_or(0, |file| file.len()))
}

/// Reads the file in a child and keeps the answer.
pub(super) fn describe_in_child(path: &Path, name: &str) -> Value {
    let document = ask_child(path, name, None)
        .unwrap_or_else(|why| json!({ "columns": [], "set_aside": true, "error": { "en": why.en, "zh": why.zh } }));
    // Without a place for it the next one who asks waits again.
    let _not_kept = replace_file(&answer_path(path), &document.to_string());
    document
}

/// Why a map that a person clicked is not kept.
#[derive(Debug, PartialEq, Eq, Error)]
pub(super) enum ProposalRefusal {
    /// The child gave no answer.
    #[error("{}", .0.en)]
    NoAnswer(Bilingual),
    /// The child read the file back under the map and refuses it, for this reason.
    #[error("{0}")]
    Refused(String),
    /// The child answered without a map and without a reason.
    #[error("the file could not be read")]
    Unreadable,
}

/// The map that a person clicked, as text, read back in a child.
///
/// # Errors
/// See [`ProposalRefusal`].
pub(super) fn propose_in_child(path: &Path, name: &str, clicked: &ClickedMap) -> Result<String, ProposalRefusal> {
    let document = ask_child(path, name, Some(clicked)).map_err(ProposalRefusal::NoAnswer)?;
    match document["toml"].as_str() {
        Some(toml) => Ok(toml.to_owned()),
        None => Err(document["refused"]
            .as_str()
            .map_or(ProposalRefusal::Unreadable, |why| ProposalRefusal::Refused(why.to_owned()))),
    }
}

fn propose_map(path: &Path, clicked: &ClickedMap) -> Value {
    match clicked.propose_toml(path, &read_map_beside(path)) {
        Ok(toml) => json!({ "toml": toml }),
        Err(error) => json!({ "refused": error.to_string() }),
    }
}

fn read_map_beside(path: &Path) -> Mapping {
    let beside = Mapping::build_path_beside(path);
    if beside.is_file() { Mapping::read(&beside).unwrap_or_default() } else { Mapping::default() }
}

/// Why a child gave no answer.
fn ask_child(path: &Path, name: &str, clicked: Option<&ClickedMap>) -> Result<Value, Bilingual> {
    let job = PreviewJob { preview: path.to_owned(), name: name.to_owned(), clicked_map: clicked.cloned() };
    let broken = |error: std::io::Error| {
        Bilingual::new(format!("no process to read it with: {error}"), format!("无法启动读取进程：{error}"))
    };
    let mut child = start_child(&job).map_err(broken)?;
    let mut line = String::new();
    let read = child.stdout.take().map(|output| BufReader::new(output.take(ANSWER_MAX)).read_line(&mut line));
    // Its standard input is open until here: it ends when that is closed.
    drop(child.stdin.take());
    let status = child.wait().map_err(broken)?;
    let answer = read.and_then(Result::ok).and_then(|_| serde_json::from_str(&line).ok());
    answer.ok_or_else(|| describe_end(status, time_limits(path)))
}

fn describe_end(status: ExitStatus, TimeLimits { processor_s, .. }: TimeLimits) -> Bilingual {
    Bilingual::new(
        format!(
            "reading it took more than {MEMORY_TOLD_MB} MB of memory or {processor_s} s, or broke off ({status}): it is set aside, and read \
             again when it is brought again or its map is changed. Save it as CSV, or in parts"
        ),
        format!(
            "读取该文件超过{MEMORY_TOLD_MB} MB内存或{processor_s}秒，或读取中断（{status}）：已搁置，重新上传或修改映射后才再次读取。请另存为CSV，或分成几个文件"
        ),
    )
}

/// The answer of this version of the program, beside the file.
fn answer_path(path: &Path) -> PathBuf {
    path.with_extension(concat!("understood-", env!("CARGO_PKG_VERSION"), ".json"))
}

/// What is known of a file.
pub(super) fn read_answer(path: &Path) -> Option<Value> {
    let text = read_text(&answer_path(path), ANSWER_MAX as usize).ok()?;
    serde_json::from_str(&text).ok()
}

/// The file or its map is another one: what was known of it does not hold.
pub(super) fn forget_answers(path: &Path) {
    let _there_was_none = std::fs::remove_file(answer_path(path));
}

fn bilingual_to_json(text: &Bilingual) -> Value {
    json!({ "en": text.en, "zh": text.zh })
}

fn build_document(path: &Path, name: &str) -> Value {
    let mapping = read_map_beside(path);
    let refused = |error: &RecordingError| {
        let (en, zh) = (error.to_string(), error.describe_in_chinese());
        let path = path.display().to_string();
        json!({ "en": en.replace(&path, name), "zh": zh.replace(&path, name) })
    };
    match preview_recording(path, &mapping) {
        Ok(found) => describe_preview(found, &mapping, refused),
        Err(error) => json!({ "columns": [], "error": refused(&error) }),
    }
}

fn describe_preview(found: Preview, mapping: &Mapping, refused: impl Fn(&RecordingError) -> Value) -> Value {
    let proposal = MapProposal::from_preview(&found, mapping);
    let questions = proposal.open_questions();
    let column = |(index, column): (usize, &ProposedColumn)| {
        let known = found.columns.iter().find(|known| known.from == column.from);
        json!({
            "from": column.from, "name": column.name, "to": column.to, "unit": known.and_then(|known| known.unit.clone()), "candidates": column.candidates,
            "is_time": column.is_time, "asked": questions.contains(&index),
        })
    };
    let columns: Vec<Value> = proposal.columns.iter().enumerate().map(column).collect();
    let mut document = json!({ "columns": columns });
    match found.read {
        Err(error) => document["error"] = refused(&error),
        Ok(read) => {
            document["statement"] = bilingual_to_json(&read.describe_assumptions());
            let notes = read.notes.iter().filter(|note| note.kind != NoteKind::Assumption);
            document["notes"] = notes
                .map(|note| json!({ "doubt": note.kind == NoteKind::Doubt, "en": note.text.en, "zh": note.text.zh }))
                .collect();
            document["rows"] = json!(read.recording.count_rows());
            document["refused"] = json!(read.refused);
            document["problems"] = read.problems.iter().take(5).map(ToString::to_string).collect();
            let (head, rows) = preview_rows(&read.recording, ROWS_SHOWN);
            document["head"] = json!(head);
            document["first_rows"] = json!(rows);
        }
    }
    document
}
