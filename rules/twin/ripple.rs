//! A wave that nobody records: the ripple of the mains, folded by slow sampling, wanders in phase and size, so it is a
//! state and not a sum of a cosine and a sine over the whole recording.
//!
//! A line of the spectrum gives the start; frequency, memory, size and noise are those that make the residual likeliest
//! (`wave`). Whether it is the mains is judged by whether the frequency stays while feed and speed change.

use super::noise::{Arma, PHI_MAX, whiten};
use super::wave::{Wave, likelihood, smoothed, variance};
use crate::statistics::count;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::ops::Range;

/// Rows of a segment of the first look at the spectrum.
const SEGMENT_ROWS: usize = 64;
/// Power of the strongest line over the mean of the spectrum below which nobody looks closer.
const PEAK_MIN: f64 = 1.5;
/// Lowest and highest frequency, in turns per row: below, passes of a repeated part make lines of their own.
const FREQUENCIES: (f64, f64) = (0.04, 0.49);
/// Turns after which a wave has lost its phase: less is slow noise, not a wave.
const TURNS_MIN: f64 = 1.2;
/// Information that a wave must bring after every price: the resampling of the search cannot judge a followed state.
const INFORMATION_MIN: f64 = 4.0;
/// Twice the gain in log-likelihood from which a part of a recording is said to show the wave.
const SEEN: f64 = 12.0;
/// Rounds of refinement.
const ROUNDS: usize = 60;

/// Mean correlation of a wave from cut to cut from which each cut begins it anew.
pub const IN_STEP: f64 = 0.3;

/// What was found in a residual.
#[derive(Debug, Clone, PartialEq)]
pub struct Ripple {
    /// The wave.
    pub wave: Wave,
    /// Twice the gain in log-likelihood over the noise alone.
    pub gain: f64,
    /// The wave per row of the residual, given all rows of its stretch.
    pub values: Vec<f64>,
    /// Standard deviation of the wave, in the residual's unit.
    pub deviation: f64,
    /// Standard error of the frequency, in turns per row.
    pub frequency_error: f64,
}

/// The price of a wave: frequency, memory and size, and the choice among the frequencies that can be told apart.
#[must_use]
pub fn price(rows: usize) -> f64 {
    3.0 * count(rows.max(2)).ln() + 2.0 * (count(SEGMENT_ROWS) / 2.0).ln()
}

/// Finds a wave in a residual with these unbroken stretches and this noise, if there is one worth its price.
#[must_use]
pub fn find(residual: &[f64], stretches: &[Range<usize>], noise: Arma) -> Option<Ripple> {
    // A strong wave looks like memory: with less of it the line stands out.
    let less = Arma { phi: 0.5 * noise.phi, theta: 0.5 * noise.theta };
    let frequency = strongest(&whiten(residual, stretches, less), stretches)?;
    let score = |wave: &Wave| likelihood(residual, stretches, wave);
    let without = score(&Wave { frequency, rho: 0.9, size: 0.0, noise });
    let starts = [(0.9, 0.5), (0.97, 0.5), (0.97, 2.0)];
    let start = starts.map(|(rho, size)| Wave { frequency, rho, size, noise: Arma { phi: noise.phi * 0.8, ..noise } });
    let scored = start.into_iter().map(|wave| (score(&wave), wave));
    let best = refined(scored.fold((f64::NEG_INFINITY, start[0]), |a, b| if b.0 > a.0 { b } else { a }), &score);
    let gain = 2.0 * (best.0 - without);
    if gain < price(residual.len()) + INFORMATION_MIN || !is_wave(&best.1) {
        return None;
    }
    let values = smoothed(residual, stretches, &best.1);
    let deviation = (best.1.size * variance(residual, stretches, &best.1)).sqrt();
    Some(Ripple { gain, values, deviation, frequency_error: frequency_error(best, &score), wave: best.1 })
}

/// Mean correlation of a wave in one pass with that in another of the same tool, row by row from where the cut begins: none
/// for the mains, which run through; one for what each cut begins anew, as an insert that rocks in its seat does. Of each
/// pass its tool, and the wave where it is known.
#[must_use]
pub fn in_step<'a>(passes: impl Iterator<Item = (&'a str, &'a [Option<f64>])>) -> f64 {
    // By tool and row of the pass: how many, their sum and the sum of their squares.
    let mut sums: BTreeMap<(&str, usize), (f64, f64, f64)> = BTreeMap::new();
    for (tool, pass) in passes {
        for (row, value) in pass.iter().enumerate().filter_map(|(row, value)| Some((row, (*value)?))) {
            let of = sums.entry((tool, row)).or_default();
            *of = (of.0 + 1.0, of.1 + value, of.2 + value * value);
        }
    }
    let together: f64 = sums.values().map(|(_, sum, squares)| sum * sum - squares).sum();
    let all: f64 = sums.values().map(|(passes, _, squares)| (passes - 1.0) * squares).sum();
    if all > 0.0 { together / all } else { 0.0 }
}

