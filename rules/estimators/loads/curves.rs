//! Learned curves of the load over the feed, and what they hold for: one quantity, spindle speed, tool and material.
//!
//! Source: constant-load feed control (DM4600): infer the depth from the present feed and load, choose the curve of that depth, take
//! the feed at which it meets the wanted load.

use super::load_inputs::LoadMoment;
use crate::regression::Refusal;
use crate::spindle_current::{Cubic, CurveAtDepth, CurveFamily};
use adapter_core::channel::find_nearest_name;
use thiserror::Error;

/// Curves hold at speeds this near to their own, as a share.
const SPEED_SHARE: f64 = 0.02;
/// A load this many standard deviations below the shallowest curve is below it.
const BELOW_SD: f64 = 2.0;

/// What the curves are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LoadQuantity {
    CuttingPower,
    SpindlePower,
    SpindleLoad,
    SpindleCurrent,
}

const QUANTITIES: [(&str, LoadQuantity); 4] = [
    ("cutting_power_w", LoadQuantity::CuttingPower),
    ("spindle_power_w", LoadQuantity::SpindlePower),
    ("spindle_load_pct", LoadQuantity::SpindleLoad),
    ("spindle_current_a", LoadQuantity::SpindleCurrent),
];

/// Why curves of a load cannot be followed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LoadCurvesError {
    /// Curves of something that is not followed.
    #[error("curves of \"{given}\" cannot be followed: identify them of {known}{near}")]
    Quantity {
        /// The quantity as the script names it.
        given: String,
        /// The quantities that can be, separated by commas.
        known: String,
        /// The one that was probably meant, as a question; empty where none is near.
        near: String,
    },
    /// Over another quantity than the two feeds; holds its name as written.
    #[error("the feed of the curves is feed_mm_min or feed_per_rev_mm, not \"{0}\"")]
    Feed(String),
    /// A spindle speed that is not positive and finite.
    #[error("the curves need the spindle speed that they are of, not {speed_rpm} rpm")]
    Speed {
        /// The speed as the script gives it, rpm; 0 where it gives none.
        speed_rpm: f64,
    },
    /// Coefficients, ranges or depths that do not belong together.
    #[error(transparent)]
    Family(#[from] Refusal),
}

/// Curves of a load over the feed, each with what it holds for.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadCurves {
    pub(super) quantity: LoadQuantity,
    /// The feed of the curves is that per revolution.
    per_rev: bool,
    speed_rpm: f64,
    tool: String,
    material: String,
    family: CurveFamily,
}

/// What the curves say of a feed and a load.
pub(super) enum Told {
    /// The feed to take, in the unit of the curves.
    Feed(f64),
    /// Lighter than every curve: the programmed feed at most.
    Below,
    /// Nothing, for this reason.
    Nothing(&'static str),
}

impl LoadCurves {
    /// Curves of this quantity over this feed (`feed_mm_min` or `feed_per_rev_mm`); rows of depth mm, least and greatest feed, four
    /// coefficients and a standard deviation. Empty texts of tool and material hold for every one.
    ///
    /// # Errors
    /// [`LoadCurvesError`].
    pub fn new(
        (quantity, feed): (&str, &str),
        speed_rpm: f64,
        (tool, material): (&str, &str),
        rows: &[[f64; 8]],
    ) -> Result<Self, LoadCurvesError> {
        let known = QUANTITIES.iter().find(|(name, _)| *name == quantity).map(|(_, quantity)| *quantity);
        let names = || QUANTITIES.iter().map(|(name, _)| *name);
        let Some(known) = known else {
            let near = find_nearest_name(quantity, names())
                .map(|near| format!("; did you mean \"{near}\"?"))
                .unwrap_or_default();
            let all: Vec<&str> = names().collect();
            return Err(LoadCurvesError::Quantity { given: quantity.to_owned(), known: all.join(", "), near });
        };
        let per_rev = match feed {
            "feed_mm_min" => false,
            "feed_per_rev_mm" => true,
            other => return Err(LoadCurvesError::Feed(other.to_owned())),
        };
        if !(speed_rpm > 0.0 && speed_rpm.is_finite()) {
            return Err(LoadCurvesError::Speed { speed_rpm });
        }
        let at = |&[depth_mm, feed_min, feed_max, c0, c1, c2, c3, sd]: &[f64; 8]| CurveAtDepth {
            depth_mm,
            curve: Cubic { coefficients: [c0, c1, c2, c3], feed_min, feed_max },
            sd,
        };
        let family = CurveFamily::new(rows.iter().map(at).collect())?;
        let (tool, material) = (tool.to_owned(), material.to_owned());
        Ok(Self { quantity: known, per_rev, speed_rpm, tool, material, family })
    }

    /// Feed in force and programmed feed, in the unit of the curves.
    pub(super) fn select_feeds(&self, now: &LoadMoment<'_>) -> Option<(f64, f64)> {
        if !self.per_rev {
            return now.feed_mm_min.zip(now.programmed_mm_min);
        }
        let turns = now.speed_rpm.map(f64::abs).filter(|turns| *turns > 0.0)?;
        now.feed_per_rev_mm.zip(now.programmed_mm_min.map(|programmed| programmed / turns))
    }

    /// Why the curves say nothing here: power grows with speed, current does not tell power, another tool cuts otherwise.
    pub(super) fn explain_unfitness(&self, now: &LoadMoment<'_>) -> Option<&'static str> {
        let Some(speed_rpm) = now.speed_rpm.map(f64::abs) else { return Some("the spindle speed is not known") };
        if (speed_rpm / self.speed_rpm - 1.0).abs() > SPEED_SHARE {
            return Some("the curves are of another spindle speed");
        }
        if !self.tool.is_empty() && crate::wear::tool_of(now.tool) != self.tool && now.tool != self.tool {
            return Some("the curves are of another tool");
        }
        let other = !self.material.is_empty() && !now.material.is_empty() && now.material != self.material;
        other.then_some("the curves are of another material")
    }

    /// What they say of this feed and load.
    pub(super) fn find_feed_for_target(&self, feed: f64, load: f64, target: f64) -> Told {
        let Some(shallow) = self.family.curves().first() else { return Told::Nothing("there is no curve") };
        if !(shallow.curve.feed_min..=shallow.curve.feed_max).contains(&feed) {
            return Told::Nothing("the feed is outside the curves");
        }
        let least = shallow.curve.evaluate_at(feed);
        if load < least - BELOW_SD * shallow.sd {
            return Told::Below;
        }
        let depth_mm = match self.family.infer_depth(feed, load, 0.0) {
            Ok(inferred) => inferred.depth_mm,
            // One curve tells no depth: it holds while the load is what it says.
            Err(_) if self.family.curves().len() == 1 && load <= least + BELOW_SD * shallow.sd => shallow.depth_mm,
            Err(_) => return Told::Nothing("the load is above every curve"),
        };
        let nearest = || if load > target { 0.0 } else { shallow.curve.feed_max };
        Told::Feed(self.family.find_feed(depth_mm, target).map_or_else(|_| nearest(), |found| found.feed))
    }
}
