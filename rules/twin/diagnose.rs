//! The diagnosis from end to end: prepare, fit the baseline, search, judge, locate.

use super::bind::bind;
use super::designs::{Design, designs};
use super::diagnosis::{Diagnosis, Quality, Verdict};
use super::edge_weights::SeenForm;
use super::excerpt;
use super::fit::{Data, Fit, fit};
use super::frame::{FOLDS, Frame, Unit, group_size, held_out, units};
use super::holdout::{HoldoutNoise, Prediction, predict, rmse};
use super::model::{Model, Part, simulate};
use super::noise::Arma;
use super::outcome::{Outcome, SearchAnswer};
use super::quality::{Fault, clean};
use super::scan::HypothesisBank;
use super::search::{EffectSearch, Hypothesis, SearchResult};
use super::verdicts;
use crate::physics::{Block, Scene, blocks_of};
use crate::statistics::{count, median, robust_deviation};
use adapters::Recording;
use std::collections::BTreeSet;

/// Rows below which nothing is claimed: the verdict is `cannot_tell`.
const ROWS_MIN: usize = 60;
/// Kinds that change over minutes to hours, whatever tool is in use.
const CREEPING: [&str; 3] = ["zero_drift", "bearing_warm_up", "preload_growth"];

/// Compares a model with a recording.
///
/// # Errors
/// Everything that makes the input unusable, with what to record instead.
pub fn diagnose(recording: &Recording, model: &Model, seed: u64) -> Result<Diagnosis, Vec<String>> {
    let mut whole = Case::new(recording, model)?;
    if !excerpt::is_long(&whole.scene) {
        return Ok(whole.diagnosed(seed));
    }
    let pieces = excerpt::close(&whole.scene, &whole.units);
    let (first, whole) = whole.seen_through(&pieces, seed);
    let Some(whole) = whole.filter(|_| first.verdict == Verdict::NoMismatch) else { return Ok(first) };
    let means = excerpt::from_afar(&whole.scene, &whole.units);
    let (second, _) = whole.seen_through(&means, seed);
    let named = matches!(second.verdict, Verdict::Explained | Verdict::Ambiguous);
    Ok(if named { second } else { first })
}

/// A recording prepared for comparison with a model.
pub struct Case<'a> {
    /// The model as given.
    pub model: &'a Model,
    /// The recording as the effects see it.
    pub scene: Scene,
    /// The parts, complete for this recording.
    pub parts: Vec<Part>,
    /// Units of hold-out.
    pub units: Vec<Unit>,
    /// Units that take no part in fitting, choosing or stopping.
    pub held: BTreeSet<usize>,
    /// Rows that are fitted.
    pub frame: Frame,
    /// Rows that are held out.
    pub held_frame: Frame,
    /// The recorded output of the fitted rows.
    pub recorded: Vec<f64>,
    /// Faults of the recording.
    pub faults: Vec<Fault>,
    /// A wave that was followed, where there is one.
    pub ripple: Option<super::ripple::Ripple>,
    /// A tone of the spindle that was followed, where there is one.
    pub tone: Option<super::tone::Tone>,
    /// A hidden switch that was followed, where there is one.
    pub switching: Option<super::latent::Switching>,
    /// The baseline beside an effect at the edges that bends it, where there is one.
    pub unbent: Option<Vec<Part>>,
    /// Effects at edges that show with every row in full.
    pub seen_at_edges: Vec<SeenForm>,
    /// The whole recording where this is an excerpt of it.
    pub whole: Option<Box<Case<'a>>>,
}

impl<'a> Case<'a> {
    pub(super) fn new(recording: &Recording, model: &'a Model) -> Result<Self, Vec<String>> {
        let mut scene = Scene::new(recording, &model.output, &model.roles).map_err(|error| vec![error.to_string()])?;
        let parts = bind(model, &scene)?;
        let Some(nominal) = simulate(&parts, &mut scene) else {
            return Err(vec!["the model cannot be simulated over this recording".to_owned()]);
        };
        super::inputs::exclude_rows_without_inputs(&mut scene, &parts);
        let faults = clean(&mut scene, &nominal.total);
        let units = units(&scene);
        let held = held_out(&units, FOLDS - 1);
        // Of a long recording an excerpt is fitted, and every row counts where the answer is told.
        let size = if excerpt::is_long(&scene) { 1 } else { group_size(&scene) };
        Ok(Self::of(model, scene, parts, units, held, size, faults))
    }

