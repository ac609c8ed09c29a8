//! Cutting power from the power balance of the main drive.
//!
//! Law: `Pi = Pu + (1 + a0) Pc + a1 Pc^2`; the additional load loss is `Pad = a0 Pc + a1 Pc^2`.
//! Source: power separation on a lathe (CJK6136), equations 3 and 7; the root is taken in the form that stays exact as
//! a1 goes to 0: `Pc = 2 D / ((1 + a0) + sqrt((1 + a0)^2 + 4 a1 D))` with `D = Pi - Pu`.
//! Valid for one gear or belt stage; a0 and a1 may be negative (motor efficiency rises with load).
//!
//! The source takes a1 as the same at every speed. Where it comes from the windings it is not: their loss goes with the square of
//! the current, hence below the drive's base speed with the square of the torque `Pc / omega`, so that a1 goes with `1 / n^2`.
//! [`LoadLossLaw`] knows both; whoever separates cutting power asks it, so that the law stands in one place.

use serde::Serialize;

/// Cutting power and the loss that comes with it, W.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Balance {
    /// Power that removes material. Negative when the drive takes less than its no-load power.
    pub cutting_power_w: f64,
    /// Loss that exists only under load: the excess over no-load power less the cutting power.
    pub load_loss_w: f64,
    /// Change of cutting power per watt of measured power.
    pub slope: f64,
}

/// Splits the power above no-load power, `excess_w = Pi - Pu`. `None` where no real cutting power gives this excess
/// (negative discriminant) or where the loss would outgrow the cutting power (1 + a0 not positive).
#[must_use]
pub fn solve_power_balance(excess_w: f64, linear: f64, quadratic_per_w: f64) -> Option<Balance> {
    let gain = 1.0 + linear;
    let discriminant = gain * gain + 4.0 * quadratic_per_w * excess_w;
    if !(gain > 0.0 && discriminant > 0.0) {
        return None;
    }
    let root = discriminant.sqrt();
    let cutting_power_w = 2.0 * excess_w / (gain + root);
    Some(Balance { cutting_power_w, load_loss_w: excess_w - cutting_power_w, slope: 1.0 / root })
}

/// Load loss of one gear stage, `Pad = a0 Pc + a1(n) Pc^2`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LoadLossLaw {
    /// a0, loss per watt of cutting power; a pure number.
    pub linear: f64,
    /// a1 at [`speed_rpm`](Self::speed_rpm), 1/W.
    pub quadratic_per_w: f64,
    /// Spindle speed at which a1 is as stated, rpm, positive: elsewhere it goes with `1 / n^2`. `None`: the same at every speed.
    pub speed_rpm: Option<f64>,
}

impl LoadLossLaw {
    /// Below this share of the speed at which a1 was learned it grows no further, so that a spindle that hardly turns has no
    /// infinite loss: a1 is then 16 times as great. The drive limits its current, so a cut cannot have any torque; and the cutting
    /// speeds of one gear stage span less than 1 to 4 to either side of their middle. A bound that is too high takes part of the loss of the
    /// slowest cuts for cutting power; without one, a watt of error in the no-load power would hide any cut at a creep.
    const SLOWEST: f64 = 0.25;

    /// a1 as stated for a spindle speed in rpm, as settings, scripts and the command line give it: 0 is the same at every speed.
    #[must_use]
    pub fn from_stated_speed(linear: f64, quadratic_per_w: f64, speed_rpm: f64) -> Self {
        Self { linear, quadratic_per_w, speed_rpm: Some(speed_rpm).filter(|rpm| *rpm > 0.0) }
    }

    /// The same coefficients at every speed, as the source of the method has them.
    #[must_use]
    pub const fn with_constant_coefficients(linear: f64, quadratic_per_w: f64) -> Self {
        Self { linear, quadratic_per_w, speed_rpm: None }
    }

    /// a1 at a spindle speed in rpm of either sign, over a1 as stated.
    pub(super) fn speed_factor(&self, speed_rpm: f64) -> f64 {
        let share = |learned: f64| (learned / speed_rpm.abs().max(Self::SLOWEST * learned)).powi(2);
        self.speed_rpm.map_or(1.0, share)
    }

    /// a1 at a spindle speed in rpm of either sign, 1/W.
    #[must_use]
    pub fn quadratic_at(&self, speed_rpm: f64) -> f64 {
        self.quadratic_per_w * self.speed_factor(speed_rpm)
    }

