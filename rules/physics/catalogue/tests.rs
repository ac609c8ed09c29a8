//! Every effect of the catalogue: told completely, finite on a rich recording, silent on a poor one.

use super::CATALOGUE;
use crate::{Effect, Entry, Form, ParameterColumns, Role, Scene, Texts};
use recording::{Cells, Numbers, Recording, Words};
use std::collections::{BTreeMap, BTreeSet};

/// Names of the contract that are laws of the catalogue.
const PUBLIC: &str = "no_load_power cutting_power load_loss offset copper_loss iron_loss inverter_loss field_weakening \
    gear_stage regeneration dry_friction viscous_friction stribeck direction_asymmetry windage bearing_warm_up \
    preload_growth spindle_inertia edge_force flank_wear speed_softening hardness_batch built_up_edge runout chatter \
    entry_exit depth_taper chip_thinning coolant_regime auxiliary_switch axis_friction axis_inertia gravity_axis \
    spindle_growth ambient_drift coolant_temperature screw_growth sensor_gain zero_drift supply_voltage ripple_alias \
    clock_lag meter_window saturation engagement_timing recipe_error constant_load_control override_delay";

/// Kinds whose forms another part finds (the scatter, a search over frequencies) or that need more than 1 Hz.
const WITHOUT_FORMS: [&str; 2] = ["ripple_alias", "runout"];

pub(super) fn set(recording: &mut Recording, name: &str, law: impl Fn(usize) -> f64) {
    let values = (0..recording.count_rows()).map(law).collect();
    recording.set_column(name, Cells::Numbers(Numbers::from_values(values)));
}

pub(super) fn set_words(recording: &mut Recording, name: &str, law: impl Fn(usize) -> String) {
    let words: Vec<String> = (0..recording.count_rows()).map(law).collect();
    recording.set_column(name, Cells::Words(words.iter().map(String::as_str).collect::<Words>()));
}

/// Six runs of ten minutes at 1 Hz: passes of 40 s with pauses of 20 s, every pass other in speed, feed and depth.
fn rich(output: &str) -> Scene {
    const ROWS: usize = 3600;
    let mut recording = Recording::new("rich", (0..ROWS).map(|row| row as f64).collect(), None);
    let pass = |row: usize| (row / 60) as f64;
    let cutting = |row: usize| row % 60 >= 15 && row % 60 < 55;
    let feed = move |row: usize| 60.0 + 20.0 * (pass(row) % 5.0) + if row % 60 > 30 { 30.0 } else { 0.0 };
    let speed = move |row: usize| {
        let ramp = ((row % 60) as f64 / 8.0).min((60 - row % 60) as f64 / 8.0).min(1.0);
        let direction = if (row / 60) % 7 == 6 { -1.0 } else { 1.0 };
        direction * ramp * (400.0 + 350.0 * (pass(row) % 6.0))
    };
    set(&mut recording, "spindle_speed_rpm", speed);
    set(&mut recording, "feed_mm_min", feed);
    set(&mut recording, "depth_of_cut_mm", |row| 0.3 + 0.4 * (pass(row) % 4.0));
    set(&mut recording, "diameter_mm", |row| 20.0 + 10.0 * (pass(row) % 3.0));
    set(&mut recording, "engaged", |row| f64::from(u8::from(cutting(row))));
    for (name, reach) in [("axis_velocity_mm_min", 900.0), ("z_axis_velocity_mm_min", 3000.0)] {
        set(&mut recording, name, |row| reach * (row as f64 / 7.0).sin());
    }
    set(&mut recording, "axis_position_mm", |row| -200.0 * (row as f64 / 7.0).cos());
    for (name, span) in
        [("bearing_temperature_c", 20.0), ("ambient_temperature_c", 4.0), ("coolant_temperature_c", 6.0)]
    {
        set(&mut recording, name, |row| 20.0 + span * (1.0 - (-(row as f64) / 900.0).exp()));
    }
    set(&mut recording, "supply_voltage_v", |row| 400.0 + 10.0 * (row as f64 / 300.0).sin());
    set(&mut recording, "coolant_on", |row| f64::from(u8::from((row / 60) % 3 == 1)));
    set(&mut recording, output, |row| {
        (300.0 + speed(row).abs() * 0.2 + 900.0 * f64::from(u8::from(cutting(row)))).min(1500.0)
    });
    set_words(&mut recording, "run", |row| format!("{}", row / 600 + 1));
    set_words(&mut recording, "lot", |row| ["A", "B", "C"][row / 1200].to_owned());
    set_words(&mut recording, "operation", |row| ["rough", "finish"][(row / 60) % 2].to_owned());
    scene(&recording, output)
}

