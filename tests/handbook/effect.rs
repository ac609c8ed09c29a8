//! A template: the least that an effect is. A lamp that is on while the spindle turns; chapter `inside` says what else
//! belongs to an effect.

use adapters::Recording;
use adapters::recording::{Cells, Numbers};
use rules::physics::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};
use std::collections::BTreeMap;

/// The spindle counts as turning above this speed, rpm. Encoders show a few turns at rest; no spindle cuts this slowly.
const TURNS_RPM: f64 = 10.0;

/// A lamp in the working area that goes on with the spindle.
#[derive(Debug, Clone, Copy)]
struct WorkLamp;

static DOC: EffectDoc = EffectDoc {
    kind: "work_lamp",
    family: "auxiliary",
    law: "P = level while the spindle turns",
    parameters: &[ParameterDoc::new_linear("level", "output", (0.0, f64::INFINITY), "power of the lamp", "灯的功率")],
    needs: &["speed"],
    source: "a constant consumer, switched with the spindle",
    experiment_minutes: 2.0,
    rivals: &["offset", "no_load_power"],
    en: Texts {
        name: "work lamp",
        statement: "A lamp that is on while the spindle turns",
        absence: "the recording lies a constant amount above the simulation whenever the spindle turns, at any speed",
        confused_with: "no-load power at the slowest speed (it grows with speed), an offset (it is there at rest too)",
        experiment: "run idle at two speeds, and one minute at rest",
    },
    zh: Texts {
        name: "工作灯",
        statement: "主轴旋转时亮起的灯",
        absence: "主轴旋转时实测值比仿真值高出一个常量，与转速无关",
        confused_with: "最低转速下的空载功率（随转速增大）、常量偏差（静止时也存在）",
        experiment: "以两档转速空转，再静止一分钟",
    },
};

fn turning(scene: &Scene) -> Option<Vec<f64>> {
    let speed = scene.role_values(Role::Speed)?;
    Some(speed.iter().map(|rpm| f64::from(u8::from(rpm.abs() > TURNS_RPM))).collect())
}

impl Effect for WorkLamp {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    /// Offered only where the spindle both turned and stood; otherwise it is an offset.
    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let told = turning(scene).is_some_and(|on| on.contains(&0.0) && on.contains(&1.0));
        if told { vec![Form::without_shape()] } else { Vec::new() }
    }

    fn compute_columns(&self, scene: &Scene, _form: &Form) -> Option<ParameterColumns> {
        Some(vec![("level", turning(scene)?)])
    }
}

fn scene(speeds_rpm: &[f64]) -> Scene {
    let times_s = (0..speeds_rpm.len()).map(|row| f64::from(u32::try_from(row).expect("few rows"))).collect();
    let mut recording = Recording::new("template", times_s, None);
    recording.set_column("spindle_speed_rpm", Cells::Numbers(Numbers::from_values(speeds_rpm.to_vec())));
    let power_w = speeds_rpm.iter().map(|rpm| 100.0 + 0.2 * rpm).collect();
    recording.set_column("spindle_power_w", Cells::Numbers(Numbers::from_values(power_w)));
    Scene::new(&recording, "spindle_power_w", &BTreeMap::new()).expect("the output is recorded")
}

#[test]
fn an_effect_is_offered_where_it_can_be_told_and_nowhere_else() {
    let rich = scene(&[0.0, 0.0, 800.0, 800.0, 1500.0]);
    let forms = WorkLamp.propose_forms(&rich);
    assert_eq!(forms, [Form::without_shape()]);
    let columns = WorkLamp.compute_columns(&rich, &forms[0]).expect("the speed is recorded");
    assert_eq!(columns, [("level", vec![0.0, 0.0, 1.0, 1.0, 1.0])]);
    assert!(columns.iter().all(|(name, _)| DOC.find_parameter(name).is_some()), "every column is a declared parameter");
    assert!(WorkLamp.propose_forms(&scene(&[800.0, 900.0])).is_empty(), "it never stands still");
}
