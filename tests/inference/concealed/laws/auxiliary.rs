//! Consumers beside the spindle: pumps, conveyors, feed axes.

use crate::concealed::dice::Dice;
use crate::concealed::law::{Planted, Terms};
use crate::concealed::schedule::Plan;

/// A pump between two pressures: on and off with its own rhythm, with an inrush each time.
pub(crate) fn pump(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (on_w, on_s, off_s) = (dice.uniform(150.0, 420.0), dice.uniform(10.0, 24.0), dice.uniform(18.0, 60.0));
    let mut dice = dice.clone();
    let (mut on, mut left_s, mut since_s) = (false, dice.uniform(0.0, off_s), 0.0);
    Planted::machine(move |s| {
        left_s -= s.tick.elapsed_s();
        since_s += s.tick.elapsed_s();
        if left_s <= 0.0 {
            on = !on;
            left_s = if on { on_s } else { off_s } * dice.uniform(0.8, 1.25);
            since_s = 0.0;
        }
        let inrush = 1.0 + 1.5 * (-since_s / 0.35_f64).exp();
        Terms::power(if on { strength * on_w * inrush } else { 0.0 })
    })
}

/// A chip conveyor: long stretches on, long stretches off.
pub(crate) fn conveyor(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let on_w = dice.uniform(120.0, 380.0);
    let mut dice = dice.clone();
    let (mut on, mut left_s) = (dice.chance(0.5), dice.uniform(40.0, 200.0));
    Planted::machine(move |s| {
        left_s -= s.tick.elapsed_s();
        if left_s <= 0.0 {
            on = !on;
            left_s = dice.uniform(70.0, 320.0);
        }
        Terms::power(if on { strength * on_w } else { 0.0 })
    })
    .with("level", strength * on_w)
}

/// Friction of the feed axis: a tangent through zero and a bent viscous part.
pub(crate) fn axis_friction(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (force_n, viscous) = (dice.uniform(500.0, 1300.0), dice.uniform(0.6, 1.4));
    Planted::machine(move |s| {
        let speed_m_s = s.tick.velocity_mm_min.abs() / 60_000.0;
        let dry_w = force_n * speed_m_s * (speed_m_s / 0.0008).tanh();
        Terms::power(strength * (dry_w + viscous * 9000.0 * speed_m_s.powf(1.9)))
    })
}

/// Guides and wipers: nearly constant force, a little more when the axis has rested.
pub(crate) fn wipers(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (force_n, rest_share) = (dice.uniform(600.0, 1500.0), dice.uniform(0.1, 0.3));
    let mut rested = 0.0_f64;
    Planted::machine(move |s| {
        let speed_m_s = s.tick.velocity_mm_min.abs() / 60_000.0;
        rested = if speed_m_s > 0.0 { rested * 0.93 } else { (rested + 0.01).min(1.0) };
        Terms::power(strength * force_n * (1.0 + rest_share * rested) * speed_m_s)
    })
}

/// A consumer that somebody switches on in the middle of the day, and off and on again.
pub(crate) fn extraction(dice: &mut Dice, plan: &Plan, strength: f64) -> Planted {
    let on_w = dice.uniform(120.0, 350.0);
    let first = dice.whole(1, (plan.parts.len() / 3).max(1));
    let mut dice = dice.clone();
    let (mut on, mut left_s) = (false, 0.0);
    Planted::machine(move |s| {
        if s.tick.run < first {
            return Terms::default();
        }
        left_s -= s.tick.elapsed_s();
        if left_s <= 0.0 {
            on = !on;
            left_s = dice.uniform(60.0, 260.0);
        }
        Terms::power(if on { strength * on_w } else { 0.0 })
    })
}

/// A ram that hangs on the screw: lifting costs, lowering gives back less.
pub(crate) fn gravity(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (kg, returned) = (dice.uniform(70.0, 220.0), dice.uniform(0.8, 1.0));
    Planted::machine(move |s| {
        let power_w = kg * 9.81 * s.tick.velocity_mm_min / 60_000.0;
        Terms::power(strength * if power_w > 0.0 { power_w } else { returned * power_w })
    })
    .with("weight", strength * kg * 9.81)
}
