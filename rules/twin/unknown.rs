//! Unknown: something real remains, and no named effect is what it is.
//!
//! The yardstick is a bent line over one channel (`empirical`). Names are withdrawn where such a line explains clearly
//! more than all of them, or much on top of them in a way that leaves the names little to explain, and where the runs
//! disagree on what explains most (`agreement`); and where nothing is named, a line that explains enough is an alarm
//! without a name.

use super::agreement::differs_by_run;
use super::designs::Design;
use super::diagnose::{Case, ordinary_noise};
use super::empirical::empirical_designs;
use super::fit::{Fit, fit};
use super::gate::p_value;
use super::model::{Body, simulate};
use super::scan::{Bank, price};
use super::search::{Found, Hypothesis, P_MAX};
use crate::physics::Role;

/// What an empirical form must explain on top, as a share of what is named, before the name is withdrawn.
const UNKNOWN_SHARE: f64 = 0.12;
/// The same in units of information.
const UNKNOWN_INFORMATION: f64 = 8.0;
/// The same where nothing is named: an alarm without a name must not be a false one either.
const NOTHING_NAMED_INFORMATION: f64 = 20.0;
/// Share of what is named that must be left to the names when an empirical form stands beside them.
const STANDS_SHARE: f64 = 0.6;
/// By how much a bent line over one channel must explain more than all that is named, as a share of it, before the
/// names are withdrawn: whatever bends over a channel nobody named is not what was named.
const BETTER_SHARE: f64 = 0.1;
/// The same in units of information.
const BETTER_INFORMATION: f64 = 15.0;
/// The same for a nameless cause as simple as the named ones, in units of information.
const SIMPLE_INFORMATION: f64 = 4.0;
/// Share of what is named that must be left without an effect, or that effect is most of it.
const MOST: f64 = 0.5;

/// What remains unexplained, described.
pub struct Unknown {
    /// The baseline and the empirical form, fitted together.
    pub fit: Fit,
    /// Information over the baseline.
    pub information: f64,
    /// The gate's answer.
    pub p_value: f64,
}

/// What an empirical form must explain beyond what is named: a bent line over any channel is a yardstick, a peak at one
/// speed or what fades through every pass is as good a cause as those with a name.
fn margin(form: &Design, named: f64) -> f64 {
    match &form.part.body {
        Body::Empirical(form) if form.is_simple() => SIMPLE_INFORMATION,
        _ => (BETTER_SHARE * named).max(BETTER_INFORMATION),
    }
}

impl Case<'_> {
    /// An empirical form where something real remains that the named effects do not explain.
    pub(super) fn unknown(&mut self, base: &Fit, found: &Found, seed: u64) -> Option<Unknown> {
        let _ = simulate(&found.best.fit.parts, &mut self.scene);
        let mut designs = empirical_designs(&self.scene, &self.frame, self.model);
        if self.frame.levels.is_some() {
            // Tools are draws, not points on a curve over time, and each wears along its own: what grows with the use of
            // a tool has been asked for by name.
            let named = ["time_s", "time_in_run_s", "cutting_time_min"];
            designs.retain(|design| match &design.part.body {
                Body::Empirical(form) => !named.contains(&form.channel.as_str()),
                _ => true,
            });
        }
        let frame = self.frame.clone();
        let bank = Bank::new(&designs, &frame);
        let on_top = self.best_empirical(&found.best.fit, &bank)?;
        let anything = !found.best.members.is_empty();
        let alone = if anything { self.best_empirical(base, &bank)? } else { on_top.clone() };
        let named = found.best.information;
        let least = if anything { UNKNOWN_INFORMATION } else { NOTHING_NAMED_INFORMATION };
        let remains = on_top.information > (UNKNOWN_SHARE * named).max(least);
        let better = anything
            && alone.information > named + margin(&bank.designs[alone.members[0]], named)
            && !self.is_friction(&alone, &bank, &found.best.fit);
        // Names that explain as much beside the empirical form as without it are not put in doubt by it.
        let stands = |given: Hypothesis| named + on_top.information - given.information > STANDS_SHARE * named;
        let unlike = anything && self.unlike(&found.best);
        let doubted = remains && !(anything && self.with_form(base, &bank, on_top.members[0]).is_some_and(stands));
        if !(doubted || better || unlike) {
            return None;
        }
        let better = better || unlike;
        let (from, to) = if better { (base, &alone) } else { (&found.best.fit, &on_top) };
        let noise = ordinary_noise(&to.fit);
        let small = self.negligible(&from.residual, &to.fit.residual, noise, to.information);
        if small {
            return None;
        }
        let p = p_value(&bank, &found.best.fit, &on_top.fit, self.ln_rows(base), seed, !anything);
        if !better && p > P_MAX {
            return None;
        }
        Some(Unknown { fit: alone.fit, information: alone.information, p_value: p })
    }

    /// Is what explains most of it another one in every run?
    fn unlike(&mut self, best: &Hypothesis) -> bool {
        let first = best.fit.parts.len() - best.members.len();
        (0..best.members.len()).any(|position| {
            differs_by_run(&best.fit, &self.frame, first + position)
                && (best.members.len() == 1
                    || self.without(best, position).is_some_and(|rest| rest.information < MOST * best.information))
        })
    }

    /// Is a bent line over the velocity of the axis no more than the shape of a friction that has been named? No law of
    /// friction fits a real axis to its noise.
    fn is_friction(&self, empirical: &Hypothesis, bank: &Bank<'_>, named: &Fit) -> bool {
        let friction = ["dry_friction", "viscous_friction", "stribeck", "axis_friction"];
        let of_velocity = empirical.members.iter().all(|member| match &bank.designs[*member].part.body {
            Body::Empirical(form) => Some(form.channel.as_str()) == self.scene.role_name(Role::Velocity),
            _ => false,
        });
        of_velocity && named.parts.iter().any(|part| friction.contains(&part.kind.as_str()))
    }

    /// The empirical form that explains most on top of `from`, fitted in full; information relative to `from`.
    fn best_empirical(&mut self, from: &Fit, bank: &Bank<'_>) -> Option<Hypothesis> {
        let scores = bank.scan(from, self.ln_rows(from));
        let known = scores.iter().filter(|score| score.information.is_finite());
        let best = known.max_by(|a, b| a.information.total_cmp(&b.information))?;
        self.with_form(from, bank, best.design)
    }

    /// One empirical form on top of `from`, fitted in full; information relative to `from`.
    fn with_form(&mut self, from: &Fit, bank: &Bank<'_>, index: usize) -> Option<Hypothesis> {
        let design = &bank.designs[index];
        let mut parts = from.parts.clone();
        parts.push(design.part.clone());
        let fit = self.with_data(|data| fit(data, &parts, from.noise))?;
        let gain = 2.0 * (fit.log_likelihood - from.log_likelihood);
        let information = gain - price(design, self.ln_rows(from));
        Some(Hypothesis { members: vec![index], fit, information })
    }
}