/// The first column that an effect makes.
pub(super) fn column(effect: &dyn Effect, scene: &Scene, form: &Form) -> Vec<f64> {
    effect.compute_columns(scene, form).expect("makes columns").swap_remove(0).1
}

/// A scene as a model would show it: with a load, a simulation and a vertical axis.
pub(super) fn scene(recording: &Recording, output: &str) -> Scene {
    let roles = BTreeMap::from([(Role::Vertical, "z".to_owned())]);
    let mut scene = Scene::new(recording, output, &roles).expect("the output is recorded");
    let depth = |row: usize| scene.column("depth_of_cut_mm").map_or(1.0, |depth| depth[row]);
    let engaged = |row: usize| scene.role_values(Role::Engaged).map_or(0.0, |engaged| engaged[row]);
    let cut = (0..scene.rows()).map(|row| 800.0 * engaged(row) * depth(row)).collect();
    let simulated = scene.recorded_output().iter().map(|value| 1.1 * value - 50.0).collect();
    scene.set_load(Some(cut));
    scene.set_simulated(Some(simulated));
    scene
}

fn columns_of(effect: &dyn Effect, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
    let columns = effect.compute_columns(scene, form)?;
    let kind = effect.doc().kind;
    for (name, column) in &columns {
        let parameter = effect.doc().find_parameter(name);
        assert!(parameter.is_some_and(|parameter| parameter.entry == Entry::Linear), "{kind}.{name} is not declared");
        assert_eq!(column.len(), scene.rows(), "{kind}.{name}");
        assert!(column.iter().all(|value| value.is_finite()), "{kind}.{name} {form:?} is not finite");
    }
    Some(columns)
}

fn check_scene(scene: &Scene) {
    for effect in CATALOGUE {
        for form in effect.propose_forms(scene) {
            let columns = columns_of(*effect, scene, &form);
            assert!(columns.is_some(), "{} offers {form:?} but cannot make it", effect.doc().kind);
        }
        for form in [effect.default_form(scene), Form::without_shape()] {
            columns_of(*effect, scene, &form);
        }
    }
}

#[test]
fn every_public_name_is_a_law_of_the_catalogue() {
    let public: BTreeSet<&str> = PUBLIC.split_whitespace().collect();
    let kinds: BTreeSet<&str> = CATALOGUE.iter().map(|effect| effect.doc().kind).collect();
    assert_eq!(kinds, public);
    assert_eq!(kinds.len(), CATALOGUE.len(), "kinds are unique");
}

fn is_told(texts: &Texts) -> bool {
    let texts = [texts.name, texts.statement, texts.absence, texts.confused_with, texts.experiment];
    texts.iter().all(|text| !text.trim().is_empty() && !text.ends_with('.') && !text.ends_with('。'))
}

fn is_chinese(text: &str) -> bool {
    text.chars().any(|c| ('\u{4e00}'..='\u{9fff}').contains(&c))
}

#[test]
fn every_effect_is_told_completely_in_both_languages() {
    for effect in CATALOGUE {
        let doc = effect.doc();
        assert!(is_told(&doc.en) && is_told(&doc.zh), "{}", doc.kind);
        assert!(
            [doc.zh.name, doc.zh.statement, doc.zh.absence, doc.zh.experiment].into_iter().all(is_chinese),
            "{}",
            doc.kind
        );
        assert!(doc.law.is_ascii() && !doc.law.is_empty() && !doc.source.is_empty(), "{}", doc.kind);
        assert!(doc.experiment_minutes > 0.0 && !doc.rivals.is_empty(), "{}", doc.kind);
        for rival in doc.rivals {
            assert!(super::find_effect(rival).is_some() && *rival != doc.kind, "{} has no rival {rival}", doc.kind);
        }
    }
}

