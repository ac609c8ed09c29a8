//! Ordinary least squares by modified Gram-Schmidt: columns that add nothing new are dropped, not inverted.

/// An orthonormal basis of the span of some columns.
pub(crate) struct Basis(Vec<Vec<f64>>);

impl Basis {
    /// Orthonormalises `columns`; a column that is dependent to 1 part in 1e8 is left out.
    pub(crate) fn of(columns: &[Vec<f64>]) -> Self {
        let mut basis = Self(Vec::new());
        for column in columns {
            let norm = norm(column);
            let left = basis.remainder(&basis.remainder(column));
            let rest = norm_of(&left);
            if rest > 1e-8 * norm {
                basis.0.push(left.iter().map(|v| v / rest).collect());
            }
        }
        basis
    }

    /// What of `y` is outside the span.
    pub(crate) fn remainder(&self, y: &[f64]) -> Vec<f64> {
        let mut left = y.to_vec();
        for q in &self.0 {
            let share = dot(q, &left);
            left.iter_mut().zip(q).for_each(|(l, q)| *l -= share * q);
        }
        left
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    norm_of(a).max(1e-300)
}

fn norm_of(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Root mean square; 0 for nothing.
pub(crate) fn rms(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { (dot(values, values) / values.len() as f64).sqrt() }
}

/// Arithmetic mean; 0 for nothing.
pub(crate) fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { values.iter().sum::<f64>() / values.len() as f64 }
}

/// The value at `fraction` of the sorted values; 0 for nothing.
pub(crate) fn quantile(values: &[f64], fraction: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    sorted.get((fraction * last as f64).round() as usize).copied().unwrap_or(0.0)
}
