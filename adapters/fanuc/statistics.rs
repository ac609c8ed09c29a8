//! What the round trips cost.

use adapter_core::integer::{saturate_to_us, widen_to_u64};
use std::time::Duration;

/// Bounds of the buckets, microseconds; the last bucket is open.
const BOUNDS_US: [u64; 20] = [
    20, 50, 100, 200, 300, 500, 750, 1_000, 2_000, 3_000, 5_000, 7_500, 10_000, 15_000, 25_000, 50_000, 100_000,
    250_000, 1_000_000, 3_000_000,
];

/// Counts of one connection.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Statistics {
    /// Frames there and back.
    pub frames: u64,
    /// Questions that these frames carried.
    pub blocks: u64,
    /// Bytes sent in all of them.
    pub sent_bytes: u64,
    /// Bytes received in all of them.
    pub received_bytes: u64,
    /// Time spent waiting for answers.
    pub waited: Duration,
    /// The longest round trip so far.
    pub longest: Duration,
    buckets: [u64; 21],
}

impl Statistics {
    /// Counts a request with so many questions and bytes, and its answer, which took `took`.
    pub fn count_frame(&mut self, blocks: usize, sent: usize, received: usize, took: Duration) {
        self.frames += 1;
        self.blocks += widen_to_u64(blocks);
        self.sent_bytes += widen_to_u64(sent);
        self.received_bytes += widen_to_u64(received);
        self.waited += took;
        self.longest = self.longest.max(took);
        let us = saturate_to_us(took);
        self.buckets[BOUNDS_US.partition_point(|bound| *bound < us)] += 1;
    }

    /// So many percent of the round trips took at most this long (the upper bound of the bucket); zero without any.
    #[must_use]
    pub fn percentile(&self, percent: u64) -> Duration {
        let rank = (self.frames * percent).div_ceil(100).max(1);
        let mut seen = 0;
        for (count, bound) in self.buckets.iter().zip(BOUNDS_US) {
            seen += count;
            if seen >= rank {
                return Duration::from_micros(bound).min(self.longest);
            }
        }
        self.longest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_bounds_of_buckets() {
        let mut statistics = Statistics::default();
        assert_eq!(statistics.percentile(50), Duration::ZERO);
        for us in 1..=100 {
            statistics.count_frame(3, 10, 20, Duration::from_micros(us * 10));
        }
        assert_eq!(statistics.percentile(50), Duration::from_micros(500));
        assert_eq!(statistics.percentile(99), Duration::from_micros(1000));
        assert_eq!((statistics.frames, statistics.blocks, statistics.sent_bytes), (100, 300, 1000));
    }
}
