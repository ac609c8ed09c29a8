//! The newest rows of the audit, beside the history as lines of JSON: what the history has not made durable when the process
//! is killed is found here at the next start, and appended to the chain.
//!
//! A commit of the history waits for the disk, up to a second late, and the tick waits for neither. Here a row is handed to
//! the system at once, by a thread of its own; the system keeps it however the process ends. Against a power cut only the
//! history helps.

use adapters::clock::{SECOND_NS, TimeNs};
use adapters::threads::receive_work;
use gateway_base::files::replace_file;
use gateway_history::{Audit, Reader, Writer};
use std::collections::VecDeque;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Rows kept when the file is begun anew: several minutes of the most that the gate writes.
const ROWS_KEPT: usize = 4096;
/// The file is begun anew when so many rows have been added.
const ROWS_ADDED: usize = 4 * ROWS_KEPT;
/// Rows that wait for the thread; one that finds no room is in the history only.
const WAITING_MAX: usize = 256;
/// A row from so long before the newest sample may be one that was lost with the samples after it.
const LOOK_BACK_NS: i64 = 60 * SECOND_NS;

/// Where the rows lie that belong to this history.
#[must_use]
pub fn audit_path(history: &Path) -> PathBuf {
    let mut name = history.as_os_str().to_owned();
    name.push("-audit");
    name.into()
}

/// Keeps the newest rows of the audit in a file beside the history, against the end of the process.
#[derive(Debug)]
pub struct Recent {
    rows: Option<SyncSender<Audit>>,
    thread: Option<JoinHandle<()>>,
}

impl Recent {
    /// Keeps rows for this history from now on. Where there is no thread to be had, none.
    #[must_use]
    pub fn start(history: &Path) -> Self {
        let (send, rows) = sync_channel(WAITING_MAX);
        let path = audit_path(history);
        let thread = std::thread::Builder::new().name("audit".to_owned()).spawn(move || write_rows(&path, &rows)).ok();
        Self { rows: thread.is_some().then_some(send), thread }
    }

    /// Keeps this row. Never waits.
    pub fn keep_row(&self, row: Audit) {
        if self.rows.as_ref().is_some_and(|rows| rows.try_send(row).is_err()) {
            tracing::warn!("a row of the audit is in the history only: the disk has not taken what came before");
        }
    }
}

impl Drop for Recent {
    fn drop(&mut self) {
        self.rows = None;
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been printed by then.
            let _ended = thread.join();
        }
    }
}

fn write_rows(path: &Path, rows: &Receiver<Audit>) {
    let mut kept: VecDeque<String> = read_lines(path).into();
    let mut added = ROWS_ADDED;
    let mut file = None;
    while let Some(row) = receive_work("audit", rows) {
        // None of its fields can fail to be written.
        let line = serde_json::to_string(&row).unwrap_or_default() + "\n";
        kept.push_back(line.clone());
        if kept.len() > ROWS_KEPT {
            kept.pop_front();
        }
        let kept = (added >= ROWS_ADDED).then_some(&kept);
        if kept.is_some() {
            (added, file) = (0, None);
        }
        added += 1;
        if let Err(error) = append_line(path, &line, kept, &mut file) {
            tracing::warn!("{}: a row of the audit is in the history only: {error}", path.display());
            file = None;
        }
    }
}

/// Appends the line, or begins the file anew with all that is kept.
fn append_line(
    path: &Path,
    line: &str,
    kept: Option<&VecDeque<String>>,
    file: &mut Option<File>,
) -> std::io::Result<()> {
    if let Some(kept) = kept {
        return replace_file(path, &kept.iter().map(String::as_str).collect::<String>());
    }
    let open = match file.take() {
        Some(open) => open,
        None => OpenOptions::new().append(true).create(true).open(path)?,
    };
    file.insert(open).write_all(line.as_bytes())
}

/// Whole lines, each with its end.
fn read_lines(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n')).map(str::to_owned);
    let mut lines: Vec<String> = whole.collect();
    lines.drain(..lines.len().saturating_sub(ROWS_KEPT));
    lines
}

/// A history that is not there has lost nothing: rows that were kept for one that somebody has taken away are forgotten. Call
/// it before the history is opened.
pub fn forget_without(history: &Path) {
    if !history.exists() {
        // There may be none.
        let _gone = std::fs::remove_file(audit_path(history));
    }
}

