//! Dense linear algebra of the evidence: products of tall matrices, Cholesky factors, small matrices made
//! tridiagonal.
//!
//! Everything is a symmetric matrix of inner products (a Gram matrix), so three operations suffice: to make it, to take
//! a block of it out (Schur complement), and to see a small block along its own axes.

use ndarray::linalg::general_mat_mul;
use ndarray::{Array1, Array2, ArrayView2, Axis, s};
use numerics::linear::columns::dot;

/// Columns of a panel of a symmetric product: below it, what is computed twice costs less than a call.
const PANEL: usize = 96;
/// Share of the diagonal that is added where a matrix is not quite positive definite, at first.
const JITTER: f64 = 1e-12;

/// Inner products of the columns of a tall matrix.
pub(super) fn compute_gram_matrix(tall: ArrayView2<'_, f64>) -> Array2<f64> {
    let mut gram = Array2::zeros((tall.ncols(), tall.ncols()));
    fill_upper_triangle(&mut gram, tall);
    mirror_upper_triangle(&mut gram);
    gram
}

/// The upper triangle of `tall' tall`, by panels.
fn fill_upper_triangle(gram: &mut Array2<f64>, tall: ArrayView2<'_, f64>) {
    let size = tall.ncols();
    let mut start = 0;
    while start < size {
        let end = (start + PANEL).min(size);
        let left = tall.slice(s![.., start..end]);
        let right = tall.slice(s![.., start..]);
        general_mat_mul(1.0, &left.t(), &right, 1.0, &mut gram.slice_mut(s![start..end, start..]));
        start = end;
    }
}

/// Copies the upper triangle into the lower one.
fn mirror_upper_triangle(gram: &mut Array2<f64>) {
    for row in 1..gram.nrows() {
        for column in 0..row {
            gram[[row, column]] = gram[[column, row]];
        }
    }
}

pub(super) struct CholeskyFactor {
    lower: Array2<f64>,
}

impl CholeskyFactor {
    /// Of a symmetric matrix; what keeps it from being positive definite is lifted by a growing share of its diagonal.
    pub(super) fn from_matrix(matrix: &Array2<f64>) -> Self {
        let mut lift = 0.0;
        loop {
            if let Some(lower) = factorise_cholesky(matrix, lift) {
                return Self { lower };
            }
            lift = if lift == 0.0 { JITTER } else { lift * 10.0 };
            if lift > 1.0 {
                // Only what is no number at all comes here: the identity leaves everything as it is.
                return Self { lower: Array2::eye(matrix.nrows()) };
            }
        }
    }

    /// `L^-1 b` for every column of `b`, in its place.
    pub(super) fn forward_substitute(&self, b: &mut Array2<f64>) {
        for row in 0..self.lower.nrows() {
            let (done, mut rest) = b.view_mut().split_at(Axis(0), row);
            let mut current = rest.index_axis_mut(Axis(0), 0);
            for (earlier, line) in done.outer_iter().enumerate() {
                let share = self.lower[[row, earlier]];
                if share != 0.0 {
                    current.scaled_add(-share, &line);
                }
            }
            current /= self.lower[[row, row]];
        }
    }

    /// The solution of `matrix x = b`.
    pub(super) fn solve_system(&self, b: &Array1<f64>) -> Array1<f64> {
        let size = b.len();
        let mut x = b.clone();
        for row in 0..size {
            let known: f64 = (0..row).map(|k| self.lower[[row, k]] * x[k]).sum();
            x[row] = (x[row] - known) / self.lower[[row, row]];
        }
        for row in (0..size).rev() {
            let known: f64 = (row + 1..size).map(|k| self.lower[[k, row]] * x[k]).sum();
            x[row] = (x[row] - known) / self.lower[[row, row]];
        }
        x
    }

    /// The number `b' matrix^-1 b`.
    pub(super) fn compute_quadratic_form(&self, b: &Array1<f64>) -> f64 {
        let mut x = b.clone();
        let mut sum = 0.0;
        for row in 0..b.len() {
            let known = self.lower.slice(s![row, ..row]).dot(&x.slice(s![..row]));
            x[row] = (x[row] - known) / self.lower[[row, row]];
            sum += x[row] * x[row];
        }
        sum
    }

