//! One pass drawn at random: speed, feed, depth and diameter as a programmer would choose them.

use std::f64::consts::PI;

use crate::concealed::dice::Dice;
use crate::concealed::schedule::{Needs, Pass};

/// Most that the spindle can turn against, Nm.
const TORQUE_NM: f64 = 95.0;

/// A pass on a lathe: the operation decides the range of feed and depth, the spindle's torque the greatest depth.
pub(crate) fn turning(operation: usize, needs: Needs, dice: &mut Dice) -> Pass {
    let diameter = dice.uniform(28.0, 130.0);
    let slow = needs.low_cutting_speed && dice.chance(0.45);
    let cutting_speed = if slow { dice.uniform(14.0, 75.0) } else { dice.log_uniform(60.0, 270.0) };
    let (feed, depth, inner) = match operation {
        0 => (dice.uniform(0.10, 0.26), dice.uniform(0.4, 1.6), dice.uniform(0.35, 0.6)),
        1 | 4 => (dice.uniform(0.20, 0.45), dice.uniform(1.2, 3.8), 1.0),
        2 => (dice.uniform(0.14, 0.30), dice.uniform(0.6, 2.0), 1.0),
        _ => (dice.uniform(0.07, 0.20), dice.uniform(0.25, 0.9), 1.0),
    };
    let depth = if needs.shallow && dice.chance(0.5) { dice.uniform(0.12, 0.7) } else { depth };
    let speed = (1000.0 * cutting_speed / (PI * diameter)).clamp(70.0, 3600.0).round();
    let (feed, depth, diameter) = (grid(feed, 0.005), grid(depth, 0.05), grid(diameter, 0.1));
    let allowed_w = f64::min(5200.0, TORQUE_NM * speed * PI / 30.0);
    let strongest = allowed_w / (2000.0 * feed.powf(0.77) * PI * diameter * speed / 60_000.0);
    Pass {
        speed_rpm: speed,
        feed_mm_rev: feed,
        depth_mm: grid(depth.min(strongest), 0.05).max(0.1),
        diameter_mm: diameter,
        end_diameter_mm: grid(diameter * inner, 0.1),
        teeth: 1.0,
        cut_s: dice.uniform(14.0, 34.0),
        ..blank(operation, dice)
    }
}

fn blank(operation: usize, dice: &mut Dice) -> Pass {
    Pass {
        operation,
        speed_rpm: 0.0,
        feed_mm_rev: 0.0,
        depth_mm: 0.0,
        width_mm: 0.0,
        diameter_mm: 0.0,
        end_diameter_mm: 0.0,
        teeth: 1.0,
        cut_s: 0.0,
        air_s: dice.uniform(3.0, 8.0),
        coolant: true,
        tool: 0,
        override_at_s: 0.0,
        override_to: 1.0,
    }
}

/// A pass with an end mill; the depth keeps the cut below 5 kW.
pub(crate) fn milling(operation: usize, dice: &mut Dice) -> Pass {
    let diameter = *dice.pick(&[16.0, 20.0, 32.0, 50.0, 63.0]);
    let teeth = *dice.pick(&[2.0, 3.0, 4.0, 5.0]);
    let speed = (1000.0 * dice.uniform(90.0, 260.0) / (PI * diameter)).clamp(300.0, 7800.0).round();
    let feed = grid(teeth * dice.uniform(0.05, 0.2), 0.005);
    let width = grid(diameter * dice.uniform(0.15, 0.9), 0.5);
    let depth = dice.uniform(0.4, 3.0) * if operation == 3 { 0.4 } else { 1.0 };
    let strongest = 5000.0 * 60_000.0 / (3000.0 * width * feed * speed);
    Pass {
        speed_rpm: speed,
        feed_mm_rev: feed,
        depth_mm: grid(depth.min(strongest), 0.05).max(0.1),
        width_mm: width,
        diameter_mm: diameter,
        end_diameter_mm: diameter,
        teeth,
        cut_s: dice.uniform(14.0, 34.0),
        ..blank(operation, dice)
    }
}

/// A hole drilled into the full material.
pub(crate) fn drilling(operation: usize, dice: &mut Dice) -> Pass {
    let diameter = *dice.pick(&[10.0, 12.0, 14.0, 18.0, 22.0, 26.0]);
    let speed = (1000.0 * dice.uniform(50.0, 130.0) / (PI * diameter)).round();
    Pass {
        speed_rpm: speed,
        feed_mm_rev: grid(dice.uniform(0.08, 0.32), 0.005),
        depth_mm: diameter / 2.0,
        width_mm: diameter,
        diameter_mm: diameter,
        end_diameter_mm: diameter,
        teeth: 2.0,
        cut_s: dice.uniform(10.0, 24.0),
        ..blank(operation, dice)
    }
}

fn grid(value: f64, step: f64) -> f64 {
    (value / step).round() * step
}
