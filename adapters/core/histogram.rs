//! Durations counted by size since the start: what a monitoring system adds up over time and over boxes, which percentiles
//! cannot be.

/// Upper ends of the classes, s: three to a decade, from what a fast loop is late by to what a hanging line takes.
pub const CLASSES_S: [f64; 15] =
    [0.000_02, 0.000_05, 0.000_1, 0.000_2, 0.000_5, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.5, 2.0, 10.0];

/// Durations counted by size since the start.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Histogram {
    counts: [u64; CLASSES_S.len()],
    longer: u64,
    sum_s: f64,
}

impl Histogram {
    /// Adds a duration, s; a negative one, of a clock that stepped, counts as none.
    pub fn add_s(&mut self, duration_s: f64) {
        let duration_s = duration_s.max(0.0);
        match CLASSES_S.iter().position(|end_s| duration_s <= *end_s) {
            Some(class) => self.counts[class] += 1,
            None => self.longer += 1,
        }
        self.sum_s += duration_s;
    }

    /// Adds a duration in nanoseconds.
    pub fn add_ns(&mut self, duration_ns: i64) {
        self.add_s(duration_ns as f64 / 1e9);
    }

    /// For each class its upper end, s, and how many durations were at most that.
    pub fn cumulative_counts(&self) -> impl Iterator<Item = (f64, u64)> + '_ {
        CLASSES_S.iter().zip(&self.counts).scan(0, |below, (end_s, count)| {
            *below += count;
            Some((*end_s, *below))
        })
    }

    /// How many there were.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.counts.iter().sum::<u64>() + self.longer
    }

    /// All of them together, s.
    #[must_use]
    pub fn sum_s(&self) -> f64 {
        self.sum_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_counted_from_below() {
        let mut histogram = Histogram::default();
        [0.0001, 0.003, 0.003, -1.0, 60.0].into_iter().for_each(|duration_s| histogram.add_s(duration_s));
        let at = |end_s: f64| histogram.cumulative_counts().find(|(end, _)| *end == end_s).map(|(_, count)| count);
        assert_eq!((at(0.0001), at(0.002), at(0.005), at(10.0)), (Some(2), Some(2), Some(4), Some(4)));
        assert_eq!((histogram.count(), histogram.sum_s()), (5, 60.0061));
        assert!(CLASSES_S.is_sorted());
    }
}
