//! Each gear or belt stage has its own drag and efficiency.

use crate::drive::read_driven_speed_krpm;
use crate::excitation::{list_speeds_between_levels, compute_ln_count};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use std::collections::BTreeSet;

/// Drag and efficiency of a gear stage.
#[derive(Debug, Clone, Copy)]
pub struct GearStage;

static DOC: EffectDoc = EffectDoc {
    kind: "gear_stage",
    family: "drive",
    law: "y = step + share * L in one stage while it turns; without the channel gear_stage: below a switching speed; sloped: and slope * n / (1000 rpm)",
    parameters: &[
        ParameterDoc::new_linear(
            "step",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "change of no-load output in this stage",
            "该档空载输出的变化",
        ),
        ParameterDoc::new_linear(
            "share",
            "1",
            (-0.4, 0.4),
            "share of the load lost in this stage beyond the others",
            "该档相对其他档多损失的负载比例",
        ),
        ParameterDoc::new_linear(
            "slope",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "change of no-load output in this stage that grows with the speed, at 1000 rpm",
            "该档空载输出随转速增长的变化（1000 rpm下）",
        ),
        ParameterDoc::new_shape("switch_rpm", "rpm", (20.0, 20000.0), "speed below which the stage is engaged", "换档转速"),
    ],
    needs: &["speed | gear_stage"],
    source: "efficiency differs by 2-6 % between stages",
    experiment_minutes: 10.0,
    rivals: &["speed_softening", "field_weakening", "copper_loss", "load_loss"],
    en: Texts {
        name: "gear stage",
        statement: "Each gear or belt stage drags and loses in its own way",
        absence: "on one side of a speed both idle and cut step away from the simulation",
        confused_with: "speed softening (gradual, cut only), field weakening (a bend, not a step)",
        experiment: "run the same speed in both stages, idle and in the same cut",
    },
    zh: Texts {
        name: "档位",
        statement: "每个齿轮或皮带档有各自的阻力和效率",
        absence: "在某一转速的一侧，空转和切削都与仿真出现跳变",
        confused_with: "高速软化（渐变，仅切削）、弱磁（转折而非跳变）",
        experiment: "在两个档位用同一转速，空转并进行相同切削",
    },
};

/// Share of the greatest speed by which two speeds differ between which the stage may change.
const SPEEDS_APART: f64 = 0.006;
/// Speeds tried for the change of stage where no column tells it.
const STAGES_TRIED: usize = 20;

impl Effect for GearStage {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["stage", "speed", SLOPED]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if read_driven_speed_krpm(scene).is_none() {
            return Vec::new();
        }
        let stages = list_stages(scene);
        let ln_choices = compute_ln_count(stages.len());
        if stages.len() > 1 {
            let place = |stage: &i64| Some(("gear_stage".to_owned(), stage.to_string()));
            let form = |name| move |stage: &i64| Form { name, place: place(stage), ln_choices, ..Form::default() };
            return stages.iter().map(form("stage")).chain(stages.iter().map(form(SLOPED))).collect();
        }
        let speeds = list_speeds_between_levels(scene, SPEEDS_APART, STAGES_TRIED);
        let ln_choices = compute_ln_count(speeds.len());
        let form = |name| move |speed: &f64| Form { name, ln_choices, ..Form::from_shape(&[("switch_rpm", *speed)]) };
        speeds.iter().map(form("speed")).chain(speeds.iter().map(form(SLOPED))).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let krpm = read_driven_speed_krpm(scene)?;
        let here: Vec<bool> = match &form.place {
            // Wheels that stand take nothing, whatever stage is engaged.
            Some((column, stage)) => {
                let stage: i64 = stage.parse().ok()?;
                let turning = |(now, n): (&f64, &f64)| now.round() as i64 == stage && *n > 0.001;
                scene.column(column)?.iter().zip(&krpm).map(turning).collect()
            }
            None => {
                let switch = form.shape_value("switch_rpm").unwrap_or(1000.0) / 1000.0;
                krpm.iter().map(|n| *n > 0.001 && *n < switch).collect()
            }
        };
        let mut columns = vec![("step", here.iter().map(|here| f64::from(u8::from(*here))).collect())];
        if let Some(load) = scene.load() {
            let law = |(here, load): (&bool, &f64)| if *here { *load } else { 0.0 };
            columns.push(("share", here.iter().zip(load).map(law).collect()));
        }
        if form.name == SLOPED {
            let law = |(here, n): (&bool, &f64)| if *here { *n } else { 0.0 };
            columns.push(("slope", here.iter().zip(&krpm).map(law).collect()));
        }
        Some(columns)
    }

    fn reads_load(&self) -> bool {
        true
    }

    fn default_form(&self, scene: &Scene) -> Form {
        let speed = Form { name: "speed", ..Form::from_shape(&[("switch_rpm", 1000.0)]) };
        self.propose_forms(scene).into_iter().next().unwrap_or(speed)
    }
}

/// The stage that also takes more or less the faster it turns.
const SLOPED: &str = "sloped";

/// The stages in use, in rising order; at most eight.
fn list_stages(scene: &Scene) -> Vec<i64> {
    let stages = scene.column("gear_stage").unwrap_or_default().iter().map(|stage| stage.round() as i64);
    stages.collect::<BTreeSet<_>>().into_iter().take(8).collect()
}
