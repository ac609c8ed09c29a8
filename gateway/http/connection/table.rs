//! Which connections there are, what each is doing, and which one has to go for another.

use gateway_base::convert::saturate_to_ms;
use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::Notify;

/// What one connection is doing. Times are milliseconds since the book was opened.
#[derive(Debug)]
pub(super) struct ConnectionActivity {
    opened: Instant,
    peer: IpAddr,
    answering: AtomicBool,
    /// Since when it waits or answers.
    since_ms: AtomicU64,
    /// When the first byte of a request came for which it waits; 0: none has come.
    first_byte_ms: AtomicU64,
    requests: AtomicU64,
    close_signal: Notify,
}

/// What a connection waits for, and for how long it has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Waits {
    /// An answer is under way.
    No,
    /// The first request, of which no byte has come.
    First(Duration),
    /// Another request, of which no byte has come.
    Next(Duration),
    /// The rest of the head of a request.
    Rest(Duration),
}

impl ConnectionActivity {
    fn now_ms(&self) -> u64 {
        // From 1, so that 0 means never.
        saturate_to_ms(self.opened.elapsed()).saturating_add(1)
    }

    /// A request is complete as far as its head goes.
    pub(super) fn mark_answering(&self) {
        self.requests.fetch_add(1, Ordering::Relaxed);
        self.since_ms.store(self.now_ms(), Ordering::Relaxed);
        self.answering.store(true, Ordering::Release);
    }

    /// The answer has gone, or nobody wants it.
    pub(super) fn mark_waiting(&self) {
        self.first_byte_ms.store(0, Ordering::Relaxed);
        self.since_ms.store(self.now_ms(), Ordering::Relaxed);
        self.answering.store(false, Ordering::Release);
    }

    pub(super) fn note_first_byte(&self) {
        if !self.answering.load(Ordering::Acquire) && self.first_byte_ms.load(Ordering::Relaxed) == 0 {
            self.first_byte_ms.store(self.now_ms(), Ordering::Relaxed);
        }
    }

    /// What it waits for.
    pub(super) fn wait_state(&self) -> Waits {
        if self.answering.load(Ordering::Acquire) {
            return Waits::No;
        }
        let for_ms = |since_ms: u64| Duration::from_millis(self.now_ms().saturating_sub(since_ms));
        match self.first_byte_ms.load(Ordering::Relaxed) {
            0 if self.requests.load(Ordering::Relaxed) == 0 => {
                Waits::First(for_ms(self.since_ms.load(Ordering::Relaxed)))
            }
            0 => Waits::Next(for_ms(self.since_ms.load(Ordering::Relaxed))),
            first_ms => Waits::Rest(for_ms(first_ms)),
        }
    }

    /// Returns when it has to go for another.
    pub(super) async fn has_to_go(&self) {
        self.close_signal.notified().await;
    }
}

#[derive(Debug, Clone)]
pub(super) struct ConnectionTable {
    opened: Instant,
    most: usize,
    of_one: usize,
    lines: Arc<Mutex<Lines>>,
}

#[derive(Debug, Default)]
struct Lines {
    next: u64,
    by_number: HashMap<u64, Arc<ConnectionActivity>>,
}

/// A place in the book; it is given back when this goes.
#[derive(Debug)]
pub(super) struct ConnectionEntry {
    pub(super) activity: Arc<ConnectionActivity>,
    number: u64,
    table: ConnectionTable,
}

impl Drop for ConnectionEntry {
    fn drop(&mut self) {
        self.table.lock_lines().by_number.remove(&self.number);
    }
}

impl ConnectionTable {
    /// With room for so many, and for so many of one address.
    pub(super) fn new(most: usize, of_one: usize) -> Self {
        Self { opened: Instant::now(), most, of_one, lines: Arc::default() }
    }

