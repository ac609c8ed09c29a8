//! Has the spindle power settled? Two consecutive windows must each be stationary and agree with each other.
//!
//! Source: tool-wear patent, state machine, buffer G of N filtered powers. Its formula is lost and both readings are
//! kept: (1) `(max - min) / mean <= c1`, (2) `max |g - mean| / mean <= c1`. One window alone passes while a slow
//! start-up still decays (bias up to 83 % at tau = 2 s), hence the second one and the slope between them.

use super::settings::Settings;
use numerics::statistics::count_to_f64;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// The last 2 N filtered powers, W.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PowerWindow {
    length: usize,
    values: VecDeque<f64>,
    /// Smallest difference that the measurement can show, W.
    #[serde(default)]
    resolution_w: f64,
}

/// Mean powers of the older and the newer window, W.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Means {
    /// Mean of the older window.
    pub older_w: f64,
    /// Mean of the newer window.
    pub newer_w: f64,
}

impl Means {
    /// The lower one: a start-up decays, and a cut that has just begun raises the newer one.
    #[must_use]
    pub fn lower_w(self) -> f64 {
        self.older_w.min(self.newer_w)
    }
}

impl PowerWindow {
    /// Two windows of `length` values each.
    #[must_use]
    pub fn new(length: usize) -> Self {
        let length = length.max(2);
        Self { length, values: VecDeque::with_capacity(2 * length), resolution_w: 0.0 }
    }

    /// The measurement shows no smaller difference than this, W: a power that goes from one step to the next and back is
    /// stationary.
    pub fn set_resolution(&mut self, resolution_w: f64) {
        self.resolution_w = resolution_w;
    }

    /// Takes a filtered power; one that is not finite is ignored.
    pub fn push(&mut self, filtered_w: f64) {
        if !filtered_w.is_finite() {
            return;
        }
        if self.values.len() == 2 * self.length {
            self.values.pop_front();
        }
        self.values.push_back(filtered_w);
    }

    /// Forgets every value; the window is empty again.
    pub fn clear(&mut self) {
        self.values.clear();
    }

    /// The means of both windows, once both are full.
    #[must_use]
    pub fn compute_means(&self) -> Option<Means> {
        let mean = |from: usize| self.values.range(from..from + self.length).sum::<f64>() / count_to_f64(self.length);
        (self.values.len() == 2 * self.length).then(|| Means { older_w: mean(0), newer_w: mean(self.length) })
    }

    /// The means of both windows if the power is stationary: each window within c1, and the means apart by no more
    /// than `agreement_w`, which also bounds the slope.
    #[must_use]
    pub fn find_stationary_means(&self, agreement_w: f64, settings: &Settings) -> Option<Means> {
        let means = self.compute_means()?;
        let agree = (means.older_w - means.newer_w).abs() <= agreement_w;
        let within = |from, mean| {
            let values = || self.values.range(from..from + self.length).copied();
            is_stationary(values(), mean, settings) || self.is_one_step(values(), mean)
        };
        (agree && within(0, means.older_w) && within(self.length, means.newer_w)).then_some(means)
    }

    fn is_one_step(&self, values: impl Iterator<Item = f64>, mean_w: f64) -> bool {
        let (least, greatest) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, greatest), value| {
            (least.min(value), greatest.max(value))
        });
        mean_w > 0.0 && greatest - least <= self.resolution_w
    }

    /// Does the power still fall from the older to the newer window by more than `agreement_w`? `None` until both
    /// windows are full.
    #[must_use]
    pub fn is_falling(&self, agreement_w: f64) -> Option<bool> {
        self.compute_means().map(|means| means.older_w - means.newer_w > agreement_w)
    }
}

/// The source's test of one window, in the reading that the settings choose. A mean that is not positive fails.
#[must_use]
pub fn is_stationary(values: impl Iterator<Item = f64>, mean_w: f64, settings: &Settings) -> bool {
    let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
    for value in values {
        least = least.min(value);
        greatest = greatest.max(value);
    }
    let spread_w =
        if settings.stationarity_reading < 1.5 { greatest - least } else { (greatest - mean_w).max(mean_w - least) };
    mean_w > 0.0 && spread_w <= settings.c1 * mean_w
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(reading: f64, c1: f64) -> Settings {
        let mut settings = Settings::default();
        settings.set_value("stationarity_reading", reading).expect("in range");
        settings.set_value("c1", c1).expect("in range");
        settings
    }

    #[test]
    fn both_readings_of_the_source() {
        let values = [480.0, 500.0, 500.0, 520.0];
        let passes = |reading, c1| is_stationary(values.into_iter(), 500.0, &settings(reading, c1));
        assert!(passes(1.0, 0.08) && !passes(1.0, 0.079));
        assert!(passes(2.0, 0.04) && !passes(2.0, 0.039));
    }

    #[test]
    fn a_slow_decay_that_one_window_accepts_is_refused_by_two() {
        let settings = settings(1.0, 0.15);
        let power = |i: usize| 500.0 + 3000.0 * (-0.1 * count_to_f64(i) / 2.0).exp();
        let mut window = PowerWindow::new(10);
        let (mut one, mut two) = (None, None);
        for i in 0..200 {
            window.push(power(i));
            let newest = window.values.iter().rev().take(10).copied();
            let mean = newest.clone().sum::<f64>() / 10.0;
            if i >= 10 && one.is_none() && is_stationary(newest, mean, &settings) {
                one = Some(mean / 500.0 - 1.0);
            }
            if two.is_none()
                && let Some(means) = window.find_stationary_means(5.0, &settings)
            {
                two = Some(means.newer_w / 500.0 - 1.0);
            }
        }
        let (one, two) = (one.expect("passes"), two.expect("passes"));
        assert!(one > 0.2 && two < 0.02, "bias of one window {one}, of two {two}");
    }

    #[test]
    fn nothing_is_stationary_before_both_windows_are_full_or_at_zero_power() {
        let settings = Settings::default();
        let mut window = PowerWindow::new(5);
        for i in 0..10 {
            assert_eq!(window.find_stationary_means(1.0, &settings), None, "{i}");
            window.push(100.0);
        }
        assert!(window.find_stationary_means(1.0, &settings).is_some());
        (0..10).for_each(|_| window.push(0.0));
        assert_eq!(window.find_stationary_means(1.0, &settings), None);
    }
}
