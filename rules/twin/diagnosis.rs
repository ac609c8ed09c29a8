//! What a diagnosis says (`diagnosis/1`), before it is written as JSON, words or a page.

use super::model::Model;
use super::quality::Fault;
use super::region::Region;
use adapter_core::bilingual::Bilingual;
use physics::explain::Language;

/// The unit of an output, from its name.
#[must_use]
pub fn find_output_unit(output: &str) -> &'static str {
    adapter_core::channel::quantity::unit_of(output).unwrap_or("1")
}

/// The name of what no law of the catalogue explains.
pub(super) const UNKNOWN: &str = "unknown";

/// The answer in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Named, and one explanation stands out.
    Explained,
    /// Real, but several named explanations cannot be told apart on this data.
    Ambiguous,
    /// Real and located; no candidate explains it.
    Unexplained,
    /// Nothing beyond the noise.
    NoMismatch,
    /// Too little data or excitation.
    CannotTell,
}

impl Verdict {
    /// The word in the contract.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Explained => "explained",
            Self::Ambiguous => "ambiguous",
            Self::Unexplained => "unexplained",
            Self::NoMismatch => "no_mismatch",
            Self::CannotTell => "cannot_tell",
        }
    }

    /// The same for a reader of Chinese; in English the word of the contract stands.
    #[must_use]
    pub fn describe(self, language: Language) -> &'static str {
        let zh = match self {
            Self::Explained => "已解释",
            Self::Ambiguous => "多种解释",
            Self::Unexplained => "存在但未能命名",
            Self::NoMismatch => "无偏差",
            Self::CannotTell => "无法判断",
        };
        language.select_text(self.as_word(), zh)
    }
}

/// A fitted number with its 95 % interval.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterEstimate {
    /// Name of the parameter.
    pub name: String,
    /// Fitted value, in `unit`.
    pub value: f64,
    /// Lower end of the 95 % interval; `None` where none was computed.
    pub low: Option<f64>,
    /// Upper end of the 95 % interval; `None` where none was computed.
    pub high: Option<f64>,
    /// Unit symbol of value and interval.
    pub unit: String,
}

/// An effect that the model lacks.
#[derive(Debug, Clone, PartialEq)]
pub struct Missing {
    /// Kind, hypothesis, or `unknown`.
    pub effect: String,
    /// One sentence that says what is missing.
    pub statement: String,
    /// The law of the effect as a line of text.
    pub equation: String,
    /// Its parameters as fitted, with intervals.
    pub parameters: Vec<ParameterEstimate>,
    /// Information lost without this one, all others refitted; `None` of what was not fitted.
    pub delta_ic: Option<f64>,
    /// Probability of the name, averaged over resamples of the recording; `None` of what has no name.
    pub probability: Option<f64>,
    /// Root mean square error on held-out runs without this one, all others refitted.
    pub held_out_rmse_before: Option<f64>,
    /// The same with it.
    pub held_out_rmse_after: Option<f64>,
    /// Why it cannot be simulated ahead; `None` where it can.
    pub not_predictable: Option<Bilingual>,
    /// Share of its variance that the baseline had swallowed.
    pub absorbed_share: f64,
}

/// Another explanation that this data cannot rule out.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// The kind that would explain it as well.
    pub effect: String,
    /// The kind it would replace.
    pub instead_of: String,
    /// How much less information it explains.
    pub delta_ic: f64,
    /// What separates the two.
    pub separating_experiment: String,
}

/// A parameter of the baseline that had been bent.
#[derive(Debug, Clone, PartialEq)]
pub struct Shift {
    /// The parameter, as `kind.parameter`.
    pub parameter: String,
    /// Refitted without the missing effect.
    pub before: f64,
    /// The value when refitted with it.
    pub after: f64,
}

/// How well something fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Root mean square error on the fitted runs.
    pub rmse: f64,
    /// Root mean square error on the held-out runs.
    pub held_out_rmse: Option<f64>,
}

/// Is anything missing at all? One test, whatever it may be called.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Existence {
    /// Probability that nothing is missing, averaged over resamples of the recording.
    pub probability_of_nothing: f64,
    /// How many independent rows the recording is worth.
    pub effective_rows: f64,
    /// Share of recordings in which nothing is missing that pass the test all the same.
    pub false_alarm_rate: f64,
}

