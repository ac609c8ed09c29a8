//! Cutting power from the power balance of the main drive.
//!
//! Law: `Pi = Pu + (1 + a0) Pc + a1 Pc^2`; the additional load loss is `Pad = a0 Pc + a1 Pc^2`.
//! Source: power separation on a lathe (CJK6136), equations 3 and 7; the root is taken in the form that stays exact as
//! a1 goes to 0: `Pc = 2 D / ((1 + a0) + sqrt((1 + a0)^2 + 4 a1 D))` with `D = Pi - Pu`.
//! Valid for one gear or belt stage; a0 and a1 may be negative (motor efficiency rises with load).

/// Cutting power and the loss that comes with it, W.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Balance {
    /// Power that removes material. Negative when the drive takes less than its no-load power.
    pub cutting_power_w: f64,
    /// Additional load loss.
    pub load_loss_w: f64,
    /// Change of cutting power per watt of measured power.
    pub slope: f64,
}

/// Splits the power above no-load power, `excess_w = Pi - Pu`. `None` where no real cutting power gives this excess
/// (negative discriminant) or where the loss would outgrow the cutting power (1 + a0 not positive).
#[must_use]
pub fn balance(excess_w: f64, linear: f64, quadratic_per_w: f64) -> Option<Balance> {
    let gain = 1.0 + linear;
    let discriminant = gain * gain + 4.0 * quadratic_per_w * excess_w;
    if !(gain > 0.0 && discriminant > 0.0) {
        return None;
    }
    let root = discriminant.sqrt();
    let cutting_power_w = 2.0 * excess_w / (gain + root);
    Some(Balance { cutting_power_w, load_loss_w: excess_w - cutting_power_w, slope: 1.0 / root })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_cut_splits_as_published() {
        let split = balance(1460.0 - 500.0, 0.1807, 4e-5).expect("a real root");
        assert!((split.cutting_power_w - 791.84).abs() < 0.01, "{split:?}");
        assert!((split.load_loss_w - 168.16).abs() < 0.01, "{split:?}");
        assert!((split.cutting_power_w / 795.0 - 1.0).abs() < 0.005, "within 0.5 % of the publication");
        let exact = balance(960.0, 0.1807, 3.377e-5).expect("a real root");
        assert!((exact.cutting_power_w - 795.0).abs() < 0.05, "{exact:?}");
    }

    #[test]
    fn constant_load_loss_gives_the_corrected_baseline_numbers() {
        let with = |excess, a0| balance(excess, a0, 0.0).expect("a real root").cutting_power_w;
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
            let split = balance(excess, 0.1807, 4e-5).expect("a real root");
            split.load_loss_w / split.cutting_power_w
        };
        assert!((coefficient(1732.5) - 0.25).abs() < 1e-4);
        assert!((coefficient(795.0) - 0.2125).abs() < 1e-4);
    }

    #[test]
    fn a_vanishing_quadratic_term_is_safe_and_negatives_are_defined() {
        let split = balance(118.0, 0.18, 1e-18).expect("a real root");
        assert!((split.cutting_power_w - 100.0).abs() < 1e-9);
        assert!((split.slope - 1.0 / 1.18).abs() < 1e-12);
        assert!(balance(-50.0, 0.18, 4e-5).expect("a real root").cutting_power_w < 0.0);
        assert_eq!(balance(1e6, 0.18, -4e-5), None, "negative discriminant");
        assert_eq!(balance(-1e6, 0.18, 4e-5), None, "negative discriminant");
        assert_eq!(balance(0.0, -1.0, 0.0), None);
        assert_eq!(balance(f64::NAN, 0.1, 1e-5), None);
    }
}
