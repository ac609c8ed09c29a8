//! Least squares by Householder QR of scaled columns, with what it takes to believe a coefficient.
//!
//! Source: Montgomery, Peck, Vining, Introduction to Linear Regression Analysis, 5th edition: intervals 3.4, PRESS and
//! predicted R2 4.2.5 and 4.3, variance inflation 9.4.2; the condition number is Belsley's, of columns scaled to length
//! one (Belsley, Kuh, Welsch, Regression Diagnostics, 3.2): beyond 30 the columns say nearly the same.

use super::CONFIDENCE;
use super::distributions::{t_quantile, t_two_sided};
use super::refusal::{Refusal, RefusalKind};
use numerics::linear::orthogonal::{
    Factored, back_substitute, dot_product, factor_columns, invert_upper_triangle, singular_values,
};
use numerics::statistics::count_to_f64;
use serde::Serialize;

/// Least to greatest singular value of the scaled columns below which they count as dependent.
const DEPENDENT: f64 = 1e-10;
/// Share of a column's values that rounding alone makes different.
const SAME: f64 = 1e-12;

/// A named column of numbers; the name ends in the unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// What it is; stands in coefficients and refusals.
    pub name: String,
    /// One number per row.
    pub values: Vec<f64>,
}

impl Column {
    /// A column of this name; the values are checked by the fit.
    #[must_use]
    pub fn new(name: impl Into<String>, values: Vec<f64>) -> Self {
        Self { name: name.into(), values }
    }
}

/// Is a constant fitted besides the columns?
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Intercept {
    /// The first coefficient is the constant, named `intercept`.
    Fitted,
    /// The law goes through zero; R2 is then relative to zero, not to the mean.
    None,
}

/// One coefficient with its interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coefficient {
    /// Name of the column; `intercept` for the constant.
    pub name: String,
    /// Change of y per unit of the column; for the constant, y where every column is 0.
    pub value: f64,
    /// Standard error of the value, in its unit.
    pub standard_error: f64,
    /// Ends of the 95 % interval.
    pub interval: (f64, f64),
    /// Probability of so great a value by chance if the true one were 0.
    pub p: f64,
    /// Variance inflation factor: by how much the other columns widen the variance. `None` for the constant.
    pub variance_inflation: Option<f64>,
}

/// A fit. Every number in it is finite.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Regression {
    /// Constant first where there is one, then the columns in their order.
    pub coefficients: Vec<Coefficient>,
    /// How many rows were fitted.
    pub rows: usize,
    /// Rows less coefficients; at least 1.
    pub degrees_of_freedom: f64,
    /// Residual standard deviation, in the unit of y (per unit weight where rows are weighted).
    pub residual_sd: f64,
    /// Sum of squared residuals.
    pub rss: f64,
    /// Sum of squares that the fit explains: about the mean with a constant, about zero without.
    pub explained: f64,
    /// Share of the variation of y that the fit explains, at most 1; 0 where y does not vary.
    pub r2: f64,
    /// Share explained, with the number of coefficients taken into account.
    pub adjusted_r2: f64,
    /// Share explained of rows that were left out one at a time. `None` where a row determines a coefficient alone.
    pub predicted_r2: Option<f64>,
    /// Greatest over least singular value of the scaled columns.
    pub condition_number: f64,
    /// What the fit gives in each row.
    #[serde(skip)]
    pub fitted: Vec<f64>,
    /// y less fitted, row by row, in the unit of y.
    #[serde(skip)]
    pub residuals: Vec<f64>,
    /// Leverage of each row, 0 to 1.
    #[serde(skip)]
    pub leverage: Vec<f64>,
    /// Inverse of the normal matrix: times `residual_sd` squared it is the covariance of the coefficients.
    #[serde(skip)]
    pub inverse: Vec<Vec<f64>>,
    /// Is the first coefficient the constant?
    #[serde(skip)]
    pub intercept: Intercept,
}

impl Regression {
    /// Value of the coefficient of this name.
    #[must_use]
    pub fn find_value(&self, name: &str) -> Option<f64> {
        self.find_coefficient(name).map(|coefficient| coefficient.value)
    }

    /// The coefficient of this name.
    #[must_use]
    pub fn find_coefficient(&self, name: &str) -> Option<&Coefficient> {
        self.coefficients.iter().find(|coefficient| coefficient.name == name)
    }

    /// All values, in order.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        self.coefficients.iter().map(|coefficient| coefficient.value).collect()
    }

    /// Covariance of two coefficients.
    #[must_use]
    pub fn covariance(&self, a: usize, b: usize) -> f64 {
        self.inverse[a][b] * self.residual_sd * self.residual_sd
    }
}

