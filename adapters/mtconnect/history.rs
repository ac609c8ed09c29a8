//! What has been read and lost so far, as facts and problems.

use crate::sequence::Gap;
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::driver::{Fact, SourceProblem};

/// A loss is told as a problem for so long: until somebody who looks once in a while has seen it. The counts stay.
const TOLD_NS: i64 = 600 * SECOND_NS;

/// Counts since the gateway was started.
#[derive(Debug, Clone, Default)]
pub(crate) struct ReadingHistory {
    pub(crate) observations: u64,
    pub(crate) lost_count: u64,
    gaps: u64,
    pub(crate) restarts: u64,
    pub(crate) model_changes: u64,
    pub(crate) connections: u64,
    /// Observations without a number or a time.
    pub(crate) unusable: u64,
    last_gap: Option<(TimeNs, Gap)>,
    last_restart_ns: Option<TimeNs>,
}

impl ReadingHistory {
    pub(crate) fn record_gap(&mut self, now_ns: TimeNs, gap: Gap) {
        self.gaps += 1;
        self.lost_count = self.lost_count.saturating_add(gap.count);
        self.last_gap = Some((now_ns, gap));
    }

    pub(crate) fn record_restart(&mut self, now_ns: TimeNs) {
        self.restarts += 1;
        self.last_restart_ns = Some(now_ns);
    }

    /// Forgets to tell what is long over.
    pub(crate) fn expire(&mut self, now_ns: TimeNs) {
        let is_recent = |at_ns: TimeNs| (0..TOLD_NS).contains(&now_ns.saturating_sub(at_ns));
        self.last_gap = self.last_gap.filter(|(at_ns, _)| is_recent(*at_ns));
        self.last_restart_ns = self.last_restart_ns.filter(|at_ns| is_recent(*at_ns));
    }

    #[expect(clippy::cast_precision_loss, reason = "counts")]
    pub(crate) fn collect_facts(&self) -> Vec<Fact> {
        let counts = [
            ("observations", self.observations),
            ("lost_observations", self.lost_count),
            ("gaps", self.gaps),
            ("agent_restarts", self.restarts),
            ("model_changes", self.model_changes),
            ("connections", self.connections),
            ("unusable_observations", self.unusable),
        ];
        counts.into_iter().map(|(name, count)| Fact::from_number(name, count as f64)).collect()
    }

    pub(crate) fn list_problems(&self) -> Vec<SourceProblem> {
        let gap = self.last_gap.map(|(_, gap)| SourceProblem {
            what: format!(
                "{} observations of the agent were overwritten before they were read, from number {} on",
                gap.count, gap.from
            ),
            next: "Give the agent a larger buffer (BufferSize), or look why its line was broken for so long".to_owned(),
        });
        let restart = self.last_restart_ns.map(|_| SourceProblem {
            what: "the agent was started anew: what it had not sent before is lost, and nobody knows how much"
                .to_owned(),
            next: "Look at the log of the agent if nobody has restarted it".to_owned(),
        });
        gap.into_iter().chain(restart).collect()
    }
}
