//! The next step: what to record where an answer is not sure. Names are separated by the experiments of their effects;
//! what has no name is asked for by the channel that its form was found over.

use super::channel::{
    ACCELERATION, DIRECTION, SIMULATED_CUT, SIMULATED_CUT_PER_KRPM, SIMULATED_OUTPUT, TIME, TIME_IN_CUT, TIME_IN_RUN,
    TIME_SINCE_CHANGE_OF,
};
use super::diagnosis::{Alternative, Experiment, Verdict};
use super::empirical::Empirical;
use super::model::{Part, PartFunction};
use super::outcome::Outcome;
use crate::physics::effect;

/// Minutes of an experiment over one channel: four levels of it, up and down, twice, half a minute each, and the way there.
const CHANNEL_MINUTES: f64 = 10.0;
/// Bounds within which the gain of an experiment is told: below the first it is worth nothing to anybody, and beyond the
/// second nothing is left to be decided.
const GAIN_BOUNDS: (f64, f64) = (10.0, 100.0);

/// What to record next: always where names compete, where none is known, and where nothing can be told.
pub(super) fn next_step(outcome: &Outcome, verdict: Verdict, alternatives: &[Alternative]) -> Option<Experiment> {
    if matches!(verdict, Verdict::NoMismatch | Verdict::Explained) {
        return None;
    }
    let gain = outcome.information();
    let open = alternatives.iter().flat_map(|other| [other.effect.as_str(), other.instead_of.as_str()]);
    let gone = outcome.withdrawn.iter().flat_map(|withdrawn| withdrawn.kinds.iter().map(String::as_str));
    of_effects(open.chain(gone), gain).or_else(|| {
        let form = outcome.last().parts.iter().rev().find_map(form_of);
        let statement = form.map_or_else(repeat, |form| over(&form.channel));
        Some(experiment(statement, CHANNEL_MINUTES, gain, ""))
    })
}

/// The experiment of the first of these kinds that the catalogue holds.
pub(super) fn of_effects<'a>(mut kinds: impl Iterator<Item = &'a str>, gain: f64) -> Option<Experiment> {
    let doc = kinds.find_map(effect)?.doc();
    Some(experiment(doc.en.experiment.to_owned(), doc.experiment_minutes, gain, doc.kind))
}

/// Another kind that this data cannot rule out, `delta_ic` units of information behind the one it would replace, with the
/// experiment that separates them.
pub(super) fn alternative(kind: &str, instead_of: &str, delta_ic: f64) -> Alternative {
    let experiment = effect(kind).or_else(|| effect(instead_of)).map(|effect| effect.doc().en.experiment);
    Alternative {
        effect: kind.to_owned(),
        instead_of: instead_of.to_owned(),
        delta_ic,
        separating_experiment: experiment.unwrap_or_default().to_owned(),
    }
}

/// An experiment, its gain in information within the bounds in which it is told.
pub(super) fn experiment(statement: String, minutes: f64, gain: f64, effect: &str) -> Experiment {
    let expected_delta_ic = gain.clamp(GAIN_BOUNDS.0, GAIN_BOUNDS.1);
    Experiment { statement, minutes, expected_delta_ic, effect: effect.to_owned() }
}

fn form_of(part: &Part) -> Option<&Empirical> {
    match &part.body {
        PartFunction::Empirical(form) => Some(form),
        _ => None,
    }
}

fn repeat() -> String {
    "Record the same programs again, at least four runs, and vary speed, feed and load on their own in each".to_owned()
}

/// What to record to learn what depends on a channel.
fn over(channel: &str) -> String {
    let stepped = |what: &str| {
        format!(
            "Step {what} alone over its whole range, up and down, twice, with everything else constant: what repeats with it depends on it"
        )
    };
    match channel {
        TIME | TIME_IN_RUN => {
            "Record one run twice as long at constant speed and load, then pause for as long and repeat it: what follows the clock, the warmth and the program part then".to_owned()
        }
        TIME_IN_CUT => {
            "Cut the same pass three times at the usual feed, half of it and double: what follows the time and what follows the way part then".to_owned()
        }
        SIMULATED_CUT | SIMULATED_CUT_PER_KRPM => stepped("the load (depth, then feed) at one speed"),
        SIMULATED_OUTPUT => stepped("the load at one speed"),
        ACCELERATION => stepped("the acceleration between the same two speeds"),
        DIRECTION => stepped("the speed of the slide in both directions"),
        _ if channel.starts_with(TIME_SINCE_CHANGE_OF) => {
            "Change it (the tool, the work, the program) twice as often as usual over one hour, with everything else constant".to_owned()
        }
        _ => stepped(channel),
    }
}

#[cfg(test)]
mod tests {
    use super::over;

    #[test]
    fn a_channel_is_stepped_and_time_is_waited_for() {
        assert!(over("feed_mm_min").starts_with("Step feed_mm_min alone"));
        assert!(over("time_in_run_s").starts_with("Record one run twice as long"));
    }
}
