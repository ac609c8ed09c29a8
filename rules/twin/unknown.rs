//! Unknown: something real remains, and no named effect is what it is.
//!
//! The yardstick is a bent line over one channel (`empirical`). Names are withdrawn where such a line explains clearly
//! more than all of them, or much on top of them in a way that leaves the names little to explain; and where nothing is
//! named, a line that explains enough is an alarm without a name.

use super::channel::SIMULATED_OUTPUT;
use super::designs::Design;
use super::diagnose::{Case, ordinary_noise};
use super::empirical::{Multiplier, as_design};
use super::events::event_designs;
use super::fit::{Fit, fit};
use super::gate::p_value;
use super::model::{PartFunction, simulate};
use super::offered::{empirical_designs, products};
use super::periodic::waves;
use super::replaceable::LEADING_SHARE;
use super::scan::{HypothesisBank, Score, likeliest, price};
use super::search::{Hypothesis, P_MAX, SearchResult};
use super::size::BEYOND_DOUBT_INFORMATION;
use crate::physics::Role;
use adapters::channel::ChannelId;

/// What an empirical form must explain on top, as a share of what is named, before the name is withdrawn.
const UNKNOWN_SHARE: f64 = 0.12;
/// The same in units of information.
const UNKNOWN_INFORMATION: f64 = 8.0;
/// The same where nothing is named: an alarm without a name must not be a false one either.
pub(super) const NOTHING_NAMED_INFORMATION: f64 = 20.0;
/// Share of what is named that must be left to the names when an empirical form stands beside them.
pub(super) const STANDS_SHARE: f64 = 0.6;
/// By how much a bent line over one channel must explain more than all that is named, as a share of it, before the
/// names are withdrawn: whatever bends over a channel nobody named is not what was named.
const BETTER_SHARE: f64 = 0.1;
/// The same in units of information.
const BETTER_INFORMATION: f64 = 15.0;
/// The same for a nameless cause as simple as the named ones, in units of information.
const SIMPLE_INFORMATION: f64 = 4.0;
/// Forms on top of a form, at most, before what is left counts as noise.
const DEEPER_MAX: usize = 3;
/// Steps by which place, width and time constant of a form are moved, as shares of themselves.
const SHARPENING: [f64; 3] = [0.15, 0.06, 0.02];
/// Moves of one step at most.
const SHARPENINGS_MAX: usize = 4;
/// Information that a move must bring.
const SHARPER: f64 = 0.5;
/// Names that stand although a form without a name explains a little more, and the share of it that they must explain.
/// Wrong names explain up to 0.78 of it, right ones in another form than the catalogue's 0.86 and more; too little costs
/// wrong names, too much costs right ones.
const NAMES_MAX: usize = 2;
const NAMED_SHARE: f64 = 0.85;
/// What remains unexplained, described.
pub struct Unknown {
    /// The baseline and the empirical form, fitted together.
    pub fit: Fit,
    /// Information over the baseline.
    pub information: f64,
    /// The gate's answer.
    pub p_value: f64,
    /// What the model file excludes and would explain clearly more than any name it admits.
    pub excluded: Option<String>,
}

/// A cause without a name that explains what was named as well.
#[derive(Debug, Clone, PartialEq)]
pub struct Nameless {
    /// The kind it could stand for: the one that explains most of what was named.
    pub instead_of: String,
    /// By how much less it explains, in units of information without the price; zero when it explains more.
    pub delta_ic: f64,
}

/// What an empirical form must explain beyond what is named: a bent line over any channel is a yardstick, a peak at one
/// speed or what fades through every pass is as good a cause as those with a name.
pub(super) fn margin(form: &Design, named: f64) -> f64 {
    match &form.part.body {
        PartFunction::Empirical(form) if form.is_simple() => SIMPLE_INFORMATION,
        _ => (BETTER_SHARE * named).max(BETTER_INFORMATION),
    }
}

/// Is it a friction over something, of which a friction that is the same everywhere is part?
fn is_against_motion(design: &Design) -> bool {
    matches!(&design.part.body, PartFunction::Empirical(form) if form.factor == Multiplier::AgainstMotion)
}

/// Is it drawn over the output as a whole?
fn is_over_output(design: &Design) -> bool {
    matches!(&design.part.body, PartFunction::Empirical(form) if form.channel == SIMULATED_OUTPUT)
}

