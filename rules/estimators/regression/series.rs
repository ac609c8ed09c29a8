//! Level and trend of a series whose noise remembers: neighbouring samples of a meter say partly the same.
//!
//! The number of independent samples follows from the integrated autocorrelation time, summed while the sums of pairs are
//! positive and falling. Source: Geyer, Practical Markov Chain Monte Carlo, Statistical Science 7 (1992) 473, section 3.3.

use numerics::linear::orthogonal::dot_product;
use numerics::statistics::{count_to_f64, median, robust_deviation};
use serde::Serialize;

/// What a trend leaves of slow noise is corrected by no more than the inverse of this.
const LEFT_MIN: f64 = 0.3;

/// A pulse lies so many standard deviations off, as the median deviation tells them.
const PULSE_SD: f64 = 6.0;

/// What a steady stretch says about its level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SteadyLevel {
    /// Mean of the stretch, in the unit of the values.
    pub mean: f64,
    /// Standard error of the mean, the memory of the noise counted.
    pub standard_error: f64,
    /// Standard deviation of one sample about the trend.
    pub sd: f64,
    /// As many independent samples would say the same.
    pub independent: f64,
    /// Change of the level per second, in the unit of the values.
    pub slope_per_s: f64,
    /// Standard error of the slope, the memory of the noise counted.
    pub slope_standard_error: f64,
}

/// Level and trend of samples at times in seconds. `None` for fewer than 4 samples, times that do not increase, or numbers
/// that are not finite.
#[must_use]
pub fn estimate_level(time_s: &[f64], values: &[f64]) -> Option<SteadyLevel> {
    let n = values.len();
    let increasing = time_s.windows(2).all(|pair| pair[1] > pair[0]);
    if n < 4 || time_s.len() != n || !increasing || values.iter().chain(time_s).any(|value| !value.is_finite()) {
        return None;
    }
    let count = count_to_f64(n);
    let mean = values.iter().sum::<f64>() / count;
    let middle_s = time_s.iter().sum::<f64>() / count;
    let about: Vec<f64> = time_s.iter().map(|time_s| time_s - middle_s).collect();
    let deviations: Vec<f64> = values.iter().map(|value| value - mean).collect();
    let spread = dot_product(&about, &about);
    let slope_per_s = dot_product(&about, &deviations) / spread;
    let residuals: Vec<f64> = deviations.iter().zip(&about).map(|(d, t)| d - slope_per_s * t).collect();
    let sd = (dot_product(&residuals, &residuals) / (count - 2.0)).sqrt();
    let memory = integrated_autocorrelation(&residuals);
    let independent = (count / memory).max(1.0);
    Some(SteadyLevel {
        mean,
        standard_error: sd / independent.sqrt(),
        sd,
        independent,
        slope_per_s,
        slope_standard_error: sd * (memory / spread).sqrt(),
    })
}

/// The samples without those that lie far from the middle of all: pulses of a meter are no noise, and one of them moves a
/// mean by more than all noise together. Far is six standard deviations, as the median deviation tells them.
#[must_use]
pub fn without_pulses(time_s: &[f64], values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let middle = median(values.to_vec()).unwrap_or(0.0);
    let sd = robust_deviation(values.iter().map(|value| value - middle)).unwrap_or(0.0);
    let near = |(_, value): &(&f64, &f64)| sd <= 0.0 || (*value - middle).abs() <= PULSE_SD * sd;
    time_s.iter().zip(values).filter(near).map(|(time_s, value)| (*time_s, *value)).unzip()
}

/// By how much the memory of the noise multiplies the variance of a mean; 1 for independent samples, never less. The
/// residuals are about a trend, which takes a part of slow noise with it: of the sum over `2 M + 1` lags about
/// `2 (2 M + 1) / n`, as the variance of `n` values about their mean lacks `1 / n`.
#[must_use]
pub fn integrated_autocorrelation(residuals: &[f64]) -> f64 {
    let power = dot_product(residuals, residuals);
    if power <= 0.0 {
        return 1.0;
    }
    let at = |lag: usize| dot_product(&residuals[..residuals.len() - lag], &residuals[lag..]) / power;
    let mut sum = -1.0;
    let mut last = f64::INFINITY;
    let mut lags = 0;
    for lag in (0..residuals.len().saturating_sub(1)).step_by(2).take(2000) {
        let pair = (at(lag) + at(lag + 1)).min(last);
        if pair <= 0.0 {
            break;
        }
        sum += 2.0 * pair;
        last = pair;
        lags = lag + 1;
    }
    let taken = 2.0 * count_to_f64(2 * lags + 1) / count_to_f64(residuals.len());
    (sum / (1.0 - taken).max(LEFT_MIN)).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    fn remembering(dice: &mut Pcg64Mcg, keep: f64, n: usize) -> Vec<f64> {
        let mut state = 0.0;
        let mut next = || {
            let kick: f64 = StandardNormal.sample(dice);
            state = keep * state + kick * (1.0_f64 - keep * keep).sqrt();
            state
        };
        (0..n + 50).map(|_| next()).skip(50).collect()
    }

    #[test]
    fn noise_with_memory_says_less() {
        let mut dice = Pcg64Mcg::seed_from_u64(3);
        let time_s: Vec<f64> = (0..400_i32).map(|i| 0.1 * f64::from(i)).collect();
        for keep in [0.0_f64, 0.6, 0.9] {
            let levels: Vec<SteadyLevel> = (0..400)
                .map(|_| estimate_level(&time_s, &remembering(&mut dice, keep, 400)).expect("a level"))
                .collect();
            let inside = levels.iter().filter(|it| it.mean.abs() < 2.0 * it.standard_error).count();
            let trends = levels.iter().filter(|it| it.slope_per_s.abs() < 2.0 * it.slope_standard_error).count();
            let said = levels.iter().map(|it| it.independent).sum::<f64>() / 400.0;
            println!("memory {keep}: {said:.0} independent samples, {inside} levels and {trends} slopes of 400 inside");
            assert!(inside > 355 && trends > 350, "{keep}: {inside} {trends}");
            assert!((said * (1.0 + keep) / (1.0 - keep) / 400.0 - 1.0).abs() < 0.35, "{keep}: {said}");
        }
    }

    #[test]
    fn pulses_are_left_out_and_noise_is_kept() {
        let mut dice = Pcg64Mcg::seed_from_u64(5);
        let time_s: Vec<f64> = (0..300_i32).map(f64::from).collect();
        let mut values = remembering(&mut dice, 0.5, 300);
        values[17] = 40.0;
        values[200] = -25.0;
        let (kept_s, kept) = without_pulses(&time_s, &values);
        assert_eq!((kept_s.len(), kept.len()), (298, 298));
        assert!(!kept_s.contains(&17.0) && !kept_s.contains(&200.0));
        assert_eq!(without_pulses(&[0.0, 1.0], &[3.0, 3.0]).1, vec![3.0, 3.0]);
    }

    #[test]
    fn what_is_no_series_has_no_level() {
        assert_eq!(estimate_level(&[0.0, 1.0, 2.0], &[1.0; 3]), None);
        assert_eq!(estimate_level(&[0.0, 1.0, 1.0, 2.0], &[1.0; 4]), None);
        assert_eq!(estimate_level(&[0.0, 1.0, 2.0, 3.0], &[1.0, f64::NAN, 1.0, 1.0]), None);
        let steady = estimate_level(&[0.0, 1.0, 2.0, 3.0], &[5.0; 4]).expect("a level");
        assert_eq!((steady.mean, steady.standard_error), (5.0, 0.0));
    }
}
