//! A constant that the simulation lacks.

use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// A constant in the output.
#[derive(Debug, Clone, Copy)]
pub struct Offset;

static DOC: EffectDoc = EffectDoc {
    kind: "offset",
    family: "measurement",
    law: "y = level",
    parameters: &[ParameterDoc::new_linear("level", "output", (f64::NEG_INFINITY, f64::INFINITY), "the constant", "常量")],
    needs: &[],
    source: "definition",
    experiment_minutes: 1.0,
    rivals: &["zero_drift", "direction_asymmetry", "gravity_axis"],
    en: Texts {
        name: "constant offset",
        statement: "The recording lies a constant amount above or below the simulation, whatever the machine does",
        absence: "the residual has the same mean in every state, also at standstill",
        confused_with: "a slowly drifting zero (it changes over hours), weight on an axis (only where the axis is declared vertical)",
        experiment: "record one minute at standstill with the drives on",
    },
    zh: Texts {
        name: "常量偏差",
        statement: "无论机床处于何种状态，实测值与仿真值之间都相差一个常量",
        absence: "残差在所有状态下均值相同，静止时也一样",
        confused_with: "零点漂移（随时间缓慢变化）、垂直轴重力（仅当声明了垂直轴）",
        experiment: "驱动使能、静止状态下记录一分钟",
    },
};

impl Effect for Offset {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, _scene: &Scene) -> Vec<Form> {
        vec![Form::without_shape()]
    }

    fn may_depart(&self) -> bool {
        false
    }

    fn compute_columns(&self, scene: &Scene, _form: &Form) -> Option<ParameterColumns> {
        Some(vec![("level", vec![1.0; scene.rows()])])
    }
}
