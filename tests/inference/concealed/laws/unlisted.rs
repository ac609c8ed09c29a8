//! Physics that no catalogue lists. The only right answers are that something real is unknown, and where.

use std::f64::consts::TAU;

use crate::concealed::dice::Dice;
use crate::concealed::law::{Planted, Terms};
use crate::concealed::schedule::Plan;
use crate::concealed::tick::STEP_S;

/// A foundation that resonates at one speed: a Lorentz peak in power.
pub(crate) fn resonance(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (centre, width, watt) = (dice.uniform(700.0, 1400.0), dice.uniform(60.0, 140.0), dice.uniform(120.0, 260.0));
    Planted::machine(move |s| {
        let x = (s.tick.speed_rpm - centre) / width;
        Terms::power(strength * watt / (1.0 + x * x))
    })
}

/// After each reversal of the slide the nut re-seats: a bump that dies with the distance moved.
pub(crate) fn backlash(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (watt, reach_mm) = (dice.uniform(200.0, 420.0), dice.uniform(6.0, 18.0));
    let (mut direction, mut since_mm) = (0.0, 1e3);
    Planted::machine(move |s| {
        let v = s.tick.velocity_mm_min;
        if v != 0.0 && v.signum() != direction {
            (direction, since_mm) = (v.signum(), 0.0);
        }
        since_mm += v.abs() / 60.0 * STEP_S * if s.tick.engaged { 3.0 } else { 0.05 };
        let x: f64 = since_mm / reach_mm;
        Terms::power(strength * watt * x * (1.0 - x).exp() * f64::from(u8::from(s.tick.engaged)))
    })
}

/// With the door open the interlock brakes against the drive: power with speed, only while the flag is set.
pub(crate) fn door_brake(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let watt = dice.uniform(150.0, 300.0);
    let mut pressed = 0.0_f64;
    Planted::machine(move |s| {
        let target = if s.tick.door_open { 1.0 } else { 0.0 };
        pressed += (target - pressed) * 0.04;
        let held = if s.tick.door_open { watt * (0.6 + 0.8 * pressed) } else { 0.0 };
        Terms::power(strength * held * (1.0 + (s.tick.position_mm / 9.0).sin() * 0.2))
    })
}

/// A chip that jams and grows until it breaks free, several times in a pass.
pub(crate) fn chip_jam(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (rise_s, height) = (dice.uniform(4.0, 7.0), dice.uniform(0.10, 0.2));
    let mut dice = dice.clone();
    let mut jam_s: f64 = -1.0;
    Planted::cut(move |s| {
        if !s.tick.engaged {
            jam_s = -1.0;
        } else if jam_s >= 0.0 {
            jam_s = if jam_s > 1.8 * rise_s { -1.0 } else { jam_s + STEP_S };
        } else if s.tick.since_entry_s > 3.0 && dice.chance(STEP_S / 9.0) {
            jam_s = 0.0;
        }
        Terms::gain(if jam_s > 0.0 { strength * height * ((jam_s / rise_s).exp() - 1.0) } else { 0.0 })
    })
}

/// A belt that slips with the fourth power of torque above its grip.
pub(crate) fn belt_slip(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (grip_nm, watt) = (dice.uniform(12.0, 18.0), dice.uniform(60.0, 120.0));
    Planted::machine(move |s| {
        let over = (s.torque_nm() / grip_nm - 1.0).clamp(0.0, 2.0);
        Terms::power(if s.tick.engaged { strength * watt * over.powi(4).min(6.0) } else { 0.0 })
    })
}

/// An insert seat that rocks: each edge has its own beat in time.
pub(crate) fn rocking_seat(dice: &mut Dice, plan: &Plan, strength: f64) -> Planted {
    let seats: Vec<(f64, f64)> =
        plan.tools.iter().map(|_| (dice.uniform(0.02, 0.16), dice.uniform(6.0, 16.0))).collect();
    Planted::cut(move |s| {
        let (height, period_s) = seats[s.tick.tool.min(seats.len() - 1)];
        Terms::gain(strength * height * (TAU * s.tick.since_entry_s / period_s).sin())
    })
}

/// A chip tray on the headstock belt that fills with the volume removed and empties when full.
pub(crate) fn filling_tray(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (full_kj, watt) = (dice.uniform(160.0, 380.0), dice.uniform(120.0, 260.0));
    let mut filled_kj = dice.uniform(0.0, full_kj);
    Planted::machine(move |s| {
        filled_kj += s.nominal_w * STEP_S / 1000.0;
        if filled_kj > full_kj {
            filled_kj = 0.0;
        }
        let share = filled_kj / full_kj;
        Terms::power(strength * watt * share * share * (s.tick.speed_rpm / 900.0).min(1.5))
    })
}

/// A lead screw with a bad pitch: the cut breathes with the position of the slide.
pub(crate) fn screw_pitch(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (pitch_mm, height) = (dice.uniform(14.0, 30.0), dice.uniform(0.05, 0.12));
    Planted::cut(move |s| Terms::gain(strength * height * (TAU * s.tick.position_mm / pitch_mm).sin()))
}

/// A bar feeder: the bar gets shorter part by part and whips near one speed.
pub(crate) fn whipping_bar(dice: &mut Dice, plan: &Plan, strength: f64) -> Planted {
    let (per_bar, watt, critical) = (dice.whole(3, 4), dice.uniform(120.0, 260.0), dice.uniform(500.0, 900.0));
    let first = dice.whole(0, plan.parts.len());
    Planted::machine(move |s| {
        let left = 1.0 - ((s.tick.run + first) % per_bar) as f64 / per_bar as f64;
        let ratio = (s.tick.speed_rpm * left / critical).powi(2);
        Terms::power(strength * watt * ratio / (1.0 + (ratio - 1.0).powi(2)) * 0.5)
    })
}

/// An insert that was cold when it entered: more force at first, depending on how long it rested.
pub(crate) fn cold_insert(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (height, warm_s, cool_s) = (dice.uniform(0.10, 0.22), dice.uniform(4.0, 9.0), dice.uniform(8.0, 20.0));
    let mut heat = 0.0_f64;
    Planted::cut(move |s| {
        let (target, tau_s) = if s.tick.engaged { (1.0, warm_s) } else { (0.0, cool_s) };
        heat = target + (heat - target) * (-s.tick.elapsed_s() / tau_s).exp();
        Terms::gain(strength * height * (1.0 - heat))
    })
}
