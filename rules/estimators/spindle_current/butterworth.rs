//! Butterworth low-pass of 4th order: bilinear transform with the cutoff prewarped, as two second-order sections.
//!
//! Law: `H(s) = 1 / prod (s^2 + s / Q_k + 1)` with `1 / Q_k = 2 cos(pi (2 k - 1) / 8)`; with `K = tan(pi fc / fs)` a section
//! is `b = K^2 / d [1, 2, 1]`, `a = [1, 2 (K^2 - 1) / d, (1 - K / Q + K^2) / d]`, `d = 1 + K / Q + K^2`.
//! Source: Oppenheim and Schafer, Discrete-Time Signal Processing, 3rd edition, 7.2.1 and 7.3; run in transposed direct
//! form II (6.3.4 there).
//!
//! A filter behind the sampling removes nothing that has already folded down: at 350 Hz of 1 kHz, which is 0.7 of the
//! Nyquist frequency, an analogue filter must stand in front against the carrier of the inverter.

use crate::regression::{Refusal, RefusalKind};
use std::f64::consts::{PI, TAU};

const SECTIONS: usize = 2;

/// Below this a state that dies away is zero; denormal numbers would be slow.
const SILENT: f64 = 1e-30;

/// One section: `b0 b1 b2 a1 a2` with `a0 = 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Section {
    b: [f64; 3],
    a: [f64; 2],
}

/// A low-pass for one rate of samples; [`LowPassDesign::build_filter`] gives one that runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowPassDesign {
    sections: [Section; SECTIONS],
    rate_hz: f64,
    cutoff_hz: f64,
}

impl LowPassDesign {
    /// The low-pass whose gain is 1/sqrt(2) at `cutoff_hz`, for samples at `rate_hz`. Cutoffs from 1/10 000 to 0.499 of
    /// the rate.
    ///
    /// # Errors
    /// A rate or cutoff outside of that.
    pub fn low_pass(cutoff_hz: f64, rate_hz: f64) -> Result<Self, Refusal> {
        let share = cutoff_hz / rate_hz;
        if !(rate_hz.is_finite() && rate_hz > 0.0 && (1e-4..=0.499).contains(&share)) {
            let what = format!("a cutoff of {cutoff_hz} Hz at {rate_hz} samples per second");
            let next = "the cutoff lies below half of the rate and above a ten-thousandth of it";
            return Err(Refusal::new(RefusalKind::OutOfRange, what, next));
        }
        let k = (PI * share).tan();
        // Poles far from the circle first; the gain of all sections stands in the first.
        let mut sections = [1.0, 3.0].map(|odd: f64| compute_section(k, 2.0 * (PI * odd / 8.0).cos()));
        let gain: f64 = sections.iter().map(|(gain, _)| gain).product();
        sections[0].0 = gain;
        sections[1].0 = 1.0;
        let sections = sections.map(|(gain, a)| Section { b: [gain, 2.0 * gain, gain], a });
        Ok(Self { sections, rate_hz, cutoff_hz })
    }

    /// Frequency at which the gain is 1/sqrt(2), Hz.
    #[must_use]
    pub fn cutoff_hz(&self) -> f64 {
        self.cutoff_hz
    }

    /// Second-order sections, each `b0 b1 b2 1 a1 a2`.
    #[must_use]
    pub fn sections(&self) -> [[f64; 6]; SECTIONS] {
        self.sections.map(|Section { b, a }| [b[0], b[1], b[2], 1.0, a[0], a[1]])
    }

    /// Numerator and denominator of the whole, five coefficients each. For comparison; the sections run.
    #[must_use]
    pub fn polynomials(&self) -> ([f64; 5], [f64; 5]) {
        let [first, second] = self.sections();
        let product = |x: &[f64], y: &[f64]| {
            let mut out = [0.0; 5];
            for (i, x) in x.iter().enumerate() {
                y.iter().enumerate().for_each(|(j, y)| out[i + j] += x * y);
            }
            out
        };
        (product(&first[..3], &second[..3]), product(&first[3..], &second[3..]))
    }

    /// Gain at a frequency, dB.
    #[must_use]
    pub fn gain_db(&self, hz: f64) -> f64 {
        let size = |c: [f64; 3]| evaluate_response(c, hz / self.rate_hz).0;
        let gain = |s: &Section| size(s.b) / size([1.0, s.a[0], s.a[1]]);
        20.0 * self.sections.iter().map(gain).product::<f64>().log10()
    }

    /// Delay of slow changes, s.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        let delay = |c: [f64; 3]| (c[1] + 2.0 * c[2]) / (c[0] + c[1] + c[2]);
        let samples: f64 = self.sections.iter().map(|s| delay(s.b) - delay([1.0, s.a[0], s.a[1]])).sum();
        samples / self.rate_hz
    }

    /// A filter at rest.
    #[must_use]
    pub fn build_filter(&self) -> LowPass {
        LowPass { sections: self.sections, states: [[0.0; 2]; SECTIONS] }
    }
}

