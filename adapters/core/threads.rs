//! Threads that broke off by a panic, known to the whole process, and a way for a test to make one break off.
//!
//! A panic ends a thread and nothing else; without a list nobody would notice that somebody who writes, reads or answers is gone. Whoever
//! sets the hook for panics calls [`record_panic`]; whoever supervises compares [`count_panics`] with what it knew.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

/// Names that are kept; a name more is counted and not kept.
const NAMES_MAX: usize = 64;
/// Names the file that holds the name of the thread that a test wants to break off. Builds without debug assertions ignore it.
pub const FAULT_VARIABLE: &str = "CNC_GATEWAY_TEST_FAULT";
/// A thread that waits for work looks for such a file this often.
const FAULT_LOOK: Duration = Duration::from_millis(50);

static PANICS: AtomicU64 = AtomicU64::new(0);
static BROKEN: Mutex<Vec<BrokenThread>> = Mutex::new(Vec::new());

/// What is known of a thread that broke off.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrokenThread {
    /// Name of the thread.
    pub thread: String,
    /// What broke off and where, of the first time.
    pub what: String,
    /// How often since the start.
    pub count: u64,
}

fn lock_list() -> MutexGuard<'static, Vec<BrokenThread>> {
    // It is complete whenever the lock is free.
    BROKEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A thread of this name has panicked. For the hook of the process.
pub fn record_panic(thread: &str, what: &str) {
    let mut broken = lock_list();
    if let Some(known) = broken.iter_mut().find(|known| known.thread == thread) {
        known.count += 1;
    } else if broken.len() < NAMES_MAX {
        broken.push(BrokenThread { thread: thread.to_owned(), what: what.to_owned(), count: 1 });
    }
    drop(broken);
    PANICS.fetch_add(1, Ordering::SeqCst);
}

/// Panics since the start of the process. Cheap enough for every tick.
#[must_use]
pub fn count_panics() -> u64 {
    PANICS.load(Ordering::SeqCst)
}

/// The threads that broke off since the start, the first one first.
#[must_use]
pub fn list_broken() -> Vec<BrokenThread> {
    lock_list().clone()
}

/// Breaks off here when a test wants it: a build with debug assertions, and [`FAULT_VARIABLE`] names a file that holds this name. The file
/// goes, so that it happens once.
pub fn reach_fault_point(thread: &str) {
    let Some(file) = find_fault_file() else { return };
    if std::fs::read_to_string(file).is_ok_and(|wanted| wanted.trim() == thread) && std::fs::remove_file(file).is_ok() {
        panic!("the fault that a test has asked for");
    }
}

fn find_fault_file() -> Option<&'static PathBuf> {
    static FILE: OnceLock<Option<PathBuf>> = OnceLock::new();
    let look = || std::env::var_os(FAULT_VARIABLE).filter(|_| cfg!(debug_assertions)).map(PathBuf::from);
    FILE.get_or_init(look).as_ref()
}

/// Waits for work, as [`Receiver::recv`] does, with a fault point of this name; `None` when nobody can send any more.
pub fn receive_work<T>(thread: &str, work: &Receiver<T>) -> Option<T> {
    if find_fault_file().is_none() {
        return work.recv().ok();
    }
    loop {
        reach_fault_point(thread);
        match work.recv_timeout(FAULT_LOOK) {
            Ok(it) => return Some(it),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return None,
        }
    }
}

/// The same with a limit, as [`Receiver::recv_timeout`] has it.
///
/// # Errors
/// As that.
pub fn receive_work_within<T>(thread: &str, work: &Receiver<T>, limit: Duration) -> Result<T, RecvTimeoutError> {
    if find_fault_file().is_none() {
        return work.recv_timeout(limit);
    }
    let mut left = limit;
    loop {
        reach_fault_point(thread);
        let step = left.min(FAULT_LOOK);
        left -= step;
        match work.recv_timeout(step) {
            Err(RecvTimeoutError::Timeout) if !left.is_zero() => {}
            other => return other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_broke_off_is_counted_by_name() {
        let before = count_panics();
        record_panic("of a test", "first");
        record_panic("of a test", "second");
        assert!(count_panics() >= before + 2);
        let known: Vec<_> = list_broken().into_iter().filter(|broken| broken.thread == "of a test").collect();
        assert_eq!(known, [BrokenThread { thread: "of a test".to_owned(), what: "first".to_owned(), count: 2 }]);
    }
}