/// Do two sets of stretches agree on the frequency of a wave? Also where one of them is too short to say.
#[must_use]
pub fn same_frequency(residual: &[f64], one: &[Range<usize>], other: &[Range<usize>], wave: &Wave) -> bool {
    match (frequency_in(residual, one, wave), frequency_in(residual, other, wave)) {
        (Some((a, error_a)), Some((b, error_b))) => (a - b).abs() < 0.004 + 3.0 * error_a.hypot(error_b),
        _ => true,
    }
}

/// Do these stretches say that a wave as it is elsewhere is not there? Not where they are too short to say.
#[must_use]
pub fn is_absent(residual: &[f64], stretches: &[Range<usize>], wave: &Wave) -> bool {
    let rows: usize = stretches.iter().map(ExactSizeIterator::len).sum();
    let without = || likelihood(residual, stretches, &Wave { size: 0.0, ..*wave });
    rows >= SEGMENT_ROWS && 2.0 * (without() - likelihood(residual, stretches, wave)) > SEEN
}

/// Likeliest frequency in some stretches, and its standard error; `None` where they tell nothing of the wave.
fn frequency_in(residual: &[f64], stretches: &[Range<usize>], wave: &Wave) -> Option<(f64, f64)> {
    let rows: usize = stretches.iter().map(ExactSizeIterator::len).sum();
    if rows < SEGMENT_ROWS {
        return None;
    }
    let score = |wave: &Wave| likelihood(residual, stretches, wave);
    let without = score(&Wave { size: 0.0, ..*wave });
    let tries = (0..240).map(|step| Wave { frequency: 0.01 + 0.002 * count(step), ..*wave });
    let scored = tries.map(|wave| (score(&wave), wave));
    let best = scored.fold((f64::NEG_INFINITY, *wave), |a, b| if b.0 > a.0 { b } else { a });
    (2.0 * (best.0 - without) > SEEN).then(|| (best.1.frequency, frequency_error(best, &score)))
}

/// Does it keep its phase for long enough to be called a wave?
fn is_wave(wave: &Wave) -> bool {
    let inside = wave.frequency > FREQUENCIES.0 && wave.frequency < FREQUENCIES.1;
    inside && wave.frequency / (1.0 - wave.rho).max(1e-6) >= TURNS_MIN
}

/// The frequency of the strongest line of the mean spectrum of half-overlapping segments, if it stands out.
fn strongest(innovations: &[f64], stretches: &[Range<usize>]) -> Option<f64> {
    let bins = 2 * SEGMENT_ROWS;
    let frequency = |bin: usize| 0.5 * count(bin) / count(bins);
    let usable = |bin: &usize| frequency(*bin) > FREQUENCIES.0 && frequency(*bin) < FREQUENCIES.1;
    let mut power = vec![0.0; bins];
    let mut segments = 0;
    for rows in stretches {
        let mut start = rows.start;
        while start + SEGMENT_ROWS <= rows.end {
            let segment = &innovations[start..start + SEGMENT_ROWS];
            (0..bins).filter(usable).for_each(|bin| power[bin] += power_at(segment, frequency(bin)));
            segments += 1;
            start += SEGMENT_ROWS / 2;
        }
    }
    let used: Vec<usize> = (0..bins).filter(usable).collect();
    let mean = used.iter().map(|bin| power[*bin]).sum::<f64>() / count(used.len());
    let best = used.into_iter().max_by(|a, b| power[*a].total_cmp(&power[*b]))?;
    // A spectrum that falls from its lowest bin on has memory, not a line.
    let stands_out = best > (0..bins).find(usable)? && power[best] > PEAK_MIN * mean;
    (segments >= 4 && stands_out).then(|| frequency(best))
}

/// Power of a tapered segment at one frequency.
fn power_at(segment: &[f64], frequency: f64) -> f64 {
    let (mut cosine, mut sine) = (0.0, 0.0);
    for (row, x) in segment.iter().enumerate() {
        let taper = (0.5 * TAU * (count(row) + 0.5) / count(segment.len())).sin();
        let (s, c) = (TAU * frequency * count(row)).sin_cos();
        cosine += x * taper * c;
        sine += x * taper * s;
    }
    cosine * cosine + sine * sine
}

