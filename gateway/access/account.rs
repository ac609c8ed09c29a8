//! Rows of the audit about the page: who signed in, who was refused, what was changed, who the persons are.
//!
//! A refusal costs whoever provokes it nothing, so their number is limited: beyond it they are counted, and the next row says
//! how many were left out.

use gateway_control::OrderSender;
use gateway_history::Audit;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Refusals with a row of their own, per minute.
const REFUSALS_MAX: u32 = 60;
const MINUTE: Duration = Duration::from_secs(60);
/// The longest text of a row, characters.
const TEXT_MAX: usize = 300;

#[derive(Debug, Default)]
struct Budget {
    since: Option<Instant>,
    used: u32,
    left_out: u32,
}

impl Budget {
    /// May another row be written? Gives how many were left out before it.
    fn admit_row(&mut self, now: Instant) -> Option<u32> {
        if self.since.is_none_or(|since| now.saturating_duration_since(since) >= MINUTE) {
            (self.since, self.used) = (Some(now), 0);
        }
        if self.used >= REFUSALS_MAX {
            self.left_out = self.left_out.saturating_add(1);
            return None;
        }
        self.used += 1;
        Some(std::mem::take(&mut self.left_out))
    }
}

#[derive(Debug)]
pub(super) struct Account {
    orders: OrderSender,
    refusals: Mutex<Budget>,
}

impl Account {
    pub(super) fn new(orders: OrderSender) -> Self {
        Self { orders, refusals: Mutex::default() }
    }

    /// Something happened; false when it will not be stored.
    pub(super) async fn append_row(&self, kind: &str, outcome: &str, reason: &str, person: &str) -> bool {
        let cut = |text: &str| text.chars().filter(|sign| !sign.is_control()).take(TEXT_MAX).collect();
        let (kind, outcome) = (kind.to_owned(), outcome.to_owned());
        self.orders
            .send_audit_row(Audit { kind, outcome, reason: cut(reason), person: cut(person), ..Audit::default() })
            .await
    }

    /// Something was refused. Nobody waits for the row.
    pub(super) fn record_refusal(&self, kind: &str, reason: &str, person: &str, now: Instant) {
        let budget = self.refusals.lock().unwrap_or_else(PoisonError::into_inner).admit_row(now);
        let Some(left_out) = budget else { return };
        let reason = match left_out {
            0 => reason.to_owned(),
            more => format!("{reason} ({more} more refusals before it were left out)"),
        };
        let (account, kind, person) = (Self::new(self.orders.clone()), kind.to_owned(), person.to_owned());
        tokio::spawn(async move { account.append_row(&kind, "refused", &reason, &person).await });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_refusals_is_counted() {
        let (mut budget, now) = (Budget::default(), Instant::now());
        assert_eq!((0..1000).filter_map(|_| budget.admit_row(now)).count(), REFUSALS_MAX as usize);
        assert_eq!(budget.admit_row(now + MINUTE), Some(1000 - REFUSALS_MAX));
        assert_eq!(budget.admit_row(now + MINUTE), Some(0));
    }
}
