//! What a sink still has to deliver: everything from one number on, and the gaps before it that an outage left. Pure.

use serde::{Deserialize, Serialize};

/// More gaps are not kept: the sink then delivers in order of the numbers until one is closed, and what it delivers out of order
/// counts as not delivered. Bounds the position to about a kilobyte.
const GAPS_MAX: usize = 64;

/// What a sink still has to deliver.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Position {
    /// Older stretches `from..to` that are not delivered, in order, apart from each other and below `next`.
    gaps: Vec<(u64, u64)>,
    /// From here on nothing is delivered.
    next: u64,
}

impl Position {
    /// Everything before `next` is delivered.
    #[must_use]
    pub fn from_next(next: u64) -> Self {
        Self { gaps: Vec::new(), next }
    }

    /// The number from which on nothing is delivered.
    #[must_use]
    pub fn next(&self) -> u64 {
        self.next
    }

    /// The oldest gap, `from..to`.
    #[must_use]
    pub fn oldest_gap(&self) -> Option<(u64, u64)> {
        self.gaps.first().copied()
    }

    /// The lowest number that is not delivered.
    #[must_use]
    pub fn lowest_undelivered(&self) -> u64 {
        self.gaps.first().map_or(self.next, |(from, _)| *from)
    }

    /// How many items are not delivered, when `head` is the number of the next item that will be made.
    #[must_use]
    pub fn count_waiting(&self, head: u64) -> u64 {
        self.count_within(0, head)
    }

    /// How many of the items `from..to` are not delivered.
    #[must_use]
    pub fn count_within(&self, from: u64, to: u64) -> u64 {
        let open = (self.next, u64::MAX);
        let overlap = |(start, end): (u64, u64)| end.min(to).saturating_sub(start.max(from));
        self.gaps.iter().copied().chain([open]).map(overlap).sum()
    }

    /// Live data begins at `head`; what lies between becomes a gap. False, and nothing changed, when there are too many
    /// gaps already.
    pub fn jump_to_head(&mut self, head: u64) -> bool {
        if head <= self.next {
            return true;
        }
        let full = self.gaps.len() >= GAPS_MAX;
        match self.gaps.last_mut() {
            Some((_, end)) if *end == self.next => *end = head,
            _ if full => return false,
            _ => self.gaps.push((self.next, head)),
        }
        self.next = head;
        true
    }

    /// The item `number`, the first that is not delivered from some number on, stays open, and what comes after it may be delivered.
    pub fn hold_item(&mut self, number: u64) {
        if number < self.next {
            return;
        }
        let (end, full) = (number.saturating_add(1), self.gaps.len() >= GAPS_MAX);
        match self.gaps.last_mut() {
            // What lies between is sent once more: better than a warning that is lost.
            Some((_, last)) if full || *last == self.next => *last = end,
            _ => self.gaps.push((self.next, end)),
        }
        self.next = end;
    }

    /// The first stretch `from..to` of items from `number` on, and below `head`, that are not delivered.
    #[must_use]
    pub fn undelivered_from(&self, number: u64, head: u64) -> Option<(u64, u64)> {
        let open = (self.next, head);
        let mut rest = self.gaps.iter().copied().chain([open]).map(|(from, to)| (from.max(number), to.min(head)));
        rest.find(|(from, to)| from < to)
    }

    /// The items `from..to` are delivered, or are not there any more.
    pub fn mark_delivered(&mut self, from: u64, to: u64) {
        let cut = |(start, end): (u64, u64)| [(start, end.min(from)), (start.max(to), end)];
        let left = |(start, end): &(u64, u64)| start < end;
        let gaps: Vec<(u64, u64)> = self.gaps.iter().copied().flat_map(cut).filter(left).collect();
        if gaps.len() <= GAPS_MAX.max(self.gaps.len()) {
            self.gaps = gaps;
        }
        if from <= self.next && to > self.next {
            self.next = to;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    #[test]
    fn an_outage_becomes_a_gap_that_is_closed_piece_by_piece() {
        let mut position = Position::from_next(1);
        position.mark_delivered(1, 11);
        assert!(position.jump_to_head(101));
        position.mark_delivered(101, 111);
        assert_eq!((position.oldest_gap(), position.next(), position.count_waiting(121)), (Some((11, 101)), 111, 100));
        position.mark_delivered(11, 100);
        assert_eq!((position.lowest_undelivered(), position.count_waiting(111)), (100, 1));
        position.mark_delivered(100, 101);
        assert_eq!((position.oldest_gap(), position.lowest_undelivered()), (None, 111));
    }

    #[test]
    fn the_number_of_gaps_is_bounded_and_nothing_is_forgotten() {
        let mut position = Position::from_next(1);
        let mut head = 1;
        while position.jump_to_head(head + 2) {
            head += 2;
            position.mark_delivered(head, head + 1);
            head += 1;
        }
        assert_eq!(position.gaps.len(), GAPS_MAX);
        assert_eq!(position.count_waiting(head), 2 * GAPS_MAX as u64);
        position.mark_delivered(1, 3);
        assert!(position.jump_to_head(head + 2));
    }

    #[test]
    fn what_is_held_stays_open_and_the_rest_is_delivered() {
        let mut position = Position::from_next(1);
        position.mark_delivered(1, 5);
        position.hold_item(5);
        position.hold_item(6);
        position.mark_delivered(7, 9);
        assert_eq!((position.oldest_gap(), position.next(), position.count_waiting(9)), (Some((5, 7)), 9, 2));
        let from = |number| position.undelivered_from(number, 12);
        assert_eq!((from(0), from(6), from(7), from(12)), (Some((5, 7)), Some((6, 7)), Some((9, 12)), None));
        // Held within what an outage left: the gap stays as it is.
        assert!(position.jump_to_head(20));
        position.hold_item(10);
        assert_eq!((position.undelivered_from(7, 30), position.next()), (Some((9, 20)), 20));
    }

    #[test]
    fn however_many_are_held_the_position_is_bounded_and_none_is_forgotten() {
        let mut position = Position::from_next(0);
        for number in (0..1000).step_by(2) {
            position.mark_delivered(number, number + 1);
            position.hold_item(number + 1);
            assert!(position.gaps.len() <= GAPS_MAX);
        }
        assert!((1..1000).step_by(2).all(|number| position.count_within(number, number + 1) == 1));
        // A hole in the middle would be a gap more: it counts as not delivered.
        position.mark_delivered(500, 501);
        assert_eq!((position.gaps.len(), position.count_within(500, 501)), (GAPS_MAX, 1));
        position.mark_delivered(0, 1000);
        assert_eq!(position, Position::from_next(1000));
    }

    proptest! {
        #[test]
        fn it_counts_as_a_set_of_numbers_does(steps in proptest::collection::vec((0u8..3, 1u64..40, 1u64..12), 1..60)) {
            let (mut position, mut open, mut head) = (Position::from_next(1), BTreeSet::new(), 1u64);
            for (step, from, count) in steps {
                match step {
                    0 => { open.extend(head..head + count); head += count; }
                    1 => { position.jump_to_head(head); }
                    _ => {
                        // A sink delivers from the beginning of its gap or of its live data.
                        let from = position.oldest_gap().filter(|_| from % 2 == 0).map_or(position.next(), |gap| gap.0);
                        let to = (from + count).min(head);
                        position.mark_delivered(from, to);
                        open.retain(|number| *number < from || *number >= to);
                    }
                }
                prop_assert_eq!(position.count_waiting(head), open.len() as u64);
                prop_assert_eq!(position.lowest_undelivered().min(head), open.first().copied().unwrap_or(head));
            }
        }
    }
}
