//! Force and power that accelerate a feed axis.

use crate::drive::{read_axis_velocities, convert_to_si, is_axis_output, is_displacement, is_power, compute_rate};
use crate::excitation::propose_plain_form;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Inertia of the feed axes.
#[derive(Debug, Clone, Copy)]
pub struct AxisInertia;

static DOC: EffectDoc = EffectDoc {
    kind: "axis_inertia",
    family: "axis",
    law: "P = mass_kg * sum v a; of a single axis in a force or current: F = per_m_s2 * a; v in m/s, a in m/s2",
    parameters: &[
        ParameterDoc::new_linear(
            "mass_kg",
            "kg",
            (0.0, 1000000.0),
            "moved mass, with the inertia of motor and screw",
            "移动质量，包括电机和丝杠惯量",
        ),
        ParameterDoc::new_linear(
            "per_m_s2",
            "output/(m/s2)",
            (0.0, f64::INFINITY),
            "output per acceleration",
            "单位加速度的输出",
        ),
    ],
    needs: &["acceleration | velocity | axis velocities"],
    source: "Newton; P = m v a",
    experiment_minutes: 3.0,
    rivals: &["axis_friction", "clock_lag", "spindle_inertia"],
    en: Texts {
        name: "axis inertia",
        statement: "Accelerating a feed axis takes force, braking gives it back",
        absence: "a peak at every start of a move and a dip at every stop",
        confused_with: "friction (follows speed, not its change), a time shift (also where loads change)",
        experiment: "make ten short rapid moves back and forth with the spindle stopped",
    },
    zh: Texts {
        name: "进给轴惯量",
        statement: "进给轴加速需要力，减速时返还",
        absence: "每次启动出现峰、每次停止出现谷",
        confused_with: "摩擦（随速度而非加速度）、时间偏移（负载变化处也有）",
        experiment: "主轴停止，快速往复短行程十次",
    },
};

impl Effect for AxisInertia {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        propose_plain_form(self, scene)
    }

    fn compute_columns(&self, scene: &Scene, _form: &Form) -> Option<ParameterColumns> {
        if is_axis_output(scene) && !is_power(scene) {
            return Some(vec![("per_m_s2", read_acceleration(scene)?)]);
        }
        let velocities = read_axis_velocities(scene);
        if velocities.is_empty() || !is_power(scene) {
            return None;
        }
        let rates: Vec<Vec<f64>> = velocities.iter().map(|velocity| compute_rate(scene, velocity)).collect();
        let power = |row: usize| velocities.iter().zip(&rates).map(|(v, a)| v[row] * a[row]).sum();
        Some(vec![("mass_kg", (0..scene.rows()).map(power).collect())])
    }
}

/// Acceleration of the axis: recorded, or else the rate of its velocity.
fn read_acceleration(scene: &Scene) -> Option<Vec<f64>> {
    if is_displacement(scene) {
        return None;
    }
    let recorded = scene.role_name(Role::Acceleration).and_then(|name| convert_to_si(scene, name));
    recorded.or_else(|| Some(compute_rate(scene, &convert_to_si(scene, scene.role_name(Role::Velocity)?)?)))
}
