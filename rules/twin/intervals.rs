//! How well the parameters of what was found are known: intervals of 95 %.
//!
//! Four things make a parameter uncertain, and none of them stands for another:
//! 1. The noise: generalised least squares over everything that is fitted together, shapes included, so that what a shape
//!    leaves open is in the intervals of the sizes too (delta method).
//! 2. The runs: innovations are never quite white, so the sandwich by units of hold-out counts where it is wider (Liang
//!    and Zeger, Biometrika 73, 1986).
//! 3. The law: where the machine does not follow it, its coefficient is another one where the law is small than where it
//!    is large, or for one sign than for the other. How far the coefficient differs between these *levels* beyond their
//!    noise is measured in the recording (DerSimonian and Laird, Controlled Clinical Trials 7, 1986), and the interval
//!    holds for a level that was not asked (prediction interval: Higgins, Thompson and Spiegelhalter, J. R. Statist. Soc. A
//!    172, 2009).
//! 4. What no recording shows: every law is a little wrong in proportion (GUM, type B), and an effect in the cut may or
//!    may not pass through the load loss that the model knows.

use super::diagnosis::ParameterEstimate;
use super::fit::{Fit, add_prior_rows};
use super::linear::{dot, extend_basis, least_squares, project_out};
use super::model::{Part, PartFunction};
use numerics::statistics::count_to_f64;
use physics::{Entry, Scene, resolve_unit};

/// By how much of its value a parameter may be off because no machine follows a law to the letter, with a certainty of
/// 95 %: a share that no amount of rows makes smaller (GUM, type B).
const LAW_SHARE: f64 = 0.05;
/// Normal quantile of a 95 % interval: 2.5 % lie beyond it on either side.
const INTERVAL: f64 = 1.96;
/// Levels at which a coefficient is compared with itself; each carries the same sum of squares of its column.
const LEVELS: usize = 4;
/// Share of a column's greatest value below which a row tells nothing of the law.
const NOTICED: f64 = 0.05;
/// Share of all that is known of a coefficient below which a level tells nothing of it.
const TELLS: f64 = 0.01;
/// Units below which their disagreement says nothing.
const UNITS_MIN: usize = 5;

/// A fit, and the rows that it was made from.
pub(super) struct FittedRows<'a> {
    pub(super) scene: &'a Scene,
    pub(super) fit: &'a Fit,
    /// The recorded output, every row.
    pub(super) recorded: &'a [f64],
    /// From a column of every row to innovations of the fitted rows.
    pub(super) whiten: &'a dyn Fn(&[f64]) -> Vec<f64>,
    pub(super) rows: &'a [usize],
    /// Unit of hold-out of each of them.
    pub(super) unit: Vec<usize>,
    /// How many parts are those of the model.
    pub(super) of_model: usize,
}

