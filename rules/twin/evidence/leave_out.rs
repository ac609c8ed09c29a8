//! What a written law leaves of rows that took no part in its numbers: each inner part is left out in turn, and the numbers move
//! by one Gauss-Newton step. No nonlinear fit is repeated, and what fits one part only loses.

use super::cross_validation::split_into_parts;
use super::linear_algebra::{CholeskyFactor, compute_gram_matrix};
use super::report::EvidenceReport;
use crate::fit::Fit;
use ndarray::{Array1, Array2, s};
use numerics::linear::columns::dot;
use numerics::statistics::{count_to_f64, rms};

/// Ridge of every column as a share of its square: columns that are alike share their size instead of tearing at each other.
const RIDGE: f64 = 1e-6;

/// What is left of the fitted rows and what moves it, whitened.
pub(super) struct PartwiseLoss {
    left: Vec<f64>,
    columns: Vec<Vec<f64>>,
    /// Ridge of each column beside the common one.
    ridges: Vec<f64>,
    parts: Vec<Vec<usize>>,
}

impl EvidenceReport<'_, '_> {
    /// A fit, prepared to be left out part by part.
    pub(super) fn prepare_left_out(&self, fit: &Fit) -> PartwiseLoss {
        let rest: Vec<f64> = self.recorded.iter().zip(&fit.simulated).map(|(y, f)| y - f).collect();
        let parts = split_into_parts(self.inputs, self.comparison);
        let mut prepared = PartwiseLoss { left: self.whiten(&rest), columns: Vec::new(), ridges: Vec::new(), parts };
        for (tangent, free) in fit.tangents.iter().zip(&fit.free) {
            let deviation = fit.parts[free.part].parameters[free.parameter].prior_deviation();
            prepared.add_column(self.whiten(tangent), deviation);
        }
        prepared
    }
}

impl PartwiseLoss {
    /// Another column, whitened, with the usual deviation of its coefficient where it has one.
    pub(super) fn add_column(&mut self, column: Vec<f64>, deviation: Option<f64>) {
        let size = rms(&column) + 1e-30;
        self.columns.push(column.iter().map(|x| x / size).collect());
        let variance = dot(&self.left, &self.left) / count_to_f64(self.left.len().max(1));
        self.ridges.push(deviation.map_or(0.0, |deviation| variance / (deviation * size).powi(2)));
    }

    /// Takes the last columns away again.
    pub(super) fn truncate_columns(&mut self, to: usize) {
        self.columns.truncate(to);
        self.ridges.truncate(to);
    }

    /// How many columns there are.
    pub(super) fn count_columns(&self) -> usize {
        self.columns.len()
    }

    /// Sum of the squares that are left in each part, its rows left out.
    pub(super) fn compute_square(&self) -> f64 {
        let size = self.columns.len();
        let gram = |rows: &Vec<usize>| {
            let cell = |(at, index): (usize, usize)| {
                if index < size { self.columns[index][rows[at]] } else { self.left[rows[at]] }
            };
            compute_gram_matrix(Array2::from_shape_fn((rows.len(), size + 1), cell).view())
        };
        let grams: Vec<Array2<f64>> = self.parts.iter().map(gram).collect();
        let Some(whole) = grams.iter().cloned().reduce(|sum, gram| sum + gram) else { return 0.0 };
        let rows = count_to_f64(self.left.len());
        let mut square = 0.0;
        for (part, own) in self.parts.iter().zip(&grams) {
            let others = &whole - own;
            let mut inner = others.slice(s![..size, ..size]).to_owned();
            (0..size).for_each(|index| inner[[index, index]] += RIDGE * rows + self.ridges[index]);
            let right: Array1<f64> = others.slice(s![..size, size]).to_owned();
            let step = if size > 0 { CholeskyFactor::from_matrix(&inner).solve_system(&right) } else { right };
            let left = |at: &usize| {
                self.left[*at] - (0..size).map(|index| step[index] * self.columns[index][*at]).sum::<f64>()
            };
            square += part.iter().map(|at| left(at).powi(2)).sum::<f64>();
        }
        square
    }
}