/// Is something among the parts of a fit that bends the output as a whole?
fn bends_the_output(fit: &Fit) -> bool {
    fit.parts.iter().any(|part| ["saturation", "sensor_gain"].contains(&part.kind.as_str()))
}

/// Is a friction among the parts of a fit?
fn has_friction(fit: &Fit) -> bool {
    let friction = ["dry_friction", "viscous_friction", "stribeck", "axis_friction"];
    fit.parts.iter().any(|part| friction.contains(&part.kind.as_str()))
}

/// An empirical form fitted on top of something.
#[derive(Clone)]
pub(super) struct FormFit {
    pub(super) design: Design,
    pub(super) fit: Fit,
    /// Information over what it was fitted on top of.
    pub(super) information: f64,
}

/// Why the names that a search found may not be right.
pub struct Doubt {
    /// What remains unexplained: the names are withdrawn.
    pub unknown: Option<Unknown>,
    /// What explains as much: the names stand, and it beside them.
    pub nameless: Option<Nameless>,
}

impl Doubt {
    /// No doubt at all.
    pub(super) const NONE: Self = Self { unknown: None, nameless: None };
}

/// Why names are withdrawn, whatever a form without a name explains.
#[derive(Debug, Clone, Copy)]
struct WithdrawnNames<'a> {
    /// A nameless form replaces the leading one.
    leading: bool,
    /// What the model file excludes, where it explains clearly more.
    excluded: Option<&'a str>,
}

/// The empirical forms of a case, and what each explains on top of the baseline alone.
pub(super) struct Yardsticks<'a> {
    pub(super) bank: HypothesisBank<'a>,
    of_base: Vec<Score>,
}

