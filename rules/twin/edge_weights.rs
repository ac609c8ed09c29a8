//! Edges: a clock that lags, a meter that averages, an inertia or an entry nobody modelled leaves a few great innovations
//! at every edge and nothing between. Rows that look outlandish weigh little, so that spikes say little - and then the
//! whole effect says little. Before the search, therefore, the effects that act at edges are fitted with every row in
//! full; where one of them makes most of the outlandish rows ordinary, the rows are weighed by what it leaves.

use super::designs::{AT_EDGES, Design, design, designs_of};
use super::diagnose::Case;
use super::fit::{Fit, fit, fit_levels};
use super::model::{Part, simulate};
use super::noise::Arma;
use super::scan::{HypothesisBank, best_of_each_law};
use super::search::FIRST_INFORMATION;
use crate::physics::{Effect, Form};

/// Outlandish rows below which it makes no difference that they weigh little.
const OUTLYING_ROWS_MIN: usize = 5;
/// Effects fitted in full after the scan.
const FITTED: usize = 6;
/// Kinds that act at the edges of the speed.
const AT_EDGES_OF_SPEED: [&str; 2] = ["spindle_inertia", "regeneration"];

/// A form of an effect at edges as fitted with every row in full, and the noise beside it.
pub struct SeenForm {
    effect: &'static dyn Effect,
    form: Form,
    noise: Arma,
}

