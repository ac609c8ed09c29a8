//! Transients out of a running machine: kept around every change of speed, never while it cuts.

use super::speed::{PowerPoint, SpeedPoint, Transient};
use std::collections::VecDeque;

/// A transient reaches so far before and behind the change of speed, s.
const BEFORE_S: f64 = 3.5;
const BEHIND_S: f64 = 4.5;
/// A change of speed goes on until it has stood still for so long, s; a longer transient is cut off.
const STILL_S: f64 = 1.0;
const LONGEST_S: f64 = 30.0;
/// So many transients are kept, the newest; each of so many readings at most.
const TRANSIENTS_MAX: usize = 24;
const READINGS_MAX: usize = 4096;
/// The speed has changed when it moved by this share of itself and by at least so many rpm within half a second.
const CHANGE_SHARE: f64 = 0.02;
const CHANGE_RPM: f64 = 20.0;

/// What has been collected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Gathered {
    /// Transients kept.
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
    cut_s: f64,
    kept: VecDeque<Transient>,
    gathered: Gathered,
}

impl Collector {
    /// A collector that has seen nothing.
    #[must_use]
    pub fn new() -> Self {
        Self { cut_s: f64::NEG_INFINITY, ..Self::default() }
    }

    /// Takes a reading of the spindle speed; `cutting` when the machine cuts, or might. Readings come in the order of their
    /// stamps; one that goes back begins anew.
    pub fn speed(&mut self, point: SpeedPoint, cutting: bool) {
        if self.speed.back().is_some_and(|last| point.time_s <= last.time_s) {
            self.forget();
        }
        if cutting {
            self.cut_s = point.time_s;
        }
        let past = self.speed.iter().rev().find(|past| past.time_s <= point.time_s - 0.5).copied();
        let moved = past.is_some_and(|past| changed(past.speed_rpm, point.speed_rpm));
        if moved {
            let from_s = self.changed_s.map_or(point.time_s - 0.5, |(from_s, _)| from_s);
            self.changed_s = Some((from_s, point.time_s));
        }
        self.speed.push_back(point);
        trim(&mut self.speed, |point| point.time_s, self.changed_s.map_or(point.time_s, |(from_s, _)| from_s));
        self.finish(point.time_s);
    }

    /// Takes a reading of the power.
    pub fn power(&mut self, point: PowerPoint) {
        if self.power.back().is_some_and(|last| point.time_s <= last.time_s) {
            return;
        }
        self.power.push_back(point);
        trim(&mut self.power, |point| point.time_s, self.changed_s.map_or(point.time_s, |(from_s, _)| from_s));
    }

    /// A source failed: what is half collected is of no use.
    pub fn interrupt(&mut self) {
        self.forget();
    }

    fn forget(&mut self) {
        self.speed.clear();
        self.power.clear();
        self.changed_s = None;
    }

    /// The change is over and its surroundings are complete.
    fn finish(&mut self, now_s: f64) {
        let Some((from_s, to_s)) = self.changed_s else { return };
        let over = now_s - to_s > BEHIND_S.max(STILL_S);
        let too_long = now_s - from_s > LONGEST_S;
        if !(over || too_long) {
            return;
        }
        self.changed_s = None;
        if self.cut_s >= from_s - BEFORE_S {
            self.gathered.while_cutting += 1;
            return;
        }
        if too_long {
            return;
        }
        let transient = Transient {
            speed: self.speed.iter().filter(|point| point.time_s >= from_s - BEFORE_S).copied().collect(),
            power: self.power.iter().filter(|point| point.time_s >= from_s - BEFORE_S).copied().collect(),
        };
        if self.kept.len() >= TRANSIENTS_MAX {
            self.kept.pop_front();
        }
        self.kept.push_back(transient);
        self.gathered.new = true;
    }

    /// What there is; `new` is then false until the next transient.
    pub fn gathered(&mut self) -> Gathered {
        let gathered = Gathered { transients: self.kept.len(), ..self.gathered };
        self.gathered.new = false;
        gathered
    }

    /// The transients, the oldest first.
    pub fn transients(&mut self) -> &[Transient] {
        self.kept.make_contiguous()
    }
}

fn changed(from_rpm: f64, to_rpm: f64) -> bool {
    (to_rpm - from_rpm).abs() > CHANGE_RPM.max(CHANGE_SHARE * from_rpm.abs().max(to_rpm.abs()))
}

fn trim<T>(points: &mut VecDeque<T>, time_s: impl Fn(&T) -> f64, from_s: f64) {
    while points.len() > READINGS_MAX || points.front().is_some_and(|point| time_s(point) < from_s - BEFORE_S - 1.0) {
        points.pop_front();
    }
}
