//! Which items this process has sent, whether they arrived or not. Pure.

use std::ops::Range;

/// Stretches that are kept. Beyond it the two that are nearest to each other become one: an item between them then counts as sent.
const STRETCHES_MAX: usize = 1024;

/// Numbers as stretches, in order and apart from each other.
#[derive(Debug, Default)]
pub(super) struct SentNumbers(Vec<Range<u64>>);

impl SentNumbers {
    pub(super) fn contains(&self, number: u64) -> bool {
        let place = self.0.partition_point(|stretch| stretch.end <= number);
        self.0.get(place).is_some_and(|stretch| stretch.contains(&number))
    }

    pub(super) fn insert(&mut self, number: u64) {
        let place = self.0.partition_point(|stretch| stretch.end < number);
        match self.0.get_mut(place) {
            Some(stretch) if stretch.start <= number => stretch.end = stretch.end.max(number + 1),
            Some(stretch) if stretch.start == number + 1 => stretch.start = number,
            _ => self.0.insert(place, number..number + 1),
        }
        self.join(place);
        if self.0.len() > STRETCHES_MAX {
            let distance = |at: &usize| self.0[at + 1].start - self.0[*at].end;
            let nearest = (0..self.0.len() - 1).min_by_key(distance).unwrap_or(0);
            self.0[nearest].end = self.0[nearest + 1].start;
            self.join(nearest);
        }
    }

    /// The stretch at this place and the next one become one where they touch.
    fn join(&mut self, place: usize) {
        if place + 1 < self.0.len() && self.0[place].end >= self.0[place + 1].start {
            self.0[place].end = self.0[place].end.max(self.0[place + 1].end);
            self.0.remove(place + 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_number_of_stretches_is_bounded_and_nothing_that_was_sent_is_forgotten() {
        let mut sent = SentNumbers::default();
        (0..5000).for_each(|number| sent.insert(3 * number));
        assert_eq!(sent.0.len(), STRETCHES_MAX);
        assert!((0..5000).all(|number| sent.contains(3 * number)));
    }

    proptest! {
        #[test]
        fn it_knows_what_a_set_knows(numbers in proptest::collection::vec(0u64..200, 0..300)) {
            let (mut sent, mut set) = (SentNumbers::default(), BTreeSet::new());
            for number in numbers {
                sent.insert(number);
                set.insert(number);
            }
            prop_assert!((0..201).all(|number| sent.contains(number) == set.contains(&number)));
            prop_assert!(sent.0.windows(2).all(|pair| pair[0].end < pair[1].start));
        }
    }
}
