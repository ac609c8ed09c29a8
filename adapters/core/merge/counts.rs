//! What happened to the readings of a source on their way into samples.

use super::Put;

/// Counters since the start; they only grow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MergeCounts {
    /// Readings that arrived, those that were dropped included.
    pub readings: u64,
    /// Readings older than one that had arrived before them.
    pub out_of_order: u64,
    /// Readings that arrived after the tick they belonged to; they still count for later ticks.
    pub late: u64,
    /// Readings too old to matter to any tick to come; dropped.
    pub too_late: u64,
    /// Readings with the stamp of an earlier one, which they replace.
    pub repeated: u64,
    /// Times that earlier readings turned out to be stamped by a clock running ahead; those were dropped.
    pub clock_steps: u64,
    /// Readings of channels that the source had not announced; dropped.
    pub unannounced: u64,
    /// Whole polls that failed.
    pub failures: u64,
    /// Slots that this source filled as a stand-in, because the one that the channel belongs to had no value.
    pub stepped_in: u64,
}

impl MergeCounts {
    pub(super) fn count_reading(&mut self, put: Put, late: bool) {
        self.late += u64::from(late && put != Put::TooLate);
        match put {
            Put::Newest => {}
            Put::Between => self.out_of_order += 1,
            Put::Repeated => self.repeated += 1,
            Put::TooLate => self.too_late += 1,
            Put::AfterStep => self.clock_steps += 1,
        }
    }
}
