//! What the meter makes of the power: late, smeared, off zero, clipped, beating with the mains.

use crate::concealed::dice::Dice;
use crate::concealed::law::Planted;
use crate::concealed::schedule::Plan;
use crate::concealed::tick::{STEP_S, Tick};

/// The series `delay_s` earlier, linear in between, held at the start of a part.
fn delayed(ticks: &[Tick], power: &[f64], delay_s: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut start = 0;
    (0..power.len())
        .map(|i| {
            if i > 0 && ticks[i].run != ticks[i - 1].run {
                start = i;
            }
            let back = (i - start) as f64 - delay_s(ticks[i].t_s) / STEP_S;
            let whole = back.floor().max(0.0);
            let share = (back - whole).clamp(0.0, 1.0);
            let j = start + whole as usize;
            power[j] + share * (power[(j + 1).min(power.len() - 1)] - power[j])
        })
        .collect()
}

/// The meter's clock is behind and drifts by some ppm.
pub(crate) fn lag(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (delay_s, ppm) = (strength * dice.uniform(0.5, 1.6), dice.uniform(-100.0, 100.0));
    Planted::meter(move |ticks, power| delayed(ticks, power, |t| (delay_s + ppm * 1e-6 * t).max(0.0)))
}

/// The meter's answer is always the same time old.
pub(crate) fn constant_lag(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let delay_s = strength * dice.uniform(0.6, 2.0);
    Planted::meter(move |ticks, power| delayed(ticks, power, |_| delay_s)).with("lag_s", delay_s)
}

/// A mean over the last seconds, as energy counters give it.
pub(crate) fn boxcar(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let steps = ((strength * dice.uniform(1.2, 3.0) / STEP_S).round() as usize).max(2);
    Planted::meter(move |ticks, power| {
        let mut start = 0;
        (0..power.len())
            .map(|i| {
                if ticks[i].gap_s > 0.0 {
                    start = i;
                }
                let from = (i + 1).saturating_sub(steps).max(start);
                crate::concealed::least_squares::mean(&power[from..=i])
            })
            .collect()
    })
}

/// Two first-order filters in a row, as in a transducer with a damped output.
pub(crate) fn window(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (first_s, second_s) = (strength * dice.uniform(0.5, 1.6), strength * dice.uniform(0.1, 0.4));
    Planted::meter(move |ticks, power| {
        let (mut a, mut b) = (power[0], power[0]);
        (0..power.len())
            .map(|i| {
                if ticks[i].gap_s > 0.0 {
                    (a, b) = (power[i], power[i]);
                }
                a = power[i] + (a - power[i]) * (-STEP_S / first_s).exp();
                b = a + (b - a) * (-STEP_S / second_s).exp();
                b
            })
            .collect()
    })
}

/// Zero that follows the temperature of the cabinet, which follows a random walk that is held back.
pub(crate) fn zero_drift(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (tau_s, watt) = (dice.uniform(400.0, 900.0), dice.uniform(18.0, 45.0));
    let mut dice = dice.clone();
    Planted::meter(move |ticks, power| {
        let (mut load, mut cabinet) = (dice.normal(), dice.normal());
        let shifted = ticks.iter().zip(power).map(|(tick, p)| {
            let keep = (-tick.elapsed_s() / tau_s).exp();
            load = keep * load + (1.0 - keep * keep).sqrt() * dice.normal();
            cabinet += (1.6 * load - cabinet) * (1.0 - (-tick.elapsed_s() / (0.7 * tau_s)).exp());
            p + strength * watt * cabinet
        });
        shifted.collect()
    })
}

/// Zero that runs off as the cabinet warms after switching on.
pub(crate) fn zero_warm_up(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (tau_s, watt) = (dice.uniform(700.0, 1600.0), dice.sign() * dice.uniform(40.0, 90.0));
    Planted::meter(move |ticks, power| {
        let drift = |t: f64| 1.0 - (-t / tau_s).exp() * (1.0 + 0.4 * t / tau_s);
        ticks.iter().zip(power).map(|(tick, p)| p + strength * watt * drift(tick.t_s)).collect()
    })
}

/// The gain of the current transformer jumps when somebody touches it.
pub(crate) fn gain_step(dice: &mut Dice, plan: &Plan, strength: f64) -> Planted {
    let (gain, from) =
        (dice.sign() * dice.uniform(0.03, 0.06), dice.whole(plan.parts.len() / 3, 2 * plan.parts.len() / 3));
    Planted::meter(move |ticks, power| {
        let factor = |run: usize| if run >= from { 1.0 + strength * gain } else { 1.0 };
        ticks.iter().zip(power).map(|(tick, p)| p * factor(tick.run)).collect()
    })
    .with("gain", strength * gain)
}

