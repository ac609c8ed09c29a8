//! The handle of the outbox: between the writer thread, the sinks, and whoever shows how far they are.

use super::item::Reading;
use super::position::Position;
use super::report::OutboxSettings;
use crate::HistoryError;
use adapter_core::clock::TimeNs;
use gateway_base::machine_path::{MachinePath, NamedMachine};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::watch;

/// How far the outbox is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OutboxHead {
    /// The number of the next item; everything below it is durable.
    pub next_sequence: u64,
    /// Time of the newest item.
    pub newest_ns: Option<TimeNs>,
    /// Has the history been opened? Before that there is nothing to read.
    pub ready: bool,
}

/// How full the outbox is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OutboxFigures {
    /// Size of all its items on disk, bytes.
    pub bytes: u64,
    /// Growth while nothing is delivered, bytes per second of machine time; `None` in the first minute.
    pub bytes_per_s: Option<f64>,
    /// Time of about the oldest item that is still there.
    pub oldest_ns: Option<TimeNs>,
    /// Ticks that never became items because the disk took nothing for too long.
    pub lost: u64,
}

impl OutboxFigures {
    /// How long an outage fits from empty, hours, with these bounds.
    #[must_use]
    pub fn outage_fits_h(&self, settings: &OutboxSettings) -> Option<f64> {
        let by_size_s = settings.max_bytes as f64 / self.bytes_per_s.filter(|rate| *rate > 0.0)?;
        Some(by_size_s.min(settings.max_age.as_secs_f64()) / 3600.0)
    }
}

/// What a sink has and has not delivered.
#[derive(Debug, Clone, PartialEq)]
pub struct DeliveryState {
    /// What it has still to deliver.
    pub position: Position,
    /// Items dropped before it had delivered them, since it was first configured.
    pub dropped: u64,
    /// Connections that were begun, since it was first configured.
    pub connections: u64,
    /// Is it connected, or about to be for the first time? At the end only such sinks are waited for.
    pub linked: bool,
}

impl DeliveryState {
    /// Nothing before `next` is to be delivered any more, and nothing has happened yet.
    #[must_use]
    pub fn from_next(next: u64) -> Self {
        Self { position: Position::from_next(next), dropped: 0, connections: 0, linked: false }
    }
}

#[derive(Debug)]
struct SharedOutbox {
    machine: NamedMachine,
    settings: OutboxSettings,
    head: watch::Sender<OutboxHead>,
    deliveries: Mutex<BTreeMap<String, DeliveryState>>,
    has_new_items: AtomicBool,
    /// Connections that are not noted yet, and how many times they were.
    connecting: AtomicBool,
    noted: watch::Sender<u64>,
    hurried: AtomicBool,
    state: Mutex<OutboxState>,
}

#[derive(Debug, Default)]
struct OutboxState {
    box_id: String,
    epoch: u64,
    figures: OutboxFigures,
    latest: Arc<Vec<Reading>>,
}

/// The handle. Clones are the same outbox.
#[derive(Debug, Clone)]
pub struct Outbox {
    shared: Arc<SharedOutbox>,
}

impl PartialEq for Outbox {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shared, &other.shared)
    }
}

