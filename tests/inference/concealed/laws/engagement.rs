//! Geometry of a pass: how the cut builds up and ends, and how the depth really runs along the work.

use crate::concealed::dice::Dice;
use crate::concealed::law::{Planted, Terms};
use crate::concealed::schedule::Plan;

/// Seconds in which the chip reaches its full width: a chamfer or a raw skin of some millimetres.
fn build_up_s(length_mm: f64, feed_mm_min: f64) -> f64 {
    (length_mm * 60.0 / feed_mm_min.max(20.0)).clamp(0.3, 4.0)
}

/// The section grows like a squared sine and shrinks the same way.
pub(crate) fn soft_entry(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (entry_mm, exit_mm) = (dice.uniform(4.0, 11.0), dice.uniform(2.0, 8.0));
    Planted::cut(move |s| {
        let feed_mm_min = s.tick.feed_mm_rev * s.tick.speed_rpm;
        let share = |seconds: f64, length_mm: f64| {
            let u = (seconds / build_up_s(length_mm * strength, feed_mm_min)).clamp(0.0, 1.0);
            (std::f64::consts::FRAC_PI_2 * u).sin().powi(2)
        };
        Terms::gain(share(s.tick.since_entry_s, entry_mm) * share(s.tick.until_exit_s, exit_mm) - 1.0)
    })
}

/// A chamfered front: the section grows in proportion, the end is sharp.
pub(crate) fn chamfer(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let length_mm = dice.uniform(5.0, 14.0);
    Planted::cut(move |s| {
        let seconds = build_up_s(length_mm * strength, s.tick.feed_mm_rev * s.tick.speed_rpm);
        Terms::gain((s.tick.since_entry_s / seconds).min(1.0) - 1.0)
    })
}

/// The work bends away like a cantilever: the depth falls towards the free end.
pub(crate) fn deflection(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (height, slender) = (dice.sign() * dice.uniform(0.05, 0.13), dice.uniform(0.3, 0.9));
    Planted::cut(move |s| {
        let x = s.tick.progress;
        let beam = 0.5 * x * x * (3.0 - x) - 0.375;
        let thin = (60.0 / s.tick.diameter_mm.max(15.0)).powf(slender * 0.5).clamp(0.6, 1.6);
        Terms::gain(strength * height * beam * thin)
    })
}

/// A blank that is forged conical and bent: linear with a bow.
pub(crate) fn conical_blank(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (slope, bow) = (dice.sign() * dice.uniform(0.06, 0.14), dice.uniform(-0.04, 0.04));
    Planted::cut(move |s| {
        let x = s.tick.progress - 0.5;
        Terms::gain(strength * (slope * x + bow * (1.0 - 8.0 * x * x) * 0.5))
    })
}
