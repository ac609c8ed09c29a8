//! What the material does: lots of other hardness, softening with temperature, built-up edge, the edge's own force,
//! thin chips on the nose radius.

use crate::concealed::dice::Dice;
use crate::concealed::law::{Planted, Scene, Terms};
use crate::concealed::schedule::Plan;

/// Hardness per lot, scattering from bar to bar and along the bar within a lot.
pub(crate) fn lots(dice: &mut Dice, plan: &Plan, strength: f64) -> Planted {
    let mut per_lot = vec![0.0];
    while per_lot.len() < plan.lots.max(2) {
        let step = dice.sign() * dice.uniform(0.05, 0.10);
        let last = per_lot[per_lot.len() - 1];
        per_lot.push(if f64::abs(last + step) < 0.14 { last + step } else { last - step });
    }
    let bars: Vec<f64> = plan.parts.iter().map(|_| 0.008 * dice.normal()).collect();
    let along = dice.uniform(-0.012, 0.012);
    Planted::cut(move |s| {
        let bar = bars.get(s.tick.run).copied().unwrap_or(0.0);
        Terms::gain(strength * (per_lot[s.tick.lot.min(per_lot.len() - 1)] + bar + along * (s.tick.progress - 0.5)))
    })
}

/// One harder lot in the middle of the day, none before and after.
pub(crate) fn one_lot(dice: &mut Dice, plan: &Plan, strength: f64) -> Planted {
    let odd = dice.whole(1, plan.lots.max(2) - 1);
    let step = dice.sign() * dice.uniform(0.06, 0.11);
    let bars: Vec<f64> = plan.parts.iter().map(|_| 1.0 + 0.12 * dice.normal()).collect();
    Planted::cut(move |s| {
        let bar = bars.get(s.tick.run).copied().unwrap_or(1.0);
        Terms::gain(if s.tick.lot == odd { strength * step * bar } else { 0.0 })
    })
}

/// Johnson-Cook in the temperature of the cut.
pub(crate) fn softening_by_temperature(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (exponent, melting_c, hot) = (dice.uniform(0.8, 1.1), dice.uniform(1380.0, 1500.0), dice.uniform(44.0, 56.0));
    let flow = move |vc: f64, f: f64| {
        let temperature_c = 20.0 + hot * vc.max(3.0).powf(0.45) * (f / 0.2).powf(0.22);
        1.0 - ((temperature_c - 20.0) / (melting_c - 20.0)).clamp(0.0, 0.95).powf(exponent)
    };
    let reference = flow(140.0, 0.2);
    Planted::cut(move |s| {
        Terms::gain(strength * (flow(s.tick.cutting_speed_m_min(), s.tick.feed_mm_rev) / reference - 1.0))
    })
}

/// A smooth step between a hard cut at low and a soft cut at high cutting speed.
pub(crate) fn softening_by_step(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (middle, width, height) = (dice.uniform(100.0, 160.0), dice.uniform(60.0, 110.0), dice.uniform(0.06, 0.11));
    Planted::cut(move |s| Terms::gain(-strength * height * ((s.tick.cutting_speed_m_min() - middle) / width).tanh()))
}

/// A bump of lower force around 35 m/min, unsteady while the edge builds and sheds.
pub(crate) fn built_up_edge(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (centre, width, depth) = (dice.uniform(30.0, 42.0), dice.uniform(10.0, 16.0), dice.uniform(0.12, 0.22));
    let mut dice = dice.clone();
    let mut built = 0.5;
    Planted::cut(move |s| {
        built = if dice.chance(0.012) { 0.25 } else { f64::min(built + 0.01, 1.0) };
        let window = (-((s.tick.cutting_speed_m_min() - centre) / width).powi(2)).exp();
        let gain = -strength * depth * window * (0.7 + 0.3 * built);
        Terms { gain, power_w: 0.0, jitter_w: 0.02 * window * s.nominal_w }
    })
}

/// Lower force between two cutting speeds, with soft borders.
pub(crate) fn built_up_window(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (from, to, depth) = (dice.uniform(17.0, 24.0), dice.uniform(48.0, 62.0), dice.uniform(0.10, 0.18));
    Planted::cut(move |s| {
        let vc = s.tick.cutting_speed_m_min();
        let inside = 1.0 / (1.0 + ((from - vc) / 2.5).exp()) / (1.0 + ((vc - to) / 4.0).exp());
        Terms { gain: -strength * depth * inside, power_w: 0.0, jitter_w: 0.015 * inside * s.nominal_w }
    })
}

/// Ploughing along the whole engaged edge, nose included.
pub(crate) fn edge_force(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (per_mm, nose_mm) = (dice.uniform(20.0, 55.0), dice.uniform(0.15, 0.4));
    Planted::cut(move |s| {
        let edge_mm = if s.tick.engaged { 1.05 * s.tick.depth_mm + nose_mm } else { 0.0 };
        Terms::power(strength * per_mm * edge_mm * s.tick.cutting_speed_m_min() / 60.0)
    })
}

