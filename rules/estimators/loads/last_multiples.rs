//! Is the power a multiple of the learned one at every one of the last samples?
//!
//! The filter of the power takes out a disturbance of one sample. A disturbed reading of a meter is more than that: values between two
//! readings are interpolated, so it lies in `r` samples, where a meter with a reading every `k` samples gives `r <= 2 k - 1`. A filter of
//! `N` samples lets it through for `N + r - 2` samples at most. So a multiple counts that lasts for `2 N`: that is longer for every
//! meter with a reading every `(N + 2) / 2` samples or more often, three samples for a filter of five. A meter that is slower beside
//! such a filter can still have one disturbed reading told as a multiple.

use std::collections::VecDeque;

/// A multiple must last for so many lengths of the filter. More: a real one is told later; fewer: a disturbed reading is told.
const FILTER_LENGTHS: usize = 2;

/// For how many samples a multiple must last where the filter of the power has so many.
pub(super) const fn count_sure_samples(filter_length: usize) -> usize {
    FILTER_LENGTHS * filter_length
}

/// The multiples at the last samples of a cut.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct LastMultiples(VecDeque<f64>);

impl LastMultiples {
    /// Takes one more, and gives the least of the last `length`; `None` before there are so many.
    pub(super) fn push(&mut self, multiple: f64, length: usize) -> Option<f64> {
        self.0.push_back(multiple);
        while self.0.len() > length {
            self.0.pop_front();
        }
        (self.0.len() == length).then(|| self.0.iter().copied().fold(f64::INFINITY, f64::min))
    }

    /// Another cut begins: what was seen so far does not count for it.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::AntiPulse;

    /// The greatest multiple that is told of a meter whose readings are as given, one every `k` samples, behind a filter of `length`.
    fn find_greatest(length: usize, k: usize, disturbed: impl Fn(usize) -> f64) -> f64 {
        let (mut filter, mut last) = (AntiPulse::new(length), LastMultiples::default());
        let mut greatest = 0.0_f64;
        for sample in 0..100 * k {
            let (reading, share) = (sample / k, (sample % k) as f64 / k as f64);
            let power = disturbed(reading) * (1.0 - share) + disturbed(reading + 1) * share;
            let sure = count_sure_samples(length);
            if let Some(multiple) = filter.push(power).and_then(|mean| last.push(mean, sure)) {
                greatest = greatest.max(multiple);
            }
        }
        greatest
    }

    /// Every filter from 3 to 12 samples, every meter whose disturbance is no longer than the filter and one sample, disturbances of
    /// 10 to 1,000 times the power.
    #[test]
    fn one_disturbed_reading_is_no_multiple_and_a_lasting_one_is() {
        for length in 3..=12 {
            for k in 1..=(length + 2) / 2 {
                for height in [10.0, 100.0, 1000.0] {
                    let once = find_greatest(length, k, |reading| if reading == 30 { height } else { 1.0 });
                    assert!((once - 1.0).abs() < 1e-9, "{once} of {height}, filter of {length}, reading every {k}");
                    let lasting = find_greatest(length, k, |reading| if reading >= 30 { height } else { 1.0 });
                    assert!((lasting / height - 1.0).abs() < 1e-9, "{lasting} of {height}, filter of {length}");
                }
            }
        }
    }
}
