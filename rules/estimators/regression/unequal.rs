//! The variance of a combination of coefficients where the points scatter unequally, and how well it is known.
//!
//! Every point's own residual stands for its scatter, less what the fit took away from it (White 1980, in the form HC2 of MacKinnon
//! and White 1985), with the degrees of freedom of Bell and McCaffrey (2002), which Imbens and Kolesar (2016) advise for few points:
//! they are low where the coefficient rests on a few points with much leverage.

use super::{Column, Regression};

/// Beyond this leverage a point alone determines a coefficient and has no residual to speak of.
const LEVERAGE_MAX: f64 = 1.0 - 1e-6;

/// What the variances of combinations of some coefficients are computed from.
#[derive(Debug, Clone)]
pub struct UnequalScatter {
    /// Change of each coefficient with each point, by coefficient.
    influence: Vec<Vec<f64>>,
    /// Square of each residual over `1 - leverage`.
    square: Vec<f64>,
    /// Share of its own error that stays in the residual of each point.
    kept: Vec<f64>,
    /// Columns of the fit times its inverse, and the columns, by point: their product is the projection on the fit.
    projection: (Vec<Vec<f64>>, Vec<Vec<f64>>),
}

impl UnequalScatter {
    /// Of these coefficients of a regression on these columns, without an intercept.
    #[must_use]
    pub fn new(regression: &Regression, columns: &[Column], coefficients: &[usize]) -> Self {
        let points = regression.residuals.len();
        let rows: Vec<Vec<f64>> =
            (0..points).map(|row| columns.iter().map(|column| column.values[row]).collect()).collect();
        let times = |inverse: &[f64], row: &[f64]| inverse.iter().zip(row).map(|(a, b)| a * b).sum::<f64>();
        let on_inverse: Vec<Vec<f64>> =
            rows.iter().map(|row| regression.inverse.iter().map(|inverse| times(inverse, row)).collect()).collect();
        let influence = coefficients.iter().map(|at| on_inverse.iter().map(|row| row[*at]).collect()).collect();
        let kept: Vec<f64> = regression.leverage.iter().map(|leverage| 1.0 - leverage.min(LEVERAGE_MAX)).collect();
        let square =
            regression.residuals.iter().zip(&kept).map(|(residual, kept)| residual * residual / kept).collect();
        Self { influence, square, kept, projection: (on_inverse, rows) }
    }

    /// Variance and degrees of freedom of a combination with these weights, one for each coefficient.
    #[must_use]
    pub fn compute_variance(&self, weights: &[f64]) -> (f64, f64) {
        let influence: Vec<f64> = (0..self.square.len())
            .map(|point| weights.iter().zip(&self.influence).map(|(weight, own)| weight * own[point]).sum())
            .collect();
        let variance = influence.iter().zip(&self.square).map(|(own, square)| own * own * square).sum();
        let each: Vec<f64> = influence.iter().zip(&self.kept).map(|(own, kept)| own * own / kept).collect();
        let sum: f64 = each.iter().zip(&self.kept).map(|(each, kept)| each * kept).sum();
        let mut of_squares = 0.0;
        for (a, of_a) in each.iter().enumerate() {
            for (b, of_b) in each.iter().enumerate() {
                of_squares += of_a * of_b * self.compute_residual_influence(a, b).powi(2);
            }
        }
        (variance, (sum * sum / of_squares.max(f64::MIN_POSITIVE)).max(1.0))
    }

    /// How far the error of one point reaches into the residual of another.
    fn compute_residual_influence(&self, a: usize, b: usize) -> f64 {
        let (on_inverse, rows) = &self.projection;
        let projected: f64 = on_inverse[a].iter().zip(&rows[b]).map(|(a, b)| a * b).sum();
        if a == b { self.kept[a] } else { -projected }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regression::{Intercept, fit_unweighted};

    #[test]
    fn of_a_mean_it_is_the_usual_variance_with_the_usual_degrees_of_freedom() {
        let values = vec![1.0, 2.0, 4.0, 3.0, 5.0];
        let column = Column::new("one".to_owned(), vec![1.0; 5]);
        let regression =
            fit_unweighted(&Column::new("y".to_owned(), values), std::slice::from_ref(&column), Intercept::None)
                .expect("a fit");
        let (variance, freedom) =
            UnequalScatter::new(&regression, std::slice::from_ref(&column), &[0]).compute_variance(&[1.0]);
        assert!((variance - 0.5).abs() < 1e-9, "variance 2.5 of five points: {variance}");
        assert!((freedom - 4.0).abs() < 1e-6, "{freedom}");
    }

    #[test]
    fn a_point_with_much_leverage_leaves_few_degrees_of_freedom() {
        let x = vec![1.0, 1.1, 0.9, 1.0, 10.0];
        let y = vec![1.1, 1.0, 1.0, 0.9, 10.4];
        let column = Column::new("x".to_owned(), x);
        let regression =
            fit_unweighted(&Column::new("y".to_owned(), y), std::slice::from_ref(&column), Intercept::None)
                .expect("a fit");
        let (variance, freedom) =
            UnequalScatter::new(&regression, std::slice::from_ref(&column), &[0]).compute_variance(&[1.0]);
        assert!(variance > 0.0 && freedom < 2.0, "{variance} {freedom}");
    }
}