/// Pattern search over frequency, memory, size and noise.
fn refined(mut best: (f64, Wave), score: &impl Fn(&Wave) -> f64) -> (f64, Wave) {
    let mut step = 1.0;
    for _ in 0..ROUNDS {
        let mut moved = false;
        for index in 0..5 {
            for direction in [1.0, -1.0] {
                let wave = nudged(&best.1, index, direction * step);
                let got = score(&wave);
                if got > best.0 + 1e-6 {
                    best = (got, wave);
                    moved = true;
                    break;
                }
            }
        }
        if !moved {
            step *= 0.5;
            if step < 0.02 {
                break;
            }
        }
    }
    best
}

fn nudged(wave: &Wave, index: usize, step: f64) -> Wave {
    let mut new = *wave;
    match index {
        0 => new.frequency = (wave.frequency + 0.004 * step).clamp(0.005, 0.495),
        1 => new.rho = (1.0 - (1.0 - wave.rho) * (-0.5 * step).exp()).clamp(0.5, 0.999),
        2 => new.size = (wave.size * (0.7 * step).exp()).clamp(1e-3, 1e4),
        3 => new.noise.phi = (wave.noise.phi + 0.2 * step * (1.0 - wave.noise.phi).max(0.02)).clamp(-0.5, PHI_MAX),
        _ => new.noise.theta = (wave.noise.theta + 0.15 * step).clamp(-0.98, 0.9),
    }
    new
}

/// From the curvature of the likelihood over the frequency.
fn frequency_error(best: (f64, Wave), score: &impl Fn(&Wave) -> f64) -> f64 {
    let step = 0.002;
    let at = |d: f64| score(&Wave { frequency: best.1.frequency + d, ..best.1 });
    let curvature = (2.0 * best.0 - at(step) - at(-step)) / (step * step);
    if curvature > 0.0 { (1.0 / curvature).sqrt() } else { step }
}

#[cfg(test)]
mod tests {
    use super::super::wave::follow;
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn normal(rows: usize, seed: u64) -> Vec<f64> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        (0..rows).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    #[test]
    fn a_wandering_wave_is_found_and_followed() {
        let (noise, steps) = (normal(1500, 1), normal(1500, 2));
        let mut phase = 0.0;
        let wave: Vec<f64> = steps
            .iter()
            .map(|step| {
                phase += TAU * 0.17 + 0.1 * step;
                f64::sin(phase)
            })
            .collect();
        let residual: Vec<f64> = noise.iter().zip(&wave).map(|(noise, wave)| noise + wave).collect();
        let all = [0..500, 500..1500];
        let found = find(&residual, &all, Arma::WHITE).expect("a wave");
        assert!((found.wave.frequency - 0.17).abs() < 0.01, "{:?}", found.wave);
        let left = |estimate: &[f64]| estimate.iter().zip(&wave).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 1500.0;
        assert!(left(&found.values) < 0.25 && left(&follow(&residual, &found.wave)) < 0.42, "{}", left(&found.values));
    }

    #[test]
    fn noise_slow_noise_and_steps_are_no_wave() {
        let all = [0..1000, 1000..2000];
        for seed in 10..20 {
            let white = normal(2000, seed);
            let mut slow = 0.0;
            let coloured: Vec<f64> = white
                .iter()
                .map(|x| {
                    slow = 0.9 * slow + x;
                    slow
                })
                .collect();
            assert_eq!(find(&white, &all, Arma::WHITE), None);
            assert_eq!(find(&coloured, &all, Arma { phi: 0.9, theta: 0.0 }), None);
        }
    }

    #[test]
    fn what_each_cut_begins_anew_is_in_step_and_the_mains_are_not() {
        let pass = |begin: f64| (0..40).map(|row| Some((begin + 0.4 * count(row)).sin())).collect::<Vec<_>>();
        let anew: Vec<_> = (0..12).map(|_| pass(0.3)).collect();
        let through: Vec<_> = (0..12).map(|number| pass(0.4 * 97.0 * count(number))).collect();
        let in_step = |passes: &[Vec<Option<f64>>]| super::in_step(passes.iter().map(|pass| ("T1", pass.as_slice())));
        assert!(in_step(&anew) > 0.999 && in_step(&through).abs() < 0.1, "{} {}", in_step(&anew), in_step(&through));
    }

    #[test]
    fn a_wave_that_stops_with_the_pump_is_absent_without_it() {
        let noise = normal(2000, 3);
        let wave = |row: usize| if row < 1000 { 2.0 * (TAU * 0.13 * count(row)).sin() } else { 0.0 };
        let residual: Vec<f64> = noise.iter().enumerate().map(|(row, noise)| noise + wave(row)).collect();
        let with = Wave { frequency: 0.13, rho: 0.97, size: 2.0, noise: Arma::WHITE };
        assert!(is_absent(&residual, &[1000..1500, 1500..2000], &with));
        assert!(!is_absent(&residual, &[0..500, 500..1000], &with), "it is there");
        assert!(!is_absent(&residual, std::slice::from_ref(&(1000..1040)), &with), "too short to say");
    }
}
