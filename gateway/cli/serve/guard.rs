//! A thread that serves until whoever started it lets go of it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Told to stop, and waited for, when it is dropped.
pub(super) struct ServingThread {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl ServingThread {
    /// Starts a thread of this name, which ends soon after the flag that it is given is set.
    pub(super) fn start(name: &str, serve: impl FnOnce(&AtomicBool) + Send + 'static) -> std::io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let stopping = stop.clone();
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(move || serve(&stopping))?;
        Ok(Self { stop, thread: Some(thread) })
    }
}

impl Drop for ServingThread {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        // A thread that panicked has said so on standard error.
        let _ended = self.thread.take().map(JoinHandle::join);
    }
}
