//! Edges whose cuts were made and whose cutting power could not be told: of these the wear is never seen, which has to be said.

use crate::{Estimates, NoEstimate, State};
use std::collections::BTreeMap;

/// Edges that are told apart; further ones are not remembered.
const EDGES_MAX: usize = 64;

/// Why the cuts of an edge are not seen, by edge. Not stored: the next cut tells it again.
#[derive(Debug, Clone, Default)]
pub(super) struct UnseenEdges {
    reasons: BTreeMap<String, NoEstimate>,
}

impl UnseenEdges {
    /// Takes a tick: while it cuts, or feeds with an unknown state, the power of an edge is told or is not.
    pub(super) fn watch_edge(&mut self, edge: &str, estimates: &Estimates) {
        let unlearned = |reason: NoEstimate| matches!(reason, NoEstimate::NotLearned | NoEstimate::Extrapolated { .. });
        let found = match (estimates.state, estimates.cutting_power_w) {
            (State::Cutting, Ok(_)) => {
                self.reasons.remove(edge);
                return;
            }
            (State::Cutting, Err(reason)) if unlearned(reason) => Some(reason),
            (State::Unknown, _) => estimates.unknown_because.filter(|reason| unlearned(*reason)),
            _ => None,
        };
        if let Some(reason) = found
            && (self.reasons.len() < EDGES_MAX || self.reasons.contains_key(edge))
        {
            self.reasons.insert(edge.to_owned(), reason);
        }
    }

    pub(super) fn find_reason(&self, edge: &str) -> Option<NoEstimate> {
        self.reasons.get(edge).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Estimate;

    #[test]
    fn an_edge_whose_speed_was_never_learned_is_told_until_its_power_is_known() {
        let mut edges = UnseenEdges::default();
        let cutting = Estimates { state: State::Cutting, ..Estimates::without_samples(0) };
        edges.watch_edge("T5", &Estimates { cutting_power_w: Err(NoEstimate::NotLearned), ..cutting });
        edges.watch_edge("T1", &Estimates { cutting_power_w: Err(NoEstimate::NotSettled), ..cutting });
        assert_eq!((edges.find_reason("T5"), edges.find_reason("T1")), (Some(NoEstimate::NotLearned), None));
        edges.watch_edge("T5", &Estimates { cutting_power_w: Ok(Estimate { value: 500.0, sd: 9.0 }), ..cutting });
        assert_eq!(edges.find_reason("T5"), None);
    }
}
