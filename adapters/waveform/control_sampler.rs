//! The load current out of a controller's own sampling channels, as the same blocks as those of a stream.
//!
//! A controller samples at 1 ms and uploads some hundred values at a time (NC-Link: a message; HNC: what the library gives).
//! It says of each block when its first value was true, on its own clock; that is mapped to the gateway's as the clock of
//! any sampler. A value that is none is a gap, as is a time that is missing; values that come twice are taken once.
//!
//! What is sampled is not the current of a phase but its amplitude, as the drive knows it ([`WaveformHeader::with_amplitude`]).

use super::frame::WaveformHeader;
use super::intake::{Block, Intake, count_missing, end_ns};
use crate::clock::TimeNs;
use crate::nclink::sample::{self, ItemColumn};
use adapter_core::driver::SourceProblem;
use adapter_core::integer::{clamp_count, count_to_f64};

/// Resolution in which the values are kept, A: 0.01, up to 327 A.
const SCALE_A: f64 = 0.01;
const FULL_SCALE: i16 = i16::MAX;
/// How the path of a load current ends.
const CURRENT: &str = "/MOTOR/CURRENT";
const MS_NS: f64 = 1e6;

/// Blocks of a controller in, blocks of the spindle's load current out.
#[derive(Debug, Clone)]
pub struct SampledCurrent {
    axis: Option<u32>,
    /// A per unit of a value.
    ampere: f64,
    intake: Intake,
    due_ns: Option<TimeNs>,
    /// Why the last block has no current in A.
    problem: Option<SourceProblem>,
}

impl SampledCurrent {
    /// The current of this axis, or the first load current of a block. Where the device's model tells a unit, that counts; `ampere` is
    /// how many amperes a value of 1 is else.
    #[must_use]
    pub fn new(axis: Option<u32>, ampere: f64) -> Self {
        Self { axis, ampere, intake: Intake::default(), due_ns: None, problem: None }
    }

    /// What has come so far.
    #[must_use]
    pub fn intake(&self) -> &Intake {
        &self.intake
    }

    /// Why the last block has no current in A, where its unit does not fit.
    #[must_use]
    pub fn problem(&self) -> Option<&SourceProblem> {
        self.problem.as_ref()
    }

    /// The current out of a block of the controller's that arrived at `arrived_ns`, in pieces without a gap.
    pub fn extract_blocks(&mut self, block: &sample::SampleBlock, arrived_ns: TimeNs) -> Vec<Block> {
        let wanted = |column: &&ItemColumn| column.step_ms > 0.0 && self.is_current(&column.path);
        let Some(column) = block.columns.iter().find(wanted) else { return Vec::new() };
        let values = match column.convert_values("A") {
            Ok(values) => values,
            Err(why) => {
                let unit = column.unit.as_deref().unwrap_or_default();
                self.problem = Some(SourceProblem {
                    what: format!(
                        "the sampled current has no value: the device gives {} in {unit:?}, {why}",
                        column.path
                    ),
                    next: "Correct the unit in the device's model".to_owned(),
                });
                return Vec::new();
            }
        };
        self.problem = None;
        let ampere = if column.unit.is_some() { 1.0 } else { self.ampere };
        let header = self.header_of(1e3 / column.step_ms);
        let begin_ns = block.begin_ms.saturating_mul(1_000_000);
        let mut blocks = Vec::new();
        let mut at = 0;
        for part in values.split(Option::is_none) {
            let part: Vec<Option<f64>> = part.iter().map(|value| value.map(|value| value * ampere)).collect();
            blocks.extend(self.build_block(&header, begin_ns, at, &part, column.step_ms, arrived_ns));
            at += part.len() + 1;
        }
        blocks
    }

    fn is_current(&self, path: &str) -> bool {
        path.strip_suffix(CURRENT).is_some_and(|axis| self.axis.is_none_or(|number| axis == format!("AXIS@{number}")))
    }

    /// A new rate begins anew.
    fn header_of(&mut self, rate_hz: f64) -> WaveformHeader {
        let header = WaveformHeader::with_amplitude(rate_hz, SCALE_A, FULL_SCALE);
        if self.intake.header() != Some(&header) {
            self.due_ns = None;
            self.intake.record_connection(header.clone());
        }
        header
    }

    /// Values without a gap between them, the first of which is number `at` of its block.
    fn build_block(
        &mut self,
        header: &WaveformHeader,
        begin_ns: TimeNs,
        at: usize,
        part: &[Option<f64>],
        step_ms: f64,
        arrived_ns: TimeNs,
    ) -> Option<Block> {
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let after_ns = |count: usize| (count_to_f64(count) * step_ms * MS_NS) as i64;
        let first_ns = begin_ns.saturating_add(after_ns(at));
        let lost = self.due_ns.map_or(0, |due_ns| count_missing(header, due_ns, first_ns));
        // A device whose clock was set back begins anew; a few values that come twice are passed over.
        let again = clamp_count(lost.saturating_neg(), usize::MAX);
        let again = if again > part.len() { 0 } else { again };
        let raw: Vec<i16> = part[again..].iter().flatten().map(|value| counts_of(*value)).collect();
        if raw.is_empty() {
            return None;
        }
        let first_ns = first_ns.saturating_add(after_ns(again));
        self.due_ns = Some(end_ns(header, first_ns, raw.len()));
        Some(self.intake.accept_samples(header, first_ns, lost.max(0).unsigned_abs(), raw, arrived_ns))
    }
}

