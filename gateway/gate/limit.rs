//! The band and the slew limit: no script can widen them.

use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::override_pct::OverridePct;

/// The longest time between two decisions over which the slew limit still counts; after more, it begins at 100 %.
const PAUSE_NS: i64 = SECOND_NS;

/// Why less, or something else, is let through than was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// Below the least override.
    Least,
    /// Above the greatest override.
    Greatest,
    /// Above this: the operator's dial, or 100 %, where the ladder takes the lesser one of dial and override.
    Dial(OverridePct),
    /// The change would be too fast; it goes on at the next ticks.
    Slew,
    /// Not a number from 0 to 254: a mistake, not a wish. It counts as no request.
    NotPossible,
}

/// The target inside the band, and what was in the way.
pub(super) fn clamp_to_band(wanted_pct: Option<f64>, min_pct: f64, max_pct: f64) -> (f64, Option<Bound>) {
    let (min_pct, max_pct) = (min_pct.ceil(), max_pct.floor());
    match wanted_pct {
        None => (100.0, None),
        Some(pct) if !(0.0..=254.0).contains(&pct) => (100.0, Some(Bound::NotPossible)),
        Some(pct) if pct < min_pct => (min_pct, Some(Bound::Least)),
        Some(pct) if pct > max_pct => (max_pct, Some(Bound::Greatest)),
        Some(pct) => (pct, None),
    }
}

/// The target below the ceiling that the operator's dial sets.
pub(super) fn clamp_to_ceiling(ceiling_pct: f64, target_pct: f64, bound: Option<Bound>) -> (f64, Option<Bound>) {
    if target_pct <= ceiling_pct {
        return (target_pct, bound);
    }
    (ceiling_pct, Some(Bound::Dial(OverridePct::from_nearest_percent(ceiling_pct).unwrap_or(OverridePct::FULL))))
}

/// Keeps to a target until another differs by more than the dead band. 100 % is always taken, and what the limits no longer
/// allow is left at once.
#[derive(Debug, Clone)]
pub(super) struct Aim {
    dead_band_pct: f64,
    pct: f64,
}

impl Aim {
    pub(super) fn new(dead_band_pct: f64) -> Self {
        Self { dead_band_pct, pct: 100.0 }
    }

    /// What is aimed at now that this is wanted; never above the ceiling.
    pub(super) fn update_target(&mut self, target_pct: f64, ceiling_pct: f64) -> f64 {
        let far = (target_pct - self.pct).abs() >= self.dead_band_pct;
        if far || target_pct == 100.0 {
            self.pct = target_pct;
        }
        self.pct = self.pct.min(ceiling_pct);
        debug_assert!(self.pct <= ceiling_pct, "what is aimed at is never above the ceiling");
        self.pct
    }

    pub(super) fn reset_target(&mut self) {
        self.pct = 100.0;
    }
}

/// Approaches a target at a limited pace. Begins at 100 %, and does so again after a pause.
#[derive(Debug, Clone)]
pub(super) struct Slew {
    up_pct_per_s: f64,
    down_pct_per_s: f64,
    exact_pct: f64,
    at_ns: Option<TimeNs>,
}

impl Slew {
    pub(super) fn new(up_pct_per_s: f64, down_pct_per_s: f64) -> Self {
        assert!(up_pct_per_s >= 0.0 && down_pct_per_s >= 0.0, "a pace has no sign: {up_pct_per_s}, {down_pct_per_s}");
        Self { up_pct_per_s, down_pct_per_s, exact_pct: 100.0, at_ns: None }
    }

    pub(super) fn exact_pct(&self) -> f64 {
        self.exact_pct
    }

