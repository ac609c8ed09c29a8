//! Facts that the plant adds, at the tick: each is stored once, with a row of the audit, or its whole message is refused.

mod marks;

pub(crate) use marks::FactMarks;

use super::command::{Commands, ROWS_AT_ONCE_MAX};
use super::health::Health;
use adapters::clock::TimeNs;
use gateway_control::{FactsRefused, FactsTaken, PostedFacts};
use gateway_history::{Audit, Fact};

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
            if self.fact_marks.knows(&fact.mark) {
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
