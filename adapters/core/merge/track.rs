//! The last readings of one channel from one source, in the order of their stamps.

use crate::channel::{ChannelId, Kind};
use crate::clock::TimeNs;
use crate::integer::convert_bounded;
use crate::reading::{Absence, Value};
use crate::sample::Slot;
use std::collections::VecDeque;

/// A track holds at least and at most this many readings.
const DEPTH: (i64, i64) = (8, 4096);

/// What follows from a source's period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PeriodLimits {
    /// The widest gap that is bridged.
    pub(super) gap_ns: i64,
    /// A reading this much older than the newest one means that a clock stepped.
    pub(super) horizon_ns: i64,
    depth: usize,
}

impl PeriodLimits {
    pub(super) fn new(period_ns: i64, delay_ns: i64) -> Self {
        let period_ns = period_ns.max(1);
        let gap_ns = period_ns.saturating_mul(super::GAP_PERIODS);
        let horizon_ns = gap_ns.saturating_add(delay_ns.max(0));
        let depth = (2 * (delay_ns / period_ns) + 8).clamp(DEPTH.0, DEPTH.1);
        Self { gap_ns, horizon_ns, depth: convert_bounded(depth, usize::MAX) }
    }
}

/// Where a reading went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Put {
    /// Behind all others.
    Newest,
    /// Between earlier readings.
    Between,
    /// In the place of one with the same stamp.
    Repeated,
    /// Nowhere: no tick to come can see it.
    TooLate,
    /// Behind all others, after readings from a clock running ahead were dropped.
    AfterStep,
}

struct TrackPoint {
    mid_ns: TimeNs,
    value: Result<Value, Absence>,
}

pub(super) struct ReadingTrack {
    continuous: bool,
    /// A meter that says exactly zero beside another number has seen nothing, or shows nothing at all.
    electric: bool,
    /// Position of the source in the merge's list.
    pub(super) source: usize,
    /// May its source deliver the channel while the one that the channel belongs to has no value?
    pub(super) stands_in: bool,
    /// Whether the source has the channel at all; `None` until it said so by a value or by [`Absence::NotSupported`]. A value once seen is
    /// proof for good: what is refused later is a fault and no other device.
    has_channel: Option<bool>,
    points: VecDeque<TrackPoint>,
    depth: usize,
}

impl ReadingTrack {
    pub(super) fn new(channel: ChannelId, source: usize, pace: PeriodLimits) -> Self {
        let continuous = channel.channel().kind == Kind::Continuous;
        let electric = channel.channel().is_electric();
        let points = VecDeque::with_capacity(pace.depth);
        Self { continuous, electric, source, stands_in: false, has_channel: None, points, depth: pace.depth }
    }

    /// Has its source said that the device does not have the channel, and never delivered a value?
    pub(super) fn lacks_channel(&self) -> bool {
        self.has_channel == Some(false)
    }

    /// Stamp of the newest reading.
    fn last_ns(&self) -> Option<TimeNs> {
        self.points.back().map(|point| point.mid_ns)
    }

    /// Puts a reading in its place.
    pub(super) fn insert_reading(
        &mut self,
        mid_ns: TimeNs,
        value: Result<Value, Absence>,
        last_tick_ns: TimeNs,
        pace: &PeriodLimits,
    ) -> Put {
        match &value {
            Ok(_) => self.has_channel = Some(true),
            Err(Absence::NotSupported) => self.has_channel = Some(self.has_channel == Some(true)),
            Err(_) => {}
        }
        let Some(last_ns) = self.last_ns().filter(|last_ns| mid_ns <= *last_ns) else {
            return self.insert(self.points.len(), TrackPoint { mid_ns, value }, Put::Newest);
        };
        let first_ns = self.points.front().map_or(last_ns, |point| point.mid_ns);
        if mid_ns < first_ns && first_ns <= last_tick_ns {
            return Put::TooLate;
        }
        if mid_ns < last_ns.saturating_sub(pace.horizon_ns) && last_ns > last_tick_ns {
            self.drop_after(mid_ns.saturating_add(pace.horizon_ns));
            let at = self.count_before(mid_ns);
            return self.insert(at, TrackPoint { mid_ns, value }, Put::AfterStep);
        }
        let at = self.count_before(mid_ns);
        match at.checked_sub(1).and_then(|at| self.points.get_mut(at)).filter(|point| point.mid_ns == mid_ns) {
            Some(point) => {
                point.value = value;
                Put::Repeated
            }
            None => self.insert(at, TrackPoint { mid_ns, value }, Put::Between),
        }
    }

    /// How many readings are not after `at_ns`.
    fn count_before(&self, at_ns: TimeNs) -> usize {
        self.points.partition_point(|point| point.mid_ns <= at_ns)
    }

    /// Never grows beyond the depth: the oldest reading makes room.
    fn insert(&mut self, at: usize, point: TrackPoint, put: Put) -> Put {
        let full = self.points.len() >= self.depth;
        match at {
            0 if full => return Put::TooLate,
            _ if full => {
                self.points.pop_front();
                self.points.insert(at - 1, point);
            }
            _ => self.points.insert(at, point),
        }
        put
    }

    /// Forgets the readings after `limit_ns`.
    pub(super) fn drop_after(&mut self, limit_ns: TimeNs) {
        self.points.truncate(self.count_before(limit_ns));
    }

    /// What is known at `at_ns`; forgets what no later tick can need.
    pub(super) fn evaluate_at(&mut self, at_ns: TimeNs, gap_ns: i64) -> Slot {
        while self.points.get(1).is_some_and(|point| point.mid_ns <= at_ns) {
            self.points.pop_front();
        }
        let Some(before) = self.points.front().filter(|point| point.mid_ns <= at_ns) else {
            return Slot::from_absence(Absence::NotYetRead);
        };
        let age_ns = at_ns - before.mid_ns;
        if let Some(value) = self.points.get(1).and_then(|after| self.interpolate_between(before, after, at_ns, gap_ns))
        {
            return Slot { value: Ok(Value::Number(value)), age_ns: 0 };
        }
        if age_ns > gap_ns {
            return Slot { value: Err(Absence::Stale), age_ns };
        }
        Slot { value: before.value.clone(), age_ns }
    }

    /// Linear between two numbers around the tick, when they are close enough together and of one kind: between nothing and
    /// something an electrical quantity was never measured, so the earlier number is held.
    fn interpolate_between(&self, before: &TrackPoint, after: &TrackPoint, at_ns: TimeNs, gap_ns: i64) -> Option<f64> {
        let width_ns = after.mid_ns.checked_sub(before.mid_ns).filter(|width_ns| *width_ns <= gap_ns)?;
        if !self.continuous || before.mid_ns == at_ns {
            return None;
        }
        let (from, to) = (before.value.as_ref().ok()?.as_number()?, after.value.as_ref().ok()?.as_number()?);
        if self.electric && (from == 0.0) != (to == 0.0) {
            return None;
        }
        Some(from + (to - from) * compute_share(at_ns - before.mid_ns, width_ns))
    }
}

#[expect(clippy::cast_precision_loss, reason = "both are within two periods, far below 2^53 ns")]
fn compute_share(part_ns: i64, whole_ns: i64) -> f64 {
    part_ns as f64 / whole_ns as f64
}
