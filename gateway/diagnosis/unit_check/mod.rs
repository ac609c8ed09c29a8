//! Are the inputs in the units that their names say? A column in another unit fits a model well, with parameters that mean nothing; so it is asked
//! before anything is claimed.
//!
//! | file | what is compared |
//! |---|---|
//! | `relations` | columns of which one follows from others |
//! | `sizes` | a column with what machines have, time with itself |
//! | `nominal` | the output with the model as it was given, under each unit that a column might be in |
//! | `parameter_ratio` | the refitted parameters with the nominal ones |
//!
//! What is found is told and refuses nothing: a person knows the machine, this does not.

mod nominal;
mod parameter_ratio;
mod relations;
mod sizes;

pub use parameter_ratio::find_parameter_doubts;

use adapter_core::bilingual::Bilingual;
use adapter_core::channel::quantity::unit_of;
use adapter_core::channel::unit::{Unit, units_of};
use recording::Recording;
use rules::twin::Model;

/// A column that is probably in another unit.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitDoubt {
    /// The column, or `kind.parameter`.
    pub about: String,
    /// The sentence, ending in a question.
    pub text: Bilingual,
}

impl UnitDoubt {
    fn new(about: &str, en: String, zh: String) -> Self {
        Self { about: about.to_owned(), text: Bilingual::new(en, zh) }
    }
}

/// Everything that is doubtful before the model is fitted, one sentence for each column.
#[must_use]
pub fn find_input_doubts(recording: &Recording, model: &Model) -> Vec<UnitDoubt> {
    let mut found: Vec<UnitDoubt> = Vec::new();
    for doubt in relations::find_doubts(recording)
        .into_iter()
        .chain(sizes::find_doubts(recording))
        .chain(nominal::find_doubts(recording, model))
    {
        if found.iter().all(|known| known.about != doubt.about) {
            found.push(doubt);
        }
    }
    found
}

/// Units that a column might be in by mistake, with the factor that turns its numbers into the unit that its name says. The same quantity only, and
/// only what differs enough to be seen.
fn list_possible_units(column: &str) -> Vec<(&'static str, f64)> {
    let Some(own) = unit_of(column).and_then(Unit::from_symbol) else { return Vec::new() };
    let factor =
        |unit: Unit| unit.compute_conversion(own).filter(|(_, offset)| *offset == 0.0).map(|(factor, _)| factor);
    let mut all: Vec<(&'static str, f64)> = units_of(own.dimension)
        .filter_map(|(symbol, unit)| Some((symbol, factor(unit)?)))
        .filter(|(_, factor)| factor.ln().abs() > 0.6)
        .collect();
    all.dedup_by(|a, b| a.1 == b.1);
    all
}

/// The unit whose factor is nearest to this one, within so much of its logarithm.
fn find_nearest_unit(column: &str, factor: f64, within: f64) -> Option<(&'static str, f64)> {
    let distance = |known: &(&'static str, f64)| (factor / known.1).ln().abs();
    list_possible_units(column)
        .into_iter()
        .filter(|known| distance(known) < within)
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Middle of the values that are present.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests;