impl FittedRows<'_> {
    /// The parameters of part number `part`, with intervals in their own units.
    pub(super) fn estimate_parameters(&self, part: usize) -> Vec<ParameterEstimate> {
        let fit = self.fit;
        let left: Vec<f64> = self.recorded.iter().zip(&fit.simulated).map(|(y, f)| y - f).collect();
        let innovations = (self.whiten)(&left);
        let white: Vec<Vec<f64>> = fit.tangents.iter().map(|tangent| (self.whiten)(tangent)).collect();
        let freedom = innovations.len().saturating_sub(fit.free.len()).max(1);
        let variance = dot(&innovations, &innovations) / count_to_f64(freedom);
        let mut known = white.clone();
        add_prior_rows(&fit.parts, &fit.free, &mut known, variance);
        let inverse = least_squares(&known, &vec![0.0; known.first().map_or(0, Vec::len)]).inverse;
        let among_units = compute_sandwich_variances(&white, &innovations, &inverse, &self.unit);
        let passed_on = self.compute_load_loss_factor(part);
        let of_part = fit.free.iter().enumerate().filter(|(_, free)| free.part == part);
        of_part
            .map(|(index, free)| {
                let parameter = &fit.parts[part].parameters[free.parameter];
                let between = match parameter.entry {
                    // Where the departure of the law was fitted, its levels differ in the model already.
                    Entry::Linear if fit.parts[part].departures.is_empty() => {
                        let own: Vec<f64> = self.rows.iter().map(|row| fit.tangents[index][*row]).collect();
                        estimate_level_variance(
                            &project_out_others(&white, index),
                            &innovations,
                            &assign_levels(&own),
                            variance,
                        )
                    }
                    Entry::Linear | Entry::Shape => 0.0,
                };
                let told = ((inverse[index][index] * variance).max(among_units[index]) + between).max(0.0).sqrt();
                let half = INTERVAL * told.hypot(LAW_SHARE * parameter.value / INTERVAL);
                let (low, high) = (parameter.value - half, parameter.value + half);
                let (low, high) = match parameter.entry {
                    Entry::Linear => (low.min(low / passed_on), high.max(high / passed_on)),
                    Entry::Shape => (low, high),
                };
                ParameterEstimate {
                    name: parameter.name.clone(),
                    value: parameter.value,
                    low: Some(low.max(parameter.range.0)),
                    high: Some(high.min(parameter.range.1)),
                    unit: resolve_unit(&parameter.unit, self.scene),
                }
            })
            .collect()
    }

    /// What one unit more in the cut comes to at the output if the load loss that the model has acts on this part too; one
    /// for a part that does not change the cut.
    fn compute_load_loss_factor(&self, part: usize) -> f64 {
        let in_the_cut = |part: &Part| match &part.body {
            PartFunction::Effect(effect, _) => effect.acts_in_cut(),
            _ => false,
        };
        let own = &self.fit.parts[..self.of_model];
        let losses: Vec<&Part> = own.iter().filter(|part| part.kind == "load_loss").collect();
        if losses.is_empty() || !in_the_cut(&self.fit.parts[part]) {
            return 1.0;
        }
        let Some(load) = self.scene.load() else { return 1.0 };
        let size: f64 = load.iter().map(|load| load.abs()).sum();
        let typical = if size > 0.0 { dot(load, load) / size } else { 0.0 };
        let value = |part: &Part, name: &str| part.find_parameter(name).map_or(0.0, |parameter| parameter.value);
        let slope = |part: &&Part| value(part, "linear") + 2.0 * value(part, "quadratic_per_w") * typical;
        (1.0 + losses.iter().map(slope).sum::<f64>()).max(0.5)
    }
}

/// Variances of the parameters from the sums of each unit; zero for too few units.
fn compute_sandwich_variances(
    columns: &[Vec<f64>],
    innovations: &[f64],
    inverse: &[Vec<f64>],
    unit: &[usize],
) -> Vec<f64> {
    let units = unit.iter().max().map_or(0, |last| last + 1);
    let mut scores = vec![vec![0.0; columns.len()]; units];
    for (row, unit) in unit.iter().enumerate() {
        columns.iter().zip(&mut scores[*unit]).for_each(|(column, score)| *score += column[row] * innovations[row]);
    }
    scores.retain(|score| score.iter().any(|x| *x != 0.0));
    if scores.len() < UNITS_MIN {
        return vec![0.0; columns.len()];
    }
    let few = count_to_f64(scores.len()) / (count_to_f64(scores.len()) - 1.0);
    let of = |line: &Vec<f64>| few * scores.iter().map(|score| dot(line, score).powi(2)).sum::<f64>();
    inverse.iter().map(of).collect()
}

/// The level of each row by the value of a column, from the lowest to the highest; none where the column is next to
/// nothing. Equal values share a level, so a column of one value has one.
fn assign_levels(column: &[f64]) -> Vec<Option<usize>> {
    let top = column.iter().fold(0.0_f64, |top, x| top.max(x.abs()));
    let mut rows: Vec<usize> = (0..column.len()).filter(|row| column[*row].abs() > NOTICED * top).collect();
    rows.sort_by(|a, b| column[*a].total_cmp(&column[*b]));
    let total: f64 = rows.iter().map(|row| column[*row] * column[*row]).sum();
    let mut levels = vec![None; column.len()];
    let (mut sum, mut level, mut last) = (0.0, 0, f64::NEG_INFINITY);
    for row in rows {
        let reached =
            (0..LEVELS).rev().find(|level| sum >= total * count_to_f64(*level) / count_to_f64(LEVELS)).unwrap_or(0);
        if reached > level && column[row] - last > 1e-9 * top {
            level = reached;
        }
        sum += column[row] * column[row];
        last = column[row];
        levels[row] = Some(level);
    }
    levels
}

