//! What the service manager (systemd) is told: ready, alive, stopping. Without one, nothing.
//!
//! The sign of life stands for the box as a whole. It is given from the tick, and only while each of these has moved within
//! [`STILL_MAX`]: the tick, at least one poll, the thread that writes the history, and the threads that answer the page. A full disk or a control
//! that is off do not stop them: those are told, and starting again would not mend them. A thread that hangs does; then the
//! service manager ends the process after its own limit (`WatchdogSec`) and starts it again.

use crate::update::{WELL_FOR, confirm_running_version};
use gateway_base::convert::saturate_to_ms;
use gateway_base::log::{Notice, Severity};
use sd_notify::NotifyState;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Longer than anything healthy lasts (a commit on a worn card takes seconds), and short enough that the box is back
/// within a minute.
pub const STILL_MAX: Duration = Duration::from_secs(20);

/// A part of the box that must keep moving.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WatchedPart {
    /// The thread of the tick.
    Tick,
    /// The threads that poll.
    Poll,
    /// The thread that writes the history.
    History,
    /// The threads that answer the page.
    Page,
}

/// All parts, in the order of their marks.
const PARTS: [WatchedPart; 4] = [WatchedPart::Tick, WatchedPart::Poll, WatchedPart::History, WatchedPart::Page];

impl WatchedPart {
    /// The word in messages.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Tick => "tick",
            Self::Poll => "poll",
            Self::History => "history",
            Self::Page => "page",
        }
    }
}

/// When each part last moved. Shared between the threads; nobody waits for anybody.
#[derive(Debug)]
pub struct ProgressMarks {
    began: Instant,
    /// Milliseconds since `began`, in the order of [`PARTS`].
    moved_ms: [AtomicU64; PARTS.len()],
}

impl ProgressMarks {
    /// Everything moves at this moment.
    #[must_use]
    pub fn new() -> Self {
        Self { began: Instant::now(), moved_ms: [const { AtomicU64::new(0) }; PARTS.len()] }
    }

    /// This part has moved.
    pub fn mark_part(&self, part: WatchedPart) {
        let now_ms = saturate_to_ms(self.began.elapsed());
        self.moved_ms[part as usize].store(now_ms, Ordering::Relaxed);
    }

    /// Parts that have stood still for longer than `limit`.
    #[must_use]
    pub fn find_stalled(&self, limit: Duration) -> Vec<WatchedPart> {
        let since = |part: &WatchedPart| Duration::from_millis(self.moved_ms[*part as usize].load(Ordering::Relaxed));
        let now = self.began.elapsed();
        PARTS.into_iter().filter(|part| now.saturating_sub(since(part)) > limit).collect()
    }
}

impl Default for ProgressMarks {
    fn default() -> Self {
        Self::new()
    }
}

/// The way to the service manager.
#[derive(Debug)]
pub struct ServiceManager {
    data_dir: PathBuf,
    ready_since: Option<Instant>,
    confirmed: bool,
}

impl ServiceManager {
    /// `data_dir` is where a version on trial is confirmed.
    #[must_use]
    pub fn new(data_dir: PathBuf) -> Self {
        Self { data_dir, ready_since: None, confirmed: false }
    }

    /// Called about once a second. The first time everything moves it says that the box is ready; a version that has been
    /// well for [`WELL_FOR`] is confirmed.
    ///
    /// # Errors
    /// The confirmation cannot be written; it is tried again at the next call.
    pub fn report_progress(&mut self, marks: &ProgressMarks) -> std::io::Result<()> {
        let still = marks.find_stalled(STILL_MAX);
        if !still.is_empty() {
            self.ready_since = None;
            let words: Vec<&str> = still.iter().map(|part| part.word()).collect();
            notify_manager(&[NotifyState::Status(&format!("stands still: {}", words.join(", ")))]);
            return Ok(());
        }
        let since = *self.ready_since.get_or_insert_with(|| {
            notify_manager(&[NotifyState::Ready, NotifyState::Status("polling")]);
            Instant::now()
        });
        notify_manager(&[NotifyState::Watchdog]);
        if !self.confirmed && since.elapsed() >= WELL_FOR {
            confirm_running_version(&self.data_dir)?;
            self.confirmed = true;
        }
        Ok(())
    }
}

