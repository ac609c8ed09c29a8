//! Marks of the facts that are stored, so that none is stored twice.

use gateway_history::{Reader, RecordSpan};
use std::collections::{HashSet, VecDeque};
use std::path::Path;

/// Marks that are remembered: those of some months. An older fact that comes again is not stored twice either, the history takes each mark once.
const MARKS_MAX: usize = 10_000;

/// Marks of the facts that are stored, the newest of them.
#[derive(Debug, Default)]
pub struct FactMarks {
    known: HashSet<String>,
    /// The same marks, the oldest first.
    order: VecDeque<String>,
}

impl FactMarks {
    /// Those of the history at this path; none where it cannot be read yet.
    #[must_use]
    pub fn from_history(path: &Path) -> Self {
        let newest = RecordSpan::newest(u32::try_from(MARKS_MAX).unwrap_or(u32::MAX));
        let stored = Reader::open(path).and_then(|reader| reader.read_facts_told(newest)).unwrap_or_default();
        let mut marks = Self::default();
        stored.iter().for_each(|fact| marks.remember_mark(&fact.mark));
        marks
    }

    /// From now on the mark is known.
    pub(super) fn remember_mark(&mut self, mark: &str) {
        if !self.known.insert(mark.to_owned()) {
            return;
        }
        self.order.push_back(mark.to_owned());
        if self.order.len() > MARKS_MAX
            && let Some(oldest) = self.order.pop_front()
        {
            self.known.remove(&oldest);
        }
    }

    /// Was this mark remembered?
    pub(super) fn knows(&self, mark: &str) -> bool {
        self.known.contains(mark)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_is_known_until_many_others_have_come() {
        let mut marks = FactMarks::default();
        (0..2).for_each(|_again| marks.remember_mark("a"));
        (1..MARKS_MAX).for_each(|number| marks.remember_mark(&format!("m{number}")));
        assert!(marks.known.len() == MARKS_MAX && marks.known.contains("a"), "once, however often it comes");
        marks.remember_mark("one more");
        assert_eq!((marks.known.len(), marks.order.len()), (MARKS_MAX, MARKS_MAX));
        assert!(!marks.known.contains("a"), "the oldest is forgotten");
    }
}
