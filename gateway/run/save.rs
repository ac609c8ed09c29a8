//! What the box has learned goes to disk beside the tick, so that a slow disk never delays a write to the machine.

use adapters::threads::receive_work;
use gateway_base::files::replace_file;
use gateway_base::state_file;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

/// Files that wait for the disk; what does not fit is saved at the next turn.
const WAITING_MAX: usize = 8;

/// A file on its way to the disk.
#[derive(Debug)]
struct SaveJob {
    path: PathBuf,
    text: String,
    /// What was learned has a checksum, and the save before it beside it.
    learned: bool,
}

impl SaveJob {
    fn write_file(&self) {
        let saved = if self.learned {
            state_file::save_state(&self.path, &self.text)
        } else {
            replace_file(&self.path, &self.text)
        };
        if let Err(error) = saved {
            tracing::warn!("{} could not be saved: {error}", self.path.display());
        }
    }
}

/// Writes to disk what the box has learned, on a thread beside the tick.
#[derive(Debug)]
pub struct Saver {
    jobs: Option<SyncSender<SaveJob>>,
    thread: Option<JoinHandle<()>>,
}

impl Saver {
    /// Starts the thread. Without one, files are written at once.
    #[must_use]
    pub fn start() -> Self {
        let (send, jobs) = sync_channel::<SaveJob>(WAITING_MAX);
        let work = move || {
            while let Some(job) = receive_work("save", &jobs) {
                job.write_file();
            }
        };
        let thread = std::thread::Builder::new().name("save".to_owned()).spawn(work).ok();
        Self { jobs: thread.is_some().then_some(send), thread }
    }

    /// Writes this file, a new one in the place of the old one, as soon as the disk has time.
    pub fn put_file(&self, path: &Path, text: String) {
        self.queue_job(SaveJob { path: path.to_owned(), text, learned: false });
    }

    /// The same for what was learned: see [`state_file`].
    pub fn put_learned(&self, path: &Path, state: String) {
        self.queue_job(SaveJob { path: path.to_owned(), text: state, learned: true });
    }

    fn queue_job(&self, job: SaveJob) {
        let Some(jobs) = &self.jobs else { return job.write_file() };
        if let Err(refused) = jobs.try_send(job) {
            let (TrySendError::Full(job) | TrySendError::Disconnected(job)) = refused;
            tracing::warn!("{} was not saved: the disk has not taken what came before", job.path.display());
        }
    }

    /// Returns when everything is written.
    pub fn close(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been printed by then.
            let _ended = thread.join();
        }
    }
}

impl Drop for Saver {
    fn drop(&mut self) {
        self.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_written_by_the_end() {
        let directory = tempfile::tempdir().expect("a directory");
        let mut saver = Saver::start();
        let path = directory.path().join("learned.json");
        saver.put_file(&path, "1".to_owned());
        saver.put_file(&path, "2".to_owned());
        saver.close();
        assert_eq!(std::fs::read_to_string(&path).expect("written"), "2");
        saver.put_file(&path, "3".to_owned());
        assert_eq!(std::fs::read_to_string(&path).expect("written"), "3", "afterwards at once");
        saver.put_learned(&path, "4".to_owned());
        assert_eq!(state_file::read(&path, |_| {}).as_deref(), Some("4"));
    }
}