/// A gain that was always wrong: the refit of the nominal law takes all of it.
pub(crate) fn constant_gain(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let gain = strength * dice.sign() * dice.uniform(0.03, 0.07);
    Planted::meter(move |_, power| power.iter().map(|p| p * (1.0 + gain)).collect())
}

/// The gain runs off with the warming of the burden.
pub(crate) fn gain_drift(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (gain, tau_s) = (dice.sign() * dice.uniform(0.04, 0.08), dice.uniform(900.0, 2000.0));
    Planted::meter(move |ticks, power| {
        let run_off = |t: f64| strength * gain * (1.0 - (-t / tau_s).exp());
        ticks.iter().zip(power).map(|(tick, p)| p * (1.0 + run_off(tick.t_s))).collect()
    })
}

/// Power that follows the mains voltage with an exponent of its own.
pub(crate) fn supply(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let exponent = strength * dice.uniform(0.8, 1.7);
    Planted::meter(move |ticks, power| {
        ticks.iter().zip(power).map(|(tick, p)| p * (tick.supply_v / 400.0).powf(exponent)).collect()
    })
    .with("exponent", exponent)
}

/// Power that follows the mains at the fans and the drive's own supply more than in the cut.
pub(crate) fn supply_of_idle(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let exponent = strength * dice.uniform(1.0, 1.9);
    Planted::meter(move |ticks, power| {
        let share = |p: f64| 0.6 + 0.4 * 900.0 / (900.0 + p.max(0.0));
        ticks
            .iter()
            .zip(power)
            .map(|(t, p)| p * (1.0 + share(*p) * ((t.supply_v / 400.0).powf(exponent) - 1.0)))
            .collect()
    })
}

/// Twice the mains frequency, folded by the polling into a slow line that wanders with the grid.
pub(crate) fn ripple(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (share, offset_hz) = (dice.uniform(0.02, 0.04), dice.uniform(0.03, 0.30));
    let mut dice = dice.clone();
    Planted::meter(move |ticks, power| {
        let (mut phase, mut grid_hz) = (dice.uniform(0.0, 1.0), 0.0);
        let rippled = ticks.iter().zip(power).map(|(tick, p)| {
            let keep = (-tick.elapsed_s() / 400.0).exp();
            grid_hz = keep * grid_hz + (1.0 - keep * keep).sqrt() * 0.0008 * dice.normal();
            phase += (offset_hz + 2.0 * grid_hz) * tick.elapsed_s();
            p + strength * share * (120.0 + p) * (std::f64::consts::TAU * phase).sin()
        });
        rippled.collect()
    })
}

/// An input that bends towards its ceiling.
pub(crate) fn soft_ceiling(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let share = (0.96 - 0.08 * strength * dice.uniform(0.5, 1.0)).clamp(0.72, 0.985);
    Planted::meter(move |_, power| {
        let ceiling = crate::concealed::least_squares::quantile(power, share);
        let knee = 0.03 * ceiling;
        let bent = |p: f64| ceiling - knee * ((ceiling - p) / knee).min(60.0).exp().ln_1p();
        power.iter().map(|p| if ceiling - p > 40.0 * knee { *p } else { bent(*p) }).collect()
    })
}

/// A beat of constant size, whatever the load.
pub(crate) fn constant_ripple(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (watt, hz, phase) = (dice.uniform(15.0, 45.0), dice.uniform(0.02, 0.35), dice.uniform(0.0, 6.3));
    let sway = dice.uniform(0.2, 0.8);
    Planted::meter(move |ticks, power| {
        let angle = |t: f64| std::f64::consts::TAU * hz * t + phase + sway * (t / 400.0).sin();
        ticks.iter().zip(power).map(|(tick, p)| p + strength * watt * angle(tick.t_s).sin()).collect()
    })
}

/// An input that stops: the ceiling lies at a quantile of the day's power.
pub(crate) fn ceiling(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let share = (0.97 - 0.08 * strength * dice.uniform(0.5, 1.0)).clamp(0.72, 0.985);
    Planted::meter(move |_, power| {
        let ceiling = crate::concealed::least_squares::quantile(power, share);
        power.iter().map(|p| p.min(ceiling)).collect()
    })
}
