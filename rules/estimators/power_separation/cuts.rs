//! Steady cuts of a recording, and idle stretches, each with power and reference.

use super::reference::Referenced;
use super::rows::MachineRow;
use super::stretches::{SAME_SPEED, Stretch, settled_from};
use crate::State;
use crate::regression::{SteadyLevel, estimate_level, without_pulses};
use numerics::statistics::count_to_f64;
use recording::Recording;
use serde::Serialize;

/// Left out after a cut begins and before it ends, s.
const GUARD_S: f64 = 1.0;
/// A shorter steady part says nothing, s.
const LEAST_S: f64 = 3.0;

/// A steady cut, or an idle stretch (reference 0).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SteadyPoint {
    /// Gear stage; 0 where the recording has none.
    pub stage: usize,
    /// Spindle speed, rpm, the same throughout.
    pub speed_rpm: f64,
    /// Middle of the stretch on the clock of the recording, s.
    pub at_s: f64,
    /// Spindle power over the stretch: level and trend, W.
    pub power: SteadyLevel,
    /// Cutting power by the reference, less what the reference shows on the mean of idling at this speed, W.
    pub cutting_power_w: f64,
    /// Is it a cut?
    pub cut: bool,
}

/// What must stay the same within a cut.
#[derive(Clone, Copy, PartialEq)]
struct ConstantConditions {
    stage: usize,
    speed_rpm: f64,
    feed: f64,
    depth: f64,
}

/// The idle stretches and the steady cuts, in the order of time.
pub(super) fn collect_points(
    recording: &Recording,
    rows: &[MachineRow],
    idle: &[Stretch],
    reference: &Referenced,
) -> Vec<SteadyPoint> {
    let mut found: Vec<SteadyPoint> = idle.iter().map(of_idle).collect();
    let mut open: Vec<usize> = Vec::new();
    for (at, row) in rows.iter().enumerate() {
        let usable = row.state == State::Cutting && row.power_w.is_some() && reference.power_w[at].is_some();
        let goes_on = usable && open.first().is_none_or(|first| have_same_conditions(recording, &rows[*first], row));
        if !goes_on {
            found.extend(close_cut(rows, &open, reference));
            open.clear();
        }
        if usable {
            open.push(at);
        }
    }
    found.extend(close_cut(rows, &open, reference));
    subtract_idle(&mut found, rows, idle, reference);
    found.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    found
}

fn of_idle(stretch: &Stretch) -> SteadyPoint {
    let at_s = 0.5 * (stretch.from_s + stretch.to_s);
    let (stage, speed_rpm, power) = (stretch.stage, stretch.speed_rpm, stretch.level);
    SteadyPoint { stage, speed_rpm, at_s, power, cutting_power_w: 0.0, cut: false }
}

fn read_conditions(recording: &Recording, row: &MachineRow) -> ConstantConditions {
    let number = |name: &str| recording.find_numbers(name).and_then(|numbers| numbers.get(row.row)).unwrap_or(0.0);
    ConstantConditions {
        stage: row.stage,
        speed_rpm: row.speed_rpm.unwrap_or(0.0),
        feed: number("feed_mm_min"),
        depth: number("depth_of_cut_mm"),
    }
}

fn have_same_conditions(recording: &Recording, a: &MachineRow, b: &MachineRow) -> bool {
    let (a, b) = (read_conditions(recording, a), read_conditions(recording, b));
    let near = |a: f64, b: f64| (a - b).abs() <= SAME_SPEED * a.abs().max(b.abs());
    a.stage == b.stage && near(a.speed_rpm, b.speed_rpm) && near(a.feed, b.feed) && near(a.depth, b.depth)
}

fn close_cut(rows: &[MachineRow], open: &[usize], reference: &Referenced) -> Option<SteadyPoint> {
    let (begin_s, end_s) = (rows[*open.first()?].time_s + GUARD_S, rows[*open.last()?].time_s - GUARD_S);
    let inner: Vec<usize> =
        open.iter().copied().filter(|at| rows[*at].time_s >= begin_s && rows[*at].time_s <= end_s).collect();
    let time_s: Vec<f64> = inner.iter().map(|at| rows[*at].time_s).collect();
    let power_w: Vec<f64> = inner.iter().filter_map(|at| rows[*at].power_w).collect();
    let settled = settled_from(&time_s, &power_w);
    let (from_s, to_s) = (*time_s.get(settled)?, *time_s.last()?);
    if to_s - from_s < LEAST_S {
        return None;
    }
    let (kept_s, kept_w) = without_pulses(&time_s[settled..], &power_w[settled..]);
    let kept = &inner[settled..];
    let mean = |of: &dyn Fn(usize) -> Option<f64>| {
        kept.iter().filter_map(|at| of(*at)).sum::<f64>() / count_to_f64(kept.len())
    };
    Some(SteadyPoint {
        stage: rows[kept[0]].stage,
        speed_rpm: mean(&|at| rows[at].speed_rpm),
        at_s: 0.5 * (from_s + to_s),
        power: estimate_level(&kept_s, &kept_w)?,
        cutting_power_w: mean(&|at| reference.power_w[at]),
        cut: true,
    })
}

/// A torque sensor's zero and the friction behind it are no cutting power: what it shows while idling at a speed, on the mean of
/// all idle stretches, is taken off every point of that speed. An idle stretch keeps its own difference from that mean, so
/// that the sensor's noise counts in the fit as it does in the cuts.
fn subtract_idle(points: &mut [SteadyPoint], rows: &[MachineRow], idle: &[Stretch], reference: &Referenced) {
    let shown = |stretch: &Stretch| {
        let inside = |row: &MachineRow| row.time_s >= stretch.from_s && row.time_s <= stretch.to_s;
        let values: Vec<f64> = rows
            .iter()
            .zip(&reference.power_w)
            .filter(|(row, _)| inside(row))
            .filter_map(|(_, power)| *power)
            .collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / count_to_f64(values.len()))
    };
    let of_stretch: Vec<Option<f64>> = idle.iter().map(shown).collect();
    // Idle stretches come first, in their order.
    for (point, shown_w) in points.iter_mut().zip(&of_stretch) {
        point.cutting_power_w = shown_w.unwrap_or(0.0);
    }
    let known = idle.iter().zip(&of_stretch);
    let shown: Vec<(usize, f64, f64)> =
        known.filter_map(|(stretch, shown_w)| Some((stretch.stage, stretch.speed_rpm, (*shown_w)?))).collect();
    let with_reference = |at: usize| of_stretch.get(at).is_none_or(Option::is_some);
    for (_, point) in points.iter_mut().enumerate().filter(|(at, _)| with_reference(*at)) {
        let near = |(stage, speed, _): &&(usize, f64, f64)| {
            *stage == point.stage && (speed / point.speed_rpm - 1.0).abs() <= SAME_SPEED
        };
        let own: Vec<f64> = shown.iter().filter(near).map(|(.., power)| *power).collect();
        if !own.is_empty() {
            point.cutting_power_w -= own.iter().sum::<f64>() / count_to_f64(own.len());
        }
    }
}