    fn lock_lines(&self) -> MutexGuard<'_, Lines> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Another connection of this address. One that waits goes for it where there is no room; `None` where none waits.
    pub(super) fn register_connection(&self, from: IpAddr) -> Option<ConnectionEntry> {
        let mut lines = self.lock_lines();
        let own = lines.by_number.values().filter(|line| line.peer == from).count();
        if own >= self.of_one {
            lines.close_one(|line| line.peer == from)?;
        } else if lines.by_number.len() >= self.most {
            let crowded = lines.most_waiting()?;
            lines.close_one(|line| line.peer == crowded)?;
        }
        let line = Arc::new(ConnectionActivity {
            opened: self.opened,
            peer: from,
            answering: AtomicBool::new(false),
            since_ms: AtomicU64::new(0),
            first_byte_ms: AtomicU64::new(0),
            requests: AtomicU64::new(0),
            close_signal: Notify::new(),
        });
        line.mark_waiting();
        let number = lines.next;
        lines.next += 1;
        lines.by_number.insert(number, line.clone());
        Some(ConnectionEntry { activity: line, number, table: self.clone() })
    }
}

impl Lines {
    /// The address with most connections that wait.
    fn most_waiting(&self) -> Option<IpAddr> {
        let mut counts: HashMap<IpAddr, usize> = HashMap::new();
        let waiting = self.by_number.values().filter(|line| line.wait_state() != Waits::No);
        waiting.for_each(|line| *counts.entry(line.peer).or_default() += 1);
        counts.into_iter().max_by_key(|(_, count)| *count).map(|(from, _)| from)
    }

    /// Closes the oldest of these that wait.
    fn close_one(&mut self, which: impl Fn(&ConnectionActivity) -> bool) -> Option<()> {
        let waiting = self.by_number.iter().filter(|(_, line)| which(line) && line.wait_state() != Waits::No);
        let oldest = waiting.min_by_key(|(number, line)| (line.since_ms.load(Ordering::Relaxed), **number));
        let number = oldest.map(|(number, _)| *number)?;
        self.by_number.remove(&number)?.close_signal.notify_one();
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_only_waits_goes_for_another_and_whoever_is_answered_stays() {
        let address = |n: u8| IpAddr::from([10, 0, 0, n]);
        let book = ConnectionTable::new(10, 6);
        let mut of_one: Vec<ConnectionEntry> = (0..100).filter_map(|_| book.register_connection(address(1))).collect();
        assert_eq!(of_one.len(), 100, "each finds a place");
        assert_eq!(book.lock_lines().by_number.len(), 6, "and of each address there are only so many");
        of_one.drain(..94);
        let mut others: Vec<ConnectionEntry> = (2..6).filter_map(|n| book.register_connection(address(n))).collect();
        assert_eq!(book.lock_lines().by_number.len(), 10);
        others.extend(book.register_connection(address(7)));
        assert_eq!(
            book.lock_lines().by_number.values().filter(|line| line.peer == address(1)).count(),
            5,
            "the crowd pays"
        );
        book.lock_lines().by_number.values().for_each(|line| line.mark_answering());
        assert!(book.register_connection(address(9)).is_none(), "nobody waits");
        others[0].activity.mark_waiting();
        assert!(book.register_connection(address(9)).is_some());
        drop((of_one, others));
        assert!(book.lock_lines().by_number.is_empty());
    }

    #[test]
    fn a_line_tells_what_it_waits_for() {
        let entry = ConnectionTable::new(1, 1).register_connection(IpAddr::from([10, 0, 0, 1])).expect("room");
        let line = &entry.activity;
        assert!(matches!(line.wait_state(), Waits::First(_)));
        line.note_first_byte();
        assert!(matches!(line.wait_state(), Waits::Rest(_)));
        line.mark_answering();
        assert_eq!(line.wait_state(), Waits::No);
        line.mark_waiting();
        assert!(matches!(line.wait_state(), Waits::Next(_)));
    }
}
