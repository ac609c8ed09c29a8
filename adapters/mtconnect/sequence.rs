//! Which observations of a document are new. Pure: documents in, observations in their order out.
//!
//! | what the document says | what follows |
//! |---|---|
//! | another `instanceId`, or a next number before ours | the agent has started anew; its numbers mean something else |
//! | a first number behind ours | what lies between was overwritten before it was read |
//! | a number before ours | it has been read already |

use crate::streams::{Header, Observation};

/// What was overwritten before it was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Gap {
    /// Number of the first observation that is missing.
    pub(crate) from: u64,
    /// How many are missing, of all devices of the agent.
    pub(crate) count: u64,
}

/// Why a document cannot be read on from the one before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Break {
    /// The agent has started anew.
    Restarted,
    /// Its devices were changed while it ran.
    ModelChanged,
    /// It has overwritten what comes next: `current` tells what changed meanwhile.
    Overrun,
}

/// How to go on after a connection has been made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Resume {
    /// Number to ask from; `None` where the agent does not tell numbers.
    pub(crate) from: Option<u64>,
    pub(crate) gap: Option<Gap>,
    /// Has the agent started anew since the last document?
    pub(crate) is_restart: bool,
}

/// How far an agent has been read.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct SequenceTrack {
    instance: Option<String>,
    model_changed_at: Option<String>,
    next: Option<u64>,
    /// Number of the oldest observation that the agent still had when it was last noticed that others are gone.
    oldest: Option<u64>,
    /// Observations that came although they had been read.
    pub(crate) repeated_count: u64,
}

/// What is new in a document.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct NewObservations {
    /// In the order of their numbers.
    pub(crate) observations: Vec<Observation>,
    /// Is there certainly no other that the agent has now?
    pub(crate) is_newest: bool,
}

impl SequenceTrack {
    /// The number to ask from.
    pub(crate) fn next(&self) -> Option<u64> {
        self.next
    }

    /// Looks at the answer to `current` after a connection was made: where to go on. `newest` is the greatest number in it.
    pub(crate) fn resume(&mut self, header: &Header, newest: Option<u64>) -> Resume {
        let behind = header.next_sequence.or_else(|| newest.map(|newest| newest.saturating_add(1)));
        let is_known = self.instance.is_some() && self.next.is_some();
        let is_same = self.instance == header.instance_id && behind >= self.next;
        let known_next = self.next.filter(|_| is_known && is_same);
        let first = header.first_sequence.max(self.oldest.take().filter(|_| is_same));
        let resume = match known_next {
            Some(next) => {
                let gap = first.filter(|first| *first > next).map(|first| Gap { from: next, count: first - next });
                Resume { from: Some(first.unwrap_or(next).max(next)), gap, is_restart: false }
            }
            // What a new start of the agent has told so far has not been read yet; of an agent that is met for the first time it is the past.
            None if is_known => Resume { from: first.or(behind), gap: None, is_restart: true },
            None => Resume { from: behind, gap: None, is_restart: false },
        };
        self.instance.clone_from(&header.instance_id);
        self.model_changed_at.clone_from(&header.model_changed_at);
        self.next = resume.from;
        resume
    }

