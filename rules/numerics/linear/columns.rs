//! Small dense least squares on columns: orthonormal bases, projections, solutions with covariance.
//!
//! Columns are many rows long and few; everything goes through an orthonormal basis (modified Gram-Schmidt, applied
//! twice), so that collinear columns are dropped instead of inverted.
//!
//! `nalgebra` 0.34 was measured for 5 to 40 columns of 1000 to 20 000 rows: its QR takes 0.4 to 0.9 of the time. The sums
//! of squared residuals agree to 1e-13 for independent columns, the coefficients to 3e-12; where a column differs from
//! another by 1e-6 of it, the coefficients here leave up to 2e-7 more. Its QR drops no column: where one repeats another,
//! coefficients of 5e9 to 2e11 come out. QR with pivots drops the shortest column, not the later one,
//! so that another law would be named.

/// Sum of the products of two columns of equal height, in a fixed order of four partial sums.
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four independent sums let the compiler keep four lanes busy; the order is fixed, so results are repeatable.
    let mut sums = [0.0; 4];
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    for (x, y) in a4.iter().zip(b4) {
        for lane in 0..4 {
            sums[lane] += x[lane] * y[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// `v -= factor * q`.
pub fn subtract_scaled(v: &mut [f64], factor: f64, q: &[f64]) {
    v.iter_mut().zip(q).for_each(|(v, q)| *v -= factor * q);
}

/// Removes from `v` its part in the span of the orthonormal `basis`.
pub fn project_out(basis: &[Vec<f64>], v: &mut [f64]) {
    for q in basis {
        let along = dot(q, v);
        subtract_scaled(v, along, q);
    }
}

/// Extends an orthonormal basis by `v`. `None`, and nothing added, when less than `tolerance` of `v`'s length is new.
/// Otherwise the share of its length that is new.
pub fn extend_basis(basis: &mut Vec<Vec<f64>>, mut v: Vec<f64>, tolerance: f64) -> Option<f64> {
    let before = dot(&v, &v).sqrt();
    if before <= 0.0 || !before.is_finite() {
        return None;
    }
    project_out(basis, &mut v);
    project_out(basis, &mut v);
    let after = dot(&v, &v).sqrt();
    if after <= tolerance * before {
        return None;
    }
    v.iter_mut().for_each(|x| *x /= after);
    basis.push(v);
    Some(after / before)
}

/// A least squares solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// One coefficient per column; zero for a dropped one.
    pub coefficients: Vec<f64>,
    /// Columns that were collinear with earlier ones.
    pub dropped: Vec<usize>,
    /// Inverse of the normal matrix, row by row; zero rows for dropped columns. Times the variance of one whitened
    /// residual it is the covariance.
    pub inverse: Vec<Vec<f64>>,
    /// Sum of squared residuals.
    pub rss: f64,
}

/// Least squares of `y` on `columns`, collinear columns dropped from the right.
#[must_use]
pub fn least_squares(columns: &[Vec<f64>], y: &[f64]) -> Solution {
    let count = columns.len();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut kept: Vec<usize> = Vec::new();
    // R of the kept columns, column by column.
    let mut r: Vec<Vec<f64>> = Vec::new();
    for (index, column) in columns.iter().enumerate() {
        let size = basis.len();
        if extend_basis(&mut basis, column.clone(), 1e-8).is_some() {
            r.push((0..=size).map(|row| dot(&basis[row], column)).collect());
            kept.push(index);
        }
    }
    let mut residual = y.to_vec();
    let q_y: Vec<f64> = basis.iter().map(|q| dot(q, y)).collect();
    basis.iter().zip(&q_y).for_each(|(q, along)| subtract_scaled(&mut residual, *along, q));
    let inverse_r = invert_upper(&r);
    let mut coefficients = vec![0.0; count];
    let mut inverse = vec![vec![0.0; count]; count];
    for (i, &column) in kept.iter().enumerate() {
        coefficients[column] = (i..kept.len()).map(|k| inverse_r[k][i] * q_y[k]).sum();
        for (j, &other) in kept.iter().enumerate() {
            inverse[column][other] = (i.max(j)..kept.len()).map(|k| inverse_r[k][i] * inverse_r[k][j]).sum();
        }
    }
    let dropped = (0..count).filter(|index| !kept.contains(index)).collect();
    Solution { coefficients, dropped, inverse, rss: dot(&residual, &residual) }
}

/// Inverse of an upper triangular matrix; both stored column by column (column `k` holds rows `0..=k`).
fn invert_upper(r: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let size = r.len();
    let mut inverse: Vec<Vec<f64>> = Vec::with_capacity(size);
    for k in 0..size {
        let mut column = vec![0.0; k + 1];
        column[k] = 1.0 / r[k][k];
        for i in (0..k).rev() {
            let sum: f64 = (i + 1..=k).map(|j| r[j][i] * column[j]).sum();
            column[i] = -sum / r[i][i];
        }
        inverse.push(column);
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_recovered_with_its_covariance() {
        let x: Vec<f64> = (0..10).map(f64::from).collect();
        let y: Vec<f64> = x.iter().map(|x| 3.0 + 2.0 * x).collect();
        let got = least_squares(&[vec![1.0; 10], x.clone()], &y);
        assert!((got.coefficients[0] - 3.0).abs() < 1e-9 && (got.coefficients[1] - 2.0).abs() < 1e-9);
        let spread: f64 = x.iter().map(|x| (x - 4.5) * (x - 4.5)).sum();
        assert!((got.inverse[1][1] - 1.0 / spread).abs() < 1e-9);
        assert!(got.rss < 1e-12);
    }

    #[test]
    fn a_repeated_column_is_dropped() {
        let x: Vec<f64> = (0..10).map(f64::from).collect();
        let got = least_squares(&[x.clone(), x.iter().map(|x| 2.0 * x).collect()], &x);
        assert_eq!(got.dropped, vec![1]);
        assert!((got.coefficients[0] - 1.0).abs() < 1e-12);
    }
}
