//! The feature of an alternating current: mean absolute, rms, or the integral of the absolute value, over whole half
//! periods.
//!
//! The source integrates over "a fixed duration": an integral of the current itself over a period is zero, so its absolute
//! value or its square is meant; which one is a choice here. Over a window that is no whole number of half periods the
//! feature ripples (13.9 % with 40 samples at 33.3 Hz and 1 kHz), so the window follows the current, or the speed.

use super::butterworth::{LowPass, LowPassDesign};
use super::half_periods::{CurrentSums, Splitter};
use crate::regression::{Refusal, RefusalKind};

/// At most this many half periods make a window.
const HALVES_MAX: usize = 64;
/// The threshold that a passage of zero must exceed on the other side, as a share of the mean absolute current.
const THRESHOLD_SHARE: f64 = 0.15;
/// Weight of a new half period in the level that the threshold follows.
const LEVEL_WEIGHT: f64 = 0.2;
/// A window without an end after so many seconds has no current in it: the spindle is fed with direct current, or not at
/// all.
const PATIENCE_S: f64 = 2.0;

/// What is made of the current over the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FeatureKind {
    /// `1/T` times the integral of `|i|`, A.
    MeanAbsolute,
    /// Root of `1/T` times the integral of `i^2`, A.
    Rms,
    /// The integral of `|i|`, A s; it also grows with the length of the window.
    AbsoluteIntegral,
}

/// Where the window begins and ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WindowSpan {
    /// At passages of zero; currents below `least_a` pass no zero.
    Crossings {
        /// Greater than the noise about zero, A.
        least_a: f64,
    },
    /// After whole half periods of a current of known frequency.
    Known {
        /// Frequency of the current, Hz.
        hz: f64,
    },
}

/// A feature over one window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feature {
    /// The value, A or A s.
    pub value: f64,
    /// Length of the window, s.
    pub window_s: f64,
    /// Frequency of the current over the window, Hz.
    pub frequency_hz: f64,
}

/// The feature of one phase. No allocation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseFeature {
    kind: FeatureKind,
    span: WindowSpan,
    rate_hz: f64,
    halves: usize,
    splitter: Splitter,
    window: CurrentSums,
    filled: usize,
    level_a: f64,
    waited: f64,
}

impl PhaseFeature {
    /// A feature over windows of `halves` half periods (1 to 64; an even number cancels an offset) of a current sampled at
    /// `rate_hz`.
    ///
    /// # Errors
    /// A rate, number or threshold out of range; a known frequency above a quarter of the rate.
    pub fn new(kind: FeatureKind, span: WindowSpan, halves: usize, rate_hz: f64) -> Result<Self, Refusal> {
        let refuse = |what: String, next: &str| Err(Refusal::new(RefusalKind::OutOfRange, what, next));
        if !(1..=HALVES_MAX).contains(&halves) {
            return refuse(format!("{halves} half periods"), "take 1 to 64; 2 are a whole period");
        }
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return refuse(format!("{rate_hz} samples per second"), "give the rate of the samples");
        }
        match span {
            WindowSpan::Crossings { least_a } if !(least_a.is_finite() && least_a > 0.0) => {
                return refuse(format!("a threshold of {least_a} A"), "give a little more than the noise about zero");
            }
            WindowSpan::Known { hz } if !(hz > 0.0 && hz <= 0.25 * rate_hz) => {
                return refuse(format!("a current of {hz} Hz at {rate_hz} samples per second"), "sample faster");
            }
            _ => {}
        }
        let (splitter, window) = (Splitter::new(), CurrentSums::default());
        Ok(Self { kind, span, rate_hz, halves, splitter, window, filled: 0, level_a: 0.0, waited: 0.0 })
    }

    /// Takes a sample, A; the feature when a window has ended. A sample that is no number begins the window anew.
    pub fn push(&mut self, sample_a: f64) -> Option<Feature> {
        if !sample_a.is_finite() {
            self.restart_window();
            return None;
        }
        match self.span {
            WindowSpan::Crossings { least_a } => self.push_by_crossings(sample_a, least_a),
            WindowSpan::Known { hz } => self.push_by_frequency(sample_a, hz),
        }
    }

    /// Begins a window anew.
    pub fn restart_window(&mut self) {
        (self.splitter, self.window, self.filled, self.waited) = (Splitter::new(), CurrentSums::default(), 0, 0.0);
        self.level_a = 0.0;
    }

    fn push_by_crossings(&mut self, sample_a: f64, least_a: f64) -> Option<Feature> {
        self.waited += 1.0;
        if self.waited > PATIENCE_S * self.rate_hz {
            self.restart_window();
        }
        let half = self.splitter.push(sample_a, least_a.max(THRESHOLD_SHARE * self.level_a))?;
        self.waited = 0.0;
        let mean_a = half.absolute / half.samples;
        let weight = if self.level_a == 0.0 { 1.0 } else { LEVEL_WEIGHT };
        self.level_a += weight * (mean_a - self.level_a);
        self.window.add(half);
        self.filled += 1;
        (self.filled == self.halves).then(|| self.finish_window())
    }

    /// Rectangles of one sample each; the last one is split between this window and the next.
    fn push_by_frequency(&mut self, sample_a: f64, hz: f64) -> Option<Feature> {
        let one = CurrentSums { samples: 1.0, absolute: sample_a.abs(), square: sample_a * sample_a };
        let length = numerics::statistics::count_to_f64(self.halves) * 0.5 * self.rate_hz / hz;
        let rest = length - self.window.samples;
        if rest > 1.0 {
            self.window.add(one);
            return None;
        }
        let part =
            |share: f64| CurrentSums { samples: share, absolute: one.absolute * share, square: one.square * share };
        self.window.add(part(rest));
        let feature = self.finish_window();
        self.window = part(1.0 - rest);
        Some(feature)
    }

    fn finish_window(&mut self) -> Feature {
        let CurrentSums { samples, absolute, square } = std::mem::take(&mut self.window);
        self.filled = 0;
        let window_s = samples / self.rate_hz;
        let value = match self.kind {
            FeatureKind::MeanAbsolute => absolute / samples,
            FeatureKind::Rms => (square / samples).sqrt(),
            FeatureKind::AbsoluteIntegral => absolute / self.rate_hz,
        };
        Feature { value, window_s, frequency_hz: numerics::statistics::count_to_f64(self.halves) / (2.0 * window_s) }
    }
}