/// Variance of a coefficient between levels beyond what the noise makes of it; zero for fewer than two levels. `own` is
/// its whitened tangent clear of all others, `variance` that of one innovation.
fn estimate_level_variance(own: &[f64], innovations: &[f64], levels: &[Option<usize>], variance: f64) -> f64 {
    let mut told = [(0.0, 0.0); LEVELS];
    for (row, level) in levels.iter().enumerate() {
        if let Some(level) = level {
            told[*level].0 += own[row] * own[row];
            told[*level].1 += own[row] * innovations[row];
        }
    }
    let all: f64 = told.iter().map(|(weight, _)| weight).sum();
    let told: Vec<(f64, f64)> = told.into_iter().filter(|(weight, _)| *weight > TELLS * all).collect();
    let sum: f64 = told.iter().map(|(weight, _)| weight).sum();
    if told.len() < 2 || variance <= 0.0 || sum <= 0.0 {
        return 0.0;
    }
    let mean = told.iter().map(|(_, score)| score).sum::<f64>() / sum;
    let q = told.iter().map(|(weight, score)| weight * (score / weight - mean).powi(2)).sum::<f64>() / variance;
    estimate_between_variance(&told, q, variance)
}

/// Variance of a coefficient between groups beyond what the noise makes of it: DerSimonian and Laird, Controlled Clinical
/// Trials 7 (1986) 177. `told` holds what each group knows of it (weight, score), `variance` is that of one innovation.
fn estimate_between_variance(told: &[(f64, f64)], q: f64, variance: f64) -> f64 {
    let sum: f64 = told.iter().map(|(weight, _)| weight).sum();
    let squares: f64 = told.iter().map(|(weight, _)| weight * weight).sum();
    ((q - count_to_f64(told.len().saturating_sub(1))) * variance / (sum - squares / sum)).max(0.0)
}

/// A parameter's whitened tangent with those of all others taken out.
fn project_out_others(white: &[Vec<f64>], index: usize) -> Vec<f64> {
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
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const ROWS: usize = 800;

    fn noise(seed: u64) -> Vec<f64> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        (0..ROWS).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    /// What one coefficient leaves of `y`.
    fn left(column: &[f64], y: &[f64]) -> Vec<f64> {
        let coefficient = dot(column, y) / dot(column, column);
        y.iter().zip(column).map(|(y, x)| y - coefficient * x).collect()
    }

    fn difference(column: &[f64], y: &[f64]) -> f64 {
        estimate_level_variance(column, &left(column, y), &assign_levels(column), 1.0).sqrt()
    }

    #[test]
    fn a_law_that_is_followed_has_one_coefficient_at_every_level() {
        let column: Vec<f64> = (0..ROWS).map(|row| 3.0 * (count_to_f64(row) * 0.37).sin()).collect();
        let mean = (0..20).map(|seed| {
            let y: Vec<f64> = column.iter().zip(noise(seed)).map(|(x, e)| 2.0 * x + e).collect();
            difference(&column, &y)
        });
        assert!(mean.sum::<f64>() / 20.0 < 0.03);
    }

    #[test]
    fn what_is_more_upwards_than_downwards_differs_by_level() {
        let column: Vec<f64> = (0..ROWS).map(|row| 3.0 * (count_to_f64(row) * 0.37).sin()).collect();
        let law = |x: f64| if x > 0.0 { 2.2 * x } else { 1.8 * x };
        let y: Vec<f64> = column.iter().zip(noise(1)).map(|(x, e)| law(*x) + e).collect();
        let found = difference(&column, &y);
        assert!((0.15..0.35).contains(&found), "0.2 each way: {found}");
    }

    #[test]
    fn a_switch_has_one_level_and_a_ramp_has_all() {
        let switch: Vec<f64> = (0..ROWS).map(|row| f64::from(u8::from(row % 3 == 0))).collect();
        assert!(assign_levels(&switch).iter().flatten().all(|level| *level == 0));
        let ramp: Vec<f64> = (0..ROWS).map(count_to_f64).collect();
        let found = assign_levels(&ramp);
        assert_eq!((found[0], found[ROWS - 1]), (None, Some(LEVELS - 1)));
        let squares = |wanted: usize| -> f64 {
            ramp.iter().zip(&found).filter(|(_, level)| **level == Some(wanted)).map(|(x, _)| x * x).sum()
        };
        let total = dot(&ramp, &ramp);
        assert!((0..LEVELS).all(|level| (squares(level) / total - 0.25).abs() < 0.01));
    }
}
