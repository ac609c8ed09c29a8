//! The hypotheses of a search: every form of every effect the scene can excite, as columns.

use super::frame::Frame;
use super::model::{Model, Parameter, Part, PartFunction};
use super::noise::Arma;
use super::term::Term;
use crate::physics::{CATALOGUE, Effect, Form, Role, Scene};
use crate::statistics::count;

/// Kinds that build a model and are never a finding by themselves.
const BUILDING: [&str; 2] = ["no_load_power", "cutting_power"];

/// What a flexible or seldom cause must explain beyond the price of its parameters, in units of information: whoever
/// bends at a threshold, steps at any word or acts at edges only imitates others easily.
fn reluctance(kind: &str, form: &Form) -> f64 {
    match kind {
        // A stage that is recorded has not been chosen to fit.
        "gear_stage" if form.place.is_some() => 0.0,
        "gear_stage" | "field_weakening" | "entry_exit" | "chatter" | "recipe_error" => 6.0,
        "zero_drift" => 14.0,
        "saturation" => 10.0,
        "sensor_gain" | "built_up_edge" | "chip_thinning" | "engagement_timing" | "override_delay" => 3.0,
        "inverter_loss" | "iron_loss" | "direction_asymmetry" | "depth_taper" | "meter_window" => 2.0,
        _ => 0.0,
    }
}

/// Kinds that act at the edges of the engagement or the feed only: one of them at a time, or they mend each other's form.
pub(super) const AT_EDGES: [&str; 5] =
    ["clock_lag", "meter_window", "engagement_timing", "entry_exit", "override_delay"];

/// Would a hypothesis of these kinds be twice the same cause?
#[must_use]
pub fn excludes(present: &str, added: &str) -> bool {
    present == added || AT_EDGES.contains(&present) && AT_EDGES.contains(&added)
}

/// One hypothesis: an effect in one form.
#[derive(Clone)]
pub struct Design {
    /// Kind of the effect, or the name of the user's hypothesis.
    pub kind: String,
    /// The part it would add, its linear parameters at zero.
    pub part: Part,
    /// Columns per linear parameter, per group.
    pub columns: Vec<Vec<f64>>,
    /// Physically possible values of the linear parameters.
    pub ranges: Vec<(f64, f64)>,
    /// Parameters it adds, shape parameters included.
    pub freedom: usize,
    /// Natural logarithm of the number of alternatives of the same freedom.
    pub ln_choices: f64,
    /// Price beyond the parameters and the choice, in units of information.
    pub reluctance: f64,
    /// The noise beside it, where that is known: what hides in slow noise is not seen from there.
    pub noise: Option<Arma>,
}

impl Design {
    /// The name of the form where the forms of a kind are laws of their own that a scan, which moves no time constant,
    /// hardly tells apart.
    #[must_use]
    pub fn law(&self) -> &'static str {
        match &self.part.body {
            PartFunction::Effect(_, form) if ["meter_window", "dry_friction"].contains(&self.kind.as_str()) => {
                form.name
            }
            _ => "",
        }
    }
}

/// Every hypothesis that this scene, with the load and output simulated by the baseline, can tell anything about.
#[must_use]
pub fn designs(scene: &Scene, frame: &Frame, model: &Model) -> Vec<Design> {
    let mut all = designs_of(scene, frame, model, |_| true);
    all.extend(model.hypotheses.iter().filter_map(|part| hypothesis(part, scene, frame)));
    all
}

/// The same of some kinds of the catalogue only.
pub(super) fn designs_of(scene: &Scene, frame: &Frame, model: &Model, takes: impl Fn(&str) -> bool) -> Vec<Design> {
    let mut all = Vec::new();
    let recursive = shifts_time_in_vain(model, scene);
    for effect in CATALOGUE.iter().filter(|effect| takes(effect.doc().kind)) {
        let shifts_time = ["clock_lag", "meter_window"].contains(&effect.doc().kind);
        if wanted(*effect, model) && !(recursive && shifts_time) {
            all.extend(effect.forms(scene).iter().filter_map(|form| design(*effect, form, scene, frame)));
        }
    }
    all
}

/// Would a shift in time explain anything of this model and mean nothing?
pub(super) fn shifts_time_in_vain(model: &Model, scene: &Scene) -> bool {
    reads_output(model) || repeats_output(model, scene)
}

/// Does the model predict the output from its own past? Then a shift in time explains anything and means nothing.
fn reads_output(model: &Model) -> bool {
    model.parts.iter().any(|part| part.inputs().contains(&model.output.as_str()))
}

/// Rows by which a column may repeat the output.
const REPEATED_ROWS: usize = 3;
/// Share of the rows in which it must.
const REPEATED_SHARE: f64 = 0.98;
/// Share of the greatest rate by which an output that is a rate may miss it: both are rounded.
const RATE_SHARE: f64 = 1e-3;

/// Is a column that the model reads the output of a few rows before, under a name of its own - or is the output nothing
/// but the rate at which such a column changes? A meter that is late would be late in both.
fn repeats_output(model: &Model, scene: &Scene) -> bool {
    let of = |name: &str| {
        let Some(column) = scene.column(name) else { return false };
        (1..=REPEATED_ROWS).any(|by| repeats(scene, column, by)) || is_rate_of(scene, column)
    };
    model.parts.iter().flat_map(Part::inputs).any(of)
}