/// Appends to the history what a process that was killed had handed over and the history has not; gives how many rows. Call
/// it before anything else is recorded.
pub fn recover_rows(history: &Path, writer: &Writer) -> usize {
    let missing = find_missing_rows(history).unwrap_or_default();
    missing.into_iter().filter(|row| writer.queue_record(row.clone()).is_some()).count()
}

/// Rows of the file from after the newest sample that the history lacks; nothing where the history cannot be read.
fn find_missing_rows(history: &Path) -> Option<Vec<Audit>> {
    let reader = Reader::open(history).ok()?;
    let newest = reader.read_present_span().ok()?;
    let from_ns = newest.map_or(TimeNs::MIN, |(_, newest_ns)| newest_ns.saturating_sub(LOOK_BACK_NS));
    let stored = reader.read_audit(from_ns, TimeNs::MAX, u32::MAX).ok()?;
    let rows =
        read_lines(&audit_path(history)).into_iter().filter_map(|line| serde_json::from_str::<Audit>(&line).ok());
    let newer = rows.filter(|row| row.at_ns >= from_ns).map(|row| row.to_storable());
    Some(newer.filter(|row| !stored.iter().any(|entry| entry.audit == *row)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapters::Sample;
    use gateway_history::Options;

    fn row(at_s: i64, asked: f64) -> Audit {
        let (kind, outcome) = ("write".to_owned(), "written".to_owned());
        Audit { at_ns: at_s * SECOND_NS, kind, outcome, asked: Some(asked), ..Audit::default() }
    }

    #[test]
    fn what_a_kill_took_from_the_history_is_appended_once() {
        let directory = tempfile::tempdir().expect("a directory");
        let history = directory.path().join("history.db");
        let keep = || {
            let recent = Recent::start(&history);
            let rows = [row(1, 70.0), row(100, 71.0), row(101, f64::NAN), row(102, 73.0)];
            rows.into_iter().for_each(|it| recent.keep_row(it));
        };
        keep();
        forget_without(&history);
        assert!(read_lines(&audit_path(&history)).is_empty(), "there is no history");
        keep();
        std::fs::OpenOptions::new()
            .append(true)
            .open(audit_path(&history))
            .and_then(|mut file| file.write_all(b"{\"at_ns\":1"))
            .expect("written");
        assert_eq!(find_missing_rows(&history), None, "there is no history");
        let writer = Writer::open(&history, Options::default()).expect("a history");
        forget_without(&history);
        assert_eq!(find_missing_rows(&history).map(|rows| rows.len()), Some(4), "killed before the first commit");
        writer.queue_sample(&Sample::new_empty(100 * SECOND_NS), &[]);
        writer.queue_record(row(100, 71.0));
        writer.flush().expect("durable");
        assert_eq!(recover_rows(&history, &writer), 2, "not the one of long ago, and not half a line");
        writer.flush().expect("durable");
        assert_eq!(recover_rows(&history, &writer), 0, "they are there now");
        drop(writer);
        let reader = Reader::open(&history).expect("readable");
        let asked: Vec<_> =
            reader.read_audit(0, TimeNs::MAX, 10).expect("rows").into_iter().map(|entry| entry.audit.asked).collect();
        assert_eq!(asked, [Some(71.0), None, Some(73.0)]);
        assert_eq!(reader.verify_audit().expect("checked").broken, None);
    }

    #[test]
    fn the_file_does_not_grow_for_ever() {
        let directory = tempfile::tempdir().expect("a directory");
        let history = directory.path().join("history.db");
        for _start in 0..3 {
            let recent = Recent::start(&history);
            for at_s in 0..2 * i64::try_from(ROWS_ADDED).expect("small") {
                while recent.rows.as_ref().expect("a thread").try_send(row(at_s, 70.0)).is_err() {
                    std::thread::yield_now();
                }
            }
            drop(recent);
            let rows = std::fs::read_to_string(audit_path(&history)).expect("there").lines().count();
            assert!((ROWS_KEPT..=ROWS_KEPT + ROWS_ADDED).contains(&rows), "{rows}");
        }
    }
}