/// The model with and without the missing physics, on the same rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Fits {
    /// Rows that took part.
    pub rows: usize,
    /// Runs, or stretches where there are too few runs.
    pub runs: usize,
    /// Names of those held out.
    pub held_out_runs: Vec<String>,
    /// Standard deviation of the ordinary noise.
    pub noise_floor: f64,
    /// The model refitted without the missing physics.
    pub before: Quality,
    /// The model refitted with it, as it is written: what the file does.
    pub after: Quality,
    /// The free curve that was found in its place; `None` where nothing was found.
    pub ceiling: Option<Quality>,
}

impl Fits {
    /// The error on those rows as a share of what it was before; `None` where none were held out.
    #[must_use]
    pub fn held_out_share(&self) -> Option<f64> {
        self.after.held_out_rmse.zip(self.before.held_out_rmse).map(|(after, before)| after / before)
    }
}

/// What to record next.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// What to do, in words.
    pub statement: String,
    /// The same in Chinese, where it is not that of the effect in the catalogue.
    pub statement_zh: Option<&'static str>,
    /// How long it takes.
    pub minutes: f64,
    /// The kind whose separating experiment it is.
    pub effect: String,
}

/// Row by row, in input order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rows {
    /// Refitted without the missing physics; `None` where an input is absent.
    pub simulated_before: Vec<Option<f64>>,
    /// Refitted with it; `None` where an input is absent.
    pub simulated_after: Vec<Option<f64>>,
    /// Rows that took part in the comparison: recorded, with every input, and free of faults.
    pub compared: Vec<bool>,
    /// Contribution of each added effect.
    pub effects: Vec<(String, Vec<f64>)>,
}

/// What a comparison of model and recording found.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// Column of the quantity that is simulated and was recorded.
    pub output: String,
    /// Unit symbol of that quantity.
    pub unit: String,
    /// The answer in one word.
    pub verdict: Verdict,
    /// The answer for a machinist.
    pub summary: Bilingual,
    /// Whether anything is missing; `None` when nothing could be fitted.
    pub existence: Option<Existence>,
    /// The fits; `None` when nothing could be fitted.
    pub fit: Option<Fits>,
    /// Where model and recording differ, the largest first.
    pub mismatch: Vec<Region>,
    /// What is missing, most important first.
    pub missing: Vec<Missing>,
    /// What else it could be.
    pub alternatives: Vec<Alternative>,
    /// Baseline parameters that had been bent.
    pub baseline_shift: Vec<Shift>,
    /// Faults of the recording.
    pub data_quality: Vec<Fault>,
    /// What is left where nothing is told to be missing, and is no white noise: under which switch, over which position, how slow.
    pub remainder: Vec<Bilingual>,
    /// What to record next.
    pub next_experiment: Option<Experiment>,
    /// The simulations row by row, before and after.
    pub rows: Rows,
    /// The extended, refitted model.
    pub model: Model,
    /// The leading explanations with their probabilities, for engineers.
    pub debug: String,
}

impl Rows {
    /// The rows of the whole recording, of which these stand at `kept`; nothing was computed for the others.
    #[must_use]
    pub fn expand_rows(&self, kept: &[usize], whole: usize) -> Self {
        let spread = |values: &[Option<f64>]| {
            let mut all = vec![None; whole];
            kept.iter().zip(values).for_each(|(row, value)| all[*row] = *value);
            all
        };
        let mut compared = vec![false; whole];
        kept.iter().zip(&self.compared).for_each(|(row, it)| compared[*row] = *it);
        let effects = self.effects.iter().map(|(name, values)| {
            let mut all = vec![0.0; whole];
            kept.iter().zip(values).for_each(|(row, value)| all[*row] = *value);
            (name.clone(), all)
        });
        Self {
            simulated_before: spread(&self.simulated_before),
            simulated_after: spread(&self.simulated_after),
            compared,
            effects: effects.collect(),
        }
    }
}

impl Diagnosis {
    /// The unit of the parameter `label.parameter` of the extended model, with the output's unit in the place of the word
    /// `output`; `None` for a pure number and for a name that the model does not have.
    #[must_use]
    pub fn find_parameter_unit(&self, name: &str) -> Option<String> {
        let unit = self.model.parts.iter().find_map(|part| {
            let parameter = name.strip_prefix(part.label())?.strip_prefix('.')?;
            part.find_parameter(parameter).map(|parameter| parameter.unit.as_str())
        })?;
        (unit != "1").then(|| unit.replace("output", &self.unit))
    }
}
