//! Facts that the plant adds, at the tick: each is stored once, with a row of the audit, or its whole message is refused.

use super::command::{Commands, ROWS_AT_ONCE_MAX};
use super::health::Health;
use adapters::clock::TimeNs;
use gateway_control::{FactsRefused, FactsTaken, PostedFacts};
use gateway_history::{Audit, Fact, Reader, RecordSpan};
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
    fn remember_mark(&mut self, mark: &str) {
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
}

impl Commands {
    /// What the plant has told meanwhile.
    pub(super) fn store_facts(&mut self, at_ns: TimeNs, health: &mut Health) {
        for _ in 0..ROWS_AT_ONCE_MAX {
            let Ok(PostedFacts { facts, reply }) = self.orders.facts.try_recv() else { return };
            // Whoever has gone meanwhile sends them again, and they are known then.
            let _gone = reply.send(self.take_facts(facts, at_ns, health));
        }
    }

    /// Where the history stops in the middle of them, those before it are known when they come again.
    fn take_facts(&mut self, facts: Vec<Fact>, at_ns: TimeNs, health: &mut Health) -> Result<FactsTaken, FactsRefused> {
        let mut taken = FactsTaken::default();
        for fact in facts {
            if self.fact_marks.known.contains(&fact.mark) {
                taken.known += 1;
                continue;
            }
            if !(health.is_storing() && health.append_audit(build_audit_row(&fact, at_ns))) {
                return Err(FactsRefused::NotStored);
            }
            self.fact_marks.remember_mark(&fact.mark);
            health.keep_record(Fact { at_ns, ..fact }.into());
            taken.new += 1;
        }
        Ok(taken)
    }
}

#[expect(clippy::cast_precision_loss, reason = "at most a million parts")]
fn build_audit_row(fact: &Fact, at_ns: TimeNs) -> Audit {
    Audit {
        at_ns,
        kind: "fact".to_owned(),
        outcome: "stored".to_owned(),
        asked: fact.parts.map(|parts| parts as f64),
        unit: if fact.parts.is_some() { "part".to_owned() } else { String::new() },
        reason: format!("{} {:?}, id {:?}", fact.fact.as_word(), fact.value, fact.mark),
        script: fact.way.clone(),
        person: fact.author.clone(),
        ..Audit::default()
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