#[test]
fn every_parameter_has_a_unit_and_a_range() {
    for effect in CATALOGUE {
        let doc = effect.doc();
        let names: BTreeSet<&str> = doc.parameters.iter().map(|parameter| parameter.name).collect();
        assert_eq!(names.len(), doc.parameters.len(), "{}", doc.kind);
        for parameter in doc.parameters {
            let (low, high) = parameter.range;
            assert!(low < high && !parameter.unit.is_empty(), "{}.{}", doc.kind, parameter.name);
            assert!(!parameter.en.is_empty() && is_chinese(parameter.zh), "{}.{}", doc.kind, parameter.name);
            let bounded = low.is_finite() && high.is_finite();
            assert!(bounded || parameter.entry == Entry::Linear, "{}.{} has no bounds", doc.kind, parameter.name);
        }
    }
}

#[test]
fn shapes_of_forms_are_declared_and_in_range() {
    for output in ["spindle_power_w", "axis_current_a", "thermal_error_um"] {
        let scene = rich(output);
        for effect in CATALOGUE {
            for form in effect.propose_forms(&scene).iter().chain([&effect.default_form(&scene)]) {
                for (name, value) in &form.shape {
                    let parameter = effect.doc().find_parameter(name).expect("declared");
                    assert_eq!(parameter.entry, Entry::Shape);
                    let (low, high) = parameter.range;
                    assert!((low..=high).contains(value), "{} {name} = {value}", effect.doc().kind);
                }
            }
        }
    }
}

/// What does not say that it reads the load is not simulated again when the load changes.
#[test]
fn whatever_changes_with_the_load_says_so() {
    for output in ["total_power_w", "axis_current_a", "thermal_error_um", "feed_override_pct", "cutting_force_n"] {
        let scene = rich(output);
        let mut heavier = scene.clone();
        heavier.set_load(scene.load().map(|load| load.iter().map(|load| 1.3 * load + load.signum()).collect()));
        for effect in CATALOGUE {
            for form in effect.propose_forms(&scene).iter().chain([&effect.default_form(&scene)]) {
                let changes = effect.compute_columns(&scene, form) != effect.compute_columns(&heavier, form);
                assert!(!changes || effect.reads_load(), "{} {form:?}", effect.doc().kind);
                let mut lossy = scene.clone();
                lossy.set_load_at_output(heavier.load().map(<[f64]>::to_vec));
                let changes = effect.compute_columns(&scene, form) != effect.compute_columns(&lossy, form);
                assert!(!changes || effect.reads_load_at_output(), "{} {form:?}", effect.doc().kind);
            }
        }
    }
}

#[test]
fn a_rich_recording_offers_every_effect_somewhere() {
    let outputs = ["total_power_w", "axis_current_a", "thermal_error_um", "feed_override_pct", "cutting_force_n"];
    let scenes: Vec<Scene> = outputs.iter().map(|output| rich(output)).collect();
    scenes.iter().for_each(check_scene);
    let offered = |effect: &&&dyn Effect| scenes.iter().any(|scene| !effect.propose_forms(scene).is_empty());
    let silent: BTreeSet<&str> =
        CATALOGUE.iter().filter(|effect| !offered(effect)).map(|effect| effect.doc().kind).collect();
    assert_eq!(silent, BTreeSet::from(WITHOUT_FORMS));
}

#[test]
fn no_effect_panics_on_a_poor_recording() {
    for rows in [1, 2, 7] {
        let mut recording = Recording::new("poor", vec![0.0; rows], None);
        set(&mut recording, "spindle_power_w", |_| 1.0);
        check_scene(&scene(&recording, "spindle_power_w"));
        for name in
            ["spindle_speed_rpm", "feed_mm_min", "engaged", "depth_of_cut_mm", "diameter_mm", "axis_velocity_mm_min"]
        {
            set(&mut recording, name, |_| 0.0);
            check_scene(&scene(&recording, "spindle_power_w"));
        }
        set_words(&mut recording, "run", |row| row.to_string());
        check_scene(&scene(&recording, "spindle_power_w"));
    }
}

#[test]
fn families_stand_together() {
    let mut families: Vec<&str> = CATALOGUE.iter().map(|effect| effect.doc().family).collect();
    families.dedup();
    assert_eq!(families.iter().collect::<BTreeSet<_>>().len(), families.len(), "{families:?}");
}
