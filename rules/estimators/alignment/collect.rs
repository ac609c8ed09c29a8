//! Transients out of a running machine: kept around every change of speed, without anything that was measured while it cut.

use super::speed::{PowerPoint, SpeedPoint, Transient};
use numerics::statistics::count_to_f64;
use std::collections::VecDeque;

/// A transient reaches so far before and behind the change of speed, s.
const BEFORE_S: f64 = 3.5;
const BEHIND_S: f64 = 4.5;
/// A longer transient is cut off, s.
const LONGEST_S: f64 = 30.0;
/// So many transients are kept, the newest; each of so many readings at most.
const TRANSIENTS_MAX: usize = 24;
const READINGS_MAX: usize = 4096;
/// The speed has changed when it moved by this share of itself and by at least so many rpm within half a second.
const CHANGE_SHARE: f64 = 0.02;
const CHANGE_RPM: f64 = 20.0;
/// Power is left out from so long before a cut is noticed to so long behind its end, s: a cut is noticed late, and a meter
/// shows it with its lag and window.
const CUT_BEFORE_S: f64 = 1.5;
const CUT_BEHIND_S: f64 = 2.5;
/// Marks of cutting that lie closer together than this are one cut, s.
const CUT_JOIN_S: f64 = 1.0;
const CUTS_MAX: usize = 64;
/// Within the change of speed at least this share of the power must be left.
const LEFT_SHARE: f64 = 0.8;
/// Nothing is known of a change with a longer gap in it, s.
const GAP_S: f64 = 1.0;

/// What has been collected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AlignmentData {
    /// Changes of speed that are kept to fit the lag from.
    pub transients: usize,
    /// Changes of speed that were not used because something was cut.
    pub while_cutting: u64,
    /// Has a transient come in since the last look?
    pub new: bool,
}

/// Collects transients from the readings of a controller and a meter as they come. Bounded in every direction.
#[derive(Debug, Clone, Default)]
pub struct Collector {
    speed: VecDeque<SpeedPoint>,
    power: VecDeque<PowerPoint>,
    changed_s: Option<(f64, f64)>,
    /// From and to, the oldest first.
    cuts: VecDeque<(f64, f64)>,
    transients: VecDeque<Transient>,
    data: AlignmentData,
    /// Has a transient come in that nobody has looked at?
    has_unseen: bool,
}

impl Collector {
    /// A collector that has seen nothing.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// At this time the machine cut, or may have. Told at every tick at which it does, within four seconds; what was
    /// measured about then is not used.
    pub fn record_cutting(&mut self, time_s: f64) {
        match self.cuts.back_mut().filter(|cut| (cut.0 - CUT_JOIN_S..=cut.1 + CUT_JOIN_S).contains(&time_s)) {
            Some(cut) => *cut = (cut.0.min(time_s), cut.1.max(time_s)),
            None => self.cuts.push_back((time_s, time_s)),
        }
        if self.cuts.len() > CUTS_MAX {
            self.cuts.pop_front();
        }
    }

    /// Takes a reading of the spindle speed. Readings come in the order of their stamps; one that goes back, or comes after
    /// a gap, begins anew.
    pub fn record_speed(&mut self, point: SpeedPoint) {
        let since_s = self.speed.back().map(|last| point.time_s - last.time_s);
        if since_s.is_some_and(|since_s| since_s <= 0.0 || since_s > GAP_S) {
            self.discard_collected();
        }
        let past = self.speed.iter().rev().find(|past| past.time_s <= point.time_s - 0.5).copied();
        let moved = past.is_some_and(|past| is_speed_change(past.speed_rpm, point.speed_rpm));
        if moved {
            let from_s = self.changed_s.map_or(point.time_s - 0.5, |(from_s, _)| from_s);
            self.changed_s = Some((from_s, point.time_s));
        }
        self.speed.push_back(point);
        trim_readings(&mut self.speed, |point| point.time_s, self.changed_s.map_or(point.time_s, |(from_s, _)| from_s));
        self.finish_transient(point.time_s);
    }

    /// Takes a reading of the power.
    pub fn record_power(&mut self, point: PowerPoint) {
        if self.power.back().is_some_and(|last| point.time_s <= last.time_s) {
            return;
        }
        self.power.push_back(point);
        trim_readings(&mut self.power, |point| point.time_s, self.changed_s.map_or(point.time_s, |(from_s, _)| from_s));
    }

    /// A source failed: what is half collected is of no use.
    pub fn discard_collected(&mut self) {
        self.speed.clear();
        self.power.clear();
        self.changed_s = None;
    }

    /// The change is over and its surroundings are complete.
    fn finish_transient(&mut self, now_s: f64) {
        let Some((from_s, to_s)) = self.changed_s else { return };
        let too_long = now_s - from_s > LONGEST_S;
        if !(now_s - to_s > BEHIND_S || too_long) {
            return;
        }
        self.changed_s = None;
        if too_long {
            return;
        }
        let within = |point: &&PowerPoint| point.time_s >= from_s - BEFORE_S;
        let free: Vec<PowerPoint> =
            self.power.iter().filter(within).filter(|point| !self.is_cut(point.time_s)).copied().collect();
        let of_change =
            |points: usize, point: &PowerPoint| points + usize::from((from_s..=to_s).contains(&point.time_s));
        let (all, left) = (self.power.iter().fold(0, of_change), free.iter().fold(0, of_change));
        if count_to_f64(left) < LEFT_SHARE * count_to_f64(all) {
            self.data.while_cutting += 1;
            return;
        }
        let speed = self.speed.iter().filter(|point| point.time_s >= from_s - BEFORE_S).copied().collect();
        if self.transients.len() >= TRANSIENTS_MAX {
            self.transients.pop_front();
        }
        self.transients.push_back(Transient { speed, power: free });
        self.data.new = true;
        self.has_unseen = true;
    }

    /// The newest transient, once.
    pub fn take_newest_transient(&mut self) -> Option<&Transient> {
        std::mem::take(&mut self.has_unseen).then(|| self.transients.back())?
    }

    /// Only so many of the newest transients are of use: the lag was another one before.
    pub fn keep_newest(&mut self, count: usize) {
        let older = self.transients.len().saturating_sub(count);
        self.transients.drain(..older);
    }

    fn is_cut(&self, time_s: f64) -> bool {
        self.cuts.iter().any(|(from_s, to_s)| (from_s - CUT_BEFORE_S..=to_s + CUT_BEHIND_S).contains(&time_s))
    }

    /// What there is; `new` is then false until the next transient.
    pub fn take_gathered_data(&mut self) -> AlignmentData {
        let gathered = AlignmentData { transients: self.transients.len(), ..self.data };
        self.data.new = false;
        gathered
    }

    /// The transients, the oldest first.
    pub fn transients(&mut self) -> &[Transient] {
        self.transients.make_contiguous()
    }
}

fn is_speed_change(from_rpm: f64, to_rpm: f64) -> bool {
    (to_rpm - from_rpm).abs() > CHANGE_RPM.max(CHANGE_SHARE * from_rpm.abs().max(to_rpm.abs()))
}

fn trim_readings<T>(points: &mut VecDeque<T>, time_s: impl Fn(&T) -> f64, from_s: f64) {
    while points.len() > READINGS_MAX || points.front().is_some_and(|point| time_s(point) < from_s - BEFORE_S - 1.0) {
        points.pop_front();
    }
}
