//! What the box has learned goes to disk beside the tick, so that a slow disk never delays a write to the machine.

use crate::files::replace;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Files that wait for the disk; what does not fit is saved at the next turn.
const WAITING_MAX: usize = 8;

/// See the [module](self).
#[derive(Debug)]
pub struct Saver {
    jobs: Option<SyncSender<(PathBuf, String)>>,
    thread: Option<JoinHandle<()>>,
}

impl Saver {
    /// Starts the thread. Without one, files are written at once.
    #[must_use]
    pub fn start() -> Self {
        let (send, jobs) = sync_channel::<(PathBuf, String)>(WAITING_MAX);
        let work = move || jobs.iter().for_each(|(path, text)| put(&path, &text));
        let thread = std::thread::Builder::new().name("save".to_owned()).spawn(work).ok();
        Self { jobs: thread.is_some().then_some(send), thread }
    }

    /// Writes this file, a new one in the place of the old one, as soon as the disk has time.
    pub fn put(&self, path: &Path, text: String) {
        let Some(jobs) = &self.jobs else { return put(path, &text) };
        if jobs.try_send((path.to_owned(), text)).is_err() {
            tracing::warn!("{} was not saved: the disk has not taken what came before", path.display());
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

fn put(path: &Path, text: &str) {
    if let Err(error) = replace(path, text) {
        tracing::warn!("what was learned could not be saved in {}: {error}", path.display());
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
        saver.put(&path, "1".to_owned());
        saver.put(&path, "2".to_owned());
        saver.close();
        assert_eq!(std::fs::read_to_string(&path).expect("written"), "2");
        saver.put(&path, "3".to_owned());
        assert_eq!(std::fs::read_to_string(&path).expect("written"), "3", "afterwards at once");
    }
}
