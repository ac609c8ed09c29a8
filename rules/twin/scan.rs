//! Scanning: how much each hypothesis explains on top of a fit, the fit's own parameters moving along.
//!
//! Columns are whitened once per noise setting and kept; on top of any fit only inner products are needed.

#![expect(clippy::needless_range_loop, reason = "matrix arithmetic reads better with indices")]

use super::designs::Design;
use super::fit::Fit;
use super::frame::Frame;
use super::linear::{dot, extend_basis, project_out};
use super::noise::Arma;
use crate::statistics::count;
use std::borrow::Cow;
use std::cell::OnceCell;

/// Share of a column's length that must lie outside what the fit can absorb: below it the hypothesis leaves no trace.
const VISIBLE_SHARE: f64 = 2e-3;
/// Noise settings at which hypotheses are compared in a first pass.
const SETTINGS: [Arma; 8] = [
    Arma { phi: 0.0, theta: 0.0 },
    Arma { phi: 0.5, theta: 0.0 },
    Arma { phi: 0.75, theta: -0.25 },
    Arma { phi: 0.88, theta: -0.25 },
    Arma { phi: 0.9, theta: -0.6 },
    Arma { phi: 0.96, theta: -0.4 },
    Arma { phi: 0.97, theta: -0.8 },
    Arma { phi: 0.985, theta: -0.93 },
];

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

/// The design of most information; `None` where none is known.
#[must_use]
pub fn likeliest<'s>(scores: impl IntoIterator<Item = &'s Score>) -> Option<&'s Score> {
    let known = scores.into_iter().filter(|score| score.information.is_finite());
    known.max_by(|a, b| a.information.total_cmp(&b.information))
}

/// The likeliest of the scores given, best first, at most `most` of them and one of each law of a kind; and whatever only
/// shows with every row in full, which no scan can rank.
#[must_use]
pub fn best_of_each_law<'s>(scores: &'s [Score], designs: &[Design], most: usize) -> Vec<&'s Score> {
    let mut ranked: Vec<&Score> = scores.iter().collect();
    ranked.sort_by(|a, b| b.information.total_cmp(&a.information).then(a.design.cmp(&b.design)));
    let mut laws: Vec<(&str, &str)> = Vec::new();
    ranked.retain(|score| {
        let design = &designs[score.design];
        let law = (design.kind.as_str(), design.law());
        let wanted = design.noise.is_some() || laws.len() < most && !laws.contains(&law);
        laws.extend(wanted.then_some(law));
        wanted
    });
    ranked
}

/// The price of a design: its parameters, and having been chosen among like ones.
#[must_use]
pub fn price(design: &Design, ln_rows: f64) -> f64 {
    count(design.freedom) * ln_rows + 2.0 * design.ln_choices + design.reluctance
}

/// The price of several designs together.
#[must_use]
pub fn price_of(designs: &[Design], members: &[usize], ln_rows: f64) -> f64 {
    members.iter().map(|member| price(&designs[*member], ln_rows)).sum()
}

/// Every hypothesis, whitened at the settings that have been asked for.
pub struct HypothesisBank<'a> {
    /// The hypotheses.
    pub designs: &'a [Design],
    frame: &'a Frame,
    whitened: [OnceCell<Vec<White>>; SETTINGS.len()],
}

/// A design at one setting: whitened columns and their inner products.
#[derive(Debug, Clone)]
struct White {
    columns: Vec<Vec<f64>>,
    gram: Vec<Vec<f64>>,
}

impl<'a> HypothesisBank<'a> {
    /// A bank that has whitened nothing yet.
    #[must_use]
    pub fn new(designs: &'a [Design], frame: &'a Frame) -> Self {
        Self { designs, frame, whitened: std::array::from_fn(|_| OnceCell::new()) }
    }

    fn at(&self, setting: usize) -> &[White] {
        self.whitened[setting].get_or_init(|| self.white(SETTINGS[setting]))
    }

    fn white(&self, noise: Arma) -> Vec<White> {
        let one = |design: &Design| {
            let white = |column: &Vec<f64>| self.frame.whiten(column, noise);
            let columns: Vec<Vec<f64>> = design.columns.iter().map(white).collect();
            let gram = columns.iter().map(|a| columns.iter().map(|b| dot(a, b)).collect()).collect();
            White { columns, gram }
        };
        self.designs.iter().map(one).collect()
    }

    /// The setting at which the fit's residual is likeliest.
    fn nearest(&self, fit: &Fit) -> usize {
        let likelihood = |noise: Arma| self.frame.log_likelihood(fit.left_in(self.frame, noise), noise);
        let scored = SETTINGS.iter().map(|noise| likelihood(*noise)).enumerate();
        scored.fold((0, f64::NEG_INFINITY), |best, next| if next.1 > best.1 { next } else { best }).0
    }

    /// Scores every design on top of `fit`: at the fit's own noise, and at less memory, because an effect that is
    /// missing looks like memory.
    #[must_use]
    pub fn scan(&self, fit: &Fit, ln_rows: f64) -> Vec<Score> {
        let own = self.nearest(fit);
        let mut settings = vec![own, own / 2, 0];
        settings.dedup();
        let mut best: Vec<f64> = vec![f64::NEG_INFINITY; self.designs.len()];
        for setting in settings {
            let stage = self.stage(fit, SETTINGS[setting], Cow::Borrowed(self.at(setting)));
            for (index, best) in best.iter_mut().enumerate() {
                let rss = stage.rss - self.explained(&stage, index, &stage.residual);
                // The fit's own noise lies between the settings: at the nearest one the gain is over that setting.
                let rows = count(self.frame.len());
                let likelihood = self.frame.log_likelihood(rss, SETTINGS[setting]);
                let here = if setting == own {
                    rows * (stage.rss / rss.max(f64::MIN_POSITIVE)).ln()
                } else {
                    f64::NEG_INFINITY
                };
                *best = best.max(2.0 * (likelihood - fit.log_likelihood)).max(here);
            }
        }
        let score = |(index, gain): (usize, f64)| Score {
            design: index,
            gain,
            information: gain - price(&self.designs[index], ln_rows),
        };
        best.into_iter().enumerate().map(score).collect()
    }

