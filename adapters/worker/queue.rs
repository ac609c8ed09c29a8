//! The bounded queue between a source's thread and the tick. When nobody takes, the oldest poll goes.

use crate::clock::TimeNs;
use crate::driver::SourceError;
use crate::reading::Reading;
use std::collections::VecDeque;

/// What one poll gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Poll {
    /// When it was over.
    pub ended_ns: TimeNs,
    /// Its readings; also a failed poll may have some.
    pub readings: Vec<Reading>,
    /// Why the poll as a whole failed.
    pub error: Option<SourceError>,
}

pub(super) struct Queue {
    polls: VecDeque<Poll>,
    /// The emptied list of the last [`Queue::take_all`], to be filled again.
    empty: VecDeque<Poll>,
    /// Emptied lists of readings, to be filled again.
    spares: Vec<Vec<Reading>>,
    limit: usize,
    dropped: u64,
}

impl Queue {
    pub(super) fn new(limit: usize) -> Self {
        Self { polls: VecDeque::new(), empty: VecDeque::new(), spares: Vec::new(), limit: limit.max(1), dropped: 0 }
    }

    pub(super) fn push_poll(&mut self, poll: Poll) {
        if self.polls.len() >= self.limit
            && let Some(oldest) = self.polls.pop_front()
        {
            self.dropped += 1;
            self.recycle_readings(oldest.readings);
        }
        self.polls.push_back(poll);
    }

    /// An empty list for the readings of the next poll.
    pub(super) fn take_spare(&mut self) -> Vec<Reading> {
        self.spares.pop().unwrap_or_default()
    }

    pub(super) fn take_all(&mut self) -> VecDeque<Poll> {
        let empty = std::mem::take(&mut self.empty);
        std::mem::replace(&mut self.polls, empty)
    }

    pub(super) fn give_back(&mut self, mut polls: VecDeque<Poll>) {
        polls.drain(..).for_each(|poll| self.recycle_readings(poll.readings));
        self.empty = polls;
    }

    fn recycle_readings(&mut self, mut readings: Vec<Reading>) {
        if self.spares.len() < 8 {
            readings.clear();
            self.spares.push(readings);
        }
    }

    pub(super) fn count_dropped(&self) -> u64 {
        self.dropped
    }
}