impl Case<'_> {
    /// The baseline, fitted with the rows weighed by what an effect at the edges leaves, where there is one.
    pub(super) fn weigh_edges(&mut self, base: Fit) -> Fit {
        let heavy_rows = self.frame.heavy();
        if heavy_rows < OUTLYING_ROWS_MIN {
            return base;
        }
        let weighed = self.frame.clone();
        self.frame.weigh_all_alike();
        let fits = self.fits_at_edges(&base);
        self.seen_in_full(&base, &fits);
        let likelihood = |a: &&Fit, b: &&Fit| a.log_likelihood.total_cmp(&b.log_likelihood);
        let Some(best) = fits.iter().max_by(likelihood).filter(|best| {
            // It must make half of the outlandish rows ordinary, in noise that a few others do not make look white.
            let noise = self.frame.noise_between_outliers(&best.residual, best.noise);
            2 * self.frame.outlandish_in(&best.residual, noise) <= heavy_rows
        }) else {
            self.frame = weighed;
            return base;
        };
        self.frame.weigh(&best.residual, best.noise);
        self.unbent = Some(best.parts[..self.parts.len()].to_vec());
        self.with_data(|data| fit(data, &base.parts, base.noise)).unwrap_or(base)
    }

    /// Simulates the baseline, for candidates to see its load and its output.
    pub(super) fn simulate_baseline(&mut self, base: &Fit) {
        let _ = simulate(self.unbent.as_ref().unwrap_or(&base.parts), &mut self.scene);
    }

    /// Keeps the forms of the effects at edges that explain something with every row in full, for the search to fit: its
    /// own scan, of rows that weigh little, sees nothing of them.
    fn seen_in_full(&mut self, base: &Fit, fits: &[Fit]) {
        let Some(plain) = self.with_data(|data| fit(data, &base.parts, base.noise)) else { return };
        let ln_rows = self.ln_rows(&plain);
        let seen = fits.iter().filter(|fit| {
            let gained = 2.0 * (fit.log_likelihood - plain.log_likelihood);
            gained > FIRST_INFORMATION + ln_rows
        });
        let form = |fit: &Fit| {
            let form = fit.parts.last().and_then(Part::effect_and_form);
            form.map(|(effect, form)| SeenForm { effect, form, noise: fit.noise })
        };
        self.seen_at_edges = seen.filter_map(form).collect();
    }

    /// The same as hypotheses that are fitted whatever a scan shows of them.
    pub(super) fn designs_seen_at_edges(&self) -> Vec<Design> {
        let design_of = |seen: &SeenForm| {
            let design = design(seen.effect, &seen.form, &self.scene, &self.frame)?;
            Some(Design { noise: Some(seen.noise), ..design })
        };
        self.seen_at_edges.iter().filter_map(design_of).collect()
    }

    /// Fits with one effect that acts at edges each, every row in full. They start from levels: in noise with much memory
    /// an edge that comes late has nothing in common with the simulated one, and the load fits best at nothing.
    fn fits_at_edges(&mut self, base: &Fit) -> Vec<Fit> {
        let nominal = self.parts.clone();
        let base = self.with_data(|data| fit_levels(data, &nominal)).unwrap_or_else(|| base.clone());
        if simulate(&base.parts, &mut self.scene).is_none() {
            return Vec::new();
        }
        let at_edges = |kind: &str| AT_EDGES.contains(&kind) || AT_EDGES_OF_SPEED.contains(&kind);
        let at_edges = designs_of(&self.scene, &self.frame, self.model, at_edges);
        let frame = self.frame.clone();
        let bank = HypothesisBank::new(&at_edges, &frame);
        let mut scores = bank.scan(&base, self.ln_rows(&base));
        scores.retain(|score| score.gain > 0.0);
        let chosen = best_of_each_law(&scores, &at_edges, FITTED);
        chosen
            .iter()
            .filter_map(|score| {
                let parts = [base.parts.as_slice(), std::slice::from_ref(&at_edges[score.design].part)].concat();
                self.with_data(|data| fit(data, &parts, base.noise))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{diagnose, parse_model};
    use adapters::Recording;
    use adapters::recording::{Cells, Numbers, Words};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const ROWS: usize = 960;
    const MODEL: &str = r#"
schema = "model/1"
name = "lathe"
output = "spindle_power_w"
[[effect]]
kind = "linear"
columns = { one = 200.0, spindle_speed_rpm = 0.2, feed_mm_min = 8.0 }
"#;

    /// Cuts of twenty rows at 2 Hz at other speeds and feeds each; the meter reports 0.7 s late, and its noise is small
    /// beside an edge.
    fn late_meter() -> Recording {
        let pass = |row: usize| row / 30;
        let speed = |row: usize| 600.0 + 130.0 * (pass(row) * 7 % 9) as f64;
        let feed = |row: usize| 80.0 + 12.0 * (pass(row) * 5 % 11) as f64;
        let engaged = |row: usize| if row % 30 >= 8 && row % 30 < 28 { 1.0 } else { 0.0 };
        let power = |row: usize| 200.0 + 0.2 * speed(row) + 8.0 * engaged(row) * feed(row);
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let mut slow = 0.0;
        let mut recorded = |row: usize| {
            let e: f64 = StandardNormal.sample(&mut rng);
            slow = 0.9 * slow + 5.0 * e;
            let e: f64 = StandardNormal.sample(&mut rng);
            // 1.4 rows late, and never from the run before.
            let (one, two) = (row.saturating_sub(1).max(row / 120 * 120), row.saturating_sub(2).max(row / 120 * 120));
            0.6 * power(one) + 0.4 * power(two) + slow + 6.0 * e
        };
        let mut recording = Recording::new("late", (0..ROWS).map(|row| 0.5 * row as f64).collect(), None);
        let mut put = |name: &str, values: Vec<f64>| recording.set_column(name, Cells::Numbers(Numbers::full(values)));
        put("spindle_speed_rpm", (0..ROWS).map(speed).collect());
        put("feed_mm_min", (0..ROWS).map(|row| engaged(row) * feed(row)).collect());
        put("engaged", (0..ROWS).map(engaged).collect());
        put("spindle_power_w", (0..ROWS).map(&mut recorded).collect());
        let mut runs = Words::default();
        (0..ROWS).for_each(|row| runs.push(&(row / 120).to_string()));
        recording.set_column("run", Cells::Words(runs));
        recording
    }

    #[test]
    fn a_late_meter_is_named_though_its_edges_look_outlandish() {
        let model = parse_model(MODEL).expect("a model");
        let diagnosis = diagnose(&late_meter(), &model, 1).expect("a diagnosis");
        let found = diagnosis.missing.first().expect("something is missing");
        let delay = found.parameters.iter().find(|parameter| parameter.name == "delay_s").map(|delay| delay.value);
        assert_eq!(found.effect, "clock_lag", "{}", diagnosis.summary);
        assert!(delay.is_some_and(|delay_s| (delay_s - 0.7).abs() < 0.05), "{delay:?}");
    }
}
