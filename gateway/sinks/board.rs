//! Where the tasks of the sinks write how they are doing, and the status reads it.

use super::SinkError;
use super::status::SinkStatus;
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::histogram::Histogram;
use gateway_base::log::{Notice, Severity};
use gateway_base::problem::StatusProblem;
use gateway_history::Outbox;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What one task tells of itself.
#[derive(Debug, Clone, Default)]
pub(super) struct Progress {
    pub(super) state: Option<&'static str>,
    pub(super) delivered: u64,
    pub(super) refused: u64,
    pub(super) connections: u64,
    pub(super) delay_s: Option<f64>,
    pub(super) delays: Histogram,
    pub(super) error: Option<String>,
    /// The last item that the receiver would not take, and why.
    pub(super) refusal: Option<String>,
    pub(super) failing: bool,
    /// What is wrong although items are delivered.
    pub(super) fault: Option<SinkError>,
    /// Time of the newest delivered item of the oldest gap, or of live data where there is no gap.
    pub(super) reached_ns: Option<TimeNs>,
}

#[derive(Debug)]
struct BoardEntry {
    name: String,
    address: String,
    progress: Progress,
}

/// What is known of every sink, for status and page. Clones are the same board.
#[derive(Debug, Clone, Default)]
pub struct Board {
    entries: Arc<Mutex<Vec<BoardEntry>>>,
    outbox: Option<Outbox>,
}

impl Board {
    /// A board for these sinks, each with name and address.
    #[must_use]
    pub fn new(outbox: Outbox, sinks: impl IntoIterator<Item = (String, String)>) -> Self {
        let entry = |(name, address)| BoardEntry { name, address, progress: Progress::default() };
        Self { entries: Arc::new(Mutex::new(sinks.into_iter().map(entry).collect())), outbox: Some(outbox) }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<BoardEntry>> {
        // An entry is complete whenever the lock is free.
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn update_progress(&self, index: usize, change: impl FnOnce(&mut Progress)) {
        if let Some(entry) = self.lock().get_mut(index) {
            change(&mut entry.progress);
        }
    }

    /// True when this error is another one than before, or came back: worth telling.
    pub(super) fn record_failure(&self, index: usize, error: &SinkError) -> bool {
        let text = error.to_string();
        let mut news = false;
        self.update_progress(index, |progress| {
            news = !progress.failing || progress.error.as_deref() != Some(&text);
            progress.state = Some("waiting");
            progress.error = Some(text);
            progress.failing = true;
        });
        news
    }

    /// What is wrong although items are delivered, or that nothing is any more; logged when it is news.
    pub(super) fn record_fault(&self, index: usize, fault: Option<SinkError>) {
        let mut news = None;
        if let Some(entry) = self.lock().get_mut(index) {
            let told = fault.as_ref().filter(|_| entry.progress.fault != fault);
            news = told.map(|fault| format!("sink {}: {fault}", entry.name));
            entry.progress.fault = fault;
        }
        if let Some(text) = news {
            Notice::new(Severity::Warning, "sink_fault", text).write_to_logs();
        }
    }

    /// The sinks that fail at the moment, and those that do not reach everybody.
    #[must_use]
    pub fn list_problems(&self) -> Vec<StatusProblem> {
        let failing = |entry: &BoardEntry| {
            let next = "it is tried again by itself; what waits is kept (see `sinks` in the status)".to_owned();
            let error = entry.progress.error.as_ref().filter(|_| entry.progress.failing)?;
            Some(StatusProblem { what: format!("sink {}: {error}", entry.name), next })
        };
        let partly = |entry: &BoardEntry| {
            let (what, next) = entry.progress.fault.as_ref()?.as_parts();
            Some(StatusProblem { what: format!("sink {}: {what}", entry.name), next: next.to_owned() })
        };
        let problem = |entry: &BoardEntry| failing(entry).or_else(|| partly(entry));
        self.lock().iter().filter_map(problem).collect()
    }

    /// Every sink at this moment.
    #[must_use]
    pub fn list_sinks(&self) -> Vec<SinkStatus> {
        let Some(outbox) = &self.outbox else { return Vec::new() };
        let (head, figures) = (*outbox.watch_head().borrow(), outbox.figures());
        let fits = figures.outage_fits_h(outbox.settings());
        let status = |entry: &BoardEntry| {
            let BoardEntry { name, address, progress } = entry;
            let standing = outbox.delivery_state(name);
            let behind_items =
                standing.as_ref().map_or(0, |standing| standing.position.count_waiting(head.next_sequence));
            let age = head.newest_ns.zip(progress.reached_ns).map(|(newest, reached)| to_seconds(newest - reached));
            SinkStatus {
                name: name.clone(),
                address: address.clone(),
                state: progress.state.unwrap_or("waiting"),
                behind_items,
                behind_s: if behind_items == 0 { Some(0.0) } else { age.map(|age| age.max(0.0)) },
                delivered: progress.delivered,
                delay_s: progress.delay_s,
                delays: progress.delays,
                dropped: standing.map_or(0, |standing| standing.dropped),
                refused: progress.refused,
                connections: progress.connections,
                outage_fits_h: fits,
                error: progress.error.clone(),
                refusal: progress.refusal.clone(),
                failing: progress.failing,
            }
        };
        self.lock().iter().map(status).collect()
    }
}

pub(super) fn to_seconds(span_ns: i64) -> f64 {
    span_ns as f64 / SECOND_NS as f64
}