/// Rows of which the row so many before, in the same run, is known too.
fn known_after(scene: &Scene, by: usize) -> Vec<usize> {
    let rows = scene.runs().iter().flat_map(|run| run.start + by..run.end.max(run.start + by));
    rows.filter(|row| scene.usable()[row - by] && scene.usable()[*row]).collect()
}

/// Does it hold for nearly all of these rows, of which there are some?
fn holds_in_most(rows: &[usize], holds: impl Fn(usize) -> bool) -> bool {
    let held = count(rows.iter().filter(|row| holds(**row)).count());
    !rows.is_empty() && held >= REPEATED_SHARE * count(rows.len())
}

/// Is a column the output of so many rows before?
fn repeats(scene: &Scene, column: &[f64], by: usize) -> bool {
    let known = known_after(scene, by);
    let equal = |row: usize| (column[row] - scene.recorded()[row - by]).abs() <= 1e-6 * column[row].abs();
    let changes = known.iter().any(|row| column[*row] != scene.recorded()[*row]);
    holds_in_most(&known, equal) && changes
}

/// Is the output the difference quotient of a column, over the row before or the row after?
fn is_rate_of(scene: &Scene, column: &[f64]) -> bool {
    let (time_s, output) = (scene.time_s(), scene.recorded());
    let known = known_after(scene, 1);
    let rate = |row: usize| (column[row] - column[row - 1]) / (time_s[row] - time_s[row - 1]);
    let size = known.iter().map(|row| rate(*row)).fold(0.0_f64, |most, rate| most.max(rate.abs()));
    let is_of = |at: usize| holds_in_most(&known, |row| (output[row - at] - rate(row)).abs() <= RATE_SHARE * size);
    size > 0.0 && size.is_finite() && (is_of(0) || is_of(1))
}

/// May the search propose this effect beside this model?
#[must_use]
pub fn wanted(effect: &dyn Effect, model: &Model) -> bool {
    let kind = effect.doc().kind;
    let listed = model.only.is_empty() || model.only.iter().any(|only| only == kind);
    let excluded = model.exclude.iter().any(|excluded| excluded == kind) || BUILDING.contains(&kind);
    // A part whose every number is fixed may itself be wrong, so its kind stays a candidate.
    let modelled = model.parts.iter().any(|part| part.kind == kind && !part.parameters.iter().all(|p| p.fixed));
    let weighed = INERTIA.contains(&kind) && weighs_acceleration(model);
    listed && !(excluded || modelled || weighed)
}

/// Kinds that a coefficient of the acceleration already is.
const INERTIA: [&str; 2] = ["axis_inertia", "spindle_inertia"];

/// Has the model a free coefficient of the acceleration it declares? Another inertia would only mend that column.
fn weighs_acceleration(model: &Model) -> bool {
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

/// The columns of one form.
#[must_use]
pub fn design(effect: &'static dyn Effect, form: &Form, scene: &Scene, frame: &Frame) -> Option<Design> {
    debug_assert!(form.name.is_empty() || effect.form_names().contains(&form.name), "{:?}", form.name);
    let columns = effect.columns(scene, form)?;
    let names: Vec<&'static str> = columns.iter().map(|(name, _)| *name).collect();
    let part = Part::candidate(effect, form, &names);
    let ranges = names.iter().map(|name| part.parameter(name).map_or(ANY, |parameter| parameter.range)).collect();
    let columns: Vec<Vec<f64>> = columns.iter().map(|(_, column)| frame.reduce(column)).collect();
    let usable = columns.iter().all(|column| column.iter().all(|x| x.is_finite()));
    usable.then(|| Design {
        kind: effect.doc().kind.to_owned(),
        // That the tools wear is told by the feed drive already; only what it costs here is open.
        freedom: if form.name == "followed" { 0 } else { names.len() + form.shape.len() - form.known.len() },
        ln_choices: form.ln_choices,
        reluctance: reluctance(effect.doc().kind, form),
        noise: None,
        part,
        columns,
        ranges,
    })
}

const ANY: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// A user's hypothesis: the law at its nominal parameters, and its derivatives by them, as columns.
fn hypothesis(part: &Part, scene: &Scene, frame: &Frame) -> Option<Design> {
    let columns = law_columns(part, scene)?;
    let columns: Vec<Vec<f64>> = columns.iter().map(|column| frame.reduce(column)).collect();
    let ranges = vec![ANY; columns.len()];
    Some(Design {
        kind: part.label().to_owned(),
        part: part.clone(),
        freedom: columns.len(),
        ln_choices: 0.0,
        reluctance: 0.0,
        noise: None,
        columns,
        ranges,
    })
}

/// The columns of a part, or of an expression its derivatives by the parameters.
pub(super) fn law_columns(part: &Part, scene: &Scene) -> Option<Vec<Vec<f64>>> {
    match &part.body {
        PartFunction::Expression(_) => (0..part.parameters.len()).map(|index| derivative(part, index, scene)).collect(),
        _ => Some(part.columns(scene)?.into_iter().map(|(_, column)| column).collect()),
    }
}

fn derivative(part: &Part, index: usize, scene: &Scene) -> Option<Vec<f64>> {
    let base = part.contribution(scene)?;
    let mut moved = part.clone();
    let step = 1e-4 * moved.parameters[index].value.abs().max(1e-3);
    moved.parameters[index].value += step;
    let ahead = moved.contribution(scene)?;
    Some(ahead.iter().zip(&base).map(|(ahead, base)| (ahead - base) / step).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::parse_model;
    use adapters::recording::read_csv;
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