    /// Logarithm of the determinant of the matrix.
    pub(super) fn ln_determinant(&self) -> f64 {
        2.0 * self.lower.diag().iter().map(|x| x.ln()).sum::<f64>()
    }

    /// The diagonal of the inverse of the matrix.
    pub(super) fn compute_inverse_diagonal(&self) -> Vec<f64> {
        let mut inverse = Array2::eye(self.lower.nrows());
        self.forward_substitute(&mut inverse);
        inverse.columns().into_iter().map(|column| column.dot(&column)).collect()
    }
}

fn factorise_cholesky(matrix: &Array2<f64>, lift: f64) -> Option<Array2<f64>> {
    let size = matrix.nrows();
    let mut lower = Array2::zeros((size, size));
    for row in 0..size {
        for column in 0..=row {
            let done = lower.slice(s![row, ..column]).dot(&lower.slice(s![column, ..column]));
            let left: f64 = matrix[[row, column]] - done;
            if row == column {
                let left = left + lift * matrix[[row, row]].abs().max(f64::MIN_POSITIVE);
                if left <= 0.0 || !left.is_finite() {
                    return None;
                }
                lower[[row, row]] = left.sqrt();
            } else {
                lower[[row, column]] = left / lower[[column, column]];
            }
        }
    }
    Some(lower)
}

/// The block of these rows and columns.
pub(super) fn extract_block(matrix: &Array2<f64>, rows: &[usize], columns: &[usize]) -> Array2<f64> {
    Array2::from_shape_fn((rows.len(), columns.len()), |(i, j)| matrix[[rows[i], columns[j]]])
}

/// The Gram matrix after these columns, each with a ridge of its own, have been taken out of all others; and the
/// logarithm of the determinant of what was taken out.
pub(super) fn compute_schur_complement(gram: &Array2<f64>, out: &[usize], ridge: &[f64]) -> (Array2<f64>, f64) {
    let mut inner = extract_block(gram, out, out);
    for (index, ridge) in ridge.iter().enumerate() {
        inner[[index, index]] += ridge;
    }
    let factor = CholeskyFactor::from_matrix(&inner);
    let mut reach = gram.select(Axis(0), out);
    factor.forward_substitute(&mut reach);
    let mut left = gram.clone();
    general_mat_mul(-1.0, &reach.t(), &reach, 1.0, &mut left);
    (left, factor.ln_determinant())
}

/// A small symmetric matrix made tridiagonal by reflections that leave the first axis where it is, and a vector along.
pub(super) struct Tridiagonal {
    diagonal: Vec<f64>,
    off_diagonal: Vec<f64>,
    along: Vec<f64>,
}

/// What `I + lambda A` does to a vector `b`.
pub(super) struct Resolved {
    /// Logarithm of the determinant of `I + lambda A`.
    pub(super) ln_determinant: f64,
    /// `lambda b' (I + lambda A)^-1 b`.
    pub(super) square: f64,
    /// First entry of `(I + lambda A)^-1 b`.
    pub(super) first: f64,
    /// First diagonal entry of `(I + lambda A)^-1`.
    pub(super) first_variance: f64,
}

