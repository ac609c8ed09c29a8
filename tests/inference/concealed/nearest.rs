//! How far apart the hidden effects are in principle: whether another law of this generator, drawn several times and
//! given any size, follows what remains of an effect after the refit. The tool has no part in this.

use crate::concealed::dice::Dice;
use crate::concealed::laws;
use crate::concealed::least_squares::Basis;
use crate::concealed::noise::{Moment, Noise, unit_noise};
use crate::concealed::tick::Tick;
use crate::concealed::world::{Seeded, Stage};

/// Another effect, the share of the remainder's variance that it follows, and the evidence against it that is left:
/// twice the expected gain in log likelihood of a matched filter under the noise of the case.
#[derive(Clone, Debug)]
pub(crate) struct Rival {
    pub(crate) name: &'static str,
    pub(crate) form: &'static str,
    pub(crate) share: f64,
    pub(crate) evidence: f64,
}

/// Below this evidence the noise alone can turn the order of two explanations.
pub(crate) const ENOUGH: f64 = 30.0;
const DRAWS: usize = 3;
const NOISES: usize = 24;

/// The remaining effect of a case, and everything needed to compare others with it.
pub(crate) struct Court<'a> {
    pub(crate) stage: &'a Stage,
    pub(crate) laws: &'a [Seeded],
    pub(crate) record: &'a [Tick],
    pub(crate) rows: &'a [usize],
    /// What the nominal model and the other hidden effects can follow.
    pub(crate) span: Vec<Vec<f64>>,
    pub(crate) remainder: &'a [f64],
    pub(crate) sd: f64,
    pub(crate) noise: Noise,
    pub(crate) moments: &'a [Moment],
}

impl Court<'_> {
    /// The best draw of every other name, most dangerous first.
    pub(crate) fn rivals(&self) -> Vec<Rival> {
        let basis = Basis::of(&self.span);
        let left = basis.remainder(self.remainder);
        let disturbances = self.disturbances();
        let bare = self.stage.bare(self.record);
        let mut dice = Dice::seeded("rivals", self.stage.seed);
        let mut rivals: Vec<Rival> = Vec::new();
        let hidden = |name: &str| self.laws.iter().any(|law| law.entry.name == name);
        for entry in laws::listed().into_iter().filter(|e| !hidden(e.name)) {
            for _ in 0..DRAWS {
                let law = Seeded { entry: entry.clone(), seed: dice.whole(0, 1 << 40) as u64, strength: 1.0 };
                let added = self.stage.added(&law, self.record, &bare);
                let shape: Vec<f64> = self.rows.iter().map(|&i| added[i]).collect();
                let (share, apart) = follow(&basis, &left, &shape);
                let evidence = matched(&apart, &disturbances, self.sd);
                rivals.push(Rival { name: entry.name, form: entry.form, share, evidence });
            }
        }
        best_of_each(rivals)
    }

    fn disturbances(&self) -> Vec<Vec<f64>> {
        let mut dice = Dice::seeded("disturbances", self.stage.seed);
        (0..NOISES).map(|_| unit_noise(self.noise, self.moments, &mut dice)).collect()
    }
}

/// Share of `left` that `shape` follows beyond the basis, and the rest of `left`.
fn follow(basis: &Basis, left: &[f64], shape: &[f64]) -> (f64, Vec<f64>) {
    let own = basis.remainder(shape);
    let size = energy(&own);
    if size < 1e-12 {
        return (0.0, left.to_vec());
    }
    let factor = own.iter().zip(left).map(|(a, b)| a * b).sum::<f64>() / size;
    let apart: Vec<f64> = left.iter().zip(&own).map(|(l, o)| l - factor * o).collect();
    (1.0 - energy(&apart) / energy(left).max(1e-12), apart)
}

fn energy(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum()
}

/// Squared signal over variance of a filter matched to `signal`.
fn matched(signal: &[f64], disturbances: &[Vec<f64>], sd: f64) -> f64 {
    let through = |noise: &Vec<f64>| signal.iter().zip(noise).map(|(a, b)| a * b).sum::<f64>().powi(2);
    let variance = disturbances.iter().map(through).sum::<f64>() / disturbances.len().max(1) as f64;
    energy(signal).powi(2) / (sd * sd * variance).max(1e-12)
}

fn best_of_each(mut rivals: Vec<Rival>) -> Vec<Rival> {
    rivals.sort_by(|a, b| a.evidence.total_cmp(&b.evidence));
    let mut best: Vec<Rival> = Vec::new();
    for rival in rivals {
        if best.iter().all(|b| b.name != rival.name) {
            best.push(rival);
        }
    }
    best
}
