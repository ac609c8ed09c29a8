//! Over a whole recording or shift: could cutting be seen at all?

use super::estimate::Estimates;
use super::estimate_words::Visibility;
use super::signals::seconds_between;
use adapter_core::clock::TimeNs;
use std::fmt;

/// A pause between ticks counts for no more than this, s.
const LONGEST_TICK_S: f64 = 1.0;

/// Cutting is visible on a machine when it is seen during at least this share of the fed time.
const SEEN_SHARE: f64 = 0.05;

/// What the time with feed (other than rapid traverse) and turning spindle was spent on.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct VisibilityTally {
    last_ns: Option<TimeNs>,
    /// Cutting was seen, s.
    pub visible_s: f64,
    /// The power did not stand out of no-load power, s.
    pub below_s: f64,
    /// No no-load power was known, s.
    pub no_reference_s: f64,
    excess_ws: f64,
    least_visible_ws: f64,
}

/// The conclusion. The text is what an operator reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum VisibilityVerdict {
    /// The feed was never on with the spindle turning.
    NothingToSee,
    /// Cutting stands out of no-load power.
    Visible {
        /// Share of the fed time in which cutting was seen.
        share: f64,
    },
    /// Whatever was cut added less than can be told from no-load power.
    BelowVisibility {
        /// Mean power above no-load power while the feed was on, W.
        excess_w: f64,
        /// Least cutting power that would have been seen, W.
        least_visible_w: f64,
    },
    /// No no-load power was known, so cutting was not claimed.
    NoReference,
}

impl VisibilityTally {
    /// Takes the estimates of a tick; it stands for the time since the one before.
    pub fn add(&mut self, estimates: &Estimates) {
        let last_ns = self.last_ns.replace(estimates.at_ns).unwrap_or(estimates.at_ns);
        let tick_s = seconds_between(last_ns, estimates.at_ns).clamp(0.0, LONGEST_TICK_S);
        match estimates.visibility {
            Visibility::NotAsked => {}
            Visibility::Visible => self.visible_s += tick_s,
            Visibility::NoReference => self.no_reference_s += tick_s,
            Visibility::BelowVisibility => self.add_below(estimates, tick_s),
        }
    }

    fn add_below(&mut self, estimates: &Estimates, tick_s: f64) {
        let known = (estimates.filtered_power_w, estimates.no_load_power_w, estimates.visible_cutting_power_w);
        if let (Ok(power), Ok(no_load), Ok(least)) = known {
            self.below_s += tick_s;
            self.excess_ws += tick_s * (power.value - no_load.value);
            self.least_visible_ws += tick_s * least.value;
        }
    }

    /// What the time amounts to.
    #[must_use]
    pub fn judge_visibility(&self) -> VisibilityVerdict {
        let fed_s = self.visible_s + self.below_s + self.no_reference_s;
        if fed_s <= 0.0 {
            VisibilityVerdict::NothingToSee
        } else if self.visible_s >= SEEN_SHARE * fed_s {
            VisibilityVerdict::Visible { share: self.visible_s / fed_s }
        } else if self.below_s >= self.no_reference_s && self.below_s > 0.0 {
            VisibilityVerdict::BelowVisibility {
                excess_w: self.excess_ws / self.below_s,
                least_visible_w: self.least_visible_ws / self.below_s,
            }
        } else {
            VisibilityVerdict::NoReference
        }
    }
}

impl VisibilityVerdict {
    /// The word used in SQL, JSON and scripts.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::NothingToSee => "nothing_to_see",
            Self::Visible { .. } => "visible",
            Self::BelowVisibility { .. } => "below_visibility",
            Self::NoReference => "no_reference",
        }
    }
}

impl fmt::Display for VisibilityVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingToSee => f.write_str("the feed was never on with the spindle turning"),
            Self::Visible { share } => {
                write!(f, "cutting is visible: it was seen during {:.0} % of the time with feed", 100.0 * share)
            }
            Self::BelowVisibility { excess_w, least_visible_w } => write!(
                f,
                "cutting is below visibility: with the feed on, spindle power was {excess_w:+.1} W from no-load power \
                 on average, and a cut shows only from {least_visible_w:.0} W"
            ),
            Self::NoReference => f.write_str(
                "no no-load power is known, so cutting was not claimed; let the spindle run without feed for a few seconds",
            ),
        }
    }
}
