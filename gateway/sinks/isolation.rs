//! Which item breaks a connection. Some receivers say nothing about a message that they do not take: they hang up, at every try
//! again. Pure.
//!
//! A connection that breaks three times while the same items are sent has them sent one by one. An item at which it breaks three
//! times alone is under suspicion, and the one after it is tried: where that arrives, the first is left out; where it breaks, too,
//! the line is to blame and both stay.

/// Breaks before the items are sent one by one, and before one of them is under suspicion.
const BREAKS: u32 = 3;

/// What is to be sent next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Turn {
    /// As many as fit.
    Many,
    /// One.
    Alone,
    /// The one after this item, alone: it decides about this one.
    Past(u64),
}

/// See the [module](self).
#[derive(Debug, Default)]
pub(super) struct Isolation {
    /// The first of the items at which the connection broke last, and how often in a row.
    first: Option<u64>,
    breaks: u32,
    /// Before this number items are sent one by one.
    alone_until: u64,
}

impl Isolation {
    /// What to send where the next item has this number.
    pub(super) fn turn(&self, from: u64) -> Turn {
        match self.first {
            Some(first) if first == from && from < self.alone_until && self.breaks >= BREAKS => Turn::Past(first),
            _ if from < self.alone_until => Turn::Alone,
            _ => Turn::Many,
        }
    }

    /// The connection broke while the items from `first` to `last` were sent in this turn.
    pub(super) fn broke(&mut self, turn: Turn, first: u64, last: u64) {
        if let Turn::Past(_) = turn {
            // The one after it breaks the line as well: the item is not to blame.
            self.breaks = 0;
            return;
        }
        self.breaks = if self.first == Some(first) { self.breaks + 1 } else { 1 };
        self.first = Some(first);
        if turn == Turn::Many && self.breaks >= BREAKS {
            (self.breaks, self.alone_until) = (0, last + 1);
        }
    }

    /// The items from `first` to `last` have arrived. Live data that arrive between two tries of a gap say nothing about its item.
    pub(super) fn arrived(&mut self, first: u64, last: u64) {
        if self.first.is_some_and(|suspect| (first..=last).contains(&suspect)) {
            self.decide();
        }
    }

    /// The item under suspicion has arrived, or is left out.
    pub(super) fn decide(&mut self) {
        (self.first, self.breaks) = (None, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Sends items 1 to `count` in batches of ten; those of `poison` break the connection, as does every try of `line`. Gives what
    /// arrived, what was left out, and how many connections broke.
    fn send(count: u64, poison: &[u64], mut line: impl FnMut(u32) -> bool) -> (BTreeSet<u64>, Vec<u64>, u32) {
        let (mut isolation, mut next, mut tries, mut breaks) = (Isolation::default(), 1, 0, 0);
        let (mut arrived, mut left_out) = (BTreeSet::new(), Vec::new());
        while next <= count && tries < 10_000 {
            tries += 1;
            let turn = isolation.turn(next);
            let (from, to) = match turn {
                Turn::Many => (next, (next + 9).min(count)),
                Turn::Alone => (next, next),
                Turn::Past(item) => (item + 1, item + 1),
            };
            if line(tries) || (from..=to).any(|item| poison.contains(&item)) {
                breaks += 1;
                isolation.broke(turn, next, to);
                continue;
            }
            isolation.arrived(from, to);
            arrived.extend(from..=to);
            if let Turn::Past(item) = turn {
                isolation.decide();
                left_out.push(item);
            }
            next = to + 1;
        }
        (arrived, left_out, breaks)
    }

    #[test]
    fn the_item_that_breaks_the_line_is_left_out_and_no_other() {
        for poison in [&[5_u64][..], &[1], &[10, 17], &[30], &[3, 25]] {
            let (arrived, left_out, breaks) = send(40, poison, |_| false);
            assert_eq!(left_out, poison);
            assert_eq!(arrived.len(), 40 - poison.len());
            assert!(breaks <= 7 * poison.len() as u32, "{poison:?}: {breaks} breaks");
        }
    }

    #[test]
    fn live_data_between_do_not_hide_the_item_of_a_gap() {
        let (mut isolation, mut live, mut breaks) = (Isolation::default(), 1_000, 0);
        while isolation.turn(5) != Turn::Past(5) {
            assert_eq!(isolation.turn(live), Turn::Many);
            isolation.arrived(live, live);
            live += 1;
            isolation.broke(isolation.turn(5), 5, 14);
            breaks += 1;
            assert!(breaks < 10, "it is never found");
        }
        isolation.arrived(6, 6);
        isolation.decide();
        assert_eq!(isolation.turn(6), Turn::Alone);
    }

    #[test]
    fn a_line_that_breaks_costs_no_item() {
        let (arrived, left_out, _) = send(40, &[], |tries| tries < 100);
        assert_eq!((arrived.len(), left_out.len()), (40, 0));
        let (arrived, left_out, _) = send(40, &[], |tries| tries % 2 == 0);
        assert_eq!((arrived.len(), left_out.len()), (40, 0));
    }
}
