//! The diagnosis in plain words.

use super::diagnosis::{Diagnosis, UNKNOWN, Verdict};
use super::locate::Condition;

/// One or two sentences for the machinist.
#[must_use]
pub fn summary(diagnosis: &Diagnosis) -> String {
    let names: Vec<String> = diagnosis.missing.iter().map(|missing| missing.effect.replace('_', " ")).collect();
    let fit = improvement(diagnosis);
    match diagnosis.verdict {
        Verdict::NoMismatch => agreement(diagnosis),
        Verdict::CannotTell => diagnosis.summary.clone(),
        Verdict::Unexplained => {
            format!(
                "Something real is missing from the model, and no candidate explains it{}. {fit}",
                region(diagnosis)
            )
        }
        Verdict::Explained => format!("The model lacks {}{}. {fit}", names.join(" and "), region(diagnosis)),
        Verdict::Ambiguous => {
            let others: Vec<String> = diagnosis.alternatives.iter().map(|other| rival(&other.effect)).collect();
            format!(
                "Something is missing from the model{}: most likely {}, but this recording cannot rule out {}. {fit}",
                region(diagnosis),
                names.join(" and "),
                others.join(", ")
            )
        }
    }
}

/// That nothing is missing is an answer too, and tells how it is known.
fn agreement(diagnosis: &Diagnosis) -> String {
    let known = diagnosis.existence.map_or_else(String::new, |existence| {
        format!(
            " Probability that nothing is missing: {:.2}; the recording is worth {:.0} independent rows.",
            existence.probability_of_nothing, existence.effective_rows
        )
    });
    format!("The recording agrees with the model: nothing remains beyond the noise.{known}")
}

/// Why nothing is told although something is there: what was `found`, in which runs the error does not fall with it, and the
/// errors there without it and with it.
#[must_use]
pub(super) fn withdrawn(found: &[String], among_fitted: bool, errors: Option<(f64, f64)>, unit: &str) -> String {
    let names: Vec<String> =
        found.iter().map(|kind| if kind == UNKNOWN { "something without a name".to_owned() } else { kind.replace('_', " ") }).collect();
    let runs = if among_fitted {
        "fitted runs that are predicted from the others"
    } else {
        "runs that took no part in fitting"
    };
    let errors = errors.map_or_else(String::new, |(before, after)| {
        format!(" ({before:.3} {unit} without it, {after:.3} {unit} with it)")
    });
    format!(
        "Cannot tell: {} fits the runs it was fitted to, but the error on {runs} does not fall{errors}.",
        names.join(" and ")
    )
}

/// A rival in words; one without a name too.
fn rival(effect: &str) -> String {
    if effect == UNKNOWN { "a cause that is not in the catalogue".to_owned() } else { effect.replace('_', " ") }
}

fn improvement(diagnosis: &Diagnosis) -> String {
    let Some(fit) = &diagnosis.fit else { return String::new() };
    let unit = &diagnosis.unit;
    match (fit.before.held_out_rmse, fit.after.held_out_rmse) {
        (Some(before), Some(after)) => {
            format!(
                "On runs that took no part in fitting the error falls from {before:.3} to {after:.3} {unit}; the noise is {:.3} {unit}.",
                fit.noise_floor
            )
        }
        _ => format!("The error falls from {:.3} to {:.3} {unit}.", fit.before.rmse, fit.after.rmse),
    }
}

fn region(diagnosis: &Diagnosis) -> String {
    let Some(first) = diagnosis.mismatch.first() else { return String::new() };
    let conditions: Vec<String> = first.conditions.iter().map(condition).collect();
    let place = if conditions.is_empty() { String::new() } else { format!(", where {}", conditions.join(" and ")) };
    let since = first.onset.as_ref().map(|onset| format!(", since run {} at {:.0} s", onset.run, onset.time_s));
    format!("{place}{} (on average {:+.3} {})", since.unwrap_or_default(), first.mean, diagnosis.unit)
}

/// A condition in words.
#[must_use]
pub fn condition(condition: &Condition) -> String {
    match condition {
        Condition::Range { column, min: Some(min), max: Some(max) } => {
            format!("{column} is between {min:.3} and {max:.3}")
        }
        Condition::Range { column, min: Some(min), max: None } => format!("{column} is above {min:.3}"),
        Condition::Range { column, min: None, max: Some(max) } => format!("{column} is below {max:.3}"),
        Condition::Range { column, .. } => format!("{column} has any value"),
        Condition::Equals { column, words } => format!("{column} is {}", words.join(" or ")),
    }
}
