//! The parent's side of a vendor's child: typed questions, and questions that the library did not survive.

use super::{ChildCounts, ChildError, ChildSettings, Supervised};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::HashMap;
use std::hash::Hash;

/// A question in which the child ended this often is not asked any more.
const DEATHS_MAX: u32 = 2;

/// What became of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Taken {
    /// Well; the next one.
    Good,
    /// It cannot be trusted, and the child neither; no other comes.
    Suspect,
    /// The child has ended the list by itself.
    Last,
}

/// A child that is asked in words of one's own. `Q` names what it can die of.
pub struct ChildClient<Q> {
    child: Supervised,
    deaths: HashMap<Q, u32>,
}

impl<Q: Copy + Eq + Hash> ChildClient<Q> {
    /// Nothing is started before the first question.
    #[must_use]
    pub fn new(settings: ChildSettings) -> Self {
        Self { child: Supervised::new(settings), deaths: HashMap::new() }
    }

    /// The process itself, which may not be running.
    #[must_use]
    pub fn child(&self) -> &Supervised {
        &self.child
    }

    /// How it has been doing.
    #[must_use]
    pub fn counts(&self) -> ChildCounts {
        self.child.counts()
    }

    /// Is there a child, so that what was opened in it is open?
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.child.process_id().is_some()
    }

    /// Ends the child; the next question starts another one at once.
    pub fn end_child(&mut self) {
        self.child.end_child();
    }

    /// Asks and waits for the answer.
    ///
    /// # Errors
    /// See [`ChildError`].
    pub fn request_answer<Ask: Serialize, Tell: DeserializeOwned>(&mut self, ask: &Ask) -> Result<Tell, ChildError> {
        let answer = self.child.request_answer(&serde_json::to_vec(ask).map_err(no_answer)?)?;
        serde_json::from_slice(&answer).map_err(no_answer)
    }

    /// Asks once for several things and takes an answer for each, in order, until `take` wants no more. Answers before a
    /// failure have been taken. What the child died of, and what cannot be trusted, is blamed.
    ///
    /// # Errors
    /// The question that the child died of, or hung in, with what happened. It has no answer; those behind it have none
    /// either.
    pub fn told_each<Ask: Serialize, Tell: DeserializeOwned>(
        &mut self,
        questions: &[Q],
        ask: &Ask,
        mut take: impl FnMut(Tell) -> Taken,
    ) -> Result<(), (Q, ChildError)> {
        let Some(last) = questions.last() else { return Ok(()) };
        let (mut taken, mut outcome) = (0, Ok(Taken::Good));
        let mut one = |answer: &[u8]| {
            taken += 1;
            outcome = serde_json::from_slice(answer).map(&mut take).map_err(no_answer);
            matches!(outcome, Ok(Taken::Good))
        };
        let asked = match serde_json::to_vec(ask) {
            Ok(bytes) => self.child.request_each(&bytes, questions.len(), &mut one),
            Err(error) => Err(no_answer(error)),
        };
        let at = |index: usize| *questions.get(index).unwrap_or(last);
        match asked.and(outcome) {
            Ok(Taken::Suspect) => self.record_death(at(taken - 1)),
            Ok(_) => {}
            Err(error) => {
                let fatal = at(taken);
                self.record_death(fatal);
                return Err((fatal, error));
            }
        }
        Ok(())
    }

    /// How many of these, from the first on, the child has survived so far.
    #[must_use]
    pub fn count_survived(&self, questions: &[Q]) -> usize {
        questions.iter().take_while(|question| !self.is_left_alone(**question)).count()
    }

    /// Has the child died of this so often that it is left alone?
    #[must_use]
    pub fn is_left_alone(&self, question: Q) -> bool {
        self.deaths.get(&question).is_some_and(|deaths| *deaths >= DEATHS_MAX)
    }

    /// The library died of this question, or wrote beyond its structures: it has hurt nothing outside its margin, but
    /// is not trusted any further.
    pub fn record_death(&mut self, question: Q) {
        *self.deaths.entry(question).or_default() += 1;
        self.end_child();
    }
}

fn no_answer(error: serde_json::Error) -> ChildError {
    ChildError::NoAnswer(error.to_string())
}
