//! A vertical axis carries weight: up costs power, down gives it back.

use crate::drive::{compute_directions, convert_to_si, is_displacement, is_power, read_motion, compute_rate};
use crate::excitation::has_variation;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Weight on a vertical axis.
#[derive(Debug, Clone, Copy)]
pub struct GravityAxis;

static DOC: EffectDoc = EffectDoc {
    kind: "gravity_axis",
    family: "axis",
    law: "P = weight * v, v in m/s, positive up; in a force or current: F = level wherever the drive holds the axis; braked: F = level * |sign(v)|, where a brake holds it at rest",
    parameters: &[
        ParameterDoc::new_linear(
            "weight",
            "output/(m/s)",
            (f64::NEG_INFINITY, f64::INFINITY),
            "unbalanced weight; newtons when the output is in watts; negative when over-balanced",
            "未平衡的重量；输出为W时单位为N；过平衡时为负",
        ),
        ParameterDoc::new_linear(
            "level",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "output that holds the axis against gravity",
            "克服重力保持该轴的输出",
        ),
    ],
    needs: &["vertical"],
    source: "P = m g v; 100-800 W at rapid traverse; the drive carries no weight while the brake holds",
    experiment_minutes: 3.0,
    rivals: &["offset", "axis_friction", "direction_asymmetry"],
    en: Texts {
        name: "weight on an axis",
        statement: "A vertical axis carries weight: moving up costs power, moving down gives it back",
        absence: "the residual is positive upwards and negative downwards, in proportion to speed; in a current it is a constant",
        confused_with: "friction (the same sign both ways), a constant offset (which is what it is where no axis is declared vertical)",
        experiment: "move the vertical axis up and down at two speeds with the spindle stopped",
    },
    zh: Texts {
        name: "垂直轴重力",
        statement: "垂直轴承受重量：上升耗能，下降返还",
        absence: "上升时残差为正，下降时为负，与速度成正比；在电流中为常量",
        confused_with: "摩擦（两个方向同号）、常量偏差（未声明垂直轴时即按常量偏差处理）",
        experiment: "主轴停止，垂直轴以两种速度上下运动",
    },
};

impl Effect for GravityAxis {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["braked"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let braked = Form { name: "braked", ..Form::without_shape() };
        let forms = if is_power(scene) { vec![Form::without_shape()] } else { vec![Form::without_shape(), braked] };
        let acts = |columns: ParameterColumns| !is_power(scene) || has_variation(&columns[0].1);
        forms.into_iter().filter(|form| self.compute_columns(scene, form).is_some_and(acts)).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let declared = scene.role_name(Role::Vertical)?;
        if is_displacement(scene) {
            return None;
        }
        if form.name == "braked" {
            // At rest the brake carries the weight.
            return Some(vec![("level", compute_directions(&read_motion(scene)?).map(f64::abs).collect())]);
        }
        if !is_power(scene) {
            let held = scene.column("drive_on").map_or_else(|| vec![1.0; scene.rows()], <[f64]>::to_vec);
            return Some(vec![("level", held)]);
        }
        Some(vec![("weight", read_upward_velocity_m_s(scene, declared)?)])
    }
}

/// Velocity of the vertical axis: declared by its letter, by its position, or the only axis there is.
fn read_upward_velocity_m_s(scene: &Scene, declared: &str) -> Option<Vec<f64>> {
    if declared.contains("velocity") {
        return convert_to_si(scene, declared);
    }
    let of_letter = convert_to_si(scene, &format!("{declared}_axis_velocity_mm_min"));
    let position = scene.column(declared).or_else(|| scene.column(&format!("{declared}_axis_position_mm")));
    let metres = |position: &[f64]| position.iter().map(|mm| mm / 1000.0).collect::<Vec<_>>();
    let of_position = || position.map(|position| compute_rate(scene, &metres(position)));
    let only = || scene.role_name(Role::Velocity).and_then(|name| convert_to_si(scene, name));
    of_letter.or_else(of_position).or_else(only)
}
