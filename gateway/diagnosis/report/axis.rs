//! One axis of a chart: its range, the round values marked on it, and their labels.

use super::text::format_fixed;

/// A range of values and the round values in it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Axis {
    /// From the least to the greatest finite value; `None` where there is none.
    pub(super) fn from_values(values: impl Iterator<Item = f64>) -> Option<Self> {
        let start = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = values.filter(|x| x.is_finite()).fold(start, |(low, high), x| (low.min(x), high.max(x)));
        (low <= high).then(|| Self { low, high }.widen_range())
    }

    /// Never empty: a single value gets room on both sides.
    fn widen_range(self) -> Self {
        if self.high > self.low {
            return self;
        }
        let room = if self.low == 0.0 { 1.0 } else { 0.1 * self.low.abs() };
        Self { low: self.low - room, high: self.high + room }
    }

    /// With a margin so that no curve touches the frame.
    pub(super) fn with_margin(self) -> Self {
        let room = 0.05 * (self.high - self.low);
        Self { low: self.low - room, high: self.high + room }
    }

    /// Extended so that it holds zero.
    pub(super) fn with_zero(self) -> Self {
        Self { low: self.low.min(0.0), high: self.high.max(0.0) }
    }

    /// Where a value lies: 0 at the low end, 1 at the high end.
    pub(super) fn to_fraction(&self, x: f64) -> f64 {
        ((x - self.low) / (self.high - self.low)).clamp(-0.5, 1.5)
    }

    /// The distance between round values when about `wanted` of them shall stand on the axis.
    fn choose_tick_step(&self, wanted: f64) -> f64 {
        let rough = (self.high - self.low) / wanted;
        let power = 10_f64.powf(rough.log10().floor());
        let round = [1.0, 2.0, 5.0, 10.0].into_iter().find(|round| round * power >= rough * 0.999);
        round.unwrap_or(10.0) * power
    }

    /// Round values with their labels.
    pub(super) fn compute_ticks(&self, wanted: f64) -> Vec<(f64, String)> {
        let step = self.choose_tick_step(wanted);
        if !step.is_finite() || step <= 0.0 {
            return Vec::new();
        }
        let first = (self.low / step).ceil();
        let values = (0..20).map(|k| (first + f64::from(k)) * step);
        values.take_while(|x| *x <= self.high + 1e-9 * step).map(|x| (x, format_tick(x, step))).collect()
    }
}

/// The label of a round value: as many decimals as the step needs.
fn format_tick(x: f64, step: f64) -> String {
    let digits = -super::text::decimal_exponent(step * 1.0001);
    if (-7..=5).contains(&digits) { format_fixed(x, digits.max(0)) } else { super::text::format_significant(x, 2) }
}

/// Seconds in a unit that reads well over this length: divisor and unit.
pub(super) fn time_unit(length_s: f64) -> (f64, &'static str) {
    match length_s {
        length if length > 36_000.0 => (3600.0, "h"),
        length if length > 1_800.0 => (60.0, "min"),
        _ => (1.0, "s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_values_stand_on_the_axis() {
        let labels = |low, high| Axis { low, high }.compute_ticks(5.0).into_iter().map(|(_, l)| l).collect::<Vec<_>>();
        assert_eq!(labels(0.0, 100.0), ["0", "20", "40", "60", "80", "100"]);
        assert_eq!(labels(-0.5, 0.5), ["\u{2212}0.4", "\u{2212}0.2", "0.0", "0.2", "0.4"]);
        assert_eq!(labels(0.0, 50_000.0).last().map(String::as_str), Some("50\u{202f}000"));
    }

    #[test]
    fn a_single_value_gets_room_and_nothing_has_no_axis() {
        assert_eq!(Axis::from_values([5.0].into_iter()), Some(Axis { low: 4.5, high: 5.5 }));
        assert_eq!(Axis::from_values([f64::NAN].into_iter()), None);
    }
}
