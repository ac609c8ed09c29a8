//! The meter shows a fixed share too much or too little.

use crate::excitation::{
    FOLLOWED, build_step_forms, compute_recording_share, follow_step_form, has_variation, mark_rows_since_run,
};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Gain of the meter.
#[derive(Debug, Clone, Copy)]
pub struct SensorGain;

static DOC: EffectDoc = EffectDoc {
    kind: "sensor_gain",
    family: "measurement",
    law: "y = gain * S, S the simulated output; from one run on, or growing as share of the recording - 1/2; followed: from some run of a stretch on, as the earlier rows of each run tell",
    parameters: &[
        ParameterDoc::new_linear(
            "gain",
            "1",
            (-0.5, 0.5),
            "share by which the meter shows too much",
            "仪表多显示的比例",
        ),
        ParameterDoc::new_shape(
            "height",
            "1",
            (-0.5, 0.5),
            "the gain that is looked for in runs in which it may have begun",
            "在可能已开始的运行中查找的比例",
        ),
        ParameterDoc::new_shape(
            "deviation",
            "output",
            (0.0, 1e9),
            "noise behind which it is looked for",
            "识别变化时的噪声",
        ),
    ],
    needs: &["the simulated output"],
    source: "current transformers and shunts: 1-3 %",
    experiment_minutes: 5.0,
    rivals: &["cutting_power", "load_loss", "hardness_batch", "supply_voltage"],
    en: Texts {
        name: "meter gain",
        statement: "The meter shows a fixed share too much or too little",
        absence: "the residual is the same share of the output in every state, also idle; the controller's own current does not follow",
        confused_with: "harder material (only in the cut), load loss (only in the cut), supply voltage (comes and goes)",
        experiment: "compare the meter with a second one, or with the controller's load, idle and in the cut",
    },
    zh: Texts {
        name: "仪表增益误差",
        statement: "仪表按固定比例偏大或偏小",
        absence: "残差在所有状态下（包括空转）都是输出的同一比例，控制器自身电流不跟随",
        confused_with: "材料变硬（仅切削时）、负载损耗（仅切削时）、供电电压（时有时无）",
        experiment: "空转和切削时与另一台仪表或控制器负载比较",
    },
};

impl Effect for SensorGain {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["constant", "drift", "step", FOLLOWED]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if !scene.simulated_output().is_some_and(has_variation) {
            return Vec::new();
        }
        let mut forms = vec![Form { name: "constant", ..Form::without_shape() }, Form { name: "drift", ..Form::without_shape() }];
        forms.extend(build_step_forms(scene, "step"));
        forms
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let simulated = scene.simulated_output()?;
        let factor = match (form.name, &form.place) {
            (FOLLOWED, _) => follow_step_form(scene, form, simulated)?,
            ("step", Some((_, run))) => mark_rows_since_run(scene, run)?,
            ("drift", _) => compute_recording_share(scene).iter().map(|share| share - 0.5).collect(),
            _ => vec![1.0; scene.rows()],
        };
        Some(vec![("gain", simulated.iter().zip(&factor).map(|(value, factor)| value * factor).collect())])
    }

    fn is_followed(&self, form: &Form) -> bool {
        form.name == FOLLOWED
    }

    fn find_followed_form(&self, form: &Form) -> Option<&'static str> {
        (form.name == "step").then_some(FOLLOWED)
    }
}
