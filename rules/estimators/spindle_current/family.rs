//! Curves of the feature over feed at several depths of cut, for one speed, tool and material: from feed and feature to
//! depth, and from depth and wanted feature to feed.
//!
//! Source: constant-load feed control (DM4600), steps 1 to 3: infer the depth from the present feed and feature, choose the
//! curve of that depth, take the feed at which it meets the wanted feature. Wear, hardness and heat raise the feature too,
//! so the depth inferred is an equivalent one, deeper than the true one: the feed errs to the safe side.

use super::cubic::{Cubic, Inversion};
use crate::regression::{Refusal, RefusalKind};
use serde::Serialize;

/// At most so many depths.
const DEPTHS_MAX: usize = 64;
/// A feature this many standard deviations outside the family still belongs to its edge.
const EDGE_SD: f64 = 2.0;
/// Points of the common range at which curves are compared, besides where their difference turns.
const COMPARED: u32 = 16;

/// The curve at one depth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CurveAtDepth {
    /// Depth of cut, mm.
    pub depth_mm: f64,
    /// The feature over the feed at this depth.
    pub curve: Cubic,
    /// Standard deviation of one cut about the curve, the error of the curve counted, in the unit of the feature.
    pub sd: f64,
}

/// A depth that was inferred.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Inferred {
    /// Equivalent depth of cut, mm.
    pub depth_mm: f64,
    /// Standard deviation of the depth, mm.
    pub sd_mm: f64,
}

/// Curves over depth that do not cross.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CurveFamily {
    curves: Vec<CurveAtDepth>,
}

