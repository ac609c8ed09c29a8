//! The scorer: asks the built binary, compares with the truth, prints tables.

pub(crate) mod answer;
mod checks;
pub(crate) mod endurance;
pub(crate) mod headline;
pub(crate) mod outcome;
pub(crate) mod tally;
pub(crate) mod tool;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::concealed::groups::Order;
use outcome::Outcome;

/// Runs all orders on `threads` threads; cases that were answered wrongly stay on disk.
pub(crate) fn run(orders: &[Order], threads: usize) -> Vec<Outcome> {
    let next = AtomicUsize::new(0);
    let outcomes = Mutex::new(Vec::new());
    let work = || {
        while let Some(order) = orders.get(next.fetch_add(1, Ordering::Relaxed)) {
            let Some(outcome) = one(order) else { continue };
            outcomes.lock().expect("no thread panicked while holding the list").push(outcome);
        }
    };
    std::thread::scope(|scope| {
        (0..threads).for_each(|_| {
            scope.spawn(work);
        });
    });
    let mut list = outcomes.into_inner().expect("no thread panicked while holding the list");
    list.sort_by(|a, b| a.label.cmp(&b.label));
    list
}

fn one(order: &Order) -> Option<Outcome> {
    let case = order.build()?;
    let outcome = Outcome::of(&case, &tool::ask(&case));
    if outcome.right {
        tool::discard(&case);
    } else {
        tool::keep(&case);
    }
    Some(outcome)
}
