//! A cubic of the feature over feed, on the range of feeds it was found in.

use crate::regression::{Refusal, RefusalKind};
use serde::Serialize;

/// `I(f) = c0 + c1 f + c2 f^2 + c3 f^3` for feeds from `feed_min` to `feed_max`, in one unit of feed throughout.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cubic {
    /// c0 to c3, the constant first; zero beyond the degree that was fitted.
    pub coefficients: [f64; 4],
    /// Least feed it holds for.
    pub feed_min: f64,
    /// Greatest feed it holds for.
    pub feed_max: f64,
}

/// A feed that gives a feature.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Inversion {
    /// The feed, in the unit of the curve.
    pub feed: f64,
    /// Change of feed per change of the feature, there.
    pub feed_per_feature: f64,
}

impl Cubic {
    /// The feature at a feed.
    #[must_use]
    pub fn evaluate_at(&self, feed: f64) -> f64 {
        self.coefficients.iter().rev().fold(0.0, |sum, c| sum * feed + c)
    }

    /// Change of the feature per change of feed.
    #[must_use]
    pub fn slope(&self, feed: f64) -> f64 {
        let [_, c1, c2, c3] = self.coefficients;
        c1 + feed * (2.0 * c2 + feed * 3.0 * c3)
    }

    /// Discriminant of the derivative, `4 c2^2 - 12 c1 c3`: negative where the cubic rises (or falls) everywhere.
    #[must_use]
    pub fn discriminant(&self) -> f64 {
        let [_, c1, c2, c3] = self.coefficients;
        4.0 * c2 * c2 - 12.0 * c1 * c3
    }

    /// Feeds within the range where the slope is zero.
    pub(super) fn find_turning_points(&self) -> impl Iterator<Item = f64> {
        let [_, c1, c2, c3] = self.coefficients;
        let (least, greatest) = (self.feed_min, self.feed_max);
        quadratic_roots(3.0 * c3, 2.0 * c2, c1)
            .into_iter()
            .flatten()
            .filter(move |feed| *feed > least && *feed < greatest)
    }

    /// Does the feature rise with feed in the whole range?
    #[must_use]
    pub fn is_rising(&self) -> bool {
        let middle = self.slope(0.5 * (self.feed_min + self.feed_max));
        middle > 0.0
            && self.find_turning_points().next().is_none()
            && self.slope(self.feed_min) >= 0.0
            && self.slope(self.feed_max) >= 0.0
    }

    /// The feed at which the feature has this value.
    ///
    /// # Errors
    /// A feature below that at the least feed (no feed gives it: the spindle takes as much without cutting) or above that
    /// at the greatest; a cubic that does not rise throughout, where several feeds may give it.
    pub fn feed_for(&self, feature: f64) -> Result<Inversion, Refusal> {
        if !self.is_rising() {
            let what = "the feature does not rise with feed everywhere, so that more than one feed may give it";
            return Err(Refusal::new(RefusalKind::Ambiguous, what, "identify the curve again with more feeds"));
        }
        let (low, high) = (self.evaluate_at(self.feed_min), self.evaluate_at(self.feed_max));
        if !(low..=high).contains(&feature) {
            return Err(refuse_out_of_range(feature, (low, high), (self.feed_min, self.feed_max)));
        }
        let feed = self.solve_for_feed(feature);
        Ok(Inversion { feed, feed_per_feature: 1.0 / self.slope(feed).max(f64::MIN_POSITIVE) })
    }

    /// Newton's method kept between bounds that close in.
    fn solve_for_feed(&self, feature: f64) -> f64 {
        let (mut low, mut high) = (self.feed_min, self.feed_max);
        let mut feed = 0.5 * (low + high);
        for _ in 0..200 {
            let off = self.evaluate_at(feed) - feature;
            if off > 0.0 {
                high = feed
            } else {
                low = feed
            }
            let newton = feed - off / self.slope(feed);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - feed).abs() <= 1e-15 * feed.abs() {
                return next;
            }
            feed = next;
        }
        feed
    }
}

fn refuse_out_of_range(feature: f64, (low, high): (f64, f64), (feed_min, feed_max): (f64, f64)) -> Refusal {
    if feature < low {
        let what = format!("{feature:.4} lies below {low:.4}, what the spindle takes at the least feed {feed_min:.4}");
        return Refusal::new(RefusalKind::OutOfRange, what, "no feed in the range gives so little; aim higher");
    }
    let what = format!("{feature:.4} lies above {high:.4}, what the spindle takes at the greatest feed {feed_max:.4}");
    Refusal::new(RefusalKind::OutOfRange, what, "aim lower, or identify the curve with greater feeds")
}

/// Real roots of `a x^2 + b x + c`.
fn quadratic_roots(a: f64, b: f64, c: f64) -> [Option<f64>; 2] {
    if a == 0.0 {
        return [(b != 0.0).then(|| -c / b), None];
    }
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return [None, None];
    }
    // The form that does not cancel.
    let q = -0.5 * (b + if b < 0.0 { -discriminant.sqrt() } else { discriminant.sqrt() });
    if q == 0.0 { [Some(0.0), None] } else { [Some(q / a), Some(c / q)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source() -> Cubic {
        Cubic { coefficients: [1.4612, 0.872, 0.4277, 0.0944], feed_min: 0.0, feed_max: 3.5 }
    }

    #[test]
    fn the_inverse_is_the_inverse() {
        assert!(source().is_rising() && (source().discriminant() + 0.256).abs() < 5e-4);
        for feed in [0.0, 1e-9, 0.3, 1.7, 3.5] {
            let found = source().feed_for(source().evaluate_at(feed)).expect("in range");
            assert!((found.feed - feed).abs() < 1e-12, "{feed}: {found:?}");
        }
    }

    #[test]
    fn what_no_feed_gives_is_refused() {
        for (feature, word) in [(1.0, "below"), (1.46, "below"), (20.0, "above"), (f64::NAN, "")] {
            let refusal = source().feed_for(feature).expect_err("no feed").to_string();
            assert!(refusal.contains(word), "{refusal}");
        }
        let hump = Cubic { coefficients: [1.0, 1.0, -0.5, 0.01], feed_min: 0.0, feed_max: 3.0 };
        assert_eq!(hump.feed_for(1.2).expect_err("two feeds").kind, RefusalKind::Ambiguous);
        let falling = Cubic { coefficients: [5.0, -1.0, 0.0, 0.0], ..hump };
        assert!(!falling.is_rising());
    }
}