impl CurveFamily {
    /// Curves at different depths, in any order. One curve has no depth to infer; it still gives feeds.
    ///
    /// # Errors
    /// No curve or too many, a depth twice, a curve that does not rise, no feed that all have in common, or curves that
    /// cross: feed and feature then do not tell the depth.
    pub fn new(mut curves: Vec<CurveAtDepth>) -> Result<Self, Refusal> {
        curves.sort_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm));
        if curves.is_empty() || curves.len() > DEPTHS_MAX {
            let what = format!("curves at {} depths", curves.len());
            return Err(Refusal::new(RefusalKind::TooFew, what, "identify curves at 1 to 64 depths of cut"));
        }
        curves.iter().try_for_each(check_curve)?;
        curves.windows(2).try_for_each(|pair| check_separation(&pair[0], &pair[1]))?;
        let family = Self { curves };
        let (least, greatest) = family.common_feed_range();
        if least < greatest {
            return Ok(family);
        }
        Err(Refusal::new(
            RefusalKind::Mismatch,
            "the curves have no feed in common",
            "identify them over the same feeds",
        ))
    }

    /// The curves, shallowest first.
    #[must_use]
    pub fn curves(&self) -> &[CurveAtDepth] {
        &self.curves
    }

    /// The range of feeds that all curves have.
    #[must_use]
    pub fn common_feed_range(&self) -> (f64, f64) {
        let fold = |of: fn(&Cubic) -> f64, pick: fn(f64, f64) -> f64, from: f64| {
            self.curves.iter().map(|it| of(&it.curve)).fold(from, pick)
        };
        (fold(|c| c.feed_min, f64::max, f64::NEG_INFINITY), fold(|c| c.feed_max, f64::min, f64::INFINITY))
    }

    /// The depth at which this feed gives this feature, known to `feature_sd`; linear between neighbouring depths.
    ///
    /// # Errors
    /// One curve only; a feed outside the common range; a feature below the shallowest curve (an air cut looks like that) or above the
    /// deepest.
    pub fn infer_depth(&self, feed: f64, feature: f64, feature_sd: f64) -> Result<Inferred, Refusal> {
        let (least, greatest) = self.common_feed_range();
        if self.curves.len() < 2 {
            let next = "identify curves at two depths of cut or more";
            return Err(Refusal::new(RefusalKind::TooFew, "one curve does not tell the depth", next));
        }
        if !(least..=greatest).contains(&feed) {
            let what = format!("a feed of {feed} lies outside {least} to {greatest}");
            return Err(Refusal::new(RefusalKind::OutOfRange, what, "identify the curves over this feed too"));
        }
        let value = |at: usize| self.curves[at].curve.evaluate_at(feed);
        let last = self.curves.len() - 1;
        // At the shallowest and the deepest curve half of all cuts lie outside by chance.
        let chance = |at: usize| EDGE_SD * self.curves[at].sd.hypot(feature_sd);
        if !(value(0) - chance(0)..=value(last) + chance(last)).contains(&feature) {
            return Err(self.refuse_out_of_range(feature, value(0), value(last)));
        }
        let feature = feature.clamp(value(0), value(last));
        let at = (0..last).find(|at| feature <= value(at + 1)).unwrap_or(last - 1);
        let (shallow, deep) = (&self.curves[at], &self.curves[at + 1]);
        let rise = (value(at + 1) - value(at)) / (deep.depth_mm - shallow.depth_mm);
        let share = (feature - value(at)) / (value(at + 1) - value(at));
        let curve_sd = ((1.0 - share) * shallow.sd).hypot(share * deep.sd);
        let sd_mm = (feature_sd.abs().hypot(curve_sd) / rise).hypot(self.estimate_bend_mm(at, value, share));
        Ok(Inferred { depth_mm: shallow.depth_mm + share * (deep.depth_mm - shallow.depth_mm), sd_mm })
    }

    /// How far a parabola through three depths lies from the straight line between two of them, mm.
    fn estimate_bend_mm(&self, at: usize, value: impl Fn(usize) -> f64, share: f64) -> f64 {
        let third = if at + 2 < self.curves.len() { Some(at + 2) } else { at.checked_sub(1) };
        let Some(third) = third else { return 0.0 };
        let [h0, h1, h2] = [at, at + 1, third].map(|at| self.curves[at].depth_mm);
        let [v0, v1, v2] = [at, at + 1, third].map(value);
        let curvature = ((h2 - h1) / (v2 - v1) - (h1 - h0) / (v1 - v0)) / (v2 - v0);
        (curvature * share * (1.0 - share) * (v1 - v0) * (v1 - v0)).abs()
    }

    fn refuse_out_of_range(&self, feature: f64, least: f64, greatest: f64) -> Refusal {
        let (shallow, deep) = (self.curves[0].depth_mm, self.curves[self.curves.len() - 1].depth_mm);
        if feature > greatest {
            let what = format!("{feature:.4} lies above {greatest:.4}, the deepest curve ({deep} mm) at this feed");
            return Refusal::new(
                RefusalKind::OutOfRange,
                what,
                "slow down; the cut is heavier than any that was identified",
            );
        }
        let what = format!("{feature:.4} lies below {least:.4}, the shallowest curve ({shallow} mm) at this feed");
        Refusal::new(RefusalKind::OutOfRange, what, "a cut in the air looks like this: keep the programmed feed")
    }

    /// The curve at a depth between the shallowest and the deepest.
    ///
    /// # Errors
    /// A depth outside.
    pub fn interpolate_curve(&self, depth_mm: f64) -> Result<Cubic, Refusal> {
        let last = self.curves.len() - 1;
        let (least, greatest) = (self.curves[0].depth_mm, self.curves[last].depth_mm);
        if last == 0 && depth_mm == least {
            return Ok(self.curves[0].curve);
        }
        if last == 0 || !(least..=greatest).contains(&depth_mm) {
            let what = format!("a depth of {depth_mm} mm lies outside {least} to {greatest} mm");
            return Err(Refusal::new(RefusalKind::OutOfRange, what, "identify a curve at this depth"));
        }
        let at = self.curves.windows(2).position(|pair| depth_mm <= pair[1].depth_mm).unwrap_or(last - 1);
        let (shallow, deep) = (&self.curves[at], &self.curves[at + 1]);
        let share = (depth_mm - shallow.depth_mm) / (deep.depth_mm - shallow.depth_mm);
        let (feed_min, feed_max) = self.common_feed_range();
        let mixed = |k: usize| (1.0 - share) * shallow.curve.coefficients[k] + share * deep.curve.coefficients[k];
        Ok(Cubic { coefficients: [mixed(0), mixed(1), mixed(2), mixed(3)], feed_min, feed_max })
    }

    /// The feed at which a cut of this depth gives the wanted feature.
    ///
    /// # Errors
    /// A depth outside the family, or a feature that no feed of the common range gives at this depth.
    pub fn find_feed(&self, depth_mm: f64, wanted: f64) -> Result<Inversion, Refusal> {
        self.interpolate_curve(depth_mm)?
            .feed_for(wanted)
            .map_err(|refusal| refusal.with_place(format!("depth {depth_mm:.2} mm")))
    }
}

fn check_curve(it: &CurveAtDepth) -> Result<(), Refusal> {
    let finite = it.curve.coefficients.iter().chain([&it.depth_mm, &it.sd]).all(|value| value.is_finite());
    if !finite || it.depth_mm <= 0.0 || it.curve.feed_min >= it.curve.feed_max {
        let what = "a number that is none, a depth that is not positive, or an empty range of feeds";
        return Err(
            Refusal::new(RefusalKind::NotFinite, what, "look at the curve").with_place(format!("{} mm", it.depth_mm))
        );
    }
    if it.curve.is_rising() {
        return Ok(());
    }
    let refusal = Refusal::new(
        RefusalKind::Ambiguous,
        "the feature does not rise with feed everywhere",
        "identify this curve again with more feeds, or over a narrower range",
    );
    Err(refusal.with_place(format!("{} mm", it.depth_mm)))
}