    /// A fit seen through exactly this noise.
    #[must_use]
    pub fn through(&self, fit: &Fit, noise: Arma) -> WhitenedFit<'_> {
        self.stage(fit, noise, Cow::Owned(self.white(noise)))
    }

    fn stage<'s>(&self, fit: &Fit, noise: Arma, white: Cow<'s, [White]>) -> WhitenedFit<'s> {
        let mut basis = Vec::new();
        for column in &fit.tangent {
            extend_basis(&mut basis, self.frame.whiten(column, noise), 1e-7);
        }
        let mut residual = self.frame.whiten(&fit.residual, noise);
        project_out(&basis, &mut residual);
        let rss = dot(&residual, &residual);
        let outside = white.iter().map(|white| outside(white, &basis)).collect();
        WhitenedFit { white, basis, residual, rss, outside }
    }

    /// Sum of squares of `target`, which lies outside the basis, that a design explains with lawful signs.
    #[must_use]
    pub fn explained(&self, stage: &WhitenedFit<'_>, design: usize, target: &[f64]) -> f64 {
        let white = &stage.white[design];
        let along: Vec<f64> = white.columns.iter().map(|column| dot(column, target)).collect();
        lawful_gain(&stage.outside[design], &along, &self.designs[design].ranges)
    }

    /// The rows of the comparison.
    #[must_use]
    pub fn frame(&self) -> &Frame {
        self.frame
    }
}

/// A fit seen through one noise.
pub struct WhitenedFit<'s> {
    white: Cow<'s, [White]>,
    /// Orthonormal basis of the whitened tangent.
    pub basis: Vec<Vec<f64>>,
    /// Whitened residual outside that basis.
    pub residual: Vec<f64>,
    /// Its sum of squares.
    pub rss: f64,
    /// Per design: inner products of its columns outside the basis; a zero diagonal marks an absorbed column.
    outside: Vec<Vec<Vec<f64>>>,
}

/// Inner products of whitened columns with their part inside the basis taken out.
fn outside(white: &White, basis: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let along: Vec<Vec<f64>> =
        white.columns.iter().map(|column| basis.iter().map(|q| dot(q, column)).collect()).collect();
    let size = white.columns.len();
    let mut gram = white.gram.clone();
    for i in 0..size {
        for j in 0..size {
            gram[i][j] -= dot(&along[i], &along[j]);
        }
    }
    for i in 0..size {
        if gram[i][i] <= VISIBLE_SHARE * VISIBLE_SHARE * white.gram[i][i] {
            gram[i][i] = 0.0;
        }
    }
    gram
}

/// Sum of squares explained by columns whose coefficients keep lawful signs; unlawful and absorbed ones are dropped.
fn lawful_gain(gram: &[Vec<f64>], along: &[f64], ranges: &[(f64, f64)]) -> f64 {
    let mut kept: Vec<usize> = (0..along.len()).filter(|index| gram[*index][*index] > 0.0).collect();
    while !kept.is_empty() {
        let coefficients = solve(gram, along, &kept);
        let unlawful = kept.iter().zip(&coefficients).position(|(index, c)| !lawful(*c, ranges[*index]));
        match unlawful {
            None => return kept.iter().zip(&coefficients).map(|(index, c)| c * along[*index]).sum(),
            Some(position) => {
                kept.remove(position);
            }
        }
    }
    0.0
}

/// A coefficient on the lawful side of zero; its size is judged after the full fit.
fn lawful(coefficient: f64, range: (f64, f64)) -> bool {
    !(range.0 >= 0.0 && coefficient < 0.0 || range.1 <= 0.0 && coefficient > 0.0)
}

/// Solves the normal equations of the kept columns by Cholesky; a column that adds nothing gets a coefficient of zero.
fn solve(gram: &[Vec<f64>], along: &[f64], kept: &[usize]) -> Vec<f64> {
    let size = kept.len();
    let mut lower = vec![vec![0.0; size]; size];
    let mut forward = vec![0.0; size];
    for i in 0..size {
        for j in 0..=i {
            let mut sum = gram[kept[i]][kept[j]];
            for k in 0..j {
                sum -= lower[i][k] * lower[j][k];
            }
            if i == j {
                lower[i][i] = if sum > 1e-9 * gram[kept[i]][kept[i]] { sum.sqrt() } else { 0.0 };
            } else if lower[j][j] > 0.0 {
                lower[i][j] = sum / lower[j][j];
            }
        }
        let sum: f64 = (0..i).map(|k| lower[i][k] * forward[k]).sum();
        forward[i] = if lower[i][i] > 0.0 { (along[kept[i]] - sum) / lower[i][i] } else { 0.0 };
    }
    let mut solution = vec![0.0; size];
    for i in (0..size).rev() {
        let sum: f64 = (i + 1..size).map(|k| lower[k][i] * solution[k]).sum();
        solution[i] = if lower[i][i] > 0.0 { (forward[i] - sum) / lower[i][i] } else { 0.0 };
    }
    solution
}
