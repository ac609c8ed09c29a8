//! Idle stretches of one speed, their settled part, and its level.

use super::rows::MachineRow;
use crate::State;
use crate::regression::{SteadyLevel, estimate_level, without_pulses};
use numerics::statistics::{count_to_f64, mean};
use serde::Serialize;

/// Speeds closer than this share are one speed.
pub(super) const SAME_SPEED: f64 = 0.02;
/// Left out before and after an axis moves or a state changes, s.
const GUARD_S: f64 = 1.0;
/// A shorter settled part says nothing, s.
const LEAST_S: f64 = 5.0;
/// Samples of a settled part, at least.
const LEAST_SAMPLES: usize = 8;
/// A leading block is still settling when its mean lies this many standard errors off the rest.
const SETTLED_SD: f64 = 3.0;

/// A settled stretch of idling at one speed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stretch {
    /// Gear stage; 0 where the recording has none.
    pub stage: usize,
    /// Mean magnitude of the spindle speed, rpm.
    pub speed_rpm: f64,
    /// From where on it counts as settled, s.
    pub from_s: f64,
    /// Until when it lasts, s.
    pub to_s: f64,
    /// Time that was left out because the power still settled, s.
    pub settling_s: f64,
    /// Level and trend of the power, W.
    pub level: SteadyLevel,
}

impl Stretch {
    /// Change of power over the stretch, W.
    #[must_use]
    pub fn drift_w(&self) -> f64 {
        self.level.slope_per_s * (self.to_s - self.from_s)
    }

    /// Does the power drift by more than noise explains?
    #[must_use]
    pub fn is_drifting(&self) -> bool {
        self.level.slope_per_s.abs() > 3.0 * self.level.slope_standard_error
            && self.drift_w().abs() > 0.005 * self.level.mean.abs()
    }
}

/// The settled idle stretches of a recording, in the order of time; what idles for longer than `longest_s` comes in pieces.
pub(super) fn find_stretches(rows: &[MachineRow], longest_s: f64) -> Vec<Stretch> {
    let mut found = Vec::new();
    let mut open: Vec<(f64, f64, f64)> = Vec::new();
    let mut stage = 0;
    for row in rows {
        let idle = read_idle_row(row);
        let goes_on = idle.is_some_and(|(speed_rpm, _)| {
            open.last().is_none_or(|last| row.time_s - last.0 < 30.0 && stage == row.stage)
                && open.first().is_none_or(|first| {
                    row.time_s - first.0 < longest_s && (speed_rpm / first.1 - 1.0).abs() <= 0.5 * SAME_SPEED
                })
        });
        if !goes_on {
            found.extend(close_stretch(&open, stage));
            open.clear();
        }
        if let Some((speed_rpm, power_w)) = idle {
            open.push((row.time_s, speed_rpm, power_w));
            stage = row.stage;
        }
    }
    found.extend(close_stretch(&open, stage));
    found
}

/// Speed and power of a row in which the spindle idles without any axis moving.
fn read_idle_row(row: &MachineRow) -> Option<(f64, f64)> {
    let idling = row.state == State::Idle && !row.feeding;
    Some((row.speed_rpm.filter(|_| idling)?, row.power_w?))
}

fn close_stretch(open: &[(f64, f64, f64)], stage: usize) -> Option<Stretch> {
    let (begin_s, end_s) = (open.first()?.0 + GUARD_S, open.last()?.0 - GUARD_S);
    let inner: Vec<&(f64, f64, f64)> = open.iter().filter(|it| it.0 >= begin_s && it.0 <= end_s).collect();
    let time_s: Vec<f64> = inner.iter().map(|it| it.0).collect();
    let power_w: Vec<f64> = inner.iter().map(|it| it.2).collect();
    let settled = settled_from(&time_s, &power_w);
    let speeds: Vec<f64> = inner[settled..].iter().map(|it| it.1).collect();
    let speed_rpm = speeds.iter().sum::<f64>() / count_to_f64(speeds.len().max(1));
    let (time_s, power_w) = without_pulses(&time_s[settled..], &power_w[settled..]);
    let (from_s, to_s) = (*time_s.first()?, *time_s.last()?);
    if time_s.len() < LEAST_SAMPLES || to_s - from_s < LEAST_S {
        return None;
    }
    Some(Stretch {
        stage,
        speed_rpm,
        from_s,
        to_s,
        settling_s: from_s - begin_s,
        level: estimate_level(&time_s, &power_w)?,
    })
}

/// Where the level is settled: leading twelfths are left out while they lie apart from what follows, at most half of all.
pub(crate) fn settled_from(time_s: &[f64], power_w: &[f64]) -> usize {
    let block = time_s.len() / 12;
    let mut from = 0;
    while block >= 2 && from + block <= time_s.len() / 2 {
        let head = mean(&power_w[from..from + block]);
        let Some(rest) = estimate_level(&time_s[from + block..], &power_w[from + block..]) else { break };
        let samples = count_to_f64(block).min(rest.independent);
        // The rest may drift; the head is compared with where the drift began.
        let begun = rest.mean - 0.5 * rest.slope_per_s * (time_s[time_s.len() - 1] - time_s[from]);
        if (head - begun).abs() <= SETTLED_SD * rest.sd / samples.sqrt() {
            break;
        }
        from += block;
    }
    from
}
