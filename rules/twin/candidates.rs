//! What may be missing from a model: which effects of the catalogue stand as candidates beside it.

use super::model::{Model, Parameter, Part, PartFunction};
use super::term::Term;
use numerics::statistics::count_to_f64;
use physics::{Effect, Role, Scene};

/// What a machine takes without a cut builds a model and is never a finding by itself.
const BUILDING: &str = "no_load_power";
/// The cut, which is one where a model of effects has none.
const CUT: &str = "cutting_power";
/// Kinds that a coefficient of the acceleration already is.
const INERTIA: [&str; 2] = ["axis_inertia", "spindle_inertia"];
/// Rows by which a column may repeat the output.
const REPEATED_ROWS: usize = 3;
/// Share of the rows in which it must.
const REPEATED_SHARE: f64 = 0.98;
/// Share of the greatest rate by which an output that is a rate may miss it: both are rounded.
const RATE_SHARE: f64 = 1e-3;

/// Would a shift in time explain anything of this model and mean nothing?
pub(super) fn is_time_shift_trivial(model: &Model, scene: &Scene) -> bool {
    reads_output(model) || repeats_output(model, scene)
}

/// Does the model predict the output from its own past? Then a shift in time explains anything and means nothing.
fn reads_output(model: &Model) -> bool {
    model.parts.iter().any(|part| part.inputs().contains(&model.output.as_str()))
}

/// Is a column that the model reads the output of a few rows before, under a name of its own - or is the output nothing
/// but the rate at which such a column changes? A meter that is late would be late in both.
fn repeats_output(model: &Model, scene: &Scene) -> bool {
    let of = |name: &str| {
        let Some(column) = scene.column(name) else { return false };
        (1..=REPEATED_ROWS).any(|by| is_lagged_output(scene, column, by)) || is_output_rate_of(scene, column)
    };
    model.parts.iter().flat_map(Part::inputs).any(of)
}

/// Rows of which the row so many before, in the same run, is known too.
fn list_lagged_rows(scene: &Scene, by: usize) -> Vec<usize> {
    let rows = scene.runs().iter().flat_map(|run| run.start + by..run.end.max(run.start + by));
    rows.filter(|row| scene.usable_rows()[row - by] && scene.usable_rows()[*row]).collect()
}

/// Does it hold for nearly all of these rows, of which there are some?
fn holds_in_most_rows(rows: &[usize], holds: impl Fn(usize) -> bool) -> bool {
    let held = count_to_f64(rows.iter().filter(|row| holds(**row)).count());
    !rows.is_empty() && held >= REPEATED_SHARE * count_to_f64(rows.len())
}

/// Is a column the output of so many rows before?
fn is_lagged_output(scene: &Scene, column: &[f64], by: usize) -> bool {
    let known = list_lagged_rows(scene, by);
    let equal = |row: usize| (column[row] - scene.recorded_output()[row - by]).abs() <= 1e-6 * column[row].abs();
    let changes = known.iter().any(|row| column[*row] != scene.recorded_output()[*row]);
    holds_in_most_rows(&known, equal) && changes
}

/// Is the output the difference quotient of a column, over the row before or the row after?
fn is_output_rate_of(scene: &Scene, column: &[f64]) -> bool {
    let (time_s, output) = (scene.time_s(), scene.recorded_output());
    let known = list_lagged_rows(scene, 1);
    let rate = |row: usize| (column[row] - column[row - 1]) / (time_s[row] - time_s[row - 1]);
    let size = known.iter().map(|row| rate(*row)).fold(0.0_f64, |most, rate| most.max(rate.abs()));
    let is_of = |at: usize| holds_in_most_rows(&known, |row| (output[row - at] - rate(row)).abs() <= RATE_SHARE * size);
    size > 0.0 && size.is_finite() && (is_of(0) || is_of(1))
}

/// May the search propose this effect beside this model?
#[must_use]
pub(super) fn is_candidate_effect(effect: &dyn Effect, model: &Model) -> bool {
    let kind = effect.doc().kind;
    let listed = model.only.is_empty() || model.only.iter().any(|only| only == kind);
    let excluded =
        model.exclude.iter().any(|excluded| excluded == kind) || kind == BUILDING || kind == CUT && may_hold_cut(model);
    // A part whose every number is fixed may itself be wrong, so its kind stays a candidate.
    let modelled = model.parts.iter().any(|part| part.kind == kind && !part.parameters.iter().all(|p| p.fixed));
    let weighed = INERTIA.contains(&kind) && has_free_inertia_term(model);
    listed && !(excluded || modelled || weighed)
}

/// May the model hold the cut already: as an effect, or in a column of a simulation or a formula?
fn may_hold_cut(model: &Model) -> bool {
    let whole = |part: &Part| matches!(part.body, PartFunction::Linear(_) | PartFunction::Expression(_));
    model.roles.contains_key(&Role::Load) || model.parts.iter().any(|part| part.is_cut() || whole(part))
}

/// Has the model a free coefficient of the acceleration it declares? Another inertia would only mend that column.
fn has_free_inertia_term(model: &Model) -> bool {
    let Some(acceleration) = model.roles.get(&Role::Acceleration) else { return false };
    let weighs = |part: &Part| match &part.body {
        PartFunction::Linear(terms) => {
            let of = |(term, parameter): (&Term, &Parameter)| {
                term.input() == Some(acceleration.as_str()) && !parameter.fixed
            };
            terms.iter().zip(&part.parameters).any(of)
        }
        _ => false,
    };
    model.parts.iter().any(weighs)
}

/// The columns of a part, or of an expression its derivatives by the parameters.
pub(super) fn compute_law_columns(part: &Part, scene: &Scene) -> Option<Vec<Vec<f64>>> {
    match &part.body {
        PartFunction::Expression(_) => {
            (0..part.parameters.len()).map(|index| differentiate_part(part, index, scene)).collect()
        }
        _ => Some(part.compute_columns(scene)?.into_iter().map(|(_, column)| column).collect()),
    }
}

fn differentiate_part(part: &Part, index: usize, scene: &Scene) -> Option<Vec<f64>> {
    let base = part.compute_contribution(scene)?;
    let mut moved = part.clone();
    let step = 1e-4 * moved.parameters[index].value.abs().max(1e-3);
    moved.parameters[index].value += step;
    let ahead = moved.compute_contribution(scene)?;
    Some(ahead.iter().zip(&base).map(|(ahead, base)| (ahead - base) / step).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse_model;
    use recording::read_csv;
    use std::collections::BTreeMap;
    use std::fmt::Write;

    /// A level, and beside it the level of the row before under another name, or one that only resembles it.
    fn repeats(share: f64) -> bool {
        let level = |row: u32| 5.0 + (f64::from(row) / 9.0).sin();
        let mut text = String::from("time_s,before_v,level_v\n");
        for row in 1..200_u32 {
            writeln!(text, "{row},{:.6},{:.6}", share * level(row - 1), level(row)).expect("a string takes it");
        }
        let model =
            "schema = \"model/1\"\noutput = \"level_v\"\n[[effect]]\nkind = \"linear\"\ncolumns = { before_v = 1.0 }\n";
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        let scene = Scene::new(&recording, "level_v", &BTreeMap::new()).expect("recorded");
        repeats_output(&parse_model(model).expect("fine"), &scene)
    }

    #[test]
    fn the_past_of_the_output_is_known_by_its_values() {
        assert!(repeats(1.0));
        assert!(!repeats(1.01));
    }
}
