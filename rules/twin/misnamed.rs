//! Names that the fit itself belies. A state that stands still leaves a curve over speed, and a curve over speed is
//! anything: friction of another form, a drag, a table that is wrong. What is named after the warmth that it needs must
//! explain more with the warmth than without. And where a tool enters the work it cuts next to nothing at first: what
//! lacks a little of the cut for a while is no entry.
//!
//! They are refused only once they would be claimed: on the way to something else they may stand for what they imitate.

use super::diagnose::Case;
use super::fit::{Fit, fit};
use super::model::Part;
use super::outcome::SearchAnswer;
use super::search::Hypothesis;
use crate::physics::Scene;

/// Units of information that the passing of time must bring.
const INFORMATION_MIN: f64 = 20.0;
/// Share of what the effect brings that it must bring.
const SHARE_MIN: f64 = 0.25;
/// Share of the cut that must be missing where it begins or ends, for a tool that is not in the work yet.
const MISSING_MIN: f64 = 0.15;
/// The kind that is refused where it is slight, and remembered: what is named in its place explains less.
pub(super) const ENTRY: &str = "entry_exit";

impl Case<'_> {
    /// What is found, without what is not what it is called: no kind is refused twice, and only a few can be.
    pub(super) fn answer(&mut self, base: &Fit, seed: u64) -> SearchAnswer {
        let weighed = self.frame.clone();
        let mut refused = Vec::new();
        let mut slight = None;
        loop {
            let mut answer = self.answered(base.clone(), &refused, seed);
            let misnamed = self.misnamed(&answer.found.best);
            if misnamed.is_empty() {
                answer.slight_entry = slight.is_some_and(|information| information >= answer.information());
                return answer;
            }
            if misnamed.iter().any(|kind| kind == ENTRY) {
                slight = Some(answer.information());
            }
            refused.extend(misnamed);
            self.frame = weighed.clone();
        }
    }

    /// The kinds of a hypothesis that are not what they are called.
    fn misnamed(&mut self, best: &Hypothesis) -> Vec<String> {
        let mut misnamed = Vec::new();
        for position in 0..best.members.len() {
            let part = &best.fit.parts[best.first_part() + position];
            if enters_at_once(part) || self.is_timeless(best, position) == Some(true) {
                misnamed.push(part.kind.clone());
            }
        }
        misnamed
    }

    /// Does it explain hardly more than the same law without time does?
    fn is_timeless(&mut self, best: &Hypothesis, position: usize) -> Option<bool> {
        let mut parts = best.fit.parts.clone();
        let part = &mut parts[best.first_part() + position];
        *part = still(part, &self.scene)?;
        let still = self.with_data(|data| fit(data, &parts, best.fit.noise))?;
        let without = self.without(best, position)?.fit;
        let brought = |from: f64| 2.0 * (best.fit.log_likelihood - from);
        let least = INFORMATION_MIN.max(SHARE_MIN * brought(without.log_likelihood));
        Some(brought(still.log_likelihood) < least)
    }
}

/// Is it an entry, or an exit, with nearly all of the cut? What settles in the course of a pass may be slight.
fn enters_at_once(part: &Part) -> bool {
    let missing = |name: &str| part.parameter(name).map_or(0.0, |parameter| -parameter.value);
    part.kind == ENTRY && !part.has_form("settling") && missing("entry").max(missing("exit")) < MISSING_MIN
}

/// The part with a state that stands still, free in sign.
fn still(part: &Part, scene: &Scene) -> Option<Part> {
    let (effect, _) = part.effect_and_form()?;
    let form = effect.still()?;
    let columns = effect.columns(scene, &form)?;
    let names: Vec<&'static str> = columns.iter().map(|(name, _)| *name).collect();
    let mut still = Part::candidate(effect, &form, &names);
    still.parameters.iter_mut().for_each(|parameter| parameter.range = (f64::NEG_INFINITY, f64::INFINITY));
    Some(still)
}

#[cfg(test)]
mod tests {
    use crate::twin::{diagnose, parse_model};
    use adapters::recording::read_csv;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use std::fmt::Write;

    const MODEL: &str = "schema = \"model/1\"\noutput = \"axis_force_n\"\n[[effect]]\nkind = \"linear\"\n\
                         columns = { velocity_m_s = 200.0, \"sign(velocity_m_s)\" = 30.0, one = 0.0 }\n\
                         [roles]\nvelocity = \"velocity_m_s\"\n";

    /// A feed drive whose friction bends over its velocity: as the power 2/3, times what is left of it after a time.
    fn drive(left: impl Fn(f64) -> f64) -> String {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        let mut text = String::from("time_s,run,velocity_m_s,axis_force_n\n");
        for row in 0..3000_u32 {
            let t = 0.5 * f64::from(row);
            let velocity = 0.4 * (t / 7.0).sin() * (0.4 + 0.6 * (t / 90.0).sin().abs());
            let noise: f64 = StandardNormal.sample(&mut rng);
            let bend = velocity.signum() * velocity.abs().powf(2.0 / 3.0);
            let force = 200.0 * velocity + 30.0 * velocity.signum() + 60.0 * left(t) * bend + noise;
            writeln!(text, "{t},{},{velocity:.6},{force:.4}", row / 250).expect("a string takes it");
        }
        text
    }

    fn names(left: impl Fn(f64) -> f64) -> Vec<String> {
        let recording = read_csv(drive(left).as_bytes(), "t.csv").expect("readable").recording;
        let found = diagnose(&recording, &parse_model(MODEL).expect("fine"), 1).expect("usable");
        found.missing.into_iter().map(|missing| missing.effect).collect()
    }

    #[test]
    fn a_bend_over_speed_is_no_warm_up() {
        let names = names(|_| 1.0);
        assert!(!names.is_empty() && !names.contains(&"bearing_warm_up".to_owned()), "{names:?}");
    }

    #[test]
    fn what_falls_with_time_is_one() {
        let names = names(|t| (-t / 300.0).exp());
        assert!(names.contains(&"bearing_warm_up".to_owned()), "{names:?}");
    }
}