/// What the service manager hears, and what was last seen of the threads that it does not see itself.
#[derive(Debug)]
pub struct WatchedService {
    manager: ServiceManager,
    marks: Arc<ProgressMarks>,
    /// Steps of the polling threads, and rounds of the thread that writes the history.
    seen: (Option<u64>, Option<u64>),
    /// The confirmation of a new version could not be written, which was told.
    told: bool,
}

impl WatchedService {
    /// `data_dir` is where a version on trial is confirmed.
    #[must_use]
    pub fn new(data_dir: PathBuf, marks: Arc<ProgressMarks>) -> Self {
        Self { manager: ServiceManager::new(data_dir), marks, seen: (None, None), told: false }
    }

    /// Marks what has moved since the last look, and reports it. A history that is not open has no thread that could hang.
    pub fn report_moved_parts(&mut self, steps: Option<u64>, rounds: Option<u64>) {
        self.marks.mark_part(WatchedPart::Tick);
        for (part, now, seen) in [(WatchedPart::Poll, steps, self.seen.0), (WatchedPart::History, rounds, self.seen.1)]
        {
            if now.is_none() || now != seen {
                self.marks.mark_part(part);
            }
        }
        self.seen = (steps, rounds);
        let Err(error) = self.manager.report_progress(&self.marks) else { return };
        if !std::mem::replace(&mut self.told, true) {
            let text = format!(
                "that this version is well cannot be written down ({error}); an update goes back to the version before"
            );
            Notice::new(Severity::Warning, "not_confirmed", text).write_to_logs();
        }
    }
}

/// How often a box that opens its files says that it lives; a third of `WatchdogSec`.
const OPENING_EVERY: Duration = Duration::from_secs(10);
/// What it asks for each time, us; longer than [`OPENING_EVERY`].
const OPENING_EXTENDS_US: u32 = 30_000_000;
/// No opening takes longer: a history of ten gigabytes is brought to another version in some minutes. A box that hangs here is ended
/// and started again after this time.
const OPENING_MAX: Duration = Duration::from_secs(1_200);

/// While it lives, the service manager hears that the box opens its files: that may take minutes (a new version of a large history,
/// rows of days to be dated anew), in which nothing else gives a sign of life.
#[derive(Debug)]
pub struct OpeningReport {
    _end: std::sync::mpsc::Sender<()>,
}

impl OpeningReport {
    /// Begins to tell. Without a thread nothing is told, and the usual limits hold.
    #[must_use]
    pub fn start() -> Self {
        let (end, ended) = std::sync::mpsc::channel();
        let tell = move || {
            let until = Instant::now() + OPENING_MAX;
            while Instant::now() < until
                && ended.recv_timeout(OPENING_EVERY) == Err(std::sync::mpsc::RecvTimeoutError::Timeout)
            {
                notify_manager(&[
                    NotifyState::Watchdog,
                    NotifyState::ExtendTimeoutUsec(OPENING_EXTENDS_US),
                    NotifyState::Status("opening the history"),
                ]);
            }
        };
        let _no_thread = std::thread::Builder::new().name("opening".to_owned()).spawn(tell);
        Self { _end: end }
    }
}

/// The box is being closed.
pub fn report_stopping() {
    notify_manager(&[NotifyState::Stopping]);
}

/// Without a service manager this does nothing; one that has gone away is not this program's trouble.
fn notify_manager(states: &[NotifyState<'_>]) {
    let _no_manager = sd_notify::notify(states);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_that_stands_still_is_named() {
        let marks = ProgressMarks::new();
        std::thread::sleep(Duration::from_millis(30));
        marks.mark_part(WatchedPart::Tick);
        marks.mark_part(WatchedPart::Poll);
        marks.mark_part(WatchedPart::Page);
        assert_eq!(marks.find_stalled(Duration::from_millis(20)), [WatchedPart::History]);
        assert!(marks.find_stalled(Duration::from_secs(5)).is_empty());
    }
}
