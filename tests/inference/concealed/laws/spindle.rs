//! Bearings, air and mass of the spindle.

use crate::concealed::dice::Dice;
use crate::concealed::law::{Planted, Scene, Terms};
use crate::concealed::schedule::Plan;

/// Two bodies warmed by friction: the inner ring and the housing, kelvin above the hall.
#[derive(Clone, Copy)]
struct TwoBodies {
    inner_k: f64,
    outer_k: f64,
    inner_tau_s: f64,
    outer_tau_s: f64,
    inner_rise_k: f64,
    outer_rise_k: f64,
}

impl TwoBodies {
    fn draw(dice: &mut Dice) -> Self {
        let warm = if dice.chance(0.75) { 0.0 } else { dice.uniform(0.2, 0.6) };
        let (inner_rise_k, outer_rise_k) = (dice.uniform(12.0, 20.0), dice.uniform(9.0, 16.0));
        Self {
            inner_k: warm * inner_rise_k,
            outer_k: warm * outer_rise_k,
            inner_tau_s: dice.uniform(240.0, 540.0),
            outer_tau_s: dice.uniform(1200.0, 2700.0),
            inner_rise_k,
            outer_rise_k,
        }
    }

    fn step(&mut self, scene: &Scene) {
        let heat = (scene.tick.speed_rpm / 1600.0).powf(1.6);
        let follow = |x: f64, rise: f64, tau: f64| {
            let moving = rise * heat + (x - rise * heat) * (-crate::concealed::tick::STEP_S / tau).exp();
            moving * (-scene.tick.gap_s / tau).exp()
        };
        self.inner_k = follow(self.inner_k, self.inner_rise_k, self.inner_tau_s);
        self.outer_k = follow(self.outer_k, self.outer_rise_k, self.outer_tau_s);
    }
}

/// Kinematic viscosity by Walther's law through two points, mm2/s.
fn walther(celsius: f64, at_40: f64, at_100: f64) -> f64 {
    let w = |v: f64| (v + 0.7).log10().log10();
    let (t40, t100) = (313.15_f64.log10(), 373.15_f64.log10());
    let slope = (w(at_40) - w(at_100)) / (t100 - t40);
    10f64.powf(10f64.powf(w(at_40) - slope * ((celsius + 273.15).log10() - t40))) - 0.7
}

/// Viscous bearing friction as the lubricant warms: Walther viscosity, power 2/3, two time constants.
pub(crate) fn warm_up(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let mut bodies = TwoBodies::draw(dice);
    let (at_40, friction_w) = (*dice.pick(&[32.0, 46.0, 68.0]), dice.uniform(70.0, 130.0));
    let at_100 = at_40 / 8.0;
    Planted::machine(move |s| {
        bodies.step(s);
        let celsius = s.tick.ambient_c + bodies.inner_k + 0.4 * bodies.outer_k;
        let warm = walther(s.tick.ambient_c + 24.0, at_40, at_100);
        let ratio = (walther(celsius, at_40, at_100) / warm).powf(2.0 / 3.0) - 1.0;
        Terms::power(strength * friction_w * (s.tick.speed_rpm / 1600.0).powf(5.0 / 3.0) * ratio)
    })
}

/// Grease friction that dies away with the revolutions made since the spindle was cold.
pub(crate) fn grease_run_in(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (tau_s, cold_w) = (dice.uniform(420.0, 1300.0), dice.uniform(90.0, 170.0));
    let mut stiff = 1.0;
    Planted::machine(move |s| {
        let speed = s.tick.speed_rpm / 1600.0;
        stiff *= (-crate::concealed::tick::STEP_S * speed.powf(0.9) / tau_s).exp();
        stiff += (1.0 - stiff) * (1.0 - (-s.tick.gap_s / (5.0 * tau_s)).exp());
        Terms::power(strength * cold_w * speed.powf(1.5) * (stiff + 0.25 * stiff * stiff))
    })
}

/// The inner ring grows before the housing does: preload, and friction with the square of speed, for a while.
pub(crate) fn preload(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let mut bodies = TwoBodies::draw(dice);
    let per_kelvin = dice.uniform(6.0, 12.0);
    Planted::machine(move |s| {
        bodies.step(s);
        let tight_k = (bodies.inner_k - 0.8 * bodies.outer_k).max(0.0);
        Terms::power(strength * per_kelvin * tight_k.powf(1.1) * (s.tick.speed_rpm / 1600.0).powi(2))
    })
}

/// Air around chuck and rotor, exponent 2.7.
pub(crate) fn windage(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let at_3000 = dice.uniform(90.0, 260.0);
    Planted::machine(move |s| Terms::power(strength * at_3000 * (s.tick.speed_rpm / 3000.0).powf(2.7)))
}

/// Air with jaws that begin to beat it above a speed.
pub(crate) fn windage_of_jaws(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (at_3000, laminar_rpm) = (dice.uniform(90.0, 240.0), dice.uniform(500.0, 900.0));
    Planted::machine(move |s| {
        let n = s.tick.speed_rpm;
        Terms::power(strength * at_3000 * (n / 3000.0).powi(3) / (1.0 + (laminar_rpm / n.max(1.0)).powi(2)))
    })
}

/// Mass of spindle, chuck and work.
pub(crate) fn inertia(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let kg_m2 = strength * dice.log_uniform(0.04, 0.25);
    Planted::machine(move |s| Terms::power(kg_m2 * s.tick.omega() * s.tick.alpha())).with("inertia_kg_m2", kg_m2)
}

/// Mass that changes with the blank in the chuck and shrinks while it is cut.
pub(crate) fn inertia_of_blanks(dice: &mut Dice, plan: &Plan, strength: f64) -> Planted {
    let kg_m2 = strength * dice.log_uniform(0.04, 0.22);
    let blanks: Vec<f64> = plan.parts.iter().map(|_| dice.uniform(0.9, 1.1)).collect();
    Planted::machine(move |s| {
        let blank = blanks.get(s.tick.run).copied().unwrap_or(1.0);
        Terms::power(kg_m2 * blank * s.tick.omega() * s.tick.alpha())
    })
}

/// Lip seals and plain guides that stick at creep speed, with a hyperbolic tangent instead of an exponential.
pub(crate) fn stribeck(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (extra_nm, speed_rpm) = (dice.uniform(5.0, 11.0), dice.uniform(60.0, 150.0));
    Planted::machine(move |s| {
        let n = s.tick.speed_rpm;
        Terms::power(strength * extra_nm * s.tick.omega() * (1.0 - (n / speed_rpm).tanh()))
    })
}

/// Friction that falls off like one over one plus the square of speed.
pub(crate) fn sticking_seal(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (extra_nm, speed_rpm) = (dice.uniform(5.0, 11.0), dice.uniform(50.0, 120.0));
    Planted::machine(move |s| {
        let ratio = s.tick.speed_rpm / speed_rpm;
        Terms::power(strength * extra_nm * s.tick.omega() / (1.0 + ratio * ratio))
    })
}

/// Bearings and seals that take a constant torque.
pub(crate) fn coulomb(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let torque_nm = strength * dice.uniform(0.3, 1.5);
    Planted::machine(move |s| Terms::power(torque_nm * s.tick.omega() * (s.tick.speed_rpm / 2.0).tanh()))
}
