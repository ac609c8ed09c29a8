//! What befalls the file of the history while the box runs: it is gone, another one, damaged, or its log does not end.

use super::{HistoryStore, read_identity};
use gateway_base::clock;
use gateway_base::log::{Notice, Severity};
use gateway_history::{self as history, Aside, Audit, Event, HistoryError};

/// A log of this length is told: three times what it has otherwise.
pub(crate) const LOG_TOLD_BYTES: u64 = 12_000_000;

/// What a long log means.
pub(crate) fn long_log(bytes: u64) -> String {
    format!(
        "somebody reads the history and does not end: the log beside it has grown to {:.1} MB and goes on growing until that \
         reader ends its transaction",
        bytes as f64 / 1e6
    )
}

impl HistoryStore {
    /// The disk has changed the file: it is kept under another name, and storing goes on in a new one.
    pub(super) fn begin_anew(&mut self, why: &HistoryError) {
        let aside = match history::set_aside(&self.path, Aside::Damaged) {
            Ok(aside) => aside,
            Err(error) => return self.put_off(&error),
        };
        let text =
            format!("the history was damaged and is kept as {}; storing goes on in a new one. {why}", aside.display());
        let notice = Notice::new(Severity::Error, "history_set_aside", text);
        notice.write_to_logs();
        match self.try_open() {
            Ok(()) => self.record_notice(&notice),
            Err(error) => self.put_off(&error),
        }
        self.set_aside = history::damaged_files(&self.path);
    }

    /// A newer version of the program has changed the file, and this one goes back to the copy of before, where there is one.
    ///
    /// # Errors
    /// The error as it was, where there is no copy; a file that cannot be renamed or written.
    pub(super) fn go_back(&mut self, error: HistoryError) -> Result<(), HistoryError> {
        let Some(newer) = history::go_back(&self.path)? else { return Err(error) };
        let text = format!(
            "a newer version of the program has changed the history; this one goes on with the copy of before. What was stored \
             since is in {}, which the newer version reads",
            newer.display()
        );
        let notice = Notice::new(Severity::Warning, "history_went_back", text).with_detail(error.to_string());
        notice.write_to_logs();
        match self.try_open() {
            Ok(()) => self.record_notice(&notice),
            Err(error) => self.opening_failed(&error),
        }
        Ok(())
    }

    /// The power failed while an older version went back to the copy of before: now it does.
    pub(super) fn finish_going_back(&self) {
        if !history::is_going_back(&self.path) {
            return;
        }
        let (severity, text) = match history::go_back(&self.path) {
            Ok(_) => {
                (Severity::Warning, "the history was missing; the copy of before is in its place again".to_owned())
            }
            Err(error) => {
                (Severity::Error, format!("the copy of before cannot take the place of the history: {error}"))
            }
        };
        Notice::new(severity, "history_went_back", text).write_to_logs();
    }

    /// As an event of the history, and as a row of its audit: the chain before is in another file.
    pub(super) fn record_notice(&self, Notice { code, operator, .. }: &Notice) {
        let Some(writer) = &self.writer else { return };
        let (at_ns, kind, source) = (clock::now_ns(), (*code).to_owned(), "history".to_owned());
        writer.queue_record(Event { at_ns, kind: kind.clone(), source, text: operator.clone(), detail: String::new() });
        let outcome = "done".to_owned();
        writer.queue_record(Audit {
            at_ns,
            kind: "history".to_owned(),
            outcome,
            reason: operator.clone(),
            ..Audit::default()
        });
    }

    /// The file is not there any more, or it is another one: what is written goes nowhere.
    pub(super) fn look_at_file(&mut self) {
        if self.writer.is_none() || read_identity(&self.path) == self.file {
            return;
        }
        let now_there = if self.path.exists() { "another file lies in its place" } else { "somebody has removed it" };
        let stored = self.end_writer();
        let text = format!(
            "{} is not the file any more that the box writes to: {now_there}. {stored} samples since the start may be lost with \
             it; storing goes on in what is there now",
            self.path.display()
        );
        let notice = Notice::new(Severity::Error, "history_gone", text);
        notice.write_to_logs();
        self.lost += stored;
        match self.try_open() {
            Ok(()) => self.record_notice(&notice),
            Err(error) => self.opening_failed(&error),
        }
    }

    /// A reader that never ends keeps the log from being put back: it is told when that begins and when it is over.
    pub(super) fn look_at_log(&mut self) {
        let bytes = self.writer.as_ref().map_or(0, |writer| writer.status().log_bytes);
        let long = bytes >= if self.long_log { LOG_TOLD_BYTES / 2 } else { LOG_TOLD_BYTES };
        if std::mem::replace(&mut self.long_log, long) == long {
            return;
        }
        let notice = match long {
            true => Notice::new(Severity::Warning, "history_log_long", long_log(bytes)),
            false => Notice::new(Severity::Info, "history_log_right", "the log beside the history is short again"),
        };
        notice.write_to_logs();
        if let Some(writer) = &self.writer {
            let (kind, source) = (notice.code.to_owned(), "history".to_owned());
            let (at_ns, text, detail) = (clock::now_ns(), notice.operator.clone(), String::new());
            writer.queue_record(Event { at_ns, kind, source, text, detail });
        }
    }

    /// The writer found that the disk has changed the file.
    pub(super) fn look_at_damage(&mut self) {
        let Some(why) = self.writer.as_ref().and_then(|writer| writer.status().damaged) else { return };
        let stored = self.end_writer();
        self.lost += self.handed.saturating_sub(stored);
        self.begin_anew(&HistoryError::Question(why));
    }

    /// Ends the writer; gives how many samples it had made durable. This is the thread of the tick: the sinks are not waited for.
    pub(super) fn end_writer(&mut self) -> u64 {
        let Some(writer) = self.writer.take() else { return 0 };
        self.recent = None;
        let set_hurried = |hurried| self.options.outbox.iter().for_each(|outbox| outbox.set_hurried(hurried));
        set_hurried(true);
        let stored = writer.close().rows;
        set_hurried(false);
        stored
    }
}
