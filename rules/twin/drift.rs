//! Slow drift or slow noise? Noise of many machines has the more power the slower it is, in proportion to one over the
//! frequency, without end (flicker noise). A model of noise with one memory does not reach so far down, and what it
//! leaves looks like a drift. A drift is more than the faster modes let expect of such noise.

use super::fit::{Data, Fit};
use super::model::Part;
use crate::statistics::{count, mean};
use std::f64::consts::PI;
use std::ops::RangeInclusive;

/// Modes, in half waves over the recording, in which a drift lies, and those that tell how strong flicker noise is.
const SLOW: RangeInclusive<usize> = 1..=4;
const FASTER: RangeInclusive<usize> = 9..=32;
/// By how much the slow modes must exceed what flicker noise of the faster ones has in them: F(4, 24) at 2 %, on top of
/// a gate that such noise rarely passes.
const EXCEEDS: f64 = 3.5;

/// Does this drift exceed flicker noise?
pub(super) fn stands_out(drift: &Part, fit: &Fit, data: &Data<'_>) -> bool {
    let Some(drift) = drift.contribution(data.scene).map(|drift| data.frame.reduce(&drift)) else { return false };
    let slow: Vec<f64> = drift.iter().zip(&fit.residual).map(|(drift, left)| drift + left).collect();
    exceeds_flicker(&slow)
}

/// Power times frequency is the same in every mode of flicker noise.
fn exceeds_flicker(values: &[f64]) -> bool {
    if values.len() < 2 * FASTER.end() {
        return true;
    }
    let level = |modes: RangeInclusive<usize>| mean(&modes.map(|k| count(k) * power(values, k)).collect::<Vec<_>>());
    level(SLOW) > EXCEEDS * level(FASTER)
}

/// Power of a mode of so many half waves (discrete cosine transform).
fn power(values: &[f64], half_waves: usize) -> f64 {
    let turn = PI * count(half_waves) / count(values.len());
    let sum: f64 = values.iter().enumerate().map(|(row, x)| x * (turn * (count(row) + 0.5)).cos()).sum();
    sum * sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const ROWS: usize = 1000;

    /// Flicker noise as the sum of memories of one row, four, sixteen and so on (Voss).
    fn flicker(seed: u64) -> Vec<f64> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let mut sources = [0.0; 10];
        let mut value = |row: usize| {
            for (octave, source) in sources.iter_mut().enumerate() {
                if row.is_multiple_of(1 << octave) {
                    *source = StandardNormal.sample(&mut rng);
                }
            }
            sources.iter().sum::<f64>()
        };
        (0..ROWS).map(&mut value).collect()
    }

    #[test]
    fn flicker_noise_is_no_drift_and_a_drift_in_it_is_one() {
        let alarms = (0..200).filter(|seed| exceeds_flicker(&flicker(*seed))).count();
        assert!(alarms <= 10, "{alarms} of 200");
        let drifting =
            |seed: u64| flicker(seed).iter().zip(0..).map(|(x, row)| x + 0.02 * f64::from(row)).collect::<Vec<_>>();
        let seen = (0..200).filter(|seed| exceeds_flicker(&drifting(*seed))).count();
        assert!(seen >= 180, "{seen} of 200");
    }
}
