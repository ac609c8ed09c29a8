//! A consumer goes on and off: coolant, hydraulics, chip conveyor, chiller.

use crate::drive::{is_axis_output, is_power};
use crate::excitation::{compute_ln_count, has_variation};
use crate::two_levels::{TwoLevels, predict_on_probability};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// A consumer that goes on and off.
#[derive(Debug, Clone, Copy)]
pub struct AuxiliarySwitch;

static DOC: EffectDoc = EffectDoc {
    kind: "auxiliary_switch",
    family: "auxiliary",
    law: "P = level while the consumer runs; latent: P = step * chance that it runs, from the earlier rows of the run",
    parameters: &[
        ParameterDoc::new_linear("level", "output", (0.0, 1e9), "power of the consumer", "该用电设备的功率"),
        ParameterDoc::new_linear(
            "share",
            "1",
            (0.0, 1.0),
            "whole: the step is the power of the consumer",
            "整体：阶跃即该用电设备的功率",
        ),
        ParameterDoc::new_shape(
            "step",
            "output",
            (0.0, 1e9),
            "power of a consumer that nobody records",
            "未被记录的用电设备的功率",
        ),
        ParameterDoc::new_shape(
            "deviation",
            "output",
            (0.0, 1e9),
            "noise behind which it is looked for",
            "识别该设备时的噪声",
        ),
        ParameterDoc::new_shape("memory", "1", (0.0, 0.99), "share of the noise that stays from row to row", "逐行保留的噪声比例"),
        ParameterDoc::new_shape("dwell_s", "s", (0.001, 1e7), "mean time in one state", "每个状态的平均时间"),
        ParameterDoc::new_shape("share_on", "1", (0.0, 1.0), "share of the time in which it runs", "运行时间的比例"),
    ],
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
        &["flag", LATENT]
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
        if form.name == LATENT {
            return follow_latent_consumer(scene, form);
        }
        let (flag, _) = form.place.as_ref()?;
        Some(vec![("level", scene.column(flag)?.to_vec())])
    }

    fn has_hidden_state(&self) -> bool {
        true
    }

    fn is_followed(&self, form: &Form) -> bool {
        form.name == LATENT
    }
}

/// The form of a consumer that nobody records.
pub const LATENT: &str = "latent";

/// While it is fitted, its level for each row in which it was found on; in a simulation what is expected of it.
fn follow_latent_consumer(scene: &Scene, form: &Form) -> Option<ParameterColumns> {
    let value = |name| form.shape_value(name);
    // Only the part that is being fitted has a level and no step.
    if value("step").is_none() {
        return Some(vec![("level", scene.unrecorded_state()?.to_vec())]);
    }
    let levels = TwoLevels {
        step: value("step")?,
        deviation: value("deviation")?,
        memory: value("memory")?,
        dwell_s: value("dwell_s")?,
        share: value("share_on")?,
    };
    let simulated = scene.simulated_output()?;
    let left: Vec<f64> = scene.recorded_output().iter().zip(simulated).map(|(y, f)| y - f).collect();
    let on = predict_on_probability(scene, &left, levels);
    Some(vec![("share", on.into_iter().map(|on| levels.step * on).collect())])
}
