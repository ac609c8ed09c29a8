//! Constant load: the feed at which the load is the target.
//!
//! Load grows with the feed to the power of `exponent` (0.75 for steel), or as learned curves say. A worn edge, hard material and a
//! deep cut look the same here: all of them slow the feed. Whatever is not known slows or holds the feed, and never raises it.

use super::Loads;
use super::curves::{LoadCurves, LoadQuantity, Told};
use super::follower::{FedShare, OverrideFollower};
use super::limits::ConstantLimits;
use super::load_inputs::LoadMoment;
use crate::NoEstimate;

/// A touch below this share of the least load that counts as a cut ends a rise; so a load at the border does not chatter.
const AIR_BACK: f64 = 0.7;

/// Follows the load of one cut.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct ConstantLoad {
    follower: OverrideFollower,
    /// In the work, not in the air.
    loaded: bool,
}

impl ConstantLoad {
    pub(super) fn update_loads(&mut self, now: &LoadMoment<'_>, limits: &ConstantLimits, loads: &mut Loads) {
        let (load, target) = select_load_and_target(now, limits);
        loads.load_share = match load {
            _ if target <= 0.0 => Err(NoEstimate::NoTarget),
            None => Err(NoEstimate::LoadUnknown),
            Some(load) => Ok(load / target),
        };
        loads.load_override_pct = self.compute_wanted_override(now, limits, (load, target), loads);
    }

    fn compute_wanted_override(
        &mut self,
        now: &LoadMoment<'_>,
        limits: &ConstantLimits,
        (load, target): (Option<f64>, f64),
        loads: &mut Loads,
    ) -> super::Figure {
        let feeds = select_feeds(now, limits).filter(|(feed, programmed)| *feed > 0.0 && *programmed > 0.0);
        let known = load.zip(feeds).zip(now.step_s);
        let in_cut = now.cutting && now.state_s >= limits.entry_s && target > 0.0;
        let Some(((load, (feed, programmed)), step_s)) = known.filter(|_| in_cut) else {
            self.follower.reset_cut();
            self.loaded = false;
            return Err(match (load, feeds) {
                _ if !now.cutting => NoEstimate::NotCutting,
                _ if target <= 0.0 => NoEstimate::NoTarget,
                (None, _) => NoEstimate::LoadUnknown,
                (_, None) => NoEstimate::FeedUnknown,
                // At the entry, and at the first tick after a pause.
                _ => NoEstimate::NotCutting,
            });
        };
        let share = load / target;
        self.loaded = share > if self.loaded { AIR_BACK * limits.air_share } else { limits.air_share };
        let pct = if self.loaded {
            let now_at = FedShare {
                at_ns: now.at_ns,
                step_s,
                share,
                feed: feed / programmed,
                actual_pct: 100.0 * feed / programmed,
                exponent: limits.exponent,
            };
            self.step_override(now, limits, now_at, (target, programmed), loads)
        } else {
            self.follower.let_go()
        };
        if (pct - 100.0).abs() < 1e-9 { Err(NoEstimate::NothingToChange) } else { Ok(pct) }
    }

    fn step_override(
        &mut self,
        now: &LoadMoment<'_>,
        limits: &ConstantLimits,
        at: FedShare,
        (target, programmed): (f64, f64),
        loads: &mut Loads,
    ) -> f64 {
        let by_exponent = |share: f64| 100.0 * share.max(1e-6).powf(-1.0 / limits.exponent);
        let Some(curves) = &limits.curves else { return self.follower.step_override(at, &limits.range, by_exponent) };
        let unfit = curves.explain_unfitness(now).or_else(|| {
            match curves.find_feed_for_target(at.feed * programmed, at.share * target, target) {
                Told::Nothing(why) => Some(why),
                _ => None,
            }
        });
        loads.load_held = unfit.unwrap_or_default();
        if unfit.is_some() {
            // Without a curve the exponent may lower the feed; nothing may raise it.
            let asked = self.follower.requested_pct();
            return self.follower.step_override(at, &limits.range, |share| by_exponent(share).min(asked));
        }
        self.follower.step_override(at, &limits.range, |share| {
            by_curves(curves, share, (at, target, programmed), by_exponent(share))
        })
    }
}

/// The override that the curves give for this share at the programmed feed, %.
fn by_curves(curves: &LoadCurves, share: f64, (at, target, programmed): (FedShare, f64, f64), by_exponent: f64) -> f64 {
    let load = share * at.feed.powf(at.exponent) * target;
    match curves.find_feed_for_target(at.feed * programmed, load, target) {
        Told::Feed(feed) => 100.0 * feed / programmed,
        Told::Below => 100.0,
        Told::Nothing(_) => by_exponent.min(100.0),
    }
}

/// The load, and what it should be.
fn select_load_and_target(now: &LoadMoment<'_>, limits: &ConstantLimits) -> (Option<f64>, f64) {
    let cutting_w = now.cutting_power_w.map(|(power_w, _)| power_w);
    match limits.curves.as_ref().map(|curves| curves.quantity) {
        Some(LoadQuantity::CuttingPower) => (cutting_w, limits.target_w),
        Some(LoadQuantity::SpindlePower) => (now.spindle_power_w, limits.target_w),
        Some(LoadQuantity::SpindleCurrent) => (now.spindle_current_a, limits.target_a),
        Some(LoadQuantity::SpindleLoad) => (now.spindle_load_pct, limits.target_pct),
        None if limits.target_w > 0.0 => (cutting_w, limits.target_w),
        None => (now.spindle_load_pct, limits.target_pct),
    }
}

/// Feed in force and programmed feed.
fn select_feeds(now: &LoadMoment<'_>, limits: &ConstantLimits) -> Option<(f64, f64)> {
    limits.curves.as_ref().map_or_else(|| now.feed_mm_min.zip(now.programmed_mm_min), |curves| curves.select_feeds(now))
}
