//! From what is known of wear and rate: the probability that the criterion is passed, and the parts that remain.

use numerics::statistics::normal_share;
use serde::Serialize;

/// Share of the criterion that one standard deviation of the wear may have for an edge to count as observed. With a wider one an
/// edge at half its criterion would be called worn more often than one time in forty.
pub const OBSERVED_SHARE: f64 = 0.25;
/// Ends of the interval of the remaining parts: one edge in ten passes the criterion before it, one in ten after.
const INTERVAL: (f64, f64) = (0.1, 0.9);
/// Parts that are looked ahead.
const PARTS_MAX: f64 = 9999.0;
const HALVINGS: usize = 40;

/// Wear and rate of an edge with their covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Known {
    /// Flank wear, mm.
    pub(super) wear: f64,
    /// Millimetres per metre that slides along the edge.
    pub(super) rate: f64,
    /// Variance of the wear, covariance, variance of the rate.
    pub(super) covariance: [f64; 3],
    /// Metres that slide along the edge in a part.
    pub(super) part_m: f64,
    pub(super) criterion_mm: f64,
}

/// How an edge stands.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Outlook {
    /// Flank wear, mm: by the learned model, or in typical millimetres without one.
    pub wear_mm: f64,
    /// Its standard deviation, mm.
    pub wear_sd_mm: f64,
    /// Flank wear at which it is worn, mm.
    pub criterion_mm: f64,
    /// Probability that the criterion is passed by the end of the next part.
    pub worn_probability: f64,
    /// Parts until the criterion is passed: the middle, and the ends of an 80 % interval. At most 9999.
    pub parts_left: [f64; 3],
    /// Is the wear known well enough to be acted upon?
    pub observed: bool,
}

impl Known {
    /// Probability that the criterion is passed after so many further parts.
    fn passing_probability(&self, parts: f64) -> f64 {
        let metres = parts * self.part_m;
        let [wear, both, rate] = self.covariance;
        let variance = wear + 2.0 * metres * both + metres * metres * rate;
        let above = self.wear + self.rate * metres - self.criterion_mm;
        normal_share(above / variance.max(1e-12).sqrt())
    }

    /// Parts after which the criterion is passed with this probability.
    fn find_parts_until(&self, probability: f64) -> f64 {
        let (mut least, mut greatest) = (0.0, PARTS_MAX);
        if self.passing_probability(greatest) < probability {
            return PARTS_MAX;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (least + greatest);
            if self.passing_probability(middle) < probability { least = middle } else { greatest = middle }
        }
        greatest
    }

    pub(super) fn build_outlook(&self) -> Outlook {
        let wear_sd_mm = self.covariance[0].max(0.0).sqrt();
        Outlook {
            wear_mm: self.wear,
            wear_sd_mm,
            criterion_mm: self.criterion_mm,
            worn_probability: self.passing_probability(1.0),
            parts_left: [0.5, INTERVAL.0, INTERVAL.1].map(|share| self.find_parts_until(share)),
            observed: wear_sd_mm <= OBSERVED_SHARE * self.criterion_mm,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_left_are_those_of_a_straight_line_and_the_interval_holds_them() {
        let known = Known { wear: 0.2, rate: 1e-5, covariance: [1e-4, 0.0, 1e-12], part_m: 1000.0, criterion_mm: 0.3 };
        let outlook = known.build_outlook();
        assert!((outlook.parts_left[0] - 10.0).abs() < 0.01, "{outlook:?}");
        assert!(outlook.parts_left[1] < 9.0 && outlook.parts_left[2] > 11.0 && outlook.observed, "{outlook:?}");
        assert!(outlook.worn_probability < 1e-6);
        assert!(Known { wear: 0.295, ..known }.build_outlook().worn_probability > 0.5);
        let blind = Known { covariance: [0.01, 0.0, 1e-12], ..known };
        assert!(!blind.build_outlook().observed);
    }
}
