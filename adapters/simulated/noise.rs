//! Randomness that is a pure function of a seed and a position: asking twice, or in another order, changes nothing.

use std::f64::consts::TAU;

/// Which use the randomness has, so that uses do not share their numbers.
#[derive(Debug, Clone, Copy)]
pub(super) enum Purpose {
    RoundTrip = 1,
    SlowRoundTrip,
    SpindlePower,
    TotalPower,
    Current,
    Pulse,
    PulseSize,
    Dropout,
    DropoutPlace,
    DropoutLength,
    Temperature,
    Speed,
    Voltage,
    Gauge,
}

/// A well mixed word for (seed, purpose, index): the finaliser of SplitMix64 (Steele, Lea, Flood, OOPSLA 2014).
fn mix_word(seed: u64, purpose: Purpose, index: i64) -> u64 {
    let mut z = seed ^ (purpose as u64).wrapping_mul(0xA24B_AED4_963E_E407);
    z = z.wrapping_add(index.cast_unsigned().wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Uniform in [0, 1).
#[expect(clippy::cast_precision_loss, reason = "53 bits fit a double")]
pub(super) fn sample_uniform(seed: u64, purpose: Purpose, index: i64) -> f64 {
    (mix_word(seed, purpose, index) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Standard normal, by Box and Muller.
pub(super) fn sample_normal(seed: u64, purpose: Purpose, index: i64) -> f64 {
    let radius = (-2.0 * (1.0 - sample_uniform(seed, purpose, 2 * index)).ln()).sqrt();
    radius * (TAU * sample_uniform(seed, purpose, 2 * index + 1)).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_have_the_moments_they_should() {
        let count = 20_000;
        let normals: Vec<f64> = (0..count).map(|index| sample_normal(7, Purpose::Current, index)).collect();
        let mean = normals.iter().sum::<f64>() / 20_000.0;
        let variance = normals.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.04, "{mean} {variance}");
        assert!(sample_normal(7, Purpose::Current, 5).to_bits() == sample_normal(7, Purpose::Current, 5).to_bits());
        assert!(sample_uniform(7, Purpose::Current, 5) != sample_uniform(8, Purpose::Current, 5));
    }
}