/// Fits `y` on columns of the same height, all rows of equal weight.
///
/// # Errors
/// A [`Refusal`] that names the column and what is needed: a number that is none, heights that differ, no more rows than
/// coefficients, a constant column, columns that depend on each other.
pub fn fit_unweighted(y: &Column, columns: &[Column], intercept: Intercept) -> Result<Regression, Refusal> {
    fit_weighted(y, columns, intercept, &vec![1.0; y.values.len()])
}

/// As [`fit_unweighted`], each row with a weight: the inverse of its relative variance, positive.
///
/// # Errors
/// As [`fit_unweighted`], and a weight that is not positive and finite.
pub fn fit_weighted(
    y: &Column,
    columns: &[Column],
    intercept: Intercept,
    weights: &[f64],
) -> Result<Regression, Refusal> {
    let count = columns.len() + usize::from(intercept == Intercept::Fitted);
    check_columns(y, columns, intercept, count)?;
    let roots = compute_weight_roots(weights, y.values.len())?;
    let weigh = |values: &[f64]| values.iter().zip(&roots).map(|(value, root)| value * root).collect::<Vec<f64>>();
    let ones = (intercept == Intercept::Fitted).then(|| roots.clone());
    let design: Vec<Vec<f64>> = ones.into_iter().chain(columns.iter().map(|column| weigh(&column.values))).collect();
    let names: Vec<&str> = (intercept == Intercept::Fitted)
        .then_some("intercept")
        .into_iter()
        .chain(columns.iter().map(|column| column.name.as_str()))
        .collect();
    let factored = factor_columns(&design);
    let condition_number = compute_condition_number(&factored, &names)?;
    let work = LeastSquaresWork { y: weigh(&y.values), design, names, factored, condition_number, intercept, roots };
    Ok(work.solve_regression())
}

fn check_columns(y: &Column, columns: &[Column], intercept: Intercept, count: usize) -> Result<(), Refusal> {
    let rows = y.values.len();
    for column in std::iter::once(y).chain(columns) {
        if column.values.len() != rows {
            let what = format!("{} rows where {} has {rows}", column.values.len(), y.name);
            return Err(Refusal::new(RefusalKind::Mismatch, what, "give every column a number in every row")
                .with_place(&column.name));
        }
        if let Some(row) = column.values.iter().position(|value| !value.is_finite()) {
            let what = format!("no number in row {}", row + 1);
            return Err(
                Refusal::new(RefusalKind::NotFinite, what, "leave rows without a value out").with_place(&column.name)
            );
        }
    }
    if count == 0 || rows <= count {
        let what = format!("{rows} rows for {count} coefficients");
        let next = format!("record at least {} rows; twice as many make an interval of use", count + 1);
        return Err(Refusal::new(RefusalKind::TooFew, what, next).with_place(&y.name));
    }
    columns.iter().try_for_each(|column| check_variation(column, intercept))
}

fn check_variation(column: &Column, intercept: Intercept) -> Result<(), Refusal> {
    let (least, greatest) = column
        .values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, greatest), value| (least.min(*value), greatest.max(*value)));
    let size = least.abs().max(greatest.abs());
    let constant = intercept == Intercept::Fitted && greatest - least <= SAME * size;
    if constant || size == 0.0 {
        let what = format!("is {least} in every row");
        return Err(Refusal::new(RefusalKind::Constant, what, "record with other values of it, or leave it out")
            .with_place(&column.name));
    }
    Ok(())
}

fn compute_weight_roots(weights: &[f64], rows: usize) -> Result<Vec<f64>, Refusal> {
    let fine = weights.len() == rows && weights.iter().all(|weight| weight.is_finite() && *weight > 0.0);
    if !fine {
        return Err(Refusal::new(RefusalKind::NotFinite, "a weight is not positive", "leave such rows out")
            .with_place("weights"));
    }
    Ok(weights.iter().map(|weight| weight.sqrt()).collect())
}

/// Condition number, or which columns depend on each other.
fn compute_condition_number(factored: &Factored, names: &[&str]) -> Result<f64, Refusal> {
    let (values, direction) = singular_values(&factored.r);
    let greatest = values.iter().fold(0.0_f64, |greatest, value| greatest.max(*value));
    let least = values.iter().fold(f64::INFINITY, |least, value| least.min(*value));
    if least > DEPENDENT * greatest {
        return Ok(greatest / least);
    }
    let part = |at: &usize| direction[*at].abs() > 0.05;
    let involved: Vec<&str> = (0..names.len()).filter(part).map(|at| names[at]).collect();
    let what = format!("{} say the same in these rows", involved.join(", "));
    let next = "leave one of them out, or record with each of them changed alone";
    Err(Refusal::new(RefusalKind::Collinear, what, next))
}

struct LeastSquaresWork<'a> {
    y: Vec<f64>,
    design: Vec<Vec<f64>>,
    names: Vec<&'a str>,
    factored: Factored,
    condition_number: f64,
    intercept: Intercept,
    roots: Vec<f64>,
}