    /// Splits the power above no-load power at a spindle speed; see [`solve_power_balance`].
    #[must_use]
    pub fn split_excess_power(&self, excess_w: f64, speed_rpm: f64) -> Option<Balance> {
        solve_power_balance(excess_w, self.linear, self.quadratic_at(speed_rpm))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_that_goes_with_the_torque_is_split_at_any_speed() {
        let loss = LoadLossLaw { linear: 0.11, quadratic_per_w: 1.2e-4, speed_rpm: Some(800.0) };
        for (rpm, a1) in [(800.0, 1.2e-4), (-400.0, 4.8e-4), (1600.0, 3e-5), (200.0, 1.92e-3)] {
            let excess_w = 1.11 * 900.0 + a1 * 900.0 * 900.0;
            let split = loss.split_excess_power(excess_w, rpm).expect("a real root");
            assert!((split.cutting_power_w - 900.0).abs() < 1e-9, "{rpm}: {split:?}");
            let same = LoadLossLaw::with_constant_coefficients(0.11, 1.2e-4).split_excess_power(excess_w, rpm);
            assert_eq!(same, solve_power_balance(excess_w, 0.11, 1.2e-4), "one a1 for every speed");
        }
        for rpm in [0.0, 10.0, -199.0] {
            assert!((loss.quadratic_at(rpm) - 1.92e-3).abs() < 1e-12, "bounded at {rpm} rpm");
        }
        assert_eq!(
            loss.split_excess_power(100.0, f64::NAN),
            loss.split_excess_power(100.0, 0.0),
            "no speed is a slow one"
        );
    }

    #[test]
    fn the_published_cut_splits_as_published() {
        let split = solve_power_balance(1460.0 - 500.0, 0.1807, 4e-5).expect("a real root");
        assert!((split.cutting_power_w - 791.84).abs() < 0.01, "{split:?}");
        assert!((split.load_loss_w - 168.16).abs() < 0.01, "{split:?}");
        assert!((split.cutting_power_w / 795.0 - 1.0).abs() < 0.005, "within 0.5 % of the publication");
        let exact = solve_power_balance(960.0, 0.1807, 3.377e-5).expect("a real root");
        assert!((exact.cutting_power_w - 795.0).abs() < 0.05, "{exact:?}");
    }

    #[test]
    fn constant_load_loss_gives_the_corrected_baseline_numbers() {
        let with = |excess, a0| solve_power_balance(excess, a0, 0.0).expect("a real root").cutting_power_w;
        for (excess, a0, expected) in
            [(960.0, 0.15, 834.8), (955.0, 0.15, 830.4), (960.0, 0.25, 768.0), (955.0, 0.25, 764.0)]
        {
            assert!((with(excess, a0) - expected).abs() < 0.05, "{excess} {a0}");
        }
    }

    #[test]
    fn the_load_loss_coefficient_spans_the_old_band() {
        let coefficient = |cut: f64| {
            let excess = cut * 1.1807 + 4e-5 * cut * cut;
            let split = solve_power_balance(excess, 0.1807, 4e-5).expect("a real root");
            split.load_loss_w / split.cutting_power_w
        };
        assert!((coefficient(1732.5) - 0.25).abs() < 1e-4);
        assert!((coefficient(795.0) - 0.2125).abs() < 1e-4);
    }

    #[test]
    fn a_vanishing_quadratic_term_is_safe_and_negatives_are_defined() {
        let split = solve_power_balance(118.0, 0.18, 1e-18).expect("a real root");
        assert!((split.cutting_power_w - 100.0).abs() < 1e-9);
        assert!((split.slope - 1.0 / 1.18).abs() < 1e-12);
        assert!(solve_power_balance(-50.0, 0.18, 4e-5).expect("a real root").cutting_power_w < 0.0);
        assert_eq!(solve_power_balance(1e6, 0.18, -4e-5), None, "negative discriminant");
        assert_eq!(solve_power_balance(-1e6, 0.18, 4e-5), None, "negative discriminant");
        assert_eq!(solve_power_balance(0.0, -1.0, 0.0), None);
        assert_eq!(solve_power_balance(f64::NAN, 0.1, 1e-5), None);
    }
}
