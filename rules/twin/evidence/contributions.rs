//! What an explanation contributes: the output with it, and every name's share of it row by row.

use super::answer::Named;
use super::inputs::RecordingInputs;
use super::linear_algebra::{CholeskyFactor, compute_gram_matrix};
use super::noise::NoiseModel;
use super::posterior::Explanation;
use super::posterior_means::PosteriorMeans;
use super::recursive_least_squares::Follower;
use super::validation::Judge;
use super::variant_bank::Since;
use crate::diagnosis::UNKNOWN;
use ndarray::{Array1, s};
use numerics::statistics::{count_to_f64, rms};
use physics::BEGUN;

impl Judge<'_> {
    /// The output with what an explanation adds, and each name's contribution.
    pub(super) fn compute_contributions(&self, of: &Explanation) -> (Vec<f64>, Vec<Named>) {
        let solved = self.solve_plain_means(of);
        let mut after = self.inputs.simulated.clone();
        for (index, w) in solved.tangents.iter().enumerate() {
            let tangent = self.comparison.tangent(index);
            after.iter_mut().zip(tangent).for_each(|(sum, x)| *sum += w * x);
        }
        let mut all: Vec<Named> = Vec::new();
        let mut put = |name: String, x: Vec<f64>| match all.iter_mut().find(|(known, _)| *known == name) {
            Some((_, sum)) => sum.iter_mut().zip(&x).for_each(|(sum, x)| *sum += x),
            None => all.push((name, x)),
        };
        let mut steps = Vec::new();
        let mut shared: Vec<(usize, Vec<f64>)> = Vec::new();
        for (at, (variant, _)) in of.members.iter().enumerate() {
            let variant = &self.second.bank.variants[*variant];
            let x = self.second.bank.compute_contribution(variant, &solved.members[at]);
            match (variant.kind(), &of.claims[at]) {
                (Some(kind), _) => {
                    if let Some(Since::Run(run)) = variant.since {
                        steps.push((kind.to_owned(), run));
                    }
                    put(kind.to_owned(), x);
                }
                (None, None) => put(UNKNOWN.to_owned(), x),
                (None, Some(_)) => shared.push((at, x)),
            }
        }
        self.distribute_claimed_curves(of, shared, &mut put);
        after = self.add_contributions(after, &all);
        for (kind, run) in steps {
            self.backdate_run_step(&kind, run, &mut after, &mut all);
        }
        self.track_hidden_states(of, &mut after, &mut all);
        (after, all)
    }

    /// Posterior means by plain least squares, as the baseline is fitted: in the metric of slow noise edges would decide
    /// about levels. What the noise remembers makes each row worth less.
    fn solve_plain_means(&self, of: &Explanation) -> PosteriorMeans {
        let comparison = self.comparison;
        let (fixed, output) = comparison.fixed_and_output();
        let bank = &comparison.bank;
        let members = of.members.iter().flat_map(|(variant, _)| &bank.columns[bank.variants[*variant].columns.clone()]);
        let columns: Vec<&[f64]> = fixed.iter().chain(members).map(Vec::as_slice).chain([output]).collect();
        let tall = comparison.whiten_columns(&columns, NoiseModel::WHITE);
        let gram = compute_gram_matrix(tall.view());
        let noise = self.settings[of.noise].gram.noise;
        let rows = count_to_f64(comparison.rows.len());
        let last = columns.len() - 1;
        let mut variance = gram[[last, last]] / rows;
        let mut w = Array1::zeros(last);
        for _ in 0..2 {
            let ridge = comparison.build_ridges(&gram, variance, &of.members);
            let mut inner = gram.slice(s![..last, ..last]).to_owned();
            ridge.iter().enumerate().for_each(|(at, ridge)| inner[[at, at]] += ridge);
            w = CholeskyFactor::from_matrix(&inner).solve_system(&gram.slice(s![..last, last]).to_owned());
            let left = &tall.column(last) - &tall.slice(s![.., ..last]).dot(&w);
            variance = left.dot(&left) / rows * noise.variance_inflation();
        }
        comparison.split_coefficients(&w, &of.members)
    }

    /// States that act in rows held out only, followed through each unit from its own earlier rows.
    fn track_hidden_states(&self, of: &Explanation, after: &mut [f64], all: &mut [Named]) {
        let setting = &self.settings[of.noise];
        let variance = setting.saturated.variance;
        let mut states: Vec<(String, &[f64], f64)> = Vec::new();
        for ((variant, size), claim) in of.members.iter().zip(&of.claims) {
            let variant = &self.second.bank.variants[*variant];
            let claimed = claim.as_ref().and_then(|claim| self.naming.kind(claim.laws[0].0));
            let name = variant.kind().map(str::to_owned).or(claimed).unwrap_or_else(|| UNKNOWN.to_owned());
            let deviation = super::marginal::SIZES[*size] * self.comparison.deviation;
            let known = |d: f64| (deviation * d).powi(2) / variance;
            states.extend(variant.followed.iter().map(|(column, d)| (name.clone(), column.as_slice(), known(*d))));
        }
        let units: std::collections::BTreeSet<usize> =
            self.inputs.held_out_rows().map(|row| self.inputs.unit[row]).collect();
        for unit in units.into_iter().filter(|_| !states.is_empty()) {
            let rows: Vec<usize> = self.inputs.held_out_rows().filter(|row| self.inputs.unit[*row] == unit).collect();
            let acts = |(_, column, _): &&(String, &[f64], f64)| rows.iter().any(|row| column[*row] != 0.0);
            let here: Vec<&(String, &[f64], f64)> = states.iter().filter(acts).collect();
            let noise = self.comparison.convert_noise_to_rows(setting.gram.noise);
            self.track_unit_states(&rows, &here, (noise, variance.sqrt()), after, all);
        }
    }

    fn track_unit_states(
        &self,
        rows: &[usize],
        states: &[&(String, &[f64], f64)],
        (noise, deviation): (NoiseModel, f64),
        after: &mut [f64],
        all: &mut [Named],
    ) {
        let blocks = self.inputs.list_unbroken_stretches(rows);
        let white = |value: &dyn Fn(usize) -> f64| {
            let mut white: Vec<f64> = rows.iter().map(|row| value(*row)).collect();
            noise.whiten_column(&mut white, &blocks);
            white
        };
        let left = white(&|row| self.recorded[row] - after[row]);
        let columns: Vec<Vec<f64>> = states.iter().map(|(_, column, _)| white(&|row| column[row])).collect();
        let mut follower = Follower::new(&states.iter().map(|(_, _, variance)| *variance).collect::<Vec<_>>());
        for (at, row) in rows.iter().enumerate() {
            for ((name, column, _), w) in states.iter().zip(follower.coefficients()) {
                let step = deviation * w * column[*row];
                after[*row] += step;
                if let Some((_, own)) = all.iter_mut().find(|(known, _)| known == name) {
                    own[*row] += step;
                }
            }
            follower.update_with_row(&columns.iter().map(|column| column[at]).collect(), left[at] / deviation);
        }
    }

    fn add_contributions(&self, mut after: Vec<f64>, all: &[Named]) -> Vec<f64> {
        for (_, x) in all {
            after.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
        }
        after
    }

    /// A claimed curve goes to its names by the regression; what that leaves of it goes to the larger.
    fn distribute_claimed_curves(
        &self,
        of: &Explanation,
        shared: Vec<(usize, Vec<f64>)>,
        put: &mut impl FnMut(String, Vec<f64>),
    ) {
        let mut done: Vec<usize> = Vec::new();
        for (at, _) in &shared {
            let Some(claim) = of.claims[*at].as_ref().filter(|_| !done.contains(at)) else { continue };
            // Curves that were claimed together are split together.
            let same = |other: &usize| of.claims[*other].as_ref().is_some_and(|c| c.laws == claim.laws);
            let together: Vec<&(usize, Vec<f64>)> = shared.iter().filter(|(other, _)| same(other)).collect();
            let mut left = vec![0.0; self.inputs.rows];
            for (other, x) in together {
                done.push(*other);
                left.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
            }
            let parts: Vec<Vec<f64>> = claim.laws.iter().map(|law| self.naming.compute_contribution(law)).collect();
            for part in &parts {
                left.iter_mut().zip(part).for_each(|(left, x)| *left -= x);
            }
            let largest = (0..parts.len()).max_by(|a, b| rms(&parts[*a]).total_cmp(&rms(&parts[*b])));
            for (number, mut part) in parts.into_iter().enumerate() {
                if Some(number) == largest {
                    part.iter_mut().zip(&left).for_each(|(sum, x)| *sum += x);
                }
                put(self.naming.kind(claim.laws[number].0).unwrap_or_default(), part);
            }
        }
    }

    /// A level that begins with a run may have begun in the held-out runs before it: their own earlier rows tell.
    fn backdate_run_step(&self, kind: &str, run: usize, after: &mut [f64], all: &mut [Named]) {
        let inputs = self.inputs;
        let law = if kind == "hardness_batch" { inputs.cut.as_ref() } else { Some(&inputs.simulated) };
        let (Some(law), Some((_, own))) = (law, all.iter_mut().find(|(name, _)| name == kind)) else { return };
        let later = || (0..inputs.rows).filter(|row| inputs.run[*row] >= run);
        let height = later().map(|row| own[row]).sum::<f64>() / (later().map(|row| law[row]).sum::<f64>() + 1e-30);
        for earlier in (0..run).rev() {
            let rows = inputs.scene.runs()[earlier].clone();
            if rows.clone().any(|row| inputs.fitted[row]) {
                break;
            }
            let mut gained = 0.0;
            for row in rows {
                let step = height * law[row];
                let before = after[row];
                if gained > BEGUN {
                    own[row] += step;
                    after[row] += step;
                }
                if inputs.comparable[row] {
                    let error = self.recorded[row] - before;
                    gained += (error * error - (error - step).powi(2)) / self.ordinary.powi(2);
                }
            }
        }
    }

    /// What the baseline cannot imitate of a contribution.
    pub(super) fn project_out_baseline(&self, x: &[f64]) -> Vec<f64> {
        project_out_baseline(self.inputs, self.tangents, x)
    }
}

/// What a baseline of these tangents cannot imitate of a contribution.
pub(super) fn project_out_baseline(inputs: &RecordingInputs<'_>, tangents: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
    let rows: Vec<usize> = inputs.fitted_rows(false).collect();
    let sizes: Vec<f64> = tangents.iter().map(|t| rms(t) + 1e-30).collect();
    let scaled = tangents.iter().zip(&sizes);
    let columns: Vec<Vec<f64>> = scaled.map(|(t, size)| rows.iter().map(|row| t[*row] / size).collect()).collect();
    let wanted: Vec<f64> = rows.iter().map(|row| x[*row]).collect();
    let w = numerics::linear::columns::least_squares(&columns, &wanted).coefficients;
    let mut left = x.to_vec();
    for ((tangent, size), w) in tangents.iter().zip(&sizes).zip(&w) {
        left.iter_mut().zip(tangent).for_each(|(left, t)| *left -= w * t / size);
    }
    left
}
