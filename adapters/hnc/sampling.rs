//! The controller's own sampling: 16 channels, one value per millisecond, ten thousand deep.
//!
//! The first channel always is the system's counter of milliseconds (F register of the system, word 149). By it a missing
//! millisecond is counted, and a library that gives the same values twice is seen through.

use adapter_core::integer::length_to_i64;
use nclink::sample::{ItemColumn, SampleBlock};
use serde::{Deserialize, Serialize};

/// Sampling channels of V1.
pub const SAMPLED_MAX: usize = 16;
/// At most so many values per channel are taken at a time.
pub const POINTS_MAX: usize = 2000;

/// `SAMPL` type 110: words of the system's F registers; word 149, two bytes.
const COUNTER: SampledItem = SampledItem::OfRegister { kind: 110, offset: 149, length: 2 };
/// Actual speed and load current of an axis.
const ACT_VEL: i32 = 5;
const ACT_TRQ: i32 = 6;

/// What one sampling channel holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum SampledItem {
    /// A property of a logical axis (types below 100).
    OfAxis {
        /// `SAMPL` type of the header, below 100.
        kind: i32,
        /// Number of the logical axis.
        axis: i32,
    },
    /// A register or system value (types from 101).
    OfRegister {
        /// `SAMPL` type of the header, from 101.
        kind: i32,
        /// The word within the registers of this type.
        offset: i32,
        /// Bytes of the value from that word on.
        length: i32,
    },
}

/// What the library gave: per sampling channel the values since the last time.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Columns {
    /// One column per sampling channel, the counter first.
    pub values: Vec<Vec<i32>>,
}

/// How the sampling has been doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sampled {
    /// Milliseconds that were taken, one row each.
    pub instants: u64,
    /// Milliseconds that the counter shows and that never came.
    pub missing: u64,
    /// Milliseconds that came twice.
    pub repeated: u64,
}

/// Which channels, and where the counter stands.
#[derive(Debug, Clone, Default)]
pub struct Sampling {
    items: Vec<SampledItem>,
    names: Vec<String>,
    /// Counter, and time of the last millisecond, ms since 1970 on the gateway's clock.
    last: Option<(u16, i64)>,
    counts: Sampled,
}

impl Sampling {
    /// Load current of the spindle and of these axes, and the spindle's speed.
    #[must_use]
    pub fn from_axes(spindle: i32, axes: &[i32]) -> Self {
        let mut sampling = Self { items: vec![COUNTER], ..Self::default() };
        sampling.add(ACT_TRQ, spindle, "CURRENT");
        sampling.add(ACT_VEL, spindle, "SPEED");
        axes.iter().for_each(|axis| sampling.add(ACT_TRQ, *axis, "CURRENT"));
        sampling
    }

    /// The same after the library was loaded anew: what was counted stays, the counter begins where it stands.
    #[must_use]
    pub fn with_counts_of(self, before: &Self) -> Self {
        Self { counts: before.counts, ..self }
    }

    fn add(&mut self, kind: i32, axis: i32, what: &str) {
        if self.items.len() < SAMPLED_MAX {
            self.items.push(SampledItem::OfAxis { kind, axis });
            self.names.push(format!("AXIS@{axis}/MOTOR/{what}"));
        }
    }

    /// What the library is told to sample.
    #[must_use]
    pub fn items(&self) -> &[SampledItem] {
        &self.items
    }

    /// How it has been doing.
    #[must_use]
    pub fn counts(&self) -> Sampled {
        self.counts
    }

    /// The columns as blocks without gaps. `now_ms` is when they were fetched: the newest value is at most that old.
    pub fn build_blocks(&mut self, columns: &Columns, now_ms: i64) -> Vec<SampleBlock> {
        let Some((counter, values)) = columns.values.split_first() else { return Vec::new() };
        let rows = values.iter().map(Vec::len).chain([counter.len()]).min().unwrap_or(0);
        let mut blocks: Vec<SampleBlock> = Vec::new();
        for row in 0..rows {
            // The register has 16 bits.
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the low half is meant")]
            let count = counter[row] as u16;
            let Some(step) = self.count_step(count) else { continue };
            let newest = length_to_i64(rows - row);
            let at_ms = self.last.map_or(now_ms - newest, |(_, last_ms)| last_ms + i64::from(step));
            self.last = Some((count, at_ms));
            if blocks.is_empty() || step > 1 {
                blocks.push(self.build_empty_block(at_ms));
            }
            if let Some(block) = blocks.last_mut() {
                block.instants += 1;
                let columns = block.columns.iter_mut().zip(values);
                columns.for_each(|(column, values)| column.values.push(Some(f64::from(values[row]))));
            }
            self.counts.instants += 1;
        }
        blocks
    }

    /// Milliseconds since the last one; `None` for one that was there already.
    fn count_step(&mut self, count: u16) -> Option<u16> {
        let Some((last, _)) = self.last else { return Some(1) };
        match count.wrapping_sub(last) {
            0 | 0x8000.. => {
                self.counts.repeated += 1;
                None
            }
            step => {
                self.counts.missing += u64::from(step - 1);
                Some(step)
            }
        }
    }

    fn build_empty_block(&self, begin_ms: i64) -> SampleBlock {
        let column =
            |path: &String| ItemColumn { path: path.clone(), unit: None, values: Vec::new(), step_ms: 1.0, word: None };
        let columns = self.names.iter().map(column).collect();
        SampleBlock { channel: "hnc".to_owned(), begin_ms, interval_ms: 1.0, instants: 0, columns, clock: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(counts: std::ops::Range<i32>) -> Columns {
        let counter: Vec<i32> = counts.clone().map(|count| count & 0xffff).collect();
        let values: Vec<i32> = counts.map(|count| count * 10).collect();
        Columns { values: vec![counter, values.clone(), values] }
    }

    #[test]
    fn milliseconds_follow_each_other_over_the_end_of_the_counter() {
        let mut sampling = Sampling::from_axes(5, &[]);
        assert_eq!(sampling.items().len(), 3);
        let first = sampling.build_blocks(&columns(65_400..65_500), 1_000_000);
        let second = sampling.build_blocks(&columns(65_500..65_700), 1_000_205);
        assert_eq!((first.len(), second.len()), (1, 1));
        assert_eq!(first[0].begin_ms, 999_900);
        assert_eq!((second[0].begin_ms, second[0].instants), (1_000_000, 200), "no gap, whenever it was fetched");
        assert_eq!(second[0].columns[0].values[0], Some(655_000.0));
        assert_eq!(sampling.counts(), Sampled { instants: 300, missing: 0, repeated: 0 });
    }

    #[test]
    fn a_gap_splits_and_a_repetition_is_dropped() {
        let mut sampling = Sampling::from_axes(5, &[0, 2]);
        sampling.build_blocks(&columns(0..100), 1000);
        let again = sampling.build_blocks(&columns(50..150), 1050);
        assert_eq!((again[0].instants, again[0].columns[0].values[0]), (50, Some(1000.0)));
        let later = sampling.build_blocks(&columns(160..200), 1100);
        assert_eq!(later[0].begin_ms, again[0].begin_ms + 60);
        assert_eq!(sampling.counts(), Sampled { instants: 190, missing: 10, repeated: 50 });
        assert!(sampling.build_blocks(&Columns::default(), 0).is_empty());
    }
}
