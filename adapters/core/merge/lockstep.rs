//! The pipeline without threads: sources that bring their own time, read in the order of their answers.

use super::{Delay, Merge, SourceId, SourcePlan};
use crate::clock::TimeNs;
use crate::driver::{Pull, SourceError};
use crate::reading::Reading;
use crate::sample::Sample;

/// Sources and merge in step: as fast as possible and the same every time.
pub struct Lockstep {
    sources: Vec<Feed>,
    merge: Merge,
    readings: Vec<Reading>,
}

struct Feed {
    source: Box<dyn Pull>,
    last_error: Option<SourceError>,
}

impl Lockstep {
    /// These sources, in the order of precedence.
    #[must_use]
    pub fn new(sources: Vec<Box<dyn Pull>>, delay: Delay) -> Self {
        let plans: Vec<SourcePlan> = sources.iter().map(|source| SourcePlan::of_pull(source.as_ref())).collect();
        Self::from_plans(sources, &plans, delay)
    }

    /// The same with plans that say who stands in for whom, one for each source in the same order.
    #[must_use]
    pub fn from_plans(sources: Vec<Box<dyn Pull>>, plans: &[SourcePlan], delay: Delay) -> Self {
        let sources = sources.into_iter().map(|source| Feed { source, last_error: None }).collect();
        Self { sources, merge: Merge::new(plans, delay), readings: Vec::new() }
    }

    /// When the next answer of any source arrives; `None` when all have ended. A recording is sampled row by row by
    /// ticking at just these times with no delay.
    #[must_use]
    pub fn next_ns(&self) -> Option<TimeNs> {
        self.sources.iter().filter_map(|feed| feed.source.next_ns()).min()
    }

    /// Reads everything that has arrived by `now_ns` and samples at `now_ns` minus the delay. `false` when every source
    /// has ended and there is nothing left to read; the sample is written all the same.
    pub fn sample_into(&mut self, sample: &mut Sample, now_ns: TimeNs) -> bool {
        self.sample_seen_into(sample, now_ns, |_, _| {})
    }

    /// The same, and shows every poll to `see` before the merge takes it: its readings, or that it failed (`None`).
    pub fn sample_seen_into(
        &mut self,
        sample: &mut Sample,
        now_ns: TimeNs,
        mut see: impl FnMut(SourceId, Option<&[Reading]>),
    ) -> bool {
        let mut alive = false;
        for index in 0..self.sources.len() {
            alive |= self.read_due(index, now_ns, &mut see);
        }
        let at_ns = now_ns.saturating_sub(self.merge.delay_ns());
        self.merge.sample_into(sample, at_ns);
        alive
    }

    fn read_due(&mut self, index: usize, now_ns: TimeNs, see: &mut impl FnMut(SourceId, Option<&[Reading]>)) -> bool {
        let feed = &mut self.sources[index];
        while let Some(at_ns) = feed.source.next_ns() {
            if at_ns > now_ns {
                return true;
            }
            match feed.source.pull_readings(&mut self.readings) {
                Ok(()) => {
                    see(SourceId(index), Some(&self.readings));
                    feed.last_error = None;
                }
                Err(error) => {
                    see(SourceId(index), None);
                    self.merge.record_failure(SourceId(index), at_ns, &error);
                    feed.last_error = Some(error);
                    if feed.source.next_ns() == Some(at_ns) {
                        return false;
                    }
                }
            }
            self.merge.push_all(SourceId(index), &mut self.readings);
        }
        false
    }

    /// The error of the source's last answer, if that failed.
    #[must_use]
    pub fn last_error(&self, source: SourceId) -> Option<&SourceError> {
        self.sources.get(source.0).and_then(|feed| feed.last_error.as_ref())
    }

    /// The merge, to be told of the lag of a source.
    pub fn merge_mut(&mut self) -> &mut Merge {
        &mut self.merge
    }

    /// The merge, for its counts.
    #[must_use]
    pub fn merge(&self) -> &Merge {
        &self.merge
    }
}
