//! Feed axes take power to move, and the meter sees it.

use crate::drive::{read_axis_velocities, is_axis_output, is_power};
use crate::excitation::has_variation;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts, resolve_unit};

/// Power to move the feed axes.
#[derive(Debug, Clone, Copy)]
pub struct AxisFriction;

static DOC: EffectDoc = EffectDoc {
    kind: "axis_friction",
    family: "axis",
    law: "P = force * sum |v|; viscous: P = per_speed * sum v^2; v in m/s",
    parameters: &[
        ParameterDoc::new_linear(
            "force",
            "output/(m/s)",
            (0.0, f64::INFINITY),
            "friction force of the axes; newtons when the output is in watts",
            "进给轴摩擦力；输出为W时单位为N",
        ),
        ParameterDoc::new_linear(
            "per_speed",
            "output/(m/s)2",
            (0.0, f64::INFINITY),
            "friction force per speed",
            "单位速度的摩擦力",
        ),
    ],
    needs: &["feed_mm_min | axis velocities"],
    source: "guideways, screws and wipers: 20-300 W at rapid traverse",
    experiment_minutes: 4.0,
    rivals: &["axis_inertia", "gravity_axis", "auxiliary_switch", "viscous_friction"],
    en: Texts {
        name: "axis friction",
        statement: "Moving the feed axes takes power that the simulation lacks",
        absence: "the residual follows the speed of the axes, most at rapid traverse, also without cutting",
        confused_with: "gravity on a vertical axis (changes sign with direction), auxiliary consumers (do not follow the motion)",
        experiment: "move each axis back and forth at three speeds with the spindle stopped",
    },
    zh: Texts {
        name: "进给轴摩擦",
        statement: "进给轴运动消耗功率，而仿真中没有",
        absence: "残差随进给轴速度变化，快移时最大，不切削时也有",
        confused_with: "垂直轴重力（随方向变号）、辅助设备（不随运动）",
        experiment: "主轴停止，每个轴以三种速度往复运动",
    },
};

/// Friction beyond which no feed axis of a machine tool could move itself, N: drives push with 5 to 30 kN in all.
const THRUST_MAX_N: f64 = 10_000.0;

impl Effect for AxisFriction {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn parameter_range(&self, scene: &Scene, parameter: &ParameterDoc) -> (f64, f64) {
        let in_watts = resolve_unit("output", scene) == "W" && parameter.name == "force";
        (parameter.range.0, if in_watts { THRUST_MAX_N } else { parameter.range.1 })
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["coulomb", "viscous", "both"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let named = ["coulomb", "viscous"].map(|name| Form { name, ..Form::without_shape() });
        let acts = |form: &Form| self.compute_columns(scene, form).is_some_and(|columns| has_variation(&columns[0].1));
        named.into_iter().filter(acts).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let velocities = read_axis_velocities(scene);
        if velocities.is_empty() || !is_power(scene) || is_axis_output(scene) {
            return None;
        }
        let sum =
            |law: fn(f64) -> f64| (0..scene.rows()).map(|row| velocities.iter().map(|v| law(v[row])).sum()).collect();
        Some(match form.name {
            "viscous" => vec![("per_speed", sum(|v| v * v))],
            _ => vec![("force", sum(f64::abs))],
        })
    }
}
