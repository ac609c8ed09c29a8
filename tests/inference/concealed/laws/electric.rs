//! Losses between the supply and the spindle nose.

use crate::concealed::dice::Dice;
use crate::concealed::law::{Planted, Terms};
use crate::concealed::schedule::Plan;
use crate::concealed::tick::STEP_S;

/// Winding loss of torque and magnetising current, with a winding that warms.
pub(crate) fn copper(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (ohm, nm_per_a, idle_a) = (dice.uniform(0.06, 0.2), dice.uniform(1.0, 1.8), dice.uniform(3.0, 6.0));
    let mut winding_k = 0.0;
    Planted::machine(move |s| {
        let torque_a = (s.torque_nm() / nm_per_a).min(90.0);
        let loss_w = 3.0 * ohm * (1.0 + 0.0039 * winding_k) * torque_a * torque_a.hypot(0.2 * idle_a);
        winding_k += (0.08 * loss_w - winding_k) * (1.0 - (-(STEP_S + s.tick.gap_s) / 900.0).exp());
        let idle_w = 3.0 * ohm * (0.5 * s.no_load_w / s.tick.omega().max(4.0) / nm_per_a).min(90.0).powi(2);
        Terms::power(if s.tick.engaged { strength * (loss_w - idle_w) } else { 0.0 })
    })
}

/// Winding loss with a constant magnetising current beside the torque current.
pub(crate) fn magnetised_copper(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (ohm, nm_per_a, idle_a) = (dice.uniform(0.06, 0.18), dice.uniform(1.0, 1.8), dice.uniform(4.0, 9.0));
    Planted::machine(move |s| {
        let torque_a = (s.torque_nm() / nm_per_a).min(90.0);
        let still_a = (0.5 * s.no_load_w / s.tick.omega().max(4.0) / nm_per_a).min(90.0);
        let loss = |a: f64| 3.0 * ohm * a * (a + 0.3 * idle_a);
        Terms::power(if s.tick.engaged { strength * (loss(torque_a) - loss(still_a)) } else { 0.0 })
    })
}

/// Gear and belt loss that grows faster than the power it passes on.
pub(crate) fn load_loss(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (exponent, at_2kw) = (dice.uniform(1.8, 2.2), dice.uniform(90.0, 240.0));
    Planted::machine(move |s| Terms::power(strength * at_2kw * (s.cutting_w / 2000.0).powf(exponent)))
}

/// A motor whose efficiency rises with load: the loss bends down.
pub(crate) fn load_loss_falling(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (knee_w, height) = (dice.uniform(2500.0, 4500.0), dice.uniform(0.05, 0.10));
    Planted::machine(move |s| {
        let x = s.cutting_w / knee_w;
        Terms::power(-strength * height * s.cutting_w * x / (1.0 + 0.3 * x))
    })
}

/// Above base speed the field current costs loss, more so under torque.
pub(crate) fn field_weakening(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (base_rpm, idle_w, per_nm2) =
        (dice.uniform(1100.0, 1700.0), dice.uniform(120.0, 240.0), dice.uniform(0.3, 1.0));
    Planted::machine(move |s| {
        let over = (s.tick.speed_rpm / base_rpm - 1.0).max(0.0);
        let torque = s.torque_nm().min(60.0);
        Terms::power(strength * (idle_w * over.powf(1.15) + per_nm2 * torque * torque * ((1.0 + over).powi(2) - 1.0)))
    })
}

/// Above base speed the idle loss turns up like a hinge that is rounded.
pub(crate) fn rounded_hinge(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (base_rpm, width, per_1000_w) =
        (dice.uniform(1200.0, 1800.0), dice.uniform(80.0, 200.0), dice.uniform(90.0, 200.0));
    Planted::machine(move |s| {
        let over = ((s.tick.speed_rpm - base_rpm) / width).min(60.0).exp().ln_1p() * width / 1000.0;
        Terms::power(strength * per_1000_w * over * (1.0 + 0.35 * s.cutting_w / 3000.0))
    })
}

/// Low gear stage with an extra wheel: a fixed drag and a share of the load.
pub(crate) fn extra_wheel(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (drag_nm, share) = (dice.uniform(0.5, 1.2), dice.uniform(0.03, 0.06));
    Planted::machine(move |s| {
        let low = f64::from(u8::from(s.tick.gear_stage == 1));
        Terms::power(
            strength * low * (drag_nm * s.tick.omega() + 30.0 * (s.tick.speed_rpm / 30.0).tanh() + share * s.cutting_w),
        )
    })
}

/// Low gear stage: churning with speed and mesh loss by an efficiency curve in torque.
pub(crate) fn gear(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (churn_w, mesh, light_nm) = (dice.uniform(25.0, 60.0), dice.uniform(0.03, 0.06), dice.uniform(8.0, 20.0));
    Planted::machine(move |s| {
        if s.tick.gear_stage != 1 {
            return Terms::default();
        }
        let churning =
            churn_w * (s.tick.speed_rpm / 800.0).powf(1.3) + 0.6 * churn_w * (s.tick.speed_rpm / 40.0).tanh();
        let loss = mesh * (1.0 + 0.6 * (-s.torque_nm() / light_nm).exp());
        Terms::power(strength * (churning + loss * s.cutting_w))
    })
}

/// Braking energy that is burnt in a resistor above a threshold instead of flowing back through the meter.
pub(crate) fn regeneration(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (lost, threshold_w) = (dice.uniform(0.35, 0.9), dice.uniform(20.0, 120.0));
    let kg_m2 = KNOWN_INERTIA_KG_M2;
    Planted::machine(move |s| {
        let braking_w = -(kg_m2 * s.tick.omega() * s.tick.alpha()).min(0.0);
        Terms::power(strength.min(1.0 / lost) * lost * (braking_w - threshold_w).max(0.0))
    })
}

/// Inertia that the nominal model states where braking is concealed, kg m2.
pub(crate) const KNOWN_INERTIA_KG_M2: f64 = 0.12;

/// Switching and conduction loss of the inverter, bent in the current.
pub(crate) fn inverter(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (per_a, nm_per_a) = (dice.uniform(4.0, 9.0), dice.uniform(1.0, 1.8));
    Planted::machine(move |s| {
        let current_a = (s.torque_nm() / nm_per_a).min(90.0);
        let share = if s.tick.engaged { 1.0 } else { 0.0 };
        Terms::power(share * strength * (per_a * current_a + 0.05 * current_a.powf(1.8)))
    })
}

/// Iron loss of the motor: hysteresis with speed to the power 1.2, eddy currents with its square.
pub(crate) fn iron(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (hysteresis_w, eddy_w) = (dice.uniform(30.0, 90.0), dice.uniform(20.0, 60.0));
    Planted::machine(move |s| {
        let speed = s.tick.speed_rpm / 1500.0;
        Terms::power(strength * (hysteresis_w * speed.powf(1.2) + eddy_w * speed * speed))
    })
}
