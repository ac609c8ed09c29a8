//! The way of orders and of rows of the audit to the tick, and of its answers back.
//!
//! Orders, rows and requests of the network go by queues of their own: however many rows a flood of refused requests makes, an
//! order to disarm finds its place. Neither waits for the next tick: the tick's thread is woken while it waits for that.

use super::{
    ANSWER_WITHIN, Ending, NetworkRequest, Order, OutcomeSender, QueuedOrder, Reply, RequestOutcome, WAITING_MAX,
};
use gateway_base::clock;
use gateway_history::{Audit, Fact};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, OnceLock};
use std::thread::Thread;
use std::time::Duration;
use thiserror::Error;
use tokio::sync::oneshot;

/// Rows that wait for the tick.
const ROWS_MAX: usize = 64;
/// A row is accounted for within this time, or not at all; a request of the network is answered within it.
const ACCOUNT_WITHIN: Duration = Duration::from_secs(3);
/// Requests of the network that wait for the tick.
const REQUESTS_MAX: usize = 16;
/// Messages of facts that wait for the tick.
const FACTS_WAITING_MAX: usize = 16;

/// Wakes the tick's thread while it waits for the next tick.
#[derive(Debug, Clone, Default)]
pub struct Wake(Arc<Woken>);

#[derive(Debug, Default)]
struct Woken {
    thread: OnceLock<Thread>,
    wanted: AtomicBool,
}

impl Wake {
    /// From now on the calling thread is the one that is woken.
    pub fn bind_current_thread(&self) {
        let _only_once = self.0.thread.set(std::thread::current());
    }

    /// Ends the wait of the bound thread at once; its next `take_wakeup` is true.
    pub fn wake_thread(&self) {
        self.0.wanted.store(true, Ordering::SeqCst);
        self.0.thread.get().map(Thread::unpark);
    }

    /// Was it woken since the last call?
    #[must_use]
    pub fn take_wakeup(&self) -> bool {
        self.0.wanted.swap(false, Ordering::SeqCst)
    }
}

/// A row of the audit on its way, with the way back.
#[derive(Debug)]
pub struct PostedRow {
    /// The row; the tick puts its own time into it.
    pub row: Audit,
    /// Will it be stored?
    pub stored: oneshot::Sender<bool>,
}

/// A request of the network on its way, with the way back.
#[derive(Debug)]
pub struct PostedRequest {
    /// What is asked for.
    pub request: NetworkRequest,
    /// Where the answer goes.
    pub reply: oneshot::Sender<Reply>,
    /// Where the outcome goes, at once or later.
    pub outcomes: OutcomeSender,
}

/// The facts of one message on their way, with the way back.
#[derive(Debug)]
pub struct PostedFacts {
    /// What the plant tells, checked.
    pub facts: Vec<Fact>,
    /// Where the answer goes.
    pub reply: oneshot::Sender<Result<FactsTaken, FactsRefused>>,
}

/// What became of the facts of one message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FactsTaken {
    /// So many are stored now.
    pub new: usize,
    /// So many were there already, by their marks.
    pub known: usize,
}

/// Why not all of the facts were taken. The same message may be sent again: what was taken is known then.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum FactsRefused {
    /// What is not stored is not taken.
    #[error("the history stores nothing at present; look at the problems of the box and send them again")]
    NotStored,
    /// The tick has other facts to take.
    #[error("too many facts wait for the box; send them again in a moment")]
    Busy,
    /// The tick does not live.
    #[error("the tick does not answer; look at the log of the box and send them again")]
    NoAnswer,
}

/// The end of those who order.
#[derive(Debug, Clone)]
pub struct OrderSender {
    orders: SyncSender<QueuedOrder>,
    rows: SyncSender<PostedRow>,
    requests: SyncSender<PostedRequest>,
    facts: SyncSender<PostedFacts>,
    wake: Wake,
}