/// A current in the resolution in which it is kept.
#[expect(clippy::cast_possible_truncation, reason = "clamped; what is beyond counts as clipped")]
fn counts_of(current_a: f64) -> i16 {
    let full = f64::from(FULL_SCALE);
    (current_a / SCALE_A).round().clamp(-full, full) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(begin_ms: i64, values: &[Option<f64>]) -> sample::SampleBlock {
        let column = |path: &str| ItemColumn {
            path: path.to_owned(),
            unit: None,
            values: values.to_vec(),
            step_ms: 1.0,
            word: None,
        };
        let columns = vec![column("AXIS@0/MOTOR/CURRENT"), column("AXIS@5/MOTOR/CURRENT")];
        sample::SampleBlock {
            channel: "s".to_owned(),
            begin_ms,
            interval_ms: 1.0,
            instants: values.len(),
            columns,
            clock: None,
        }
    }

    #[test]
    fn blocks_follow_each_other_and_gaps_are_counted() {
        let mut current = SampledCurrent::new(Some(5), 1.0);
        let first = current.extract_blocks(&block(1000, &[Some(1.5); 100]), 1_100_000_000);
        assert_eq!((first.len(), first[0].gap, first[0].raw[0], first[0].raw.len()), (1, 0, 150, 100));
        assert_eq!(current.extract_blocks(&block(1100, &[Some(1.0); 50]), 1_150_000_000)[0].gap, 0);
        assert_eq!(current.extract_blocks(&block(1180, &[Some(1.0); 20]), 1_200_000_000)[0].gap, 30);
        let counts = current.intake().counts();
        assert_eq!((counts.samples, counts.gaps, counts.missing), (170, 1, 30));
        assert_eq!(current.intake().header().map(|header| header.rate_hz), Some(1000.0));
    }

    #[test]
    fn a_value_that_is_none_splits_and_one_that_comes_twice_is_taken_once() {
        let mut current = SampledCurrent::new(None, 0.001);
        let blocks = current.extract_blocks(&block(0, &[Some(2000.0), None, None, Some(4000.0)]), 4_000_000);
        let found: Vec<(u64, &[i16])> = blocks.iter().map(|block| (block.gap, block.raw.as_slice())).collect();
        assert_eq!(found, [(0, &[200][..]), (2, &[400][..])]);
        let again = current.extract_blocks(&block(2, &[Some(9.0), Some(9.0), Some(5000.0)]), 5_000_000);
        assert_eq!((again.len(), again[0].gap, again[0].raw.as_slice()), (1, 0, &[500][..]));
        assert!(current.extract_blocks(&block(3, &[Some(1.0); 2]), 6_000_000).is_empty(), "all of it was there");
    }

    /// The unit of the model, as for what is polled; the factor of the address counts only without one.
    #[test]
    fn every_unit_of_the_table_gives_amperes_or_a_reason() {
        let mut right = 0;
        let units = crate::channel::unit::list_symbols().chain(["furlong"]);
        for unit in units {
            let mut of_unit = block(0, &[Some(200.0); 3]);
            of_unit.columns.iter_mut().for_each(|column| column.unit = Some(unit.to_owned()));
            let mut current = SampledCurrent::new(Some(5), 7.0);
            let found = current.extract_blocks(&of_unit, 3_000_000).first().map(|block| block.raw[0]);
            let wanted =
                crate::conversion::find_conversion(unit, "A").map(|to_a| counts_of(to_a.convert_number(200.0)));
            assert_eq!(found, wanted, "{unit}");
            assert_eq!(current.problem().is_some(), wanted.is_none(), "{unit}");
            right += usize::from(found.is_some());
        }
        assert!(right >= 8, "{right} units of a current");
        let mut current = SampledCurrent::new(Some(5), 7.0);
        assert_eq!(current.extract_blocks(&block(0, &[Some(2.0)]), 1_000_000)[0].raw, [1400], "without a unit");
    }

    #[test]
    fn a_current_beyond_the_scale_is_clipped_and_others_are_not_taken() {
        let mut current = SampledCurrent::new(Some(5), 1.0);
        assert_eq!(current.extract_blocks(&block(0, &[Some(400.0), Some(-400.0)]), 2_000_000)[0].clipped, 2);
        assert!(SampledCurrent::new(Some(7), 1.0).extract_blocks(&block(0, &[Some(1.0)]), 1_000_000).is_empty());
    }
}
