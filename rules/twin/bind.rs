//! Binding a model to a recording: forms and missing parameters are completed, missing inputs are named.

use super::model::{Model, Parameter, Part, PartFunction};
use physics::{Entry, Role, Scene};

/// Completes every part for this scene.
///
/// # Errors
/// Every part that cannot be simulated over this recording, and what to record.
pub fn bind_model(model: &Model, scene: &Scene) -> Result<Vec<Part>, Vec<String>> {
    let mut problems = Vec::new();
    let parts = model.parts.iter().map(|part| complete_part(part, scene)).collect::<Vec<_>>();
    // Some laws need the load or the output that other parts simulate; a stand-in tells inputs from those.
    let mut stand_in = scene.clone();
    stand_in.set_load(Some(vec![1.0; scene.rows()]));
    stand_in.set_simulated(Some(vec![1.0; scene.rows()]));
    for part in &parts {
        if part.compute_contribution(&stand_in).is_none() {
            problems.push(describe_missing_input(part, scene));
        }
    }
    let load_known = scene.load().is_some() || parts.iter().any(Part::is_cut);
    for part in parts.iter().filter(|part| part.kind == "load_loss" && !load_known) {
        problems.push(format!("{} (line {}) needs a cutting_power in the model or a role load", part.kind, part.line));
    }
    if problems.is_empty() { Ok(parts) } else { Err(problems) }
}

fn complete_part(part: &Part, scene: &Scene) -> Part {
    let mut part = part.clone();
    let PartFunction::Effect(effect, form) = &mut part.body else { return part };
    let effect = *effect;
    let mut stand_in = scene.clone();
    stand_in.set_load(Some(vec![1.0; scene.rows()]));
    stand_in.set_simulated(Some(vec![1.0; scene.rows()]));
    let default = effect.default_form(&stand_in);
    if form.name.is_empty() {
        form.name = default.name;
    }
    let known = |parameters: &[Parameter], name: &str| parameters.iter().any(|parameter| parameter.name == name);
    for (name, value) in &default.shape {
        if !known(&part.parameters, name) {
            let doc = effect.doc().find_parameter(name);
            part.parameters.push(build_parameter(name, *value, Entry::Shape, doc.map(|doc| (doc.range, doc.unit))));
        }
    }
    let shaped = physics::Form { shape: default.shape.clone(), ..form.clone() };
    for (name, _) in effect.compute_columns(&stand_in, &shaped).unwrap_or_default() {
        if !known(&part.parameters, name) {
            let doc = effect.doc().find_parameter(name);
            part.parameters.push(build_parameter(name, 0.0, Entry::Linear, doc.map(|doc| (doc.range, doc.unit))));
        }
    }
    part
}

fn build_parameter(name: &str, value: f64, entry: Entry, doc: Option<((f64, f64), &str)>) -> Parameter {
    let (range, unit) = doc.unwrap_or(((f64::NEG_INFINITY, f64::INFINITY), "output"));
    Parameter { name: name.to_owned(), value, fixed: false, entry, range, unit: unit.to_owned() }
}

/// Which of an effect's needs the recording does not meet, each with the channels that would.
fn describe_unmet_needs(needs: &[&str], scene: &Scene) -> String {
    let met = |name: &str| {
        scene.column(name).is_some() || Role::from_name(name).is_some_and(|role| scene.role_values(role).is_some())
    };
    let lacking: Vec<String> = needs
        .iter()
        .filter(|need| !need.split('|').any(|name| met(name.trim())))
        .map(|need| need.split('|').map(|name| describe_channels(name.trim())).collect::<Vec<_>>().join(" or "))
        .collect();
    if lacking.is_empty() { needs.join(", ") } else { lacking.join(" and ") }
}

/// The channels that provide what an effect calls by its role, or that it is computed from.
fn describe_channels(need: &str) -> String {
    match (Role::from_name(need).and_then(|role| role.default_channels().first()), need) {
        (Some(channel), _) => format!("{need} ({channel})"),
        (None, "cutting_speed_m_min") => format!("{need} (or diameter_mm and spindle_speed_rpm)"),
        (None, "feed_per_rev_mm") => format!("{need} (or feed_mm_min and spindle_speed_rpm)"),
        (None, "removal_rate_cm3_min") => format!("{need} (or depth_of_cut_mm, width_of_cut_mm and feed_mm_min)"),
        (None, _) => need.to_owned(),
    }
}

fn describe_missing_input(part: &Part, scene: &Scene) -> String {
    let place = format!("{} (line {})", part.label(), part.line);
    let unknown = |name: &&str| super::channel::read_channel_values(scene, name).is_none();
    let over: Vec<&str> = part.departures.iter().map(|departure| departure.over.as_str()).filter(unknown).collect();
    if !over.is_empty() {
        return format!("{place} departs from its law over {}: record it", over.join(", "));
    }
    let absent = part.inputs().into_iter().filter(unknown).collect::<Vec<_>>().join(", ");
    match &part.body {
        PartFunction::Linear(_) => format!("{place} needs the columns {absent}: record them"),
        PartFunction::Expression(_) if absent.is_empty() => {
            format!("{place}: the expression fails on this recording (a result that is no finite number)")
        }
        PartFunction::Expression(_) => {
            format!("{place} needs {absent}: record these columns or give them as parameters")
        }
        PartFunction::Table(_) => {
            format!("{place} needs the spindle speed: record spindle_speed_rpm or declare the role speed")
        }
        PartFunction::Effect(effect, _) => {
            format!("{place} needs {}: record it, or declare a role", describe_unmet_needs(effect.doc().needs, scene))
        }
    }
}