/// Three phases: filter and feature of each, and their mean. No allocation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThreePhase {
    filters: [LowPass; 3],
    phases: [PhaseFeature; 3],
    last: [Option<Feature>; 3],
}

impl ThreePhase {
    /// The same filter and feature for each phase.
    #[must_use]
    pub fn new(design: &LowPassDesign, phase: PhaseFeature) -> Self {
        Self { filters: [design.build_filter(); 3], phases: [phase; 3], last: [None; 3] }
    }

    /// Takes one sample of each phase, A. The mean feature of the three phases whenever the first one's window has ended
    /// and all have one; a broken phase gives no mean.
    pub fn push(&mut self, samples_a: [f64; 3]) -> Option<Feature> {
        let mut ended = false;
        for (at, sample_a) in samples_a.into_iter().enumerate() {
            match self.filters[at].push(sample_a) {
                Some(filtered_a) => {
                    if let Some(feature) = self.phases[at].push(filtered_a) {
                        self.last[at] = Some(feature);
                        ended |= at == 0;
                    }
                }
                None => self.drop_phase(at),
            }
        }
        if ended { self.average_phases() } else { None }
    }

    fn drop_phase(&mut self, at: usize) {
        self.phases[at].restart_window();
        self.last[at] = None;
    }

    /// Features of the three phases, as last known.
    #[must_use]
    pub fn phases(&self) -> [Option<Feature>; 3] {
        self.last
    }

    /// Greatest deviation of a phase from the mean of the three, as a share of that mean; a tenth is a worn contact, a half
    /// a lost phase. `None` until all have a feature.
    #[must_use]
    pub fn unbalance(&self) -> Option<f64> {
        let mean = self.average_phases()?.value;
        let off = self.last.iter().flatten().map(|feature| (feature.value - mean).abs()).fold(0.0, f64::max);
        (mean > 0.0).then(|| off / mean)
    }

    fn average_phases(&self) -> Option<Feature> {
        let [Some(a), Some(b), Some(c)] = self.last else { return None };
        Some(Feature {
            value: (a.value + b.value + c.value) / 3.0,
            window_s: (a.window_s + b.window_s + c.window_s) / 3.0,
            frequency_hz: (a.frequency_hz + b.frequency_hz + c.frequency_hz) / 3.0,
        })
    }
}