    /// A step towards the target.
    pub(super) fn step_towards(&mut self, target_pct: f64, at_ns: TimeNs) -> OverridePct {
        let mut elapsed_ns = self.at_ns.map_or(0, |before_ns| at_ns.saturating_sub(before_ns));
        if !(0..=PAUSE_NS).contains(&elapsed_ns) {
            self.exact_pct = 100.0;
            elapsed_ns = 0;
        }
        let elapsed_s = elapsed_ns as f64 / SECOND_NS as f64;
        let (down, up) = (self.down_pct_per_s * elapsed_s, self.up_pct_per_s * elapsed_s);
        debug_assert!(elapsed_s >= 0.0 && elapsed_ns <= PAUSE_NS, "a ramp knows how long its step took: {elapsed_s} s");
        let before_pct = self.exact_pct;
        self.exact_pct += (target_pct - self.exact_pct).clamp(-down, up);
        debug_assert!(
            self.exact_pct - before_pct <= up + 1e-9 && before_pct - self.exact_pct <= down + 1e-9,
            "no step is wider than the slew"
        );
        self.at_ns = Some(at_ns);
        round_to_whole(self.exact_pct)
    }

    /// Begins anew, at 100 %, with the next step.
    pub(super) fn restart_ramp(&mut self) {
        (self.exact_pct, self.at_ns) = (100.0, None);
    }

    /// At once to 100 %.
    pub(super) fn jump_to_full(&mut self, at_ns: TimeNs) -> OverridePct {
        self.exact_pct = 100.0;
        self.at_ns = Some(at_ns);
        OverridePct::FULL
    }
}

/// Whole percent, rounded towards 100 so that rounding never goes beyond what was permitted.
fn round_to_whole(pct: f64) -> OverridePct {
    // A sum of small steps ends a hair beside a whole number.
    let near = pct.round();
    let rounded = if (pct - near).abs() < 1e-9 {
        near
    } else if pct < 100.0 {
        pct.ceil()
    } else {
        pct.floor()
    };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=254 before the cast")]
    let percent = rounded.clamp(0.0, 254.0) as u8;
    OverridePct::new(percent).unwrap_or(OverridePct::FULL)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_band_holds_and_a_mistake_is_no_wish() {
        let within = |pct| clamp_to_band(Some(pct), 50.0, 120.0);
        assert_eq!(within(80.0), (80.0, None));
        assert_eq!(within(49.9), (50.0, Some(Bound::Least)));
        assert_eq!(within(120.1), (120.0, Some(Bound::Greatest)));
        for mistake in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 254.5, 300.0] {
            assert_eq!(within(mistake), (100.0, Some(Bound::NotPossible)), "{mistake}");
        }
        assert_eq!(clamp_to_band(Some(10.0), 50.5, 120.0), (51.0, Some(Bound::Least)), "a band is rounded inwards");
    }

    #[test]
    fn a_small_change_is_left_alone_and_the_way_back_never_is() {
        let mut aim = Aim::new(2.0);
        let mut take = |target: f64| aim.update_target(target, 120.0);
        assert_eq!([take(90.0), take(91.9), take(88.1), take(92.0)], [90.0, 90.0, 90.0, 92.0]);
        assert_eq!([take(99.0), take(100.0), take(99.5)], [99.0, 100.0, 100.0]);
        take(115.0);
        assert_eq!(aim.update_target(115.5, 110.0), 110.0, "a ceiling counts at once");
    }

    #[test]
    fn a_change_takes_its_time_and_a_pause_begins_at_full() {
        let mut slew = Slew::new(10.0, 50.0);
        let tenth = SECOND_NS / 10;
        assert_eq!(slew.step_towards(60.0, 0).percent(), 100, "the first decision has no time behind it");
        assert_eq!(slew.step_towards(60.0, tenth).percent(), 95);
        for tick in 2..=8 {
            slew.step_towards(60.0, tick * tenth);
        }
        assert_eq!(slew.step_towards(60.0, 9 * tenth).percent(), 60);
        assert_eq!(slew.step_towards(100.0, 10 * tenth).percent(), 61);
        assert_eq!(slew.step_towards(60.0, 100 * tenth).percent(), 100);
        assert_eq!(slew.step_towards(60.0, -100 * tenth).percent(), 100, "a clock that jumps back begins anew");
    }
}
