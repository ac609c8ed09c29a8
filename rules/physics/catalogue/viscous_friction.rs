//! Friction that grows in proportion to speed.

use adapter_core::channel::quantity::Quantity;
use crate::drive::{is_power, read_motion};
use crate::excitation::propose_plain_form;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Friction in proportion to speed.
#[derive(Debug, Clone, Copy)]
pub struct ViscousFriction;

static DOC: EffectDoc = EffectDoc {
    kind: "viscous_friction",
    family: "axis",
    law: "F = coefficient * v; in a power: P = coefficient * v^2; v in m/s, of a spindle in rad/s",
    parameters: &[ParameterDoc::new_linear(
        "coefficient",
        "friction/velocity",
        (0.0, f64::INFINITY),
        "friction per speed; of a spindle per rad/s; in a power per squared speed",
        "单位速度的摩擦；主轴按rad/s；功率输出时按速度平方",
    )],
    needs: &["velocity | speed"],
    source: "oil film, Stokes; F = b v",
    experiment_minutes: 3.0,
    rivals: &["dry_friction", "stribeck", "windage", "no_load_power", "axis_friction"],
    en: Texts {
        name: "viscous friction",
        statement: "Friction that grows in proportion to speed, as in an oil film",
        absence: "the residual follows the velocity, with its sign",
        confused_with: "dry friction (the same at every speed), windage (steeper)",
        experiment: "move back and forth at four constant speeds, the slowest a tenth of the fastest",
    },
    zh: Texts {
        name: "粘性摩擦",
        statement: "与速度成正比的摩擦，如油膜",
        absence: "残差随速度（含方向）成比例变化",
        confused_with: "干摩擦（与速度无关）、风阻（更陡）",
        experiment: "以四种恒定速度往复运动，最慢速度为最快速度的十分之一",
    },
};

impl Effect for ViscousFriction {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn follows_quantity(&self, _quantity: Quantity) -> bool {
        true
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        propose_plain_form(self, scene)
    }

    fn compute_columns(&self, scene: &Scene, _form: &Form) -> Option<ParameterColumns> {
        let velocity = read_motion(scene)?;
        let law = |v: &f64| if is_power(scene) { v * v } else { *v };
        Some(vec![("coefficient", velocity.iter().map(law).collect())])
    }
}