fn lock_mutex<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Everything in there is complete whenever the lock is free.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Outbox {
    /// The outbox of a machine for these sinks. Hand it to [`Options::outbox`](crate::Options::outbox).
    #[must_use]
    pub fn new(
        machine: impl Into<NamedMachine>,
        settings: OutboxSettings,
        sinks: impl IntoIterator<Item = String>,
    ) -> Self {
        let standing = || DeliveryState::from_next(1);
        let shared = SharedOutbox {
            machine: machine.into(),
            settings,
            head: watch::Sender::new(OutboxHead::default()),
            deliveries: Mutex::new(sinks.into_iter().map(|name| (name, standing())).collect()),
            has_new_items: AtomicBool::new(false),
            connecting: AtomicBool::new(false),
            noted: watch::Sender::new(0),
            hurried: AtomicBool::new(false),
            state: Mutex::new(OutboxState::default()),
        };
        Self { shared: Arc::new(shared) }
    }

    /// The outbox of a history that another process may be writing, for a sink that sends parts of it once more: it knows machine and box,
    /// and no items.
    #[must_use]
    pub fn of_box(machine: impl Into<NamedMachine>, settings: OutboxSettings, box_id: &str) -> Self {
        let outbox = Self::new(machine, settings, []);
        outbox.set_identity(box_id.to_owned(), 0);
        outbox
    }

    /// Name of the machine as configured.
    #[must_use]
    pub fn machine(&self) -> &str {
        &self.shared.machine.name
    }

    /// Where the machine stands in its plant; `None` where nobody has said.
    #[must_use]
    pub fn path(&self) -> Option<&MachinePath> {
        self.shared.machine.path.as_ref()
    }

    /// One name for the machine, for receivers that know a single one: its path with points, whichever box stands there; the box
    /// itself where there is no path.
    #[must_use]
    pub fn device_name(&self) -> String {
        self.path().map_or_else(|| self.box_id(), MachinePath::format_dotted)
    }

    /// Names this box and this history: letters, digits and `-` of the name that the machine had at first, `-`, and digits that
    /// were made with the outbox. With epoch and number it names an item everywhere and for ever. Empty until the history is open.
    #[must_use]
    pub fn box_id(&self) -> String {
        lock_mutex(&self.shared.state).box_id.clone()
    }

    /// The epoch of the items that are made since the history was opened; 0 before. Items of earlier lives have others.
    #[must_use]
    pub fn epoch(&self) -> u64 {
        lock_mutex(&self.shared.state).epoch
    }

    /// What is gathered and how much of it is kept.
    #[must_use]
    pub fn settings(&self) -> &OutboxSettings {
        &self.shared.settings
    }

    /// How far it is now, and every change of that.
    #[must_use]
    pub fn watch_head(&self) -> watch::Receiver<OutboxHead> {
        self.shared.head.subscribe()
    }

    /// How full it is.
    #[must_use]
    pub fn figures(&self) -> OutboxFigures {
        lock_mutex(&self.shared.state).figures
    }

    /// Every series with what a receiver of all items knows by now; empty until the history is open. All values are
    /// missing until the first commit.
    #[must_use]
    pub fn latest_readings(&self) -> Arc<Vec<Reading>> {
        lock_mutex(&self.shared.state).latest.clone()
    }

    /// What sink `name` has delivered; `None` for a name that is not configured.
    #[must_use]
    pub fn delivery_state(&self, name: &str) -> Option<DeliveryState> {
        lock_mutex(&self.shared.deliveries).get(name).cloned()
    }

    /// Sink `name` has delivered the items `from..to`. Becomes durable with the next commit.
    pub fn mark_delivered(&self, name: &str, from: u64, to: u64) {
        self.change_state(name, |standing| standing.position.mark_delivered(from, to));
    }

    /// Sink `name` will never deliver what is left of the items `from..to`; they count as dropped.
    pub fn give_up(&self, name: &str, from: u64, to: u64) {
        self.change_state(name, |standing| {
            standing.dropped += standing.position.count_within(from, to);
            standing.position.mark_delivered(from, to);
        });
    }

    /// Sink `name` begins a connection; gives its number, from 0 over the life of the history. Returns when that is durable, so
    /// that no later connection can have the same number, or after `limit`.
    pub async fn begin_connection(&self, name: &str, limit: Duration) -> u64 {
        let mut noted = self.shared.noted.subscribe();
        let twice = *noted.borrow() + 2;
        let mut number = 0;
        self.change_state(name, |standing| {
            number = standing.connections;
            standing.connections += 1;
        });
        self.shared.connecting.store(true, Ordering::Release);
        // A commit may be under way that has not seen it; one that has seen it is not durable before it is noted.
        let waiting =
            async { while noted.changed().await.is_ok() && self.has_connections() && *noted.borrow() < twice {} };
        // A disk that takes nothing must not keep anybody from sending.
        let _late = tokio::time::timeout(limit, waiting).await;
        number
    }

    /// The writer's side: is there a connection that is not noted yet?
    pub(super) fn has_connections(&self) -> bool {
        self.shared.connecting.load(Ordering::Acquire)
    }

    /// The writer's side: what was known of the sinks when the last transaction began is durable.
    pub(super) fn connections_noted(&self) {
        self.shared.noted.send_modify(|times| *times += 1);
    }

    /// Sink `name` goes on with live data; what it has not delivered before the head becomes a gap. See
    /// [`Position::jump_to_head`].
    pub fn jump_to_head(&self, name: &str) -> bool {
        let head = self.shared.head.borrow().next_sequence;
        let mut jumped = false;
        self.change_state(name, |standing| jumped = standing.position.jump_to_head(head));
        jumped
    }

    /// Sink `name` keeps this item back; [`Position::hold_item`].
    pub fn hold_item(&self, name: &str, sequence: u64) {
        self.change_state(name, |standing| standing.position.hold_item(sequence));
    }

    /// Sink `name` is connected, or is not.
    pub fn set_linked(&self, name: &str, linked: bool) {
        if let Some(standing) = lock_mutex(&self.shared.deliveries).get_mut(name) {
            standing.linked = linked;
        }
    }

    /// At the end the sinks are not waited for any longer; with `false` they are again.
    pub fn set_hurried(&self, hurried: bool) {
        self.shared.hurried.store(hurried, Ordering::Release);
    }

    fn change_state(&self, name: &str, change: impl FnOnce(&mut DeliveryState)) {
        if let Some(standing) = lock_mutex(&self.shared.deliveries).get_mut(name) {
            change(standing);
            self.shared.has_new_items.store(true, Ordering::Release);
        }
    }

    /// The writer's side: has a sink delivered something since the last commit?
    pub(super) fn has_news(&self) -> bool {
        self.shared.has_new_items.load(Ordering::Acquire)
    }

    /// The writer's side: the names of the sinks.
    pub(super) fn sink_names(&self) -> Vec<String> {
        lock_mutex(&self.shared.deliveries).keys().cloned().collect()
    }

    /// The writer's side: the lowest number that some sink has not delivered.
    pub(super) fn lowest_undelivered(&self) -> u64 {
        lock_mutex(&self.shared.deliveries)
            .values()
            .map(|standing| standing.position.lowest_undelivered())
            .min()
            .unwrap_or(u64::MAX)
    }

    /// The writer's side: looks at every sink, and may change it. What has been delivered until here is noted.
    pub(super) fn for_each_sink(
        &self,
        mut each: impl FnMut(&str, &mut DeliveryState) -> Result<(), HistoryError>,
    ) -> Result<(), HistoryError> {
        self.shared.has_new_items.store(false, Ordering::Release);
        self.shared.connecting.store(false, Ordering::Release);
        let mut sinks = lock_mutex(&self.shared.deliveries);
        let done = sinks.iter_mut().try_for_each(|(name, standing)| each(name, standing));
        if done.is_err() {
            self.shared.has_new_items.store(true, Ordering::Release);
        }
        done
    }

    /// The writer's side: these stretches are durably gone, delivered or not.
    pub(super) fn mark_dropped(&self, dropped: &[(u64, u64)]) {
        if dropped.is_empty() {
            return;
        }
        for standing in lock_mutex(&self.shared.deliveries).values_mut() {
            for (from, to) in dropped {
                standing.dropped += standing.position.count_within(*from, *to);
                standing.position.mark_delivered(*from, *to);
            }
        }
    }

    /// The writer's side: the name of this box, and the epoch of its new items.
    pub(super) fn set_identity(&self, name: String, epoch: u64) {
        let mut state = lock_mutex(&self.shared.state);
        (state.box_id, state.epoch) = (name, epoch);
    }

    /// The writer's side: has every sink that is connected delivered everything before `next`, or is it not to be waited for?
    pub(super) fn is_drained(&self, next: u64) -> bool {
        self.shared.hurried.load(Ordering::Acquire)
            || lock_mutex(&self.shared.deliveries)
                .values()
                .all(|standing| !standing.linked || standing.position.count_waiting(next) == 0)
    }

    /// The writer's side: what is durable now.
    pub(super) fn publish_state(&self, head: OutboxHead, figures: OutboxFigures, latest: Vec<Reading>) {
        let mut state = lock_mutex(&self.shared.state);
        state.figures = figures;
        state.latest = Arc::new(latest);
        drop(state);
        self.shared.head.send_if_modified(|known| std::mem::replace(known, head) != head);
    }
}