    /// Takes a document of the answer to `sample`.
    ///
    /// # Errors
    /// It belongs to another start of the agent or to other devices, or others before it are gone.
    pub(crate) fn accept(&mut self, header: &Header, observations: Vec<Observation>) -> Result<NewObservations, Break> {
        let goes_back = header.next_sequence.is_some_and(|next| Some(next) < self.next);
        if header.instance_id != self.instance || goes_back {
            return Err(Break::Restarted);
        }
        if header.model_changed_at != self.model_changed_at {
            return Err(Break::ModelChanged);
        }
        let expected = self.next.unwrap_or(0);
        if self.next.is_some() && header.first_sequence > self.next {
            self.oldest = header.first_sequence;
            return Err(Break::Overrun);
        }
        let count = observations.len();
        let is_new = |observation: &Observation| observation.sequence.is_some_and(|sequence| sequence >= expected);
        let mut fresh: Vec<Observation> = observations.into_iter().filter(is_new).collect();
        fresh.sort_by_key(|observation| observation.sequence);
        fresh.dedup_by_key(|observation| observation.sequence);
        self.repeated_count += adapter_core::integer::widen_to_u64(count - fresh.len());
        let behind = fresh.last().and_then(|last| last.sequence).map(|last| last.saturating_add(1));
        self.next = self.next.max(behind).max(header.next_sequence);
        Ok(NewObservations { is_newest: fresh.is_empty(), observations: fresh })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(instance: &str, first: u64, next: u64) -> Header {
        Header {
            instance_id: Some(instance.to_owned()),
            first_sequence: Some(first),
            next_sequence: Some(next),
            ..Header::default()
        }
    }

    fn observe(sequences: &[u64]) -> Vec<Observation> {
        let of = |sequence: &u64| Observation {
            item: "a".to_owned(),
            element: "Load".to_owned(),
            sub_type: None,
            component: String::new(),
            sequence: Some(*sequence),
            timestamp: String::new(),
            text: sequence.to_string(),
            condition: None,
        };
        sequences.iter().map(of).collect()
    }

    fn numbers(fresh: &NewObservations) -> Vec<u64> {
        fresh.observations.iter().filter_map(|observation| observation.sequence).collect()
    }

    #[test]
    fn each_is_taken_once_and_in_order() {
        let mut track = SequenceTrack::default();
        let resume = track.resume(&header("1", 1, 10), Some(9));
        assert_eq!(resume, Resume { from: Some(10), gap: None, is_restart: false });
        let fresh = track.accept(&header("1", 1, 13), observe(&[12, 10, 9, 11, 10])).expect("goes on");
        assert_eq!((numbers(&fresh), track.repeated_count, track.next()), (vec![10, 11, 12], 2, Some(13)));
        // Other devices of the agent have the numbers between.
        let fresh = track.accept(&header("1", 1, 20), observe(&[17])).expect("goes on");
        assert_eq!((numbers(&fresh), track.next()), (vec![17], Some(20)));
        // After a broken line it goes on where it was.
        assert_eq!(
            track.resume(&header("1", 5, 40), Some(39)),
            Resume { from: Some(20), gap: None, is_restart: false }
        );
    }

    #[test]
    fn what_was_overwritten_is_counted() {
        let mut track = SequenceTrack::default();
        track.resume(&header("1", 1, 10), Some(9));
        let resume = track.resume(&header("1", 25, 90), Some(89));
        assert_eq!(resume, Resume { from: Some(25), gap: Some(Gap { from: 10, count: 15 }), is_restart: false });
        // Overwritten while the answer comes: nothing of that document counts until it is known how much is gone.
        assert_eq!(track.accept(&header("1", 30, 40), observe(&[30, 31])), Err(Break::Overrun));
        let unnumbered = Header { first_sequence: None, ..header("1", 0, 40) };
        let resume = track.resume(&unnumbered, Some(39));
        assert_eq!(resume, Resume { from: Some(30), gap: Some(Gap { from: 25, count: 5 }), is_restart: false });
        assert_eq!(numbers(&track.accept(&header("1", 30, 40), observe(&[30, 31])).expect("goes on")), [30, 31]);
    }

    #[test]
    fn another_start_is_noticed_in_the_stream_and_after_a_broken_line() {
        let mut track = SequenceTrack::default();
        track.resume(&header("1", 1, 10), Some(9));
        assert_eq!(track.accept(&header("2", 1, 11), observe(&[10])), Err(Break::Restarted));
        assert_eq!(track.accept(&header("1", 1, 4), observe(&[3])), Err(Break::Restarted), "numbers that go back");
        let changed = Header { model_changed_at: Some("t".to_owned()), ..header("1", 1, 11) };
        assert_eq!(track.accept(&changed, observe(&[10])), Err(Break::ModelChanged));
        let resume = track.resume(&header("2", 1, 50), Some(49));
        assert_eq!(
            resume,
            Resume { from: Some(1), gap: None, is_restart: true },
            "what the new start has told is read"
        );
        assert!(track.resume(&header("2", 1, 0), None).is_restart);
    }

    #[test]
    fn an_agent_without_numbers_in_the_head_is_followed_by_those_of_its_observations() {
        let mut track = SequenceTrack::default();
        let head = Header { instance_id: Some("1".to_owned()), ..Header::default() };
        assert_eq!(track.resume(&head, Some(9)).from, Some(10));
        let fresh = track.accept(&head, observe(&[10, 11])).expect("goes on");
        assert_eq!((numbers(&fresh), track.next()), (vec![10, 11], Some(12)));
    }

    proptest::proptest! {
        /// Any documents in any order: no number is taken twice between two starts.
        #[test]
        fn nothing_is_taken_twice(documents in proptest::collection::vec((0_u64..40, 0_u64..40, proptest::collection::vec(0_u64..40, 0..8)), 0..30)) {
            let (mut track, mut seen) = (SequenceTrack::default(), std::collections::BTreeSet::new());
            track.resume(&header("1", 0, 0), None);
            for (first, next, sequences) in documents {
                if let Ok(fresh) = track.accept(&header("1", first, next), observe(&sequences)) {
                    for number in numbers(&fresh) {
                        proptest::prop_assert!(seen.insert(number), "{}", number);
                    }
                }
            }
        }
    }
}
