//! Evidence for load: a bounded cumulative sum of standardised excess power.
//!
//! Law: `S <- clamp(S + clamp((x - k) / sigma, -h/3, h/3), 0, h)`; load begins at `S = h` and ends at `S = 0`.
//! A cumulative sum finds a small lasting step far sooner than a threshold on a filtered value at the same false-alarm
//! rate (Page, Biometrika 1954); the inner clamp lets no pulse decide, not even one that
//! interpolation has smeared over two ticks; the outer one makes begin and end alike.

use serde::{Deserialize, Serialize};

/// The sum, between none and full.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Evidence {
    sum: f64,
}

impl Evidence {
    /// Takes the excess power over no-load power, measured against `reference_w` in units of `sd_w`; `full` is the sum
    /// at which load begins.
    pub fn add(&mut self, excess_w: f64, reference_w: f64, sd_w: f64, full: f64) {
        let step = (excess_w - reference_w) / sd_w.max(f64::MIN_POSITIVE);
        if step.is_finite() {
            self.sum = (self.sum + step.clamp(-full / 3.0, full / 3.0)).clamp(0.0, full);
        }
    }

    /// Is the sum full? Load begins then.
    #[must_use]
    pub fn is_sufficient(&self, full: f64) -> bool {
        self.sum >= full
    }

    /// Is nothing of the sum left? Load ends then.
    #[must_use]
    pub fn is_exhausted(&self) -> bool {
        self.sum <= 0.0
    }

    /// Sets the sum to zero, whatever was seen before.
    pub fn clear(&mut self) {
        self.sum = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps_until_full(excess: f64) -> Option<usize> {
        let mut evidence = Evidence::default();
        (1..1000).find(|_| {
            evidence.add(excess, 3.0, 2.0, 5.0);
            evidence.is_sufficient(5.0)
        })
    }

    #[test]
    fn a_heavy_cut_takes_three_samples_and_a_light_one_a_few() {
        assert_eq!((steps_until_full(1000.0), steps_until_full(6.0), steps_until_full(3.0)), (Some(3), Some(4), None));
    }

    #[test]
    fn one_pulse_never_decides() {
        let mut evidence = Evidence::default();
        for excess in [0.0, 1e9, 1e9, 0.0, 0.0, 1e9, 1e9, 0.0] {
            evidence.add(excess, 3.0, 2.0, 5.0);
            assert!(!evidence.is_sufficient(5.0));
        }
    }
}