impl Tridiagonal {
    /// Householder's reduction of the rows `a` of a symmetric matrix, the vector `b` reflected with it.
    pub(super) fn reduce_matrix(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Self {
        let size = a.len();
        for k in 0..size.saturating_sub(2) {
            apply_reflection(&mut a, &mut b, k);
        }
        let off_diagonal = (1..size).map(|k| a[k][k - 1]).collect();
        Self { diagonal: (0..size).map(|k| a[k][k]).collect(), off_diagonal, along: b }
    }

    /// Solves with `I + lambda A` from the last axis to the first.
    pub(super) fn solve_shifted_system(&self, lambda: f64) -> Resolved {
        let size = self.diagonal.len();
        let (mut pivot, mut right) = (1.0, 0.0);
        let (mut ln_determinant, mut square) = (0.0, 0.0);
        for k in (0..size).rev() {
            let mut own = 1.0 + lambda * self.diagonal[k];
            let mut b = self.along[k];
            if k + 1 < size {
                let side = lambda * self.off_diagonal[k];
                own -= side * side / pivot;
                b -= side * right / pivot;
            }
            pivot = own.max(1e-12);
            right = b;
            ln_determinant += pivot.ln();
            square += b * b / pivot;
        }
        Resolved { ln_determinant, square: lambda * square, first: right / pivot, first_variance: 1.0 / pivot }
    }
}

/// Reflects the axes after `k` of a symmetric matrix, row by row, so that of column `k` only the entry below the diagonal is left.
fn apply_reflection(a: &mut [Vec<f64>], b: &mut [f64], k: usize) {
    let mut v: Vec<f64> = a[k + 1..].iter().map(|row| row[k]).collect();
    let (norm, rest) = (dot(&v, &v).sqrt(), dot(&v[1..], &v[1..]));
    if rest <= 1e-30 * norm * norm || norm <= 0.0 {
        return;
    }
    let target = if v[0] > 0.0 { -norm } else { norm };
    v[0] -= target;
    let half = 0.5 * dot(&v, &v);
    let share = dot(&v, &b[k + 1..]) / half;
    b[k + 1..].iter_mut().zip(&v).for_each(|(b, v)| *b -= share * v);
    // A - v w' - w v' with w = A v / half - v (v' A v / half) / (2 half).
    let mut w: Vec<f64> = a[k + 1..].iter().map(|row| dot(&row[k + 1..], &v) / half).collect();
    let turn = dot(&v, &w) / (2.0 * half);
    w.iter_mut().zip(&v).for_each(|(w, v)| *w -= turn * v);
    for (row, (v_here, w_here)) in a[k + 1..].iter_mut().zip(v.iter().zip(&w)) {
        row[k + 1..].iter_mut().zip(v.iter().zip(&w)).for_each(|(x, (v, w))| *x -= v_here * w + w_here * v);
        row[k] = 0.0;
    }
    a[k][k + 1..].fill(0.0);
    (a[k + 1][k], a[k][k + 1]) = (target, target);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tall() -> Array2<f64> {
        Array2::from_shape_fn((40, 5), |(row, column)| ((row * (column + 3) * 7 + column) % 11) as f64 - 5.0)
    }

    fn gram() -> Array2<f64> {
        super::compute_gram_matrix(tall().view())
    }

    #[test]
    fn a_gram_matrix_is_the_product() {
        assert_eq!(gram(), tall().t().dot(&tall()));
    }

    #[test]
    fn what_is_solved_gives_the_right_hand_side() {
        let b = Array1::from(vec![1.0, -2.0, 3.0, 0.5, 4.0]);
        let x = CholeskyFactor::from_matrix(&gram()).solve_system(&b);
        assert!((gram().dot(&x) - b).iter().all(|e| e.abs() < 1e-9));
    }

    #[test]
    fn a_schur_complement_is_what_least_squares_leaves() {
        let (left, ln) = compute_schur_complement(&gram(), &[0, 1], &[0.0, 0.0]);
        let inner = extract_block(&gram(), &[0, 1], &[0, 1]);
        assert!((ln - (inner[[0, 0]] * inner[[1, 1]] - inner[[0, 1]] * inner[[1, 0]]).ln()).abs() < 1e-9);
        let b = Array1::from(vec![gram()[[0, 4]], gram()[[1, 4]]]);
        let x = CholeskyFactor::from_matrix(&inner).solve_system(&b);
        assert!((left[[4, 4]] - (gram()[[4, 4]] - b.dot(&x))).abs() < 1e-9);
    }

    #[test]
    fn a_tridiagonal_matrix_resolves_as_the_whole_one() {
        let b = vec![1.0, -2.0, 3.0, 0.5, 4.0];
        let lambda = 0.03;
        let inner = Array2::eye(5) + gram() * lambda;
        let x = CholeskyFactor::from_matrix(&inner).solve_system(&Array1::from(b.clone()));
        let resolved =
            Tridiagonal::reduce_matrix(gram().rows().into_iter().map(|row| row.to_vec()).collect(), b.clone())
                .solve_shifted_system(lambda);
        assert!((resolved.ln_determinant - CholeskyFactor::from_matrix(&inner).ln_determinant()).abs() < 1e-9);
        assert!((resolved.square - lambda * x.dot(&Array1::from(b))).abs() < 1e-9);
        assert!((resolved.first - x[0]).abs() < 1e-9);
        assert!(
            (resolved.first_variance - CholeskyFactor::from_matrix(&inner).compute_inverse_diagonal()[0]).abs() < 1e-9
        );
    }
}
