//! Which item breaks a connection. Some receivers say nothing about a message that they do not take: they hang up, at every try
//! again. Pure.
//!
//! A connection that breaks three times while the same items are sent has them sent one by one. An item at which it breaks three
//! times alone is under suspicion. Then a later item, the witness, and the item take turns: only where the line carries the witness and
//! breaks at the item, three times in a row, is the item to blame and left out. A line that was down and stands again carries both:
//! an outage, however long, costs no item, nor do three of them one after another.
//!
//! The witness is the next item at first. Where the line breaks at it as well, it may be of the same kind: the next witness is 2, 4, ..
//! 64 items further, and then the next item again. So up to 64 such items in a row are told from a line that is down.

/// Breaks before the items are sent one by one, and before one of them is under suspicion.
const BREAKS: u32 = 3;
/// How often in a row the line must carry the witness and break at the item. A line that breaks at random at every second try
/// does that once in 64 times; each costs a connection.
const PROOFS: u32 = 3;
/// The furthest witness, in items after the one that follows the suspected item. A receiver that refuses more in a row refuses all.
const REACH_MAX: u64 = 63;

/// What is to be sent next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Turn {
    /// As many as fit.
    Many,
    /// The first item alone.
    Alone,
    /// The one after this number, alone: it tells whether the line stands.
    Past(u64),
}

#[derive(Debug, Default)]
pub(super) struct Isolation {
    /// The first of the items at which the connection broke last, and how often in a row.
    first: Option<u64>,
    breaks: u32,
    /// Has the line carried the witness since it broke last, and how often did it then break at the item?
    stands: bool,
    proofs: u32,
    /// Items between the suspected one and the witness.
    reach: u64,
    /// Before this number items are sent one by one.
    alone_until: u64,
}

impl Isolation {
    /// What to send where the next item has this number.
    pub(super) fn choose_turn(&self, from: u64) -> Turn {
        let suspected = self.breaks >= BREAKS && !self.stands;
        match self.first {
            Some(first) if first == from && from < self.alone_until && suspected => Turn::Past(first + self.reach),
            _ if from < self.alone_until => Turn::Alone,
            _ => Turn::Many,
        }
    }

    /// The connection broke while the items from `first` to `last` were sent in this turn. True where it is proved that the first is
    /// to blame: it is to be left out.
    pub(super) fn record_break(&mut self, turn: Turn, first: u64, last: u64) -> bool {
        if let Turn::Past(_) = turn {
            // The witness breaks the line as well: nothing is proved, and the next witness is another.
            (self.breaks, self.proofs) = (0, 0);
            self.reach = if self.reach < REACH_MAX { 2 * self.reach + 1 } else { 0 };
            return false;
        }
        if self.first != Some(first) {
            self.clear();
            self.first = Some(first);
        }
        self.breaks += 1;
        if turn == Turn::Many && self.breaks >= BREAKS {
            (self.breaks, self.alone_until) = (0, last + 1);
        }
        self.proofs += u32::from(std::mem::take(&mut self.stands));
        let proved = self.proofs >= PROOFS;
        if proved {
            self.clear();
        }
        proved
    }

    /// The witness has arrived, or was refused with a word: the line stands.
    pub(super) fn carried_witness(&mut self) {
        self.stands = true;
    }

    /// There is no item so far after the suspected one.
    pub(super) fn without_witness(&mut self) {
        self.reach = 0;
    }

    /// The items from `first` to `last` have arrived. Live data that arrive between two tries of a gap say nothing about its item.
    pub(super) fn record_arrival(&mut self, first: u64, last: u64) {
        if self.first.is_some_and(|suspect| (first..=last).contains(&suspect)) {
            self.clear();
        }
    }

    fn clear(&mut self) {
        *self = Self { alone_until: self.alone_until, ..Self::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// Sends items 1 to `count` in batches of ten; those of `poison` break the connection, as does every try of `line`. Gives what
    /// arrived, what was left out, and how many connections broke.
    fn send(count: u64, poison: &[u64], mut line: impl FnMut(u32) -> bool) -> (BTreeSet<u64>, Vec<u64>, u32) {
        let (mut isolation, mut next, mut tries, mut breaks) = (Isolation::default(), 1, 0, 0);
        let (mut arrived, mut left_out) = (BTreeSet::new(), Vec::new());
        while next <= count && tries < 10_000 {
            tries += 1;
            // After the last item nothing comes yet: it is tried again.
            let turn = match isolation.choose_turn(next) {
                Turn::Past(item) if item >= count => {
                    isolation.without_witness();
                    Turn::Alone
                }
                turn => turn,
            };
            let (from, to) = match turn {
                Turn::Many => (next, (next + 9).min(count)),
                Turn::Alone => (next, next),
                Turn::Past(item) => (item + 1, item + 1),
            };
            if line(tries) || (from..=to).any(|item| poison.contains(&item)) {
                breaks += 1;
                if isolation.record_break(turn, next, to) {
                    left_out.push(next);
                    next += 1;
                }
                continue;
            }
            arrived.extend(from..=to);
            if let Turn::Past(_) = turn {
                isolation.carried_witness();
                continue;
            }
            isolation.record_arrival(from, to);
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
            assert!(breaks <= 9 * poison.len() as u32, "{poison:?}: {breaks} breaks");
        }
    }

    #[test]
    fn items_in_a_row_that_break_the_line_are_left_out_and_no_other() {
        for poison in [5..7_u64, 1..4, 20..36, 28..39, 1..65] {
            let poison: Vec<u64> = poison.collect();
            let (arrived, left_out, _) = send(100, &poison, |_| false);
            assert_eq!(left_out, poison);
            assert_eq!(arrived.len(), 100 - poison.len());
        }
        // All of them: no item tells that the line stands.
        let (arrived, left_out, _) = send(100, &(1..=100).collect::<Vec<_>>(), |_| false);
        assert_eq!((arrived.len(), left_out), (0, vec![]));
    }

    #[test]
    fn live_data_between_do_not_hide_the_item_of_a_gap() {
        let (mut isolation, mut live, mut breaks) = (Isolation::default(), 1_000, 0);
        loop {
            assert_eq!(isolation.choose_turn(live), Turn::Many);
            isolation.record_arrival(live, live);
            live += 1;
            match isolation.choose_turn(5) {
                Turn::Past(5) => isolation.carried_witness(),
                turn if isolation.record_break(turn, 5, 14) => break,
                _ => breaks += 1,
            }
            assert!(breaks < 10, "it is never found");
        }
        assert_eq!(isolation.choose_turn(6), Turn::Alone);
    }

    #[test]
    fn a_line_that_breaks_costs_no_item() {
        let (arrived, left_out, _) = send(40, &[], |tries| tries < 100);
        assert_eq!((arrived.len(), left_out.len()), (40, 0));
        let (arrived, left_out, _) = send(40, &[], |tries| tries % 2 == 0);
        assert_eq!((arrived.len(), left_out.len()), (40, 0));
    }

    proptest! {
        #[test]
        fn three_outages_cost_no_item(outages in proptest::collection::vec((1_u32..60, 1_u32..60), 0..=3)) {
            let down = |tries: u32| outages.iter().any(|(from, length)| (*from..from + length).contains(&tries));
            let (arrived, left_out, _) = send(40, &[], down);
            prop_assert_eq!((arrived.len(), left_out), (40, vec![]));
        }
    }
}
