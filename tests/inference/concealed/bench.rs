//! Cases whose nominal model is a linear law of columns: a drive on its own, thermal error.

use crate::concealed::case::{Case, Expect, Hiding, Table};
use crate::concealed::dice::Dice;
use crate::concealed::least_squares::{Basis, mean, rms};
use crate::concealed::noise::{Moment, Noise, spoil};

/// One hidden contribution at its physical size.
pub(crate) struct Part {
    pub(crate) name: &'static str,
    pub(crate) also: &'static [&'static str],
    pub(crate) form: &'static str,
    pub(crate) reach: (f64, f64),
    pub(crate) contribution: Vec<f64>,
    pub(crate) parameters: Vec<(&'static str, f64)>,
}

/// A recording without noise, and what is hidden in it.
pub(crate) struct Bench {
    pub(crate) group: String,
    pub(crate) name: String,
    pub(crate) seed: u64,
    pub(crate) expect: Expect,
    pub(crate) rho: f64,
    pub(crate) noise: Noise,
    /// Least and greatest noise, as a share of the rms of the output.
    pub(crate) noise_share: (f64, f64),
    pub(crate) table: Table,
    pub(crate) output: &'static str,
    pub(crate) model: String,
    /// Columns that the nominal model is linear in.
    pub(crate) span: Vec<Vec<f64>>,
    /// Output of the nominal physics.
    pub(crate) nominal: Vec<f64>,
    pub(crate) parts: Vec<Part>,
    /// Seconds of a row as the noise counts them.
    pub(crate) noise_time_s: Vec<f64>,
}

impl Bench {
    /// The case; none when the wished remainder is out of the effects' reach.
    pub(crate) fn finish(mut self) -> Option<Case> {
        let mut dice = Dice::seeded(&format!("{}/{}/finish", self.group, self.name), self.seed);
        let basis = Basis::of(&self.span);
        let sd = self.balance(&basis, &mut dice)?;
        let mut clean = self.nominal.clone();
        for part in &self.parts {
            clean.iter_mut().zip(&part.contribution).for_each(|(c, p)| *c += p);
        }
        let moments: Vec<Moment> = self.noise_time_s.iter().zip(&clean).map(|(t, c)| moment(*t, *c)).collect();
        let spoiled = spoil(self.noise, &moments, sd, &mut dice);
        self.table.sparse(self.output, 4, spoiled.values.iter().copied());
        let hidden = self.parts.iter().map(|p| hiding(p, &basis, sd)).collect();
        Some(Case {
            group: self.group,
            name: self.name,
            seed: self.seed,
            expect: self.expect,
            noise: self.noise.name().into(),
            noise_sd: sd,
            table: self.table,
            model: self.model,
            hidden,
            clean,
            faults: spoiled.faults,
            tangent: self.span,
            rivals: Vec::new(),
        })
    }

    fn balance(&mut self, basis: &Basis, dice: &mut Dice) -> Option<f64> {
        let level = rms(&self.nominal);
        let (mut low, mut high) = (self.noise_share.0 * level, self.noise_share.1 * level);
        let left: Vec<f64> = self.parts.iter().map(|p| rms(&basis.remainder(&p.contribution))).collect();
        for (part, left) in self.parts.iter().zip(&left) {
            low = low.max(part.reach.0 * left / self.rho);
            high = high.min(part.reach.1 * left / self.rho);
        }
        if low > high {
            return None;
        }
        let sd = dice.log_uniform(low, high);
        for (part, left) in self.parts.iter_mut().zip(&left) {
            let factor = self.rho * sd / left;
            part.contribution.iter_mut().for_each(|c| *c *= factor);
            part.parameters.iter_mut().for_each(|(_, v)| *v *= factor);
        }
        Some(sd)
    }
}

fn moment(t_s: f64, clean: f64) -> Moment {
    Moment { t_s, clean, engaged: true, speed_rpm: 100.0 * t_s, ln_thickness: 0.0 }
}

fn hiding(part: &Part, basis: &Basis, sd: f64) -> Hiding {
    let remainder = basis.remainder(&part.contribution);
    let left = rms(&remainder);
    Hiding {
        name: part.name.into(),
        also: part.also.iter().map(ToString::to_string).collect(),
        form: part.form.into(),
        rho: left / sd,
        absorbed: 1.0 - (left / rms(&part.contribution).max(1e-12)).powi(2),
        onset_row: None,
        parameters: part.parameters.iter().map(|(n, v)| (n.to_string(), *v)).collect(),
        contribution: part.contribution.clone(),
        remainder,
    }
}

/// A first-order lag of `input` in row time `dt_s`, from its first value.
pub(crate) fn follow(input: &[f64], tau_s: f64, dt_s: f64) -> Vec<f64> {
    let mut state = input.first().copied().unwrap_or(0.0);
    let keep = (-dt_s / tau_s).exp();
    input
        .iter()
        .map(|x| {
            state = x + (state - x) * keep;
            state
        })
        .collect()
}

/// The values less their mean.
pub(crate) fn centred(values: &[f64]) -> Vec<f64> {
    let middle = mean(values);
    values.iter().map(|v| v - middle).collect()
}
