//! A consumer that nobody records, as it is written: its power, how long it stays on or off, and the noise behind which a
//! simulation follows it from the earlier rows of a run.

use super::inputs::RecordingInputs;
use crate::departure::is_of_departure;
use crate::model::{Parameter, Part};
use numerics::statistics::{count_to_f64, robust_deviation};
use physics::catalogue::auxiliary_switch::LATENT;
use physics::{Entry, Form, find_effect, format_run_stretch};

/// The kind that has such a form.
pub(super) const CONSUMER: &str = "auxiliary_switch";
/// Longest memory of the noise from row to row, as in the search for hidden sequences: nearer to one the noise
/// follows every level, lower makes switches of slow noise.
const MEMORY_MAX: f64 = 0.95;

/// Rows in which a contribution of two levels is on; `None` where it is none.
pub(super) fn read_two_level_state(inputs: &RecordingInputs<'_>, contribution: &[f64]) -> Option<Vec<f64>> {
    // Found with either sign: what is less while it is off is more while it is on.
    let top = inputs.fitted_rows(false).map(|row| contribution[row]).fold(f64::NEG_INFINITY, f64::max);
    let low = inputs.fitted_rows(false).map(|row| contribution[row]).fold(f64::INFINITY, f64::min);
    let on: Vec<f64> = contribution.iter().map(|x| f64::from(u8::from(*x > 0.5 * (low + top)))).collect();
    let rows = inputs.fitted_rows(false).filter(|row| on[*row] > 0.5).count();
    (top > low && rows > 0 && rows < inputs.fitted_rows(false).count()).then_some(on)
}

/// The consumer as a part whose level is fitted while its state is known.
pub(super) fn build_latent_part(level: f64) -> Option<Part> {
    let effect = find_effect(CONSUMER)?;
    let mut part = Part::from_effect(effect, &Form { name: LATENT, ..Form::without_shape() }, &["level"]);
    part.parameters.iter_mut().for_each(|parameter| parameter.value = level.max(0.0));
    Some(part)
}

/// Is it a part whose state was read from the recording?
pub(super) fn is_latent(part: &Part) -> bool {
    part.is_followed() && part.find_parameter("level").is_some()
}

/// The same as it stands in a file: `left` is what all parts leave of the output, the state known.
pub(super) fn write_latent_part(inputs: &RecordingInputs<'_>, part: &Part, on: &[f64], left: &[f64]) -> Option<Part> {
    let level = part.find_parameter("level")?.value;
    let follows = |row: &usize| *row > 0 && inputs.fitted[row - 1] && inputs.block[*row] == inputs.block[row - 1];
    let pairs: Vec<usize> = inputs.fitted_rows(false).filter(follows).collect();
    let square: f64 = pairs.iter().map(|row| left[row - 1].powi(2)).sum();
    let along: f64 = pairs.iter().map(|row| left[*row] * left[row - 1]).sum();
    let memory = (along / square.max(f64::MIN_POSITIVE)).clamp(0.0, MEMORY_MAX);
    let deviation = robust_deviation(pairs.iter().map(|row| left[*row] - memory * left[row - 1]))?;
    let changes = pairs.iter().filter(|row| on[**row] != on[*row - 1]).count();
    let seconds = count_to_f64(pairs.len()) * inputs.period_s;
    let share = numerics::statistics::mean(&inputs.fitted_rows(false).map(|row| on[row]).collect::<Vec<_>>());
    let effect = find_effect(CONSUMER)?;
    let shape = [
        ("step", level),
        ("deviation", deviation),
        ("memory", memory),
        ("dwell_s", seconds / count_to_f64(changes.max(1))),
        ("share_on", share),
    ];
    let form = Form { name: LATENT, ..Form::from_shape(&shape) }.with_full_share();
    let mut part = Part::from_effect(effect, &form, &["share"]);
    part.parameters.iter_mut().filter(|p| p.entry == Entry::Shape).for_each(settle_shape);
    Some(part)
}

/// A step that begins with a fitted run, as it stands in a file: where the runs before it took no part in the fit it may have begun
/// there, and their own earlier rows tell. `None` of every other part.
pub(super) fn write_followed_step(inputs: &RecordingInputs<'_>, part: &Part, deviation: f64) -> Option<Part> {
    let (effect, form) = part.effect_and_form()?;
    let name = effect.find_followed_form(&form)?;
    let (column, run) = form.place?;
    let (runs, names) = (inputs.scene.runs(), inputs.scene.run_names());
    let is_fitted = |run: &usize| runs[*run].clone().any(|row| inputs.fitted[row]);
    let told = names.iter().position(|name| *name == run)?;
    // Rows held out do not say when it begins: the fitted runs around them do.
    let last = (told..runs.len()).find(is_fitted)?;
    let first = (0..last).rev().take_while(|run| !is_fitted(run)).last()?;
    let gain = part.find_parameter("gain")?;
    let place = Some((column, format_run_stretch(names.get(first)?, names.get(last)?)));
    let shape = [("height", gain.value), ("deviation", deviation)];
    let form = Form { name, place, ..Form::from_shape(&shape) };
    let mut followed = Part::from_effect(effect, &form, &["gain"]);
    followed.parameters.iter_mut().filter(|p| p.name == "gain").for_each(|p| p.clone_from(gain));
    followed.parameters.iter_mut().filter(|p| p.name == "deviation").for_each(settle_shape);
    followed.parameters.extend(part.parameters.iter().filter(|p| is_of_departure(p)).cloned());
    followed.departures.clone_from(&part.departures);
    Some(followed)
}

/// Inside its range; how the state is followed was measured and is no size to be fitted again.
fn settle_shape(parameter: &mut Parameter) {
    parameter.value = parameter.value.clamp(parameter.range.0, parameter.range.1);
    parameter.fixed |= parameter.name != "step";
}
