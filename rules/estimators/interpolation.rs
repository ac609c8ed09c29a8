//! No-load power of a gear stage between, and a little beyond, its known speeds: the law of [`numerics::speed_weights`], and a power law as
//! its doubt where the speeds alone give no other form.

use super::no_load::StagePowers;
use numerics::speed_weights::{SpeedWeights, Weights, weigh_known_speeds};

/// No-load power goes with this power of the speed where nothing better is known: dry friction 1, viscous 1.6 to 2.
const EXPONENT: f64 = 1.3;

/// Known speeds must span this logarithmic range to show an exponent of their own.
const EXPONENT_SPAN: f64 = 0.2;

impl StagePowers {
    /// Weights for `n` and those of another form, whose difference is the doubt in the interpolation itself.
    pub(super) fn compute_weight_pair(&self, n: f64) -> Option<(Weights, Weights)> {
        let SpeedWeights { law, other } = weigh_known_speeds(&self.speeds_rpm, n)?;
        Some((law, other.unwrap_or_else(|| self.by_law(n))))
    }

    /// Position of the known speed nearest in ratio, and the logarithm of that ratio.
    pub(super) fn find_nearest_speed(&self, n: f64) -> Option<(usize, f64)> {
        let distance = |at: usize| (self.speeds_rpm[at] / n).ln().abs();
        let ratios = (0..self.len()).map(|at| (at, distance(at)));
        ratios.min_by(|(_, a), (_, b)| a.total_cmp(b))
    }

    /// A power law through the nearest known power, with the exponent that the slowest and fastest known speeds show.
    pub(super) fn by_law(&self, n: f64) -> Weights {
        let Some((nearest, _)) = self.find_nearest_speed(n) else { return Weights::from_single_speed(0, 0.0) };
        let last = self.len() - 1;
        let span = (self.speeds_rpm[last] / self.speeds_rpm[0]).ln();
        let shown = (self.powers_w[last] / self.powers_w[0]).ln() / span;
        let exponent = if span > EXPONENT_SPAN { shown.clamp(0.5, 2.5) } else { EXPONENT };
        Weights::from_single_speed(nearest, (n / self.speeds_rpm[nearest]).powf(exponent))
    }

    pub(super) fn covers_speed(&self, n: f64) -> bool {
        self.speeds_rpm.first().is_some_and(|first| *first <= n)
            && self.speeds_rpm.last().is_some_and(|last| n <= *last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::speed_weights::{INSIDE_GAIN_LIMIT, noise_gain};

    fn stage(points: &[(f64, f64)]) -> StagePowers {
        let mut stage = StagePowers::default();
        stage.speeds_rpm.extend(points.iter().map(|(speed, _)| speed));
        stage.powers_w.extend(points.iter().map(|(_, power)| power));
        stage
    }

    #[test]
    fn speeds_that_lie_close_together_do_not_amplify_noise() {
        let speeds = [1200.0, 1230.0, 1260.0, 1300.0, 1600.0];
        let known = stage(&speeds.map(|speed| (speed, speed / 2.0)));
        for n in [1100.0, 1215.0, 1245.0, 1280.0, 1350.0, 1450.0, 1550.0] {
            let (weights, other) = known.compute_weight_pair(n).expect("five speeds");
            assert!(noise_gain(&weights.weight) <= INSIDE_GAIN_LIMIT, "{n}: {weights:?}");
            assert!((weights.weigh_powers(&known.powers_w) - n / 2.0).abs() < 1e-9, "{n}: a straight line stays one");
            assert!(other.weigh_powers(&known.powers_w) > 0.0);
        }
        let (far, _) = known.compute_weight_pair(1000.0).expect("five speeds");
        assert!(noise_gain(&far.weight) > 3.0, "too far for a straight line: the table refuses");
    }

    /// As a simulation of the same table computes it.
    #[test]
    fn a_wide_gap_is_curved_and_says_how_far_it_may_be_off() {
        let known = stage(&[(200.0, 110.0), (300.0, 150.0), (600.0, 330.0), (2000.0, 900.0)]);
        let (weights, other) = known.compute_weight_pair(1200.0).expect("four speeds");
        let power_w = weights.weigh_powers(&known.powers_w);
        assert!((power_w - 628.74).abs() < 0.01, "{power_w}");
        assert!((other.weigh_powers(&known.powers_w) - 574.29).abs() < 0.01, "the straight line is the doubt");
    }

    #[test]
    fn the_triple_holds_the_speed_between_its_own() {
        let known = stage(&[(1200.0, 700.0), (1240.0, 710.0), (1280.0, 720.0), (1600.0, 1000.0)]);
        let (weights, _) = known.compute_weight_pair(1330.0).expect("four speeds");
        let used: Vec<f64> = weights.at.iter().map(|at| known.speeds_rpm[*at]).collect();
        assert!(used.contains(&1280.0) && used.contains(&1600.0), "{used:?}");
    }

    #[test]
    fn one_speed_serves_only_itself() {
        assert!(stage(&[(600.0, 400.0)]).compute_weight_pair(700.0).is_none());
        assert!(stage(&[]).compute_weight_pair(700.0).is_none());
    }
}
