//! Above its base speed the motor is run with a weakened field: currents and losses change there.

use crate::drive::{read_driven_speed_krpm, is_power};
use crate::excitation::{list_speeds_between_levels, compute_ln_count};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Change of losses above base speed.
#[derive(Debug, Clone, Copy)]
pub struct FieldWeakening;

static DOC: EffectDoc = EffectDoc {
    kind: "field_weakening",
    family: "drive",
    law: "P = magnetising * (n - nb) / 1000 rpm + per_load2 * L^2 * 1 / nb^2, both for n > nb only; in excess of a copper loss that is known below nb: 1 / nb^2 - 1 / n^2; n, nb in 1000 rpm",
    parameters: &[
        ParameterDoc::new_linear(
            "magnetising",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "change of no-load power per 1000 rpm above base speed",
            "基速以上每1000 rpm空载功率的变化",
        ),
        ParameterDoc::new_linear(
            "per_load2",
            "1/output",
            (-1.0, 1.0),
            "loss per squared load above base speed",
            "基速以上单位负载平方的损耗",
        ),
        ParameterDoc::new_shape("base_speed_rpm", "rpm", (200.0, 20000.0), "base speed of the motor", "电机基速"),
    ],
    needs: &["speed"],
    source: "torque constant proportional to nb / n above base speed, so that copper loss grows from T^2 to T^2 (n / nb)^2; nb 750-3000 rpm",
    experiment_minutes: 12.0,
    rivals: &["gear_stage", "windage", "copper_loss", "speed_softening"],
    en: Texts {
        name: "field weakening",
        statement: "Above its base speed the motor runs with a weakened field and needs more current for the same torque",
        absence: "no-load power bends at one speed, and above it heavy cuts take more than simulated",
        confused_with: "gear stage (a step rather than a bend), windage (bends everywhere)",
        experiment: "run idle at three speeds on each side of the suspected base speed, then the same heavy cut on each side",
    },
    zh: Texts {
        name: "弱磁",
        statement: "高于基速时电机弱磁运行，相同转矩需要更大电流",
        absence: "空载功率在某一转速处转折，高于该转速时重切实测偏大",
        confused_with: "档位（跳变而非转折）、风阻（处处弯曲）",
        experiment: "在疑似基速两侧各取三档转速空转，再在两侧进行相同的重切",
    },
};

/// Share of the greatest speed by which two speeds differ between which the bend may lie.
const SPEEDS_APART: f64 = 0.03;
/// Speeds tried for the bend.
const BENDS_TRIED: usize = 5;

impl Effect for FieldWeakening {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["whole", "excess"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if read_driven_speed_krpm(scene).is_none() {
            return Vec::new();
        }
        let speeds = list_speeds_between_levels(scene, SPEEDS_APART, BENDS_TRIED);
        let names = if has_output_load(scene) { self.form_names() } else { &["whole"] };
        let ln_choices = compute_ln_count(speeds.len() * names.len());
        let form = |name, speed: &f64| Form { name, ln_choices, ..Form::from_shape(&[("base_speed_rpm", *speed)]) };
        names.iter().flat_map(|name| speeds.iter().map(move |speed| form(name, speed))).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let krpm = read_driven_speed_krpm(scene)?;
        let base = form.shape_value("base_speed_rpm").unwrap_or(1500.0) / 1000.0;
        let mut columns = vec![("magnetising", krpm.iter().map(|n| (n - base).max(0.0)).collect())];
        if let Some(load) = scene.load().filter(|_| has_output_load(scene)) {
            let below = |n: f64| if form.name == "excess" { n.powi(-2) } else { 0.0 };
            let law = |(n, load): (&f64, &f64)| if *n > base { load * load * (base.powi(-2) - below(*n)) } else { 0.0 };
            columns.push(("per_load2", krpm.iter().zip(load).map(law).collect()));
        }
        Some(columns)
    }

    fn reads_load(&self) -> bool {
        true
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form { name: "whole", ..Form::from_shape(&[("base_speed_rpm", 1500.0)]) }
    }
}

/// Is there a load whose losses are of this output?
fn has_output_load(scene: &Scene) -> bool {
    is_power(scene) && scene.load().is_some()
}