    pub(super) fn of(
        model: &'a Model,
        scene: Scene,
        parts: Vec<Part>,
        units: Vec<Unit>,
        held: BTreeSet<usize>,
        size: usize,
        faults: Vec<Fault>,
    ) -> Self {
        let frame = Frame::new(&scene, &units, size, |unit| !held.contains(&unit));
        let held_frame = Frame::new(&scene, &units, size, |unit| held.contains(&unit));
        let recorded = frame.reduce(scene.recorded());
        Self {
            model,
            scene,
            parts,
            units,
            held,
            frame,
            held_frame,
            recorded,
            faults,
            ripple: None,
            tone: None,
            switching: None,
            unbent: None,
            seen_at_edges: Vec::new(),
            whole: None,
        }
    }

    /// The diagnosis found from an excerpt and told over the whole, and the whole again.
    fn seen_through(self, blocks: &[Block], seed: u64) -> (Diagnosis, Option<Box<Self>>) {
        let unit = |unit: &Unit| Unit { name: unit.name.clone(), rows: blocks_of(blocks, &unit.rows) };
        let units = self.units.iter().map(unit).collect();
        let (scene, parts, held) = (self.scene.excerpt(blocks), self.parts.clone(), self.held.clone());
        let mut short = Self::of(self.model, scene, parts, units, held, 1, self.faults.clone());
        short.whole = Some(Box::new(self));
        (short.diagnosed(seed), short.whole)
    }

    /// From the baseline to the verdict.
    fn diagnosed(&mut self, seed: u64) -> Diagnosis {
        if let Some(needed) = self.too_little() {
            return verdicts::cannot_tell(self, needed);
        }
        let Some(base) = self.fit_baseline() else {
            return verdicts::cannot_tell(self, "a model that can be fitted to this recording".to_owned());
        };
        let base = if self.give_levels(&base) { self.fit_baseline().unwrap_or(base) } else { base };
        let base = self.weigh_edges(base);
        let answer = self.answered(base.clone(), seed);
        self.show_hidden(&base);
        let outcome = Outcome::new(self, answer).confirmed(self);
        verdicts::judge(self, outcome)
    }

    /// What is found, and what is doubted of it.
    fn answered(&mut self, base: Fit, seed: u64) -> SearchAnswer {
        let (mut found, designs) = self.search(&base, seed);
        let base = self.settle(base, &mut found);
        let doubt = self.doubt(&base, &mut found, &designs, seed);
        let found = if doubt.unknown.is_none() { self.worth_claiming(found, &base, &designs) } else { found };
        SearchAnswer { base, found, designs, doubt }
    }

    /// The case in which the answer is told: the whole recording.
    pub fn told(&self) -> &Self {
        self.whole.as_deref().unwrap_or(self)
    }

    pub(super) fn too_little(&self) -> Option<String> {
        if self.frame.len() < ROWS_MIN {
            return Some(format!("at least {ROWS_MIN} rows with a value of {}", self.model.output));
        }
        let first = self.recorded[0];
        if self.recorded.iter().all(|x| *x == first) {
            return Some(format!("a recording in which {} changes", self.model.output));
        }
        None
    }