/// The end of the tick.
#[derive(Debug)]
pub struct OrderReceiver {
    /// What persons order, at the box or on the page.
    pub orders: Receiver<QueuedOrder>,
    /// What is to be accounted for.
    pub rows: Receiver<PostedRow>,
    /// What the network asks for.
    pub requests: Receiver<PostedRequest>,
    /// What the plant adds.
    pub facts: Receiver<PostedFacts>,
    /// How the tick is woken.
    pub wake: Wake,
}

/// The sender for all who order, and the receiver of the tick; every queue is bounded.
#[must_use]
pub fn create_queues() -> (OrderSender, OrderReceiver) {
    let (orders, to_obey) = sync_channel(WAITING_MAX);
    let (rows, to_keep) = sync_channel(ROWS_MAX);
    let (requests, to_judge) = sync_channel(REQUESTS_MAX);
    let (facts, to_store) = sync_channel(FACTS_WAITING_MAX);
    let wake = Wake::default();
    let post = OrderSender { orders, rows, requests, facts, wake: wake.clone() };
    (post, OrderReceiver { orders: to_obey, rows: to_keep, requests: to_judge, facts: to_store, wake })
}

impl OrderSender {
    /// Hands an order to the tick and gives what it says.
    pub async fn send_order(&self, order: Order) -> Reply {
        let (reply, answered) = oneshot::channel();
        if self.orders.try_send(QueuedOrder { order, reply }).is_err() {
            return Reply::from_refusal("the box is busy; look at its log and try again");
        }
        self.wake.wake_thread();
        match tokio::time::timeout(ANSWER_WITHIN, answered).await {
            Ok(Ok(reply)) => reply,
            _ => Reply::from_refusal(
                "the tick does not answer; look at the log, and restart the gateway if it does not recover",
            ),
        }
    }

    /// Hands a request of the network to the tick and gives what it says; the outcome goes to `outcomes`. The tick is not woken for
    /// it: a request counts from the next tick on.
    pub async fn send_request(&self, request: NetworkRequest, outcomes: &OutcomeSender) -> Reply {
        let (reply, answered) = oneshot::channel();
        let posted = PostedRequest { request, reply, outcomes: outcomes.clone() };
        if let Err(TrySendError::Full(posted) | TrySendError::Disconnected(posted)) = self.requests.try_send(posted) {
            return refuse_busy(posted);
        }
        match tokio::time::timeout(ACCOUNT_WITHIN, answered).await {
            Ok(Ok(reply)) => reply,
            _ => Reply::from_refusal("the tick does not answer; look at the log of the box"),
        }
    }

    /// Hands the facts of one message to the tick. Where the history stops in the middle of them, those before it are stored.
    ///
    /// # Errors
    /// Why not all were taken.
    pub async fn send_facts(&self, facts: Vec<Fact>) -> Result<FactsTaken, FactsRefused> {
        let (reply, answered) = oneshot::channel();
        self.facts.try_send(PostedFacts { facts, reply }).map_err(|_full| FactsRefused::Busy)?;
        self.wake.wake_thread();
        match tokio::time::timeout(ACCOUNT_WITHIN, answered).await {
            Ok(Ok(answer)) => answer,
            _ => Err(FactsRefused::NoAnswer),
        }
    }

    /// Hands in a row of the audit; false when it will not be stored, or when that is not known in time.
    pub async fn send_audit_row(&self, row: Audit) -> bool {
        let (stored, answered) = oneshot::channel();
        if self.rows.try_send(PostedRow { row, stored }).is_err() {
            return false;
        }
        self.wake.wake_thread();
        matches!(tokio::time::timeout(ACCOUNT_WITHIN, answered).await, Ok(Ok(true)))
    }
}

/// The tick takes nothing more: it will neither answer nor tell an outcome.
fn refuse_busy(posted: PostedRequest) -> Reply {
    let text = "too many requests wait for the gate; ask again later";
    let outcome = RequestOutcome {
        origin: posted.request.origin,
        ending: Ending::Refused,
        why: "busy",
        text: text.to_owned(),
        asked_pct: None,
        in_force_pct: None,
        at_ns: clock::now_ns(),
    };
    // Where the sink does not fetch outcomes there is nobody to tell.
    let _full = posted.outcomes.try_send(outcome);
    Reply::from_refusal(text)
}
