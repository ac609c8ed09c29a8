//! The lag that is really applied: it follows the estimates slowly, and stands still while the machine cuts.

use super::estimate::Lag;

/// The applied lag moves by at most this share of the time that passes, so that neither readings nor ticks change their
/// order.
const RATE: f64 = 0.05;
/// After the first, an estimate moves what is aimed at by at most this, s: one that jumps is an error or another meter, and
/// several in a row are needed to be believed.
const STEP_MAX_S: f64 = 0.05;
/// A change of the aim below this is not worth a word, s.
const WORTH_TELLING_S: f64 = 0.005;

/// A lag that is aimed at, and the one that is in force.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LagFollower {
    aim_s: Option<f64>,
    told_s: Option<f64>,
    applied_s: f64,
}

impl LagFollower {
    /// Aims at a new estimate as of `at_s`. The aim when it has moved enough to be told.
    pub fn aim_at_estimate(&mut self, lag: &Lag, at_s: f64) -> Option<f64> {
        let wanted_s = lag.predict_lag(at_s);
        let aim_s = self.aim_s.map_or(wanted_s, |aim_s| aim_s + (wanted_s - aim_s).clamp(-STEP_MAX_S, STEP_MAX_S));
        self.aim_s = Some(aim_s);
        let worth = self.told_s.is_none_or(|told_s| (aim_s - told_s).abs() >= WORTH_TELLING_S);
        worth.then(|| *self.told_s.insert(aim_s))
    }

    /// The lag has changed: what is in force stays until the next estimate, which is then aimed at as a whole.
    pub fn forget_aim(&mut self) {
        (self.aim_s, self.told_s) = (None, None);
    }

    /// `passed_s` later; what is in force now, s. Frozen while it cuts.
    pub fn step_lag(&mut self, passed_s: f64, cutting: bool) -> f64 {
        if let Some(aim_s) = self.aim_s.filter(|_| !cutting) {
            let most_s = RATE * passed_s.max(0.0);
            self.applied_s += (aim_s - self.applied_s).clamp(-most_s, most_s);
        }
        self.applied_s
    }

    /// What is in force, s.
    #[must_use]
    pub fn applied_s(&self) -> f64 {
        self.applied_s
    }
}

#[cfg(test)]
mod tests {
    use super::super::fit::PowerModel;
    use super::*;

    fn lag(lag_s: f64) -> Lag {
        let model = PowerModel {
            constant_w: 0.0,
            linear_w_krpm: 0.0,
            square_w_krpm2: 0.0,
            cube_w_krpm3: 0.0,
            inertia_kg_m2: 0.1,
            braking_inertia_kg_m2: 0.1,
            excess_w: 0.0,
            turning_w: 0.0,
        };
        Lag {
            lag_s,
            uncertainty_s: 0.01,
            at_s: 0.0,
            drift: None,
            window_s: 0.2,
            model,
            excess_tau_s: 1.0,
            residual_w: 1.0,
            explained: 0.99,
            inertia_share: 0.5,
            transients: 8,
        }
    }

    #[test]
    fn it_is_taken_up_slowly_and_stands_still_while_cutting() {
        let mut follower = LagFollower::default();
        assert_eq!(follower.step_lag(100.0, false), 0.0, "nothing is known yet");
        assert_eq!(follower.aim_at_estimate(&lag(0.2), 0.0), Some(0.2));
        assert!((follower.step_lag(1.0, false) - 0.05).abs() < 1e-12);
        assert!((follower.step_lag(60.0, true) - 0.05).abs() < 1e-12, "frozen");
        assert!((follower.step_lag(60.0, false) - 0.2).abs() < 1e-12);
    }

    #[test]
    fn an_estimate_that_jumps_is_followed_in_steps() {
        let mut follower = LagFollower::default();
        follower.aim_at_estimate(&lag(0.2), 0.0);
        assert_eq!(follower.aim_at_estimate(&lag(0.201), 0.0), None, "not worth a word");
        let told = follower.aim_at_estimate(&lag(0.8), 0.0).expect("a step");
        assert!((told - 0.25).abs() < 0.002, "{told}");
        follower.forget_aim();
        assert_eq!(follower.aim_at_estimate(&lag(0.8), 0.0), Some(0.8), "a change that was seen is followed at once");
    }
}
