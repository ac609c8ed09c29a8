//! Where the tick lays down what the writing thread is to do.
//!
//! A thread that sleeps is woken by way of the kernel and of a processor that may sleep too, which takes between some tens of
//! microseconds and, on a loaded or virtual processor, a millisecond. While the gate is armed a worker of real-time priority
//! therefore wakes by itself shortly before the next verdict is due, and looks for it until it is there. A thread of ordinary
//! priority that looked would have used up its turn when the verdict comes.

use gateway_gate::offset::OffsetOrder;
use gateway_gate::{ScriptRequest, Verdict};
use gateway_sources::pace::{LEAD, LEAD_PERIOD_MIN};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Requests to the ladder that wait.
const ASKS_MAX: usize = 8;
/// Orders to shift an axis that wait; each axis has at most one.
const ORDERS_MAX: usize = 8;
/// The tick lays down a verdict ten times a second; an older one is that of a tick that hangs.
const VERDICT_LASTS: Duration = Duration::from_secs(1);
/// A feed hold or a stop that waits for longer is about something else than what goes on by then.
const ASK_LASTS: Duration = Duration::from_secs(10);
/// After this time a program may have begun.
const ORDER_LASTS: Duration = Duration::from_secs(2);
/// A verdict that is so late is waited for asleep.
const SPIN_AFTER_DUE: Duration = Duration::from_micros(900);

#[derive(Debug, Default)]
struct PendingVerdict {
    verdict: Option<(Instant, Verdict)>,
    requests: TimedQueue<ScriptRequest>,
    orders: TimedQueue<OffsetOrder>,
    closing: bool,
    /// When the last verdict came, if it was armed: the next is due a period later.
    armed_at: Option<Instant>,
}

/// What waits, and since when.
type TimedQueue<T> = VecDeque<(Instant, T)>;

/// Queues these from now on; gives those for which there is no room.
fn queue_items<T: Clone>(waiting: &mut TimedQueue<T>, most: usize, new: &[T]) -> Vec<T> {
    let (taken, left) = new.split_at(most.saturating_sub(waiting.len()).min(new.len()));
    waiting.extend(taken.iter().map(|it| (Instant::now(), it.clone())));
    left.to_vec()
}

#[derive(Debug, Default)]
pub(super) struct VerdictMailbox {
    pending: Mutex<PendingVerdict>,
    arrived: Condvar,
    /// Grows with everything that is laid down.
    laid: AtomicU64,
    /// Time between two verdicts; none where nobody waits awake.
    period: Option<Duration>,
}

impl VerdictMailbox {
    /// Verdicts come at this period.
    pub(super) fn new(period: Duration) -> Self {
        Self { period: Some(period).filter(|period| *period >= LEAD_PERIOD_MIN), ..Self::default() }
    }

    fn notify_worker(&self) {
        self.laid.fetch_add(1, Ordering::Release);
        self.arrived.notify_one();
    }

    fn lock(&self) -> MutexGuard<'_, PendingVerdict> {
        // It is complete whenever the lock is free.
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The newest verdict, and requests to the ladder. Gives those that will not be handed over: there is no room, or the
    /// arming has ended.
    pub(super) fn post_verdict(&self, verdict: &Verdict, asks: &[ScriptRequest]) -> Vec<ScriptRequest> {
        let mut pending = self.lock();
        let now = Instant::now();
        pending.verdict = Some((now, *verdict));
        pending.armed_at = verdict.armed.then_some(now);
        let mut refused = Vec::new();
        if !verdict.armed {
            refused.extend(pending.requests.drain(..).map(|(_, ask)| ask));
        }
        refused.extend(queue_items(&mut pending.requests, ASKS_MAX, asks));
        drop(pending);
        self.notify_worker();
        refused
    }

    /// Orders to shift axes. Gives those that will not be carried out: there is no room, or the arming has ended.
    pub(super) fn post_orders(&self, orders: &[OffsetOrder], armed: bool) -> Vec<OffsetOrder> {
        let mut pending = self.lock();
        let mut withdrawn = Vec::new();
        if !armed {
            let is_step = |order: &OffsetOrder| matches!(order, OffsetOrder::Shift { .. });
            withdrawn.extend(pending.orders.iter().map(|(_, order)| *order).filter(is_step));
            pending.orders.retain(|(_, order)| !is_step(order));
        }
        withdrawn.extend(queue_items(&mut pending.orders, ORDERS_MAX, orders));
        drop(pending);
        if !orders.is_empty() {
            self.notify_worker();
        }
        withdrawn
    }

    /// Nothing more will come.
    pub(super) fn close(&self) {
        self.lock().closing = true;
        self.notify_worker();
    }

    /// Waits at most so long for something to do. Gives the newest verdict, and whether the end has come.
    /// `awake`, it waits awake for the next verdict that is due.
    pub(super) fn take_verdict(&self, limit: Duration, awake: bool) -> (Option<Verdict>, bool) {
        let empty =
            |pending: &mut PendingVerdict| pending.verdict.is_none() && pending.orders.is_empty() && !pending.closing;
        let pending = self.lock();
        let due = self.period.filter(|_| awake).zip(pending.armed_at).map(|(period, at)| at + period);
        let laid = self.laid.load(Ordering::Acquire);
        let asleep = due.map_or(limit, |due| due.saturating_duration_since(Instant::now() + LEAD).min(limit));
        let waited = self.arrived.wait_timeout_while(pending, asleep, empty);
        let mut pending = waited.unwrap_or_else(PoisonError::into_inner).0;
        if let Some(due) = due.filter(|_| asleep < limit && empty(&mut pending)) {
            drop(pending);
            self.spin_until(laid, due + SPIN_AFTER_DUE);
            let waited = self.arrived.wait_timeout_while(self.lock(), limit - asleep, empty);
            pending = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let fresh = |(laid, verdict): &(Instant, Verdict)| !verdict.armed || laid.elapsed() <= VERDICT_LASTS;
        let fresh = pending.verdict.take().filter(fresh);
        (fresh.map(|(_, verdict)| verdict), pending.closing)
    }

    /// Awake until something is laid down, or it has become too late for it.
    fn spin_until(&self, laid: u64, until: Instant) {
        while self.laid.load(Ordering::Acquire) == laid && Instant::now() < until {
            // The tick may go on meanwhile, on a box with one processor.
            std::thread::yield_now();
        }
    }

    /// The next request to the ladder, and whether it comes in time.
    pub(super) fn next_ask(&self) -> Option<(ScriptRequest, bool)> {
        let (laid, ask) = self.lock().requests.pop_front()?;
        Some((ask, laid.elapsed() <= ASK_LASTS))
    }

    /// The next order, and whether it comes in time.
    pub(super) fn next_order(&self) -> Option<(OffsetOrder, bool)> {
        let (laid, order) = self.lock().orders.pop_front()?;
        Some((order, laid.elapsed() <= ORDER_LASTS))
    }
}
