//! What a measured upper bound says about a quantity that is known only roughly.
//!
//! Law: before, the quantity `x` is normal with mean `m` and variance `v`; measured is a level `u` with noise `s`, and it
//! is known that `x <= u`. Then `x` has the mean `m - v/t r` and the variance `v - v^2/t^2 r (z + r)` with
//! `t^2 = v + s^2`, `z = (u - m)/t` and `r = phi(z)/Phi(z)`: the moments of a normal cut off softly.
//! Source: Rasmussen and Williams, Gaussian Processes for Machine Learning, section 3.9, equations 3.82 to 3.87.
//!
//! The level itself is not the quantity: under a light cut it lies above no-load power by the cut, and a cut that is
//! learned as no-load power is never seen again.

use numerics::statistics::erfc;

/// Mean and standard deviation of a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Normal {
    pub(super) mean: f64,
    pub(super) sd: f64,
}

/// The least variance that is left, relative to the one before: rounding must not make it negative.
const LEFT_MIN: f64 = 1e-6;

/// What is known of the quantity once it is known to be no greater than `level`, which was measured with `noise_sd`.
pub(super) fn condition_on_upper_bound(before: Normal, level: f64, noise_sd: f64) -> Normal {
    let variance = before.sd * before.sd;
    let total = variance + noise_sd * noise_sd;
    let z = (level - before.mean) / total.sqrt();
    let ratio = inverse_mills_ratio(z);
    let mean = before.mean - variance / total.sqrt() * ratio;
    let left = variance - variance * variance / total * ratio * (z + ratio);
    Normal { mean, sd: left.max(LEFT_MIN * variance).sqrt() }
}

/// The measurement that leads from `before` to `after` where it is weighed by its variance, as a Kalman update does.
pub(super) fn as_measurement(before: Normal, after: Normal) -> Normal {
    let (precision, known) = (after.sd.powi(-2), before.sd.powi(-2));
    let gained = (precision - known).max(1e-9 * known);
    Normal { mean: (after.mean * precision - before.mean * known) / gained, sd: gained.sqrt().recip() }
}

/// Density over distribution of the standard normal, phi(z)/Phi(z).
fn inverse_mills_ratio(z: f64) -> f64 {
    if z < -8.0 {
        // The first terms of the asymptotic series; the quotient itself is 0/0 there.
        return -z - 1.0 / z;
    }
    let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
    2.0 * density / erfc(-z / std::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same moments by adding up the densities.
    fn added_up(before: Normal, level: f64, noise_sd: f64) -> Normal {
        let (mut weight, mut first, mut second) = (0.0, 0.0, 0.0);
        for step in -8000..8000 {
            let x = before.mean + before.sd * f64::from(step) / 1000.0;
            let density = (-0.5 * ((x - before.mean) / before.sd).powi(2)).exp();
            let share = density * 0.5 * erfc((x - level) / noise_sd / std::f64::consts::SQRT_2);
            weight += share;
            first += share * x;
            second += share * x * x;
        }
        let mean = first / weight;
        Normal { mean, sd: (second / weight - mean * mean).sqrt() }
    }

    #[test]
    fn the_moments_are_those_of_the_cut_off_normal() {
        let before = Normal { mean: 500.0, sd: 25.0 };
        for (level, noise) in [(600.0, 3.0), (500.0, 3.0), (475.0, 5.0), (450.0, 2.0), (430.0, 10.0)] {
            let (known, summed) = (condition_on_upper_bound(before, level, noise), added_up(before, level, noise));
            assert!((known.mean - summed.mean).abs() < 0.01 && (known.sd - summed.sd).abs() < 0.01, "{level}");
        }
    }

    #[test]
    fn a_level_far_above_says_nothing_and_one_far_below_is_believed() {
        let before = Normal { mean: 500.0, sd: 10.0 };
        let above = condition_on_upper_bound(before, 600.0, 2.0);
        assert!((above.mean - 500.0).abs() < 1e-6 && (above.sd - 10.0).abs() < 1e-6);
        let far = condition_on_upper_bound(before, 300.0, 2.0);
        // A twenty-fifth of the contradiction is put down to noise, as the variances say.
        assert!(far.mean < 308.0 && far.mean > 300.0 && far.sd.is_finite() && far.sd > 0.0, "{far:?}");
    }

    #[test]
    fn the_measurement_leads_where_it_should() {
        let before = Normal { mean: 500.0, sd: 20.0 };
        let after = condition_on_upper_bound(before, 480.0, 3.0);
        let seen = as_measurement(before, after);
        let gain = before.sd.powi(2) / (before.sd.powi(2) + seen.sd.powi(2));
        assert!((before.mean + gain * (seen.mean - before.mean) - after.mean).abs() < 1e-6);
        assert!(((1.0 - gain) * before.sd.powi(2) - after.sd.powi(2)).abs() < 1e-6);
    }
}