/// Ploughing that grows a little when the feed comes near the rounding of the edge.
pub(crate) fn rounded_edge(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (per_mm, rounding_mm) = (dice.uniform(20.0, 50.0), dice.uniform(0.02, 0.05));
    Planted::cut(move |s| {
        let edge_mm = if s.tick.engaged { 1.15 * s.tick.depth_mm } else { 0.0 };
        let blunt = 1.0 + 0.25 * (rounding_mm / s.tick.feed_mm_rev.max(0.01)).sqrt();
        Terms::power(strength * per_mm * blunt * edge_mm * s.tick.cutting_speed_m_min() / 60.0)
    })
}

/// Colwell's mean chip: section over the length of the edge in the work, nose arc included.
pub(crate) fn mean_chip(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let radius = *dice.pick(&[0.8, 1.2, 1.6]);
    Planted::cut(move |s| {
        let (depth, feed) = (s.tick.depth_mm.max(0.02), s.tick.feed_mm_rev.max(0.01));
        let arc = (1.0 - (depth / radius).min(1.0)).acos() + (feed / (2.0 * radius)).min(1.0).asin();
        let length = radius * arc + (depth - radius).max(0.0);
        Terms::gain(strength * ((depth / length).min(1.0).powf(-s.baseline.mc) - 1.0))
    })
}

/// Below the nose radius the chip is thinner than the feed says and the specific force higher.
pub(crate) fn nose_radius(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let radius = *dice.pick(&[0.8, 1.2, 1.6]);
    Planted::cut(move |s| {
        let ratio = (s.tick.depth_mm / radius).clamp(0.02, 1.0);
        let approach = (1.0 - ratio).acos();
        let mean_sine = (1.0 - approach.cos()) / approach.max(1e-3);
        let full = std::f64::consts::FRAC_2_PI;
        let thin = (mean_sine / full).min(1.0).powf(-s.baseline.mc) - 1.0;
        Terms::gain(strength * if s.tick.depth_mm < radius { thin } else { 0.0 })
    })
}

/// Dry cutting takes more; the zone dries and wets with its own inertia.
pub(crate) fn coolant(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (dry, tau_s) = (dice.uniform(0.05, 0.13), dice.uniform(1.5, 5.0));
    let mut wet = 0.0;
    Planted::cut(move |s| {
        let target = f64::from(u8::from(s.tick.coolant));
        wet = target + (wet - target) * (-s.tick.elapsed_s() / tau_s).exp();
        Terms::gain(strength * dry * (1.0 - wet))
    })
}

/// Coolant that helps more the slower the cut.
pub(crate) fn coolant_at_low_speed(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (dry, slow) = (dice.uniform(0.05, 0.12), dice.uniform(0.15, 0.4));
    Planted::cut(move |s| {
        let more = (140.0 / s.tick.cutting_speed_m_min().max(20.0)).powf(slow);
        Terms::gain(if s.tick.coolant { 0.0 } else { strength * dry * more })
    })
}

/// Chatter that starts at one depth and lasts until the depth is well below it.
pub(crate) fn chatter_with_memory(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (start_mm, height) = (dice.uniform(1.5, 2.2), dice.uniform(0.05, 0.09));
    let mut loud = 0.0_f64;
    Planted::cut(move |s| {
        let beyond = s.tick.engaged && s.tick.depth_mm > start_mm * if loud > 0.5 { 0.85 } else { 1.0 };
        loud += (f64::from(u8::from(beyond)) - loud) * 0.1;
        let jitter_w = 0.04 * loud * strength * s.nominal_w;
        Terms { gain: strength * height * loud * (1.0 + 0.2 * (s.tick.depth_mm - start_mm)), power_w: 0.0, jitter_w }
    })
}

/// Chatter beyond a depth that follows the stability lobes: more mean power and much noise.
pub(crate) fn chatter(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (limit, lobe, phase) = (dice.uniform(1.3, 1.9), dice.uniform(300.0, 520.0), dice.uniform(0.0, 6.0));
    let (height, soft) = (dice.uniform(0.05, 0.10), dice.uniform(0.4, 0.8));
    Planted::cut(move |s| {
        let edge = limit * (1.0 + 0.2 * (std::f64::consts::TAU * s.tick.speed_rpm / lobe + phase).sin());
        let over = (s.tick.depth_mm - edge).max(0.0);
        let share = 1.0 - (-over / soft).exp();
        let jitter_w = 0.03 * share * strength * s.nominal_w;
        Terms { gain: strength * height * share, power_w: 0.0, jitter_w }
    })
}

/// Runout of the work: once per revolution, seen by a slow meter as a slow beat.
pub(crate) fn runout(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let height = dice.uniform(0.04, 0.10);
    let mut turns = dice.uniform(0.0, 1.0);
    Planted::cut(move |s: &Scene| {
        turns += s.tick.speed_rpm / 60.0 * s.tick.elapsed_s().min(1.0);
        Terms::gain(strength * height * (std::f64::consts::TAU * turns).sin())
    })
}
