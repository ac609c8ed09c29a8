//! Scanning: how much each hypothesis explains on top of a fit, the fit's own parameters moving along.

use super::designs::Design;
use super::fit::Fit;
use super::frame::Frame;
use super::linear::{dot, extend_basis, project_out};
use super::noise::{Arma, count, log_likelihood, whiten};

/// Share of a column's length that must lie outside what the fit can absorb: below it the hypothesis leaves no trace.
const VISIBLE_SHARE: f64 = 2e-3;

/// What a hypothesis explains on top of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// Index of the design.
    pub design: usize,
    /// Twice the gain in log-likelihood over the fit, each at its own noise.
    pub gain: f64,
    /// Gain minus the price of the freedom.
    pub information: f64,
}

/// The price of a design: its parameters, and having been chosen among like ones.
#[must_use]
pub fn price(design: &Design, ln_rows: f64) -> f64 {
    count(design.freedom) * ln_rows + 2.0 * design.ln_choices
}

/// Noise models at which hypotheses are compared in a first pass: the fit's own, and less memory, because an effect
/// that is missing looks like memory.
fn settings(noise: Arma) -> Vec<Arma> {
    let mut settings = vec![noise];
    let shorter = [Arma::WHITE, Arma { phi: 0.5, theta: 0.0 }, Arma { phi: 0.85, theta: -0.5 }];
    settings.extend(shorter.into_iter().filter(|other| other.inflation() < noise.inflation() || other.phi < noise.phi));
    settings
}

/// Scores every design on top of `fit`.
#[must_use]
pub fn scan(fit: &Fit, frame: &Frame, designs: &[Design], ln_rows: f64) -> Vec<Score> {
    let mut best: Vec<f64> = vec![f64::NEG_INFINITY; designs.len()];
    for noise in settings(fit.noise) {
        let stage = Stage::new(fit, frame, noise);
        for (design, best) in designs.iter().zip(&mut best) {
            let rss = stage.rss - stage.explained(frame, design);
            let likelihood = log_likelihood(rss, frame.len(), frame.stretches.len(), noise);
            *best = best.max(2.0 * (likelihood - fit.log_likelihood));
        }
    }
    let score = |(index, gain): (usize, f64)| Score {
        design: index,
        gain,
        information: gain - price(&designs[index], ln_rows),
    };
    best.into_iter().enumerate().map(score).collect()
}

/// A fit seen through one noise model.
pub struct Stage {
    noise: Arma,
    /// Orthonormal basis of the whitened tangent.
    pub basis: Vec<Vec<f64>>,
    /// Whitened residual outside that basis.
    pub residual: Vec<f64>,
    /// Its sum of squares.
    pub rss: f64,
}

impl Stage {
    /// Whitens the fit's residual and tangent.
    #[must_use]
    pub fn new(fit: &Fit, frame: &Frame, noise: Arma) -> Self {
        let mut basis = Vec::new();
        for column in &fit.tangent {
            extend_basis(&mut basis, whiten(column, &frame.stretches, noise), 1e-7);
        }
        let mut residual = whiten(&fit.residual, &frame.stretches, noise);
        project_out(&basis, &mut residual);
        let rss = dot(&residual, &residual);
        Self { noise, basis, residual, rss }
    }

    /// Orthonormal columns of a design outside the fit's basis, with the coefficients that bring them back, and which
    /// of the design's columns they come from.
    #[must_use]
    pub fn outside(&self, frame: &Frame, design: &Design) -> Vec<(usize, Vec<f64>)> {
        let mut all = Vec::new();
        for (index, column) in design.columns.iter().enumerate() {
            let mut white = whiten(column, &frame.stretches, self.noise);
            let before = dot(&white, &white).sqrt();
            project_out(&self.basis, &mut white);
            project_out(&self.basis, &mut white);
            let after = dot(&white, &white).sqrt();
            if after > VISIBLE_SHARE * before && after > 0.0 {
                all.push((index, white));
            }
        }
        all
    }

    /// Sum of squares that a design explains with lawful signs.
    #[must_use]
    pub fn explained(&self, frame: &Frame, design: &Design) -> f64 {
        let columns = self.outside(frame, design);
        lawful_gain(&columns, &design.ranges, &self.residual)
    }
}

/// Sum of squares explained by columns whose coefficients stay within their ranges; columns that would leave theirs
/// are dropped, worst first.
#[must_use]
pub fn lawful_gain(columns: &[(usize, Vec<f64>)], ranges: &[(f64, f64)], target: &[f64]) -> f64 {
    let mut kept: Vec<&(usize, Vec<f64>)> = columns.iter().collect();
    while !kept.is_empty() {
        let (coefficients, gain) = solve_small(&kept, target);
        let outside = kept.iter().zip(&coefficients).position(|((index, _), c)| !lawful(*c, ranges[*index]));
        match outside {
            None => return gain,
            Some(position) => {
                kept.remove(position);
            }
        }
    }
    0.0
}

/// A coefficient on the lawful side of zero; the size is judged after the full fit.
fn lawful(coefficient: f64, range: (f64, f64)) -> bool {
    !(range.0 >= 0.0 && coefficient < 0.0 || range.1 <= 0.0 && coefficient > 0.0)
}

fn solve_small(columns: &[&(usize, Vec<f64>)], target: &[f64]) -> (Vec<f64>, f64) {
    if let [(_, only)] = columns {
        let (along, size) = (dot(only, target), dot(only, only));
        return (vec![along / size], along * along / size);
    }
    let plain: Vec<Vec<f64>> = columns.iter().map(|(_, column)| column.clone()).collect();
    let solution = super::linear::least_squares(&plain, target);
    (solution.coefficients, dot(target, target) - solution.rss)
}
