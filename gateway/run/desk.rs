//! Where the tick lays down what the hand is to do.

use crate::gate::offset::Order;
use crate::gate::{Ask, Verdict};
use std::collections::VecDeque;
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

#[derive(Debug, Default)]
struct Paper {
    verdict: Option<(Instant, Verdict)>,
    asks: VecDeque<(Instant, Ask)>,
    orders: VecDeque<(Instant, Order)>,
    closing: bool,
}

/// See the [module](self).
#[derive(Debug, Default)]
pub(super) struct Desk {
    paper: Mutex<Paper>,
    arrived: Condvar,
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, Paper> {
        // A paper is complete whenever the lock is free.
        self.paper.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The newest verdict, and requests to the ladder. Gives those that will not be handed over: there is no room, or the
    /// arming has ended.
    pub(super) fn lay_down(&self, verdict: &Verdict, asks: &[Ask]) -> Vec<Ask> {
        let mut paper = self.lock();
        paper.verdict = Some((Instant::now(), *verdict));
        let mut refused = Vec::new();
        if !verdict.armed {
            refused.extend(paper.asks.drain(..).map(|(_, ask)| ask));
        }
        for ask in asks {
            if paper.asks.len() < ASKS_MAX {
                paper.asks.push_back((Instant::now(), ask.clone()));
            } else {
                refused.push(ask.clone());
            }
        }
        self.arrived.notify_one();
        refused
    }

    /// Orders to shift axes. Gives those that will not be carried out: there is no room, or the arming has ended.
    pub(super) fn order(&self, orders: &[Order], armed: bool) -> Vec<Order> {
        let mut paper = self.lock();
        let mut withdrawn = Vec::new();
        if !armed {
            let is_step = |order: &Order| matches!(order, Order::Shift { .. });
            withdrawn.extend(paper.orders.iter().map(|(_, order)| *order).filter(is_step));
            paper.orders.retain(|(_, order)| !is_step(order));
        }
        for order in orders {
            if paper.orders.len() < ORDERS_MAX {
                paper.orders.push_back((Instant::now(), *order));
            } else {
                withdrawn.push(*order);
            }
        }
        if !orders.is_empty() {
            self.arrived.notify_one();
        }
        withdrawn
    }

    /// Nothing more will come.
    pub(super) fn close(&self) {
        self.lock().closing = true;
        self.arrived.notify_one();
    }

    /// Waits at most so long for something to do. Gives the newest verdict, and whether the end has come.
    pub(super) fn take(&self, limit: Duration) -> (Option<Verdict>, bool) {
        let empty = |paper: &mut Paper| paper.verdict.is_none() && paper.orders.is_empty() && !paper.closing;
        let waited = self.arrived.wait_timeout_while(self.lock(), limit, empty);
        let mut paper = waited.unwrap_or_else(PoisonError::into_inner).0;
        let fresh = |(laid, verdict): &(Instant, Verdict)| !verdict.armed || laid.elapsed() <= VERDICT_LASTS;
        let fresh = paper.verdict.take().filter(fresh);
        (fresh.map(|(_, verdict)| verdict), paper.closing)
    }

    /// The next request to the ladder, and whether it comes in time.
    pub(super) fn next_ask(&self) -> Option<(Ask, bool)> {
        let (laid, ask) = self.lock().asks.pop_front()?;
        Some((ask, laid.elapsed() <= ASK_LASTS))
    }

    /// The next order, and whether it comes in time.
    pub(super) fn next_order(&self) -> Option<(Order, bool)> {
        let (laid, order) = self.lock().orders.pop_front()?;
        Some((order, laid.elapsed() <= ORDER_LASTS))
    }
}