impl LeastSquaresWork<'_> {
    fn solve_regression(self) -> Regression {
        let rows = self.y.len();
        let columns = self.design.len();
        let along: Vec<f64> = self.factored.q.iter().map(|q| dot_product(q, &self.y)).collect();
        let scaled = back_substitute(&self.factored.r, &along);
        let values: Vec<f64> = scaled.iter().zip(&self.factored.lengths).map(|(x, length)| x / length).collect();
        let fitted: Vec<f64> =
            (0..rows).map(|row| self.factored.q.iter().zip(&along).map(|(q, along)| q[row] * along).sum()).collect();
        let residuals: Vec<f64> = self.y.iter().zip(&fitted).map(|(y, fitted)| y - fitted).collect();
        let leverage: Vec<f64> = (0..rows).map(|row| self.factored.q.iter().map(|q| q[row] * q[row]).sum()).collect();
        let inverse = self.invert_normal_matrix();
        let rss = dot_product(&residuals, &residuals);
        let total = self.total_sum_of_squares();
        let degrees_of_freedom = count_to_f64(rows - columns);
        let residual_sd = (rss / degrees_of_freedom).sqrt();
        let spare = count_to_f64(rows - usize::from(self.intercept == Intercept::Fitted));
        let share = |lost: f64| if total > 0.0 { 1.0 - lost / total } else { 0.0 };
        Regression {
            coefficients: self.build_coefficients(&values, &inverse, residual_sd, degrees_of_freedom),
            rows,
            degrees_of_freedom,
            residual_sd,
            rss,
            explained: (total - rss).max(0.0),
            r2: share(rss),
            adjusted_r2: share(rss * spare / degrees_of_freedom),
            predicted_r2: compute_press_statistic(&residuals, &leverage).map(share),
            condition_number: self.condition_number,
            fitted: self.remove_weights(&fitted),
            residuals: self.remove_weights(&residuals),
            leverage,
            inverse,
            intercept: self.intercept,
        }
    }

    fn remove_weights(&self, weighed: &[f64]) -> Vec<f64> {
        weighed.iter().zip(&self.roots).map(|(value, root)| value / root).collect()
    }

    /// Sum of squares of y, about its weighted mean where a constant is fitted.
    fn total_sum_of_squares(&self) -> f64 {
        if self.intercept == Intercept::None {
            return dot_product(&self.y, &self.y);
        }
        self.about_mean(&self.y)
    }

    fn about_mean(&self, weighed: &[f64]) -> f64 {
        let mean = dot_product(weighed, &self.roots) / dot_product(&self.roots, &self.roots);
        weighed.iter().zip(&self.roots).map(|(value, root)| (value - mean * root).powi(2)).sum()
    }

    fn invert_normal_matrix(&self) -> Vec<Vec<f64>> {
        let (r, lengths) = (invert_upper_triangle(&self.factored.r), &self.factored.lengths);
        let count = lengths.len();
        let entry = |i: usize, j: usize| (0..count).map(|k| r[k][i] * r[k][j]).sum::<f64>() / (lengths[i] * lengths[j]);
        (0..count).map(|i| (0..count).map(|j| entry(i, j)).collect()).collect()
    }

    fn build_coefficients(&self, values: &[f64], inverse: &[Vec<f64>], sd: f64, df: f64) -> Vec<Coefficient> {
        let t = t_quantile(0.5 + 0.5 * CONFIDENCE, df);
        let coefficient = |at: usize| {
            let standard_error = sd * inverse[at][at].sqrt();
            let value = values[at];
            let p = if standard_error > 0.0 { t_two_sided(value / standard_error, df) } else { 0.0 };
            Coefficient {
                name: self.names[at].to_owned(),
                value,
                standard_error,
                interval: (value - t * standard_error, value + t * standard_error),
                p,
                variance_inflation: self.compute_variance_inflation(at, inverse),
            }
        };
        (0..values.len()).map(coefficient).collect()
    }

    fn compute_variance_inflation(&self, at: usize, inverse: &[Vec<f64>]) -> Option<f64> {
        match (self.intercept, at) {
            (Intercept::Fitted, 0) => None,
            (Intercept::Fitted, _) => Some(inverse[at][at] * self.about_mean(&self.design[at])),
            (Intercept::None, _) => Some(inverse[at][at] * self.factored.lengths[at].powi(2)),
        }
    }
}

/// Sum of squared residuals of rows left out one at a time.
fn compute_press_statistic(residuals: &[f64], leverage: &[f64]) -> Option<f64> {
    let left_out = residuals.iter().zip(leverage).map(|(residual, leverage)| {
        let rest = 1.0 - leverage;
        (rest > 1e-9).then(|| (residual / rest).powi(2))
    });
    left_out.sum()
}

#[cfg(test)]
mod tests;
