//! Flank wear: three stages, every edge with its own rates and its own age when the recording begins.

use std::collections::HashMap;

use crate::concealed::dice::Dice;
use crate::concealed::law::{Planted, Scene, Terms};
use crate::concealed::schedule::Plan;
use crate::concealed::tick::STEP_S;

/// Wear of one edge: break-in, steady stage, acceleration beyond a critical age.
struct Edge {
    minutes: f64,
    break_in_mm: f64,
    break_in_min: f64,
    rate_mm_min: f64,
    critical_min: f64,
    acceleration: f64,
    chipped_mm: f64,
}

impl Edge {
    fn draw(dice: &mut Dice) -> Self {
        Self {
            minutes: if dice.chance(0.3) { dice.uniform(0.0, 3.0) } else { 0.0 },
            break_in_mm: dice.uniform(0.02, 0.06),
            break_in_min: dice.uniform(0.3, 0.9),
            rate_mm_min: 0.028 * (0.35 * dice.normal()).exp(),
            critical_min: dice.uniform(3.5, 7.0),
            acceleration: dice.uniform(0.004, 0.02),
            chipped_mm: 0.0,
        }
    }

    fn land_mm(&self) -> f64 {
        let late = (self.minutes - self.critical_min).max(0.0);
        self.break_in_mm * (1.0 - (-self.minutes / self.break_in_min).exp())
            + self.rate_mm_min * self.minutes
            + self.acceleration * late * late
            + self.chipped_mm
    }
}

/// Power of a land: friction falls as the land grows and polishes.
fn friction_w(land_mm: f64, scene: &Scene, strength: f64) -> f64 {
    let contact_mm = 1.1 * scene.tick.depth_mm + 0.35;
    let polish = 1.0 - 0.4 * land_mm / (land_mm + 0.25);
    strength * 1.9 * land_mm * polish * contact_mm * scene.tick.cutting_speed_m_min()
}

fn worn(mut dice: Dice, strength: f64, rate: fn(&Scene) -> f64, chips: bool) -> Planted {
    let mut edges: HashMap<usize, Edge> = HashMap::new();
    Planted::cut(move |scene| {
        if !scene.tick.engaged {
            return Terms::default();
        }
        let edge = edges.entry(scene.tick.tool).or_insert_with(|| Edge::draw(&mut dice));
        edge.minutes += rate(scene) * STEP_S / 60.0;
        if chips && dice.chance(STEP_S / 150.0) {
            edge.chipped_mm += dice.uniform(0.005, 0.03);
        }
        Terms::power(friction_w(edge.land_mm(), scene, strength))
    })
}

/// Age counts in minutes of cutting.
pub(crate) fn by_time(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    worn(dice.clone(), strength, |_| 1.0, false)
}

/// Age runs faster at high cutting speed and coarse feed.
pub(crate) fn by_speed(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let rate = |s: &Scene| (s.tick.cutting_speed_m_min() / 140.0).powf(1.3) * (s.tick.feed_mm_rev / 0.22).powf(0.4);
    worn(dice.clone(), strength, rate, false)
}

/// Growth with small breaks of the edge on top.
pub(crate) fn with_chipping(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    worn(dice.clone(), strength, |_| 1.0, true)
}
