//! The thread that estimates: one estimate at a time, started with the first one.

use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::threads::receive_work;
use rules::estimators::alignment::{Lag, LagSettings, NotIdentifiable, Transient, estimate_lag};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};

/// An answer is taken so long after it was asked for, on the clock of the ticks.
const TAKEN_AFTER_NS: i64 = 2 * SECOND_NS;

/// What a tick does when the time of an answer has come and it has not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Patience {
    /// Goes on, and takes it when it comes: time does not wait.
    GoesOn,
    /// Waits: time is simulated, and the same readings shall give the same samples.
    Waits,
}

pub(super) type LagResult = Result<Lag, NotIdentifiable>;

struct BackgroundThread {
    transients: SyncSender<Vec<Transient>>,
    results: Receiver<LagResult>,
}

pub(super) struct Background {
    patience: Patience,
    thread: Option<BackgroundThread>,
    /// For which pair, and when the answer is due.
    asked: Option<(usize, TimeNs)>,
}

impl Background {
    pub(super) fn new(patience: Patience) -> Self {
        Self { patience, thread: None, asked: None }
    }

    pub(super) fn is_idle(&self) -> bool {
        self.asked.is_none()
    }

    /// Asks for an estimate. Without a thread there is none, and the next transient asks again.
    pub(super) fn request_estimate(&mut self, pair: usize, transients: Vec<Transient>, now_ns: TimeNs) {
        if self.thread.is_none() {
            self.thread = spawn_thread();
        }
        let asked = self.thread.as_ref().is_some_and(|line| line.transients.try_send(transients).is_ok());
        self.asked = asked.then_some((pair, now_ns + TAKEN_AFTER_NS));
    }

    /// The answer for a pair, when it is due and there.
    pub(super) fn take_estimate(&mut self, pair: usize, now_ns: TimeNs) -> Option<LagResult> {
        let due = self.asked.is_some_and(|(asked, due_ns)| asked == pair && due_ns <= now_ns);
        let line = self.thread.as_ref().filter(|_| due)?;
        let answer = match self.patience {
            Patience::Waits => line.results.recv().map_err(|_| TryRecvError::Disconnected),
            Patience::GoesOn => line.results.try_recv(),
        };
        match answer {
            Ok(found) => {
                self.asked = None;
                Some(found)
            }
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                (self.thread, self.asked) = (None, None);
                None
            }
        }
    }
}

/// The thread ends when nobody asks any more.
fn spawn_thread() -> Option<BackgroundThread> {
    let (ask, asked) = sync_channel::<Vec<Transient>>(1);
    let (answer, answers) = sync_channel(1);
    let estimate = move || {
        while let Some(transients) = receive_work("align", &asked) {
            if answer.send(estimate_lag(&transients, &LagSettings::default())).is_err() {
                return;
            }
        }
    };
    std::thread::Builder::new().name("align".to_owned()).spawn(estimate).ok()?;
    Some(BackgroundThread { transients: ask, results: answers })
}
