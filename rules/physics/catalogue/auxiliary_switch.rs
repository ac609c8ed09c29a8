//! A consumer goes on and off: coolant, hydraulics, chip conveyor, chiller.

use crate::drive::{is_axis_output, is_power};
use crate::excitation::{compute_ln_count, has_variation};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// A consumer that goes on and off.
#[derive(Debug, Clone, Copy)]
pub struct AuxiliarySwitch;

static DOC: EffectDoc = EffectDoc {
    kind: "auxiliary_switch",
    family: "auxiliary",
    law: "P = level while the consumer runs",
    parameters: &[ParameterDoc::new_linear(
        "level",
        "output",
        (0.0, f64::INFINITY),
        "power of the consumer",
        "该用电设备的功率",
    )],
    needs: &["coolant_on | hydraulics_on | a column ending in _on | the recorded output"],
    source: "coolant 0.3-1.5 kW, high-pressure coolant 2-7 kW, hydraulics 0.5-2 kW in cycles of 5-60 s",
    experiment_minutes: 4.0,
    rivals: &["offset", "coolant_regime", "zero_drift", "hardness_batch"],
    en: Texts {
        name: "auxiliary consumer",
        statement: "A pump, conveyor or chiller goes on and off without the simulation knowing",
        absence: "the residual jumps between two levels at moments that speed and cut do not explain, idle as in the cut",
        confused_with: "a constant offset (never off), material or coolant in the cut (scale with the cut)",
        experiment: "switch coolant, hydraulics and conveyor on and off by hand, half a minute each, at standstill",
    },
    zh: Texts {
        name: "辅助设备启停",
        statement: "泵、排屑器或冷却机启停，而仿真不知道",
        absence: "残差在两个水平之间跳变，与转速和切削无关，空转和切削时都有",
        confused_with: "常量偏差（从不断开）、材料或冷却状态（与切削成比例）",
        experiment: "静止状态下手动启停冷却泵、液压和排屑器，各半分钟",
    },
};

impl Effect for AuxiliarySwitch {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["flag", "latent"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if !is_power(scene) || is_axis_output(scene) {
            return Vec::new();
        }
        let names = scene.column_names().filter(|name| name.ends_with("_on") && *name != "drive_on");
        let flags: Vec<&str> = names.filter(|name| scene.column(name).is_some_and(has_variation)).collect();
        let ln_choices = compute_ln_count(flags.len());
        let place = |flag: &&str| Some(((*flag).to_owned(), "1".to_owned()));
        flags.iter().map(|flag| Form { name: "flag", place: place(flag), ln_choices, ..Form::default() }).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        if form.name == "latent" {
            return Some(vec![("level", scene.unrecorded_state())]);
        }
        let (flag, _) = form.place.as_ref()?;
        Some(vec![("level", scene.column(flag)?.to_vec())])
    }

    fn has_hidden_state(&self) -> bool {
        true
    }
}