/// Square of the prewarped cutoff over `d`, and the two denominator coefficients.
fn compute_section(k: f64, per_q: f64) -> (f64, [f64; 2]) {
    let d = 1.0 + k * per_q + k * k;
    (k * k / d, [2.0 * (k * k - 1.0) / d, (1.0 - k * per_q + k * k) / d])
}

/// Size and phase of `c0 + c1 z^-1 + c2 z^-2` on the unit circle.
fn evaluate_response(c: [f64; 3], share: f64) -> (f64, f64) {
    let w = TAU * share;
    let real = c[0] + c[1] * w.cos() + c[2] * (2.0 * w).cos();
    let imaginary = -(c[1] * w.sin() + c[2] * (2.0 * w).sin());
    (real.hypot(imaginary), imaginary.atan2(real))
}

/// A running low-pass. No allocation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowPass {
    sections: [Section; SECTIONS],
    states: [[f64; 2]; SECTIONS],
}

impl LowPass {
    /// Takes a sample. `None` for a number that is not finite: the filter begins anew then, so that one bad sample does
    /// not stay in it for ever.
    pub fn push(&mut self, sample: f64) -> Option<f64> {
        if !sample.is_finite() {
            self.reset_state();
            return None;
        }
        let mut x = sample;
        for (section, state) in self.sections.iter().zip(&mut self.states) {
            let y = section.b[0] * x + state[0];
            state[0] = flush_small_state(section.b[1] * x - section.a[0] * y + state[1]);
            state[1] = flush_small_state(section.b[2] * x - section.a[1] * y);
            x = y;
        }
        Some(x)
    }

    /// Sets both sections to rest, as before the first sample.
    pub fn reset_state(&mut self) {
        self.states = [[0.0; 2]; SECTIONS];
    }
}

fn flush_small_state(state: f64) -> f64 {
    if state.abs() < SILENT { 0.0 } else { state }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source() -> LowPassDesign {
        LowPassDesign::low_pass(350.0, 1000.0).expect("the filter of the source")
    }

    #[test]
    fn the_running_filter_is_the_difference_equation_of_the_polynomials() {
        let (b, a) = source().polynomials();
        let mut filter = source().build_filter();
        let input = |n: i64| if n < 0 { 0.0 } else { ((n * n % 17) as f64 - 8.0) / 3.0 };
        let mut out: Vec<f64> = Vec::new();
        for n in 0..200_i64 {
            let direct: f64 = (0..5_i64)
                .map(|k| {
                    let before = n - k;
                    let y = usize::try_from(before).ok().filter(|at| *at < out.len()).map_or(0.0, |at| out[at]);
                    b[k as usize] * input(before) - if k > 0 { a[k as usize] * y } else { 0.0 }
                })
                .sum();
            out.push(direct);
            let ours = filter.push(input(n)).expect("finite");
            assert!((ours - direct).abs() < 1e-12, "{n}");
        }
    }

    #[test]
    fn the_gain_is_that_of_butterworth_at_every_rate_and_cutoff() {
        for (cutoff, rate) in [(350.0, 1000.0), (50.0, 8000.0), (2.0, 10_000.0), (490.0, 1000.0), (0.3, 1000.0)] {
            let design = LowPassDesign::low_pass(cutoff, rate).expect("in range");
            let warped = |hz: f64| (PI * hz / rate).tan() / (PI * cutoff / rate).tan();
            for share in [0.1, 0.5, 1.0, 1.5] {
                let hz = share * cutoff;
                if hz < 0.5 * rate {
                    let expected = -10.0 * (1.0 + warped(hz).powi(8)).log10();
                    assert!((design.gain_db(hz) - expected).abs() < 1e-6, "{cutoff} {rate} {hz}");
                }
            }
        }
    }

    #[test]
    fn a_bad_sample_is_forgotten_and_bad_designs_are_refused() {
        let mut filter = source().build_filter();
        (0..50).for_each(|_| assert!(filter.push(5.0).is_some()));
        assert_eq!(filter.push(f64::NAN), None);
        assert_eq!(filter, source().build_filter());
        let settled = (0..200).filter_map(|_| filter.push(5.0)).last().expect("samples");
        assert!((settled - 5.0).abs() < 1e-12, "no gain at rest");
        for (cutoff, rate) in [(500.0, 1000.0), (0.0, 1000.0), (350.0, 0.0), (f64::NAN, 1000.0), (350.0, f64::INFINITY)]
        {
            assert!(LowPassDesign::low_pass(cutoff, rate).is_err(), "{cutoff} {rate}");
        }
    }
}