/// A deeper cut takes more at every feed both curves have.
fn check_separation(shallow: &CurveAtDepth, deep: &CurveAtDepth) -> Result<(), Refusal> {
    let difference = |k: usize| deep.curve.coefficients[k] - shallow.curve.coefficients[k];
    let between = Cubic {
        coefficients: [difference(0), difference(1), difference(2), difference(3)],
        feed_min: deep.curve.feed_min.max(shallow.curve.feed_min),
        feed_max: deep.curve.feed_max.min(shallow.curve.feed_max),
    };
    let span = between.feed_max - between.feed_min;
    let grid = (0..=COMPARED).map(|k| between.feed_min + span * f64::from(k) / f64::from(COMPARED));
    let crossing = grid.chain(between.find_turning_points()).find(|feed| between.evaluate_at(*feed) <= 0.0);
    match crossing {
        Some(feed) if span >= 0.0 => {
            let (shallow, deep) = (shallow.depth_mm, deep.depth_mm);
            let what = format!(
                "the curves of {shallow} mm and {deep} mm cross or touch: at a feed of {feed:.4} the deeper cut takes no more"
            );
            let next = "feed and feature do not tell the depth; identify both again, with the same tool and material";
            Err(Refusal::new(RefusalKind::Ambiguous, what, next))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(depth_mm: f64) -> CurveAtDepth {
        let h = depth_mm / 1.2;
        let coefficients = [1.4 + 0.0612 * h, 0.872 * h, 0.4277 * h, 0.0944 * h];
        CurveAtDepth { depth_mm, curve: Cubic { coefficients, feed_min: 0.2, feed_max: 3.0 }, sd: 0.01 }
    }

    #[test]
    fn depth_and_feed_are_found_back() {
        let family = CurveFamily::new([1.6, 0.4, 0.8, 1.2].map(curve).to_vec()).expect("apart");
        for depth in [0.4, 0.7, 1.2, 1.55] {
            let feature = curve(depth).curve.evaluate_at(1.3);
            let found = family.infer_depth(1.3, feature, 0.02).expect("in the family");
            assert!((found.depth_mm - depth).abs() < 1e-9, "{depth}: {found:?}");
            assert!(found.sd_mm > 0.0 && found.sd_mm < 0.05);
            let feed = family.find_feed(depth, feature).expect("a feed").feed;
            assert!((feed - 1.3).abs() < 1e-9);
        }
    }

    #[test]
    fn what_is_not_in_the_family_is_refused() {
        let family = CurveFamily::new([0.4, 1.2].map(curve).to_vec()).expect("apart");
        let told = |refusal: Refusal| refusal.to_string();
        assert!(told(family.infer_depth(1.3, 1.42, 0.02).expect_err("air")).contains("in the air"));
        assert!(told(family.infer_depth(1.3, 9.0, 0.02).expect_err("too heavy")).contains("slow down"));
        assert!(told(family.infer_depth(4.0, 3.0, 0.02).expect_err("feed")).contains("outside 0.2 to 3"));
        assert!(told(family.find_feed(2.0, 3.0).expect_err("depth")).contains("outside 0.4 to 1.2 mm"));
        assert!(told(family.find_feed(1.2, 1.3).expect_err("below no load")).contains("aim higher"));
        assert!(family.infer_depth(1.3, f64::NAN, 0.0).is_err() && family.infer_depth(f64::NAN, 2.0, 0.0).is_err());
    }

    #[test]
    fn curves_that_cross_are_refused() {
        let mut crossing = curve(1.2);
        crossing.curve.coefficients = [2.0, 0.05, 0.01, 0.0];
        let refusal = CurveFamily::new(vec![curve(0.8), crossing]).expect_err("they cross");
        assert!(refusal.kind == RefusalKind::Ambiguous && refusal.what.contains("0.8 mm and 1.2 mm"), "{refusal}");
        let one = CurveFamily::new(vec![curve(0.8)]).expect("one curve gives feeds");
        assert!(
            one.infer_depth(1.0, 2.0, 0.1).is_err()
                && one.find_feed(0.8, 2.0).is_ok()
                && one.find_feed(0.9, 2.0).is_err()
        );
        assert!(CurveFamily::new(Vec::new()).is_err());
        assert!(CurveFamily::new(vec![curve(0.8), curve(0.8)]).is_err(), "a depth twice");
    }
}
