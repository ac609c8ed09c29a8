//! The inner split: fitted runs predicted from the other fitted runs.
//!
//! It decides two things without a look at the runs that are held out. How a set of parts is fitted for prediction: by
//! generalised least squares, or by its levels alone where the noise model takes what is missing for slow noise and so
//! forgets the levels. And whether what was found may be told at all: it must leave less of fitted runs that took no part
//! in fitting it.

use super::diagnose::{Case, ordinary_noise};
use super::fit::{Data, Fit, fit_at, fit_levels};
use super::holdout::{HoldoutNoise, Prediction, predict};
use super::linear::dot;
use super::model::Part;
use super::noise::Arma;
use crate::physics::Entry;
use crate::statistics::count;
use std::collections::BTreeSet;

/// Parts of the inner split. Each is predicted from the others, so three leave two thirds of the fitted runs to fit.
const INNER_FOLDS: usize = 3;
/// Share of all that is known of a parameter below which the other runs tell nothing of it.
const TELLS: f64 = 1e-3;
/// Error of the fit to the levels over that of generalised least squares below which the levels are reported. Between one
/// and this, generalised least squares knows its parameters better; the contract allows 1.05.
const LEVELS_BETTER: f64 = 0.99;

/// What is left of fitted rows that took no part in the fit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Left {
    /// Squares, outlandish rows weighing less.
    squares: f64,
    /// Squares of the innovations in the noise of the fit.
    white: f64,
    rows: f64,
}

impl Left {
    fn and(self, other: Self) -> Self {
        Self { squares: self.squares + other.squares, white: self.white + other.white, rows: self.rows + other.rows }
    }

    /// Is more left than of another, row by row and in innovations? Either alone may be chance: rows have slow noise in
    /// them, and innovations know little of levels.
    pub(super) fn exceeds(self, other: Self) -> bool {
        self.squares >= other.squares && self.white >= other.white
    }

    /// Root mean square error, in the output's unit.
    pub(super) fn error(self) -> f64 {
        (self.squares / self.rows.max(1.0)).sqrt()
    }
}

/// Parts with the shapes known of all behind the first so many: two thirds of the runs may not tell a time constant, and
/// what the split asks is whether the law holds there, not whether it can be shaped again.
fn with_shapes_known(parts: &[Part], first: usize) -> Vec<Part> {
    let mut parts = parts.to_vec();
    let added = parts.iter_mut().skip(first).flat_map(|part| &mut part.parameters);
    added.filter(|parameter| parameter.entry == Entry::Shape).for_each(|parameter| parameter.fixed = true);
    parts
}

/// A fit as it is reported, and what it leaves of fitted units that are predicted from the others.
pub(super) struct Checked {
    pub(super) fit: Fit,
    /// `None` where there are too few units to split.
    pub(super) left: Option<Left>,
}

impl Case<'_> {
    /// A fit refitted to its levels alone where the inner split is better for that, and what it leaves there, `judged` in
    /// one noise for all that are compared.
    pub(super) fn checked(&mut self, fit: &Fit, judged: Arma) -> Checked {
        let own = self.left_of_inner(fit, fit.noise, judged);
        let levels = self.left_of_inner(fit, Arma::WHITE, judged);
        if let (Some(own_left), Some(levels_left)) = (&own, &levels)
            && levels_left.error() < LEVELS_BETTER * own_left.error()
        {
            let parts = fit.parts.clone();
            if let Some(refitted) = self.with_data(|data| fit_levels(data, &parts)) {
                return Checked { fit: refitted, left: levels };
            }
        }
        Checked { fit: fit.clone(), left: own }
    }

    /// The baseline as it predicts the units held out best: as given, or by plain least squares. Units held out choose
    /// nothing that is told; whatever is told beside the baseline must beat the better of both.
    pub(super) fn strictest(&mut self, base: Fit) -> (Fit, Option<Prediction>) {
        let given = self.predict(&base);
        let plain = self.frame.with_all_rows_alike();
        let mut data = Data { scene: &mut self.scene, frame: &plain, recorded: &self.recorded };
        let Some(plain) = fit_levels(&mut data, &base.parts) else { return (base, given) };
        let predicted = self.predict(&plain);
        let error = |prediction: &Option<Prediction>| self.quality(prediction.as_ref()?).held_out_rmse;
        let is_better = error(&given).zip(error(&predicted)).is_some_and(|(given, plain)| plain < given);
        if is_better { (plain, predicted) } else { (base, given) }
    }

    /// What is left of the fitted units when each is predicted by the same parts fitted to the others in one noise, and
    /// judged in another.
    pub(super) fn left_of_inner(&mut self, fit: &Fit, noise: Arma, judged: Arma) -> Option<Left> {
        let mut fitted: Vec<usize> = self.frame.unit.clone();
        fitted.dedup();
        if fitted.len() < INNER_FOLDS {
            return None;
        }
        let mut all = Left::default();
        for fold in 0..INNER_FOLDS {
            let out: BTreeSet<usize> = fitted.iter().copied().skip(fold).step_by(INNER_FOLDS).collect();
            all = all.and(self.left_of_fold(fit, noise, judged, &out)?);
        }
        Some(all)
    }

    fn left_of_fold(&mut self, fit: &Fit, noise: Arma, judged: Arma, out: &BTreeSet<usize>) -> Option<Left> {
        let mut parts = with_shapes_known(&fit.parts, self.parts.len());
        for (free, tangent) in fit.free.iter().zip(&fit.tangent) {
            let told = tangent.iter().zip(&self.frame.unit).filter(|(_, unit)| !out.contains(unit));
            let told: f64 = told.map(|(x, _)| x * x).sum();
            // A state of a run of its own is not told by other runs, and stays as it is.
            parts[free.part].parameters[free.parameter].fixed |= told < TELLS * dot(tangent, tangent);
        }
        let train = self.frame.only(|unit| !out.contains(&unit));
        let test = self.frame.only(|unit| out.contains(&unit));
        let recorded = train.reduce(self.scene.recorded());
        let mut data = Data { scene: &mut self.scene, frame: &train, recorded: &recorded };
        let refitted = fit_at(&mut data, &parts, noise)?;
        let known = HoldoutNoise { arma: fit.noise, deviation: ordinary_noise(fit) };
        let prediction = predict(&mut self.scene, &refitted.parts, self.parts.len(), &self.units, out, known)?;
        let recorded = test.reduce(self.scene.recorded());
        let simulated = test.reduce(&prediction.total);
        let left: Vec<f64> =
            recorded.iter().zip(&simulated).map(|(recorded, simulated)| recorded - simulated).collect();
        let white = test.whiten(&left, judged);
        let squares = left.iter().enumerate().map(|(group, x)| (x * test.outlier_weight(group)).powi(2)).sum();
        Some(Left { squares, white: dot(&white, &white), rows: count(test.len()) })
    }
}
