//! Do the runs agree on an effect, or the tools, operations, parts, passes? A law has the same coefficient in all of them;
//! what comes and goes by itself, and is only imitated by a law on average, has not.

use super::fit::{Fit, UNITS_MIN};
use super::frame::Frame;
use super::linear::{extend_basis, project_out};
use super::model::{Part, PartFunction};
use crate::statistics::count;

/// Deviation of the runs' own coefficients, as a share of the common one, beyond which they do not share it. Effects
/// that are there, in other forms than the catalogue's, stay below 0.4 (`tests/concealed`).
const SHARE: f64 = 0.45;
/// Normal deviate of Cochran's Q beyond which that is no chance (p = 0.025).
const DEVIATE: f64 = 1.96;
/// The same for any of many ways to form groups.
const FAR_DEVIATE: f64 = 4.0;
/// Share of all that is known of a coefficient below which a unit tells nothing of it.
const TELLS: f64 = 1e-3;

/// Kinds whose coefficients belong to a tool, a lot, a blank, a program, a stretch of time or a place, not to the machine.
const OWN: [&str; 13] = [
    "flank_wear",
    "hardness_batch",
    "recipe_error",
    "auxiliary_switch",
    "ripple_alias",
    "zero_drift",
    "sensor_gain",
    "built_up_edge",
    "edge_force",
    "chatter",
    "spindle_inertia",
    "engagement_timing",
    "entry_exit",
];

/// Does no parameter of this part have one value for all runs?
#[must_use]
pub(super) fn differs_by_run(fit: &Fit, frame: &Frame, part: usize) -> bool {
    if !is_of_the_machine(&fit.parts[part].kind) || !is_law(&fit.parts[part]) {
        return false;
    }
    ParameterInformation::of(fit, frame, part).disagree(&runs(frame), SHARE, DEVIATE)
}

/// Is there, in one of these groupings, no parameter of this part with one value for all groups?
#[must_use]
pub(super) fn differs_in_any(fit: &Fit, frame: &Frame, part: usize, groupings: &[Grouping]) -> bool {
    let columns = ParameterInformation::of(fit, frame, part);
    groupings.iter().any(|grouping| columns.disagree(&grouping.group, grouping.share_max, FAR_DEVIATE))
}

/// How the fitted rows fall into groups.
pub(super) struct Grouping {
    /// Which group each row is of, if any.
    pub(super) group: Vec<Option<usize>>,
    /// The share of a coefficient by which groups may differ.
    pub(super) share_max: f64,
}

/// The unit of hold-out of each row.
pub(super) fn runs(frame: &Frame) -> Vec<Option<usize>> {
    frame.unit.iter().map(|unit| Some(*unit)).collect()
}

/// Does a coefficient of this kind belong to the machine?
pub(super) fn is_of_the_machine(kind: &str) -> bool {
    !OWN.contains(&kind)
}

/// What the rows tell of each parameter of a part.
struct ParameterInformation<'a> {
    fit: &'a Fit,
    innovations: Vec<f64>,
    /// Free parameter, and its whitened tangent with those of all others taken out.
    own: Vec<(usize, Vec<f64>)>,
}

impl<'a> ParameterInformation<'a> {
    fn of(fit: &'a Fit, frame: &Frame, part: usize) -> Self {
        let white: Vec<Vec<f64>> = fit.tangent.iter().map(|column| frame.whiten(column, fit.noise)).collect();
        let of_part = (0..fit.free.len()).filter(|index| fit.free[*index].part == part);
        let own = of_part.map(|index| (index, cleared(&white, index))).collect();
        Self { fit, innovations: fit.innovations(frame), own }
    }

    /// Does no parameter have one value for all groups, by more than this share of it and this far beyond chance, where
    /// enough of them tell something?
    fn disagree(&self, group: &[Option<usize>], share: f64, deviate: f64) -> bool {
        let told =
            self.own.iter().filter_map(|(index, own)| disagreement(self.fit, group, own, &self.innovations, *index));
        let told: Vec<Disagreement> = told.collect();
        !told.is_empty() && told.iter().all(|told| told.share > share && told.deviate() > deviate)
    }
}

fn is_law(part: &Part) -> bool {
    matches!(&part.body, PartFunction::Effect(_, form) if form.place.is_none() && form.name != "latent")
}

/// How far groups disagree on one parameter.
struct Disagreement {
    /// Deviation of their own values beyond their noise, over the common value.
    share: f64,
    /// Cochran's Q.
    q: f64,
    /// Its degrees of freedom.
    freedom: f64,
}

impl Disagreement {
    /// Q as a normal deviate (Wilson and Hilferty, 1931).
    fn deviate(&self) -> f64 {
        let spread = 2.0 / (9.0 * self.freedom);
        ((self.q / self.freedom).cbrt() - (1.0 - spread)) / spread.sqrt()
    }
}

/// `None` for fewer groups than can disagree.
fn disagreement(
    fit: &Fit,
    group: &[Option<usize>],
    own: &[f64],
    innovations: &[f64],
    index: usize,
) -> Option<Disagreement> {
    let variance = fit.innovation_variance(innovations);
    let groups = group.iter().flatten().max().map_or(0, |last| last + 1);
    let mut told = vec![(0.0, 0.0); groups];
    for (row, group) in group.iter().enumerate().filter_map(|(row, group)| Some((row, (*group)?))) {
        told[group].0 += own[row] * own[row];
        told[group].1 += own[row] * innovations[row];
    }
    let total: f64 = told.iter().map(|(weight, _)| weight).sum();
    told.retain(|(weight, _)| *weight > TELLS * total);
    let free = fit.free[index];
    let value = fit.parts[free.part].parameters[free.parameter].value.abs();
    if told.len() < UNITS_MIN || variance <= 0.0 || value <= 0.0 {
        return None;
    }
    // Everything else in the fit moves along: the common value has a score of zero.
    let q = told.iter().map(|(weight, score)| score * score / weight).sum::<f64>() / variance;
    let between = between(&told, q, variance);
    Some(Disagreement { share: between.sqrt() / value, q, freedom: count(told.len() - 1) })
}

/// Variance of a coefficient between groups beyond what the noise makes of it: DerSimonian and Laird, Controlled Clinical
/// Trials 7 (1986) 177. `told` holds what each group knows of it (weight, score), `variance` is that of one innovation.
pub(super) fn between(told: &[(f64, f64)], q: f64, variance: f64) -> f64 {
    let sum: f64 = told.iter().map(|(weight, _)| weight).sum();
    let squares: f64 = told.iter().map(|(weight, _)| weight * weight).sum();
    ((q - count(told.len().saturating_sub(1))) * variance / (sum - squares / sum)).max(0.0)
}

/// A parameter's whitened tangent with those of all others taken out.
pub(super) fn cleared(white: &[Vec<f64>], index: usize) -> Vec<f64> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for (_, column) in white.iter().enumerate().filter(|(other, _)| *other != index) {
        let _ = extend_basis(&mut basis, column.clone(), 1e-8);
    }
    let mut own = white[index].clone();
    project_out(&basis, &mut own);
    project_out(&basis, &mut own);
    own
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviate_of_cochrans_q_is_that_of_the_table() {
        for (q, freedom, deviate) in [(19.02, 9.0, 1.96), (23.34, 12.0, 1.96), (4.17, 9.0, -1.28), (13.36, 8.0, 1.28)] {
            let told = Disagreement { share: 0.0, q, freedom };
            assert!((told.deviate() - deviate).abs() < 0.03, "{q} of {freedom}: {}", told.deviate());
        }
    }
}