    /// Runs `act` with the fitted rows.
    pub fn with_data<T>(&mut self, act: impl FnOnce(&mut Data<'_>) -> T) -> T {
        let mut data = Data { scene: &mut self.scene, frame: &self.frame, recorded: &self.recorded };
        act(&mut data)
    }

    pub(super) fn fit_baseline(&mut self) -> Option<Fit> {
        let parts = self.parts.clone();
        let plain = self.with_data(|data| fit(data, &parts, Arma { phi: 0.7, theta: -0.2 }))?;
        self.even_out(&plain);
        let noise = self.frame.noise_between_outliers(&plain.residual, plain.noise);
        self.frame.weigh(&plain.residual, noise);
        self.with_data(|data| fit(data, &plain.parts, noise))
    }

    /// Weighs the rows by what the best hypothesis leaves, and fits it and the baseline again: rows that looked
    /// outlandish because an effect was missing count in full once it is there.
    fn settle(&mut self, base: Fit, found: &mut SearchResult) -> Fit {
        let best = &mut found.best;
        if best.members.is_empty() {
            return base;
        }
        self.frame.weigh(&best.fit.residual, best.fit.noise);
        let parts = best.fit.parts.clone();
        let again = self.with_data(|data| {
            let best_again = fit(data, &parts, best.fit.noise)?;
            let base_again = fit(data, &base.parts, base.noise)?;
            Some((best_again, base_again))
        });
        let Some((best_again, base_again)) = again else { return base };
        let shift = 2.0 * (best_again.log_likelihood - base_again.log_likelihood)
            - 2.0 * (best.fit.log_likelihood - base.log_likelihood);
        // The search's own figure stays where rows had to be weighed down to see it.
        let shift = shift.max(0.0);
        best.information += shift;
        found.others.iter_mut().for_each(|other| other.information += shift);
        best.fit = best_again;
        base_again
    }

    /// Gives passes and tools levels of their own where a feed drive tells how each tool wears.
    fn give_levels(&mut self, base: &Fit) -> bool {
        if self.scene.feed_load_growth().is_none() {
            return false;
        }
        let found = super::levels::found(&self.scene, &self.frame, &base.residual);
        found.map(|frame| self.frame = frame).is_some()
    }

    fn search(&mut self, base: &Fit, seed: u64) -> (SearchResult, Vec<Design>) {
        self.simulate_baseline(base);
        let mut designs = designs(&self.scene, &self.frame, self.model);
        if self.frame.levels.is_some() {
            // What creeps over hours is in the levels of the tools; within one tool's life it is but a bend.
            designs.retain(|design| !CREEPING.contains(&design.kind.as_str()));
        }
        designs.extend(self.designs_seen_at_edges());
        designs.extend(self.hidden_lots(base));
        designs.extend(self.hidden_switch(base));
        designs.extend(self.hidden_ripple(base));
        designs.extend(self.hidden_tone(base));
        let found = self.searched(base, &designs, seed);
        if self.shows_switch_beside(&found.best, &mut designs) {
            let found = self.searched(base, &designs, seed);
            return (found, designs);
        }
        (found, designs)
    }

    pub(super) fn searched(&mut self, base: &Fit, designs: &[Design], seed: u64) -> SearchResult {
        let frame = self.frame.clone();
        let bank = HypothesisBank::new(designs, &frame);
        let unbent = self.unbent.clone();
        self.with_data(|data| EffectSearch::new(data, base, &bank, seed).beside(unbent).run())
    }

    /// The hypothesis with one member taken out and everything else refitted.
    pub fn without(&mut self, from: &Hypothesis, position: usize) -> Option<Hypothesis> {
        let (members, parts) = from.taken_out(position);
        let fit = self.with_data(|data| fit(data, &parts, from.fit.noise))?;
        let information = from.information - 2.0 * (from.fit.log_likelihood - fit.log_likelihood);
        Some(Hypothesis { members, fit, information })
    }

    /// Logarithm of the number of independent rows.
    #[must_use]
    pub fn ln_rows(&self, base: &Fit) -> f64 {
        (count(self.frame.len()) / base.noise.inflation()).max(20.0).ln()
    }

    /// Simulates every row with hidden states followed through the held-out units.
    pub fn predict(&mut self, fit: &Fit) -> Option<Prediction> {
        if let Some(whole) = &mut self.whole {
            return whole.predict(fit);
        }
        self.predict_here(fit)
    }

    /// The same of what is fitted here, be it but an excerpt.
    pub(super) fn predict_here(&mut self, fit: &Fit) -> Option<Prediction> {
        let noise = HoldoutNoise { arma: fit.noise, deviation: ordinary_noise(fit) };
        predict(&mut self.scene, &fit.parts, self.parts.len(), &self.units, &self.held, noise)
    }

    /// How well a prediction fits.
    #[must_use]
    pub fn quality(&self, prediction: &Prediction) -> Quality {
        let told = self.told();
        Quality {
            rmse: rmse(&told.scene, &told.frame, &prediction.total).unwrap_or(0.0),
            held_out_rmse: rmse(&told.scene, &told.held_frame, &prediction.total),
        }
    }
}

/// Robust standard deviation of what remains, edges and spikes left aside.
#[must_use]
pub fn ordinary_noise(fit: &Fit) -> f64 {
    let middle = median(fit.residual.clone()).unwrap_or(0.0);
    robust_deviation(fit.residual.iter().map(|x| x - middle)).unwrap_or(0.0)
}

/// Root mean square distance.
pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / count(a.len().max(1))).sqrt()
}