impl Case<'_> {
    /// Weighs what was found against causes without a name.
    pub(super) fn doubt(&mut self, base: &Fit, found: &mut SearchResult, designs: &[Design], seed: u64) -> Doubt {
        let _ = simulate(&found.best.fit.parts, &mut self.scene);
        let mut forms = self.empirical_forms();
        let left = [base, &found.best.fit].map(|fit| waves(&self.scene, &self.frame, &fit.residual, fit.noise));
        let left = left.into_iter().flatten();
        forms.extend(left.filter_map(|form| as_design(form, &self.scene, &self.frame)));
        if found.best.members.is_empty() {
            forms.extend(event_designs(&self.scene, &self.frame, base));
            forms.extend(products(&self.scene, &self.frame));
        }
        let frame = self.frame.clone();
        let bank = HypothesisBank::new(&forms, &frame);
        let of_base = bank.scan(base, self.ln_rows(base));
        let yardsticks = Yardsticks { bank, of_base };
        let replaceable = self.replaceable(base, &found.best, designs, &yardsticks);
        let leading = replaceable.iter().any(|replaceable| replaceable.share >= LEADING_SHARE);
        let excluded = self.outdone_by_excluded(base, &found.best, designs, seed);
        let withdrawn = WithdrawnNames { leading, excluded: excluded.as_deref() };
        let unknown = self.unknown(base, found, &yardsticks, withdrawn, seed);
        let beside = unknown.as_ref().and_then(|unknown| self.named_nearly_as_well(unknown, found, designs));
        if unknown.is_some() && beside.is_none() {
            return Doubt { unknown, nameless: None };
        }
        self.drop_minor(base, found, designs, &yardsticks, replaceable);
        let nameless = self.nameless(base, found, designs, &yardsticks);
        let first = found.best.members.first().filter(|_| excluded.is_some());
        let named = first.map(|member| Nameless { instead_of: designs[*member].kind.clone(), delta_ic: 0.0 });
        Doubt { unknown: None, nameless: nameless.or(named).or(beside) }
    }

    /// The cause without a name as one beside the names, where few names explain nearly as much as it does: no machine
    /// follows a law to the letter, and a free form always explains the rest. Not where it lies over a column of the user's
    /// own, which no law of the catalogue could follow.
    fn named_nearly_as_well(&self, unknown: &Unknown, found: &SearchResult, designs: &[Design]) -> Option<Nameless> {
        let best = &found.best;
        let few = (1..=NAMES_MAX).contains(&best.members.len());
        let own_column = unknown.fit.parts[self.parts.len()..].iter().any(|part| match &part.body {
            PartFunction::Empirical(form) => {
                self.scene.column(&form.channel).is_some() && ChannelId::of(&form.channel).is_none()
            }
            _ => false,
        });
        if !few || own_column || unknown.excluded.is_some() || best.information < NAMED_SHARE * unknown.information {
            return None;
        }
        let instead_of = designs[best.members[0]].kind.clone();
        Some(Nameless { instead_of, delta_ic: (best.information - unknown.information).max(0.0) })
    }

    /// Every empirical form worth trying.
    fn empirical_forms(&self) -> Vec<Design> {
        let mut forms = empirical_designs(&self.scene, &self.frame, self.model);
        if self.frame.levels.is_some() {
            // Tools are draws, not points on a curve over time, and each wears along its own: what grows with the use of
            // a tool has been asked for by name.
            let named = ["time_s", "time_in_run_s", "cutting_time_min"];
            forms.retain(|design| match &design.part.body {
                PartFunction::Empirical(form) => !named.contains(&form.channel.as_str()),
                _ => true,
            });
        }
        forms
    }

    /// An empirical form where something real remains that the named effects do not explain.
    fn unknown(
        &mut self,
        base: &Fit,
        found: &SearchResult,
        forms: &Yardsticks<'_>,
        withdrawn: WithdrawnNames<'_>,
        seed: u64,
    ) -> Option<Unknown> {
        let best = &found.best;
        let anything = !best.members.is_empty();
        let alone = self.best_empirical(base, forms, &forms.of_base)?;
        let on_top = if anything {
            let of_best = forms.bank.scan(&best.fit, self.ln_rows(&best.fit));
            self.best_empirical(&best.fit, forms, &of_best)?
        } else {
            alone.clone()
        };
        let named = found.best.information;
        let least = if anything { UNKNOWN_INFORMATION } else { NOTHING_NAMED_INFORMATION };
        let remains = on_top.information > (UNKNOWN_SHARE * named).max(least);
        let better = anything
            && alone.information > named + margin(&alone.design, named)
            && !self.is_another_shape(&alone.design, best);
        // Names that explain as much beside the empirical form as without it are not put in doubt by it.
        let stands = |given: FormFit| named + on_top.information - given.information > STANDS_SHARE * named;
        let refined = self.is_another_shape(&on_top.design, best);
        let doubted = remains && !refined && !(anything && self.with_form(base, &on_top.design).is_some_and(stands));
        let WithdrawnNames { leading, excluded } = withdrawn;
        let instead = better || leading || excluded.is_some() && alone.information > 0.0;
        if !(doubted || instead) {
            return None;
        }
        let (from, to) = if instead { (base, &alone) } else { (&found.best.fit, &on_top) };
        let rest = self.deepened(to, forms);
        let noise = ordinary_noise(&rest.fit);
        let small =
            self.negligible(&from.residual, &rest.fit.residual, noise, rest.information >= BEYOND_DOUBT_INFORMATION);
        if small && excluded.is_none() {
            return None;
        }
        let rest = if instead { self.deepened(&on_top, forms) } else { rest };
        let p = p_value(&forms.bank, &found.best.fit, &rest.fit, None, self.ln_rows(base), seed, !anything);
        if !better && excluded.is_none() && p > P_MAX {
            return None;
        }
        Some(Unknown {
            fit: alone.fit,
            information: alone.information,
            p_value: p,
            excluded: excluded.map(str::to_owned),
        })
    }

    /// A form with others on top of it, as long as they explain something: one form seldom describes the whole of what is
    /// left, and its rest is no noise to be resampled.
    fn deepened(&mut self, form: &FormFit, forms: &Yardsticks<'_>) -> FormFit {
        let mut deepest = form.clone();
        for _ in 0..DEEPER_MAX {
            let scores = forms.bank.scan(&deepest.fit, self.ln_rows(&deepest.fit));
            let more = self.best_empirical(&deepest.fit, forms, &scores);
            let Some(more) = more.filter(|more| more.information > UNKNOWN_INFORMATION) else { break };
            deepest = FormFit { fit: more.fit, information: deepest.information + more.information, ..deepest };
        }
        deepest
    }

    /// A peak at one speed, or what fades through every pass, that fits as well as all that is named: then the recording
    /// does not tell that the name is right. Prices are left out, for where a peak stands and how wide it is is nothing
    /// that a recording of a few speeds could tell.
    fn nameless(
        &mut self,
        base: &Fit,
        found: &SearchResult,
        designs: &[Design],
        forms: &Yardsticks<'_>,
    ) -> Option<Nameless> {
        let best = &found.best;
        if best.members.is_empty() {
            return None;
        }
        let simple = |score: &&Score| match &forms.bank.designs[score.design].part.body {
            PartFunction::Empirical(form) => form.is_simple() && score.gain.is_finite(),
            _ => false,
        };
        let likeliest = forms.of_base.iter().filter(simple).max_by(|a, b| a.gain.total_cmp(&b.gain))?;
        let form = self.sharpened(base, &forms.bank.designs[likeliest.design], likeliest.gain);
        let form = self.with_form(base, &form)?;
        let delta_ic = 2.0 * (best.fit.log_likelihood - form.fit.log_likelihood);
        if delta_ic > super::verdicts::CLASS_INFORMATION {
            return None;
        }
        let rest = |position| (position, self.without(best, position).map_or(0.0, |rest| rest.information));
        let rests: Vec<(usize, f64)> = (0..best.members.len()).map(rest).collect();
        let (most, _) = rests.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Nameless { instead_of: designs[best.members[most]].kind.clone(), delta_ic: delta_ic.max(0.0) })
    }

    /// Is a nameless form no more than another shape of what has been named? A bent line over the velocity of the axis, or
    /// one against the motion over whatever else, is that of a friction, for no law of friction fits a real axis to its
    /// noise; one over the output is that of a ceiling or a gain; and one over a column that only one effect follows is
    /// that effect's.
    pub(super) fn is_another_shape(&self, empirical: &Design, named: &Hypothesis) -> bool {
        let of_velocity = match &empirical.part.body {
            PartFunction::Empirical(form) => Some(form.channel.as_str()) == self.scene.role_name(Role::Velocity),
            _ => false,
        };
        (of_velocity || is_against_motion(empirical)) && has_friction(&named.fit)
            || is_over_output(empirical) && bends_the_output(&named.fit)
            || self.is_over_own_column(empirical, named)
    }

    /// Does it bend over a column that only an effect among the named ones follows?
    fn is_over_own_column(&self, empirical: &Design, named: &Hypothesis) -> bool {
        let PartFunction::Empirical(form) = &empirical.part.body else { return false };
        let members = &named.fit.parts[named.first_part()..];
        let mut own = members.iter().filter_map(|part| part.effect_and_form()?.0.own_column(&self.scene));
        own.any(|column| column == form.channel)
    }

    /// The empirical form that explains most on top of `from`, fitted in full; information relative to `from`.
    pub(super) fn best_empirical(&mut self, from: &Fit, forms: &Yardsticks<'_>, scores: &[Score]) -> Option<FormFit> {
        let best = likeliest(scores)?;
        let design = self.sharpened(from, &forms.bank.designs[best.design], best.gain);
        self.with_form(from, &design)
    }

    /// The same form with its place, width or time constant moved to where it explains most: the forms that are tried
    /// first are few.
    fn sharpened(&self, from: &Fit, design: &Design, gain: f64) -> Design {
        let mut best = (gain, design.clone());
        for step in SHARPENING {
            for _ in 0..SHARPENINGS_MAX {
                let PartFunction::Empirical(form) = &best.1.part.body else { return best.1 };
                let near = form.neighbours(step).into_iter();
                let near: Vec<Design> = near.filter_map(|form| as_design(form, &self.scene, &self.frame)).collect();
                let bank = HypothesisBank::new(&near, &self.frame);
                let scores = bank.scan(from, self.ln_rows(from));
                let Some(next) = scores.iter().max_by(|a, b| a.gain.total_cmp(&b.gain)) else { return best.1 };
                if next.gain.is_nan() || next.gain < best.0 + SHARPER {
                    break;
                }
                best = (next.gain, near[next.design].clone());
            }
        }
        best.1
    }

    /// An empirical form on top of `from`, fitted in full.
    pub(super) fn with_form(&mut self, from: &Fit, design: &Design) -> Option<FormFit> {
        let mut parts = from.parts.clone();
        parts.push(design.part.clone());
        let fit = self.with_data(|data| fit(data, &parts, from.noise))?;
        let gain = 2.0 * (fit.log_likelihood - from.log_likelihood);
        let information = gain - price(design, self.ln_rows(from));
        Some(FormFit { design: design.clone(), fit, information })
    }
}
