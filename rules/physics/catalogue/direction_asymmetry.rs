//! Friction differs between the two directions of motion.

use crate::drive::{compute_directions, has_both_directions, is_power, read_motion, compute_rest_width};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use numerics::statistics::{count_to_f64, mean};

/// Friction that differs between directions.
#[derive(Debug, Clone, Copy)]
pub struct DirectionAsymmetry;

static DOC: EffectDoc = EffectDoc {
    kind: "direction_asymmetry",
    family: "axis",
    law: "F = level * |sign(v)|; viscous: F = slope * (|v| - about); in a power: P = slope * v, step: P = level * sign(v); v in m/s, of a spindle in rad/s",
    parameters: &[
        ParameterDoc::new_linear(
            "level",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "half the difference between the directions",
            "两个方向之差的一半",
        ),
        ParameterDoc::new_linear(
            "slope",
            "output/velocity",
            (f64::NEG_INFINITY, f64::INFINITY),
            "half the difference per speed; of a spindle per rad/s",
            "单位速度下两方向之差的一半；主轴按rad/s",
        ),
        ParameterDoc::new_shape(
            "about",
            "velocity",
            (0.0, 3000.0),
            "speed at which the slope adds nothing: zero, or the mean speed of an axis that is never at rest, for which a difference at that speed is an offset",
            "斜率不起作用的速度：零；轴从不静止时为平均速度，该速度下的差值即为偏置",
        ),
    ],
    needs: &["velocity | speed"],
    source: "preload of nut and wipers, fans and belts that act one way",
    experiment_minutes: 3.0,
    rivals: &["offset", "gravity_axis", "dry_friction"],
    en: Texts {
        name: "direction asymmetry",
        statement: "Friction differs between the two directions of motion",
        absence: "when moving, the residual has the same sign both ways; at rest there is none",
        confused_with: "a constant offset (also at rest), weight on an axis (only where the axis is declared vertical)",
        experiment: "move back and forth at one speed with rests of five seconds between",
    },
    zh: Texts {
        name: "方向差异",
        statement: "两个运动方向的摩擦不同",
        absence: "运动时残差在两个方向符号相同，静止时没有",
        confused_with: "常量偏差（静止时也有）、垂直轴重力（仅当声明了垂直轴）",
        experiment: "以同一速度往复运动，中间各停五秒",
    },
};

impl Effect for DirectionAsymmetry {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["slope", "step", "level", "viscous"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(motion) = read_motion(scene).filter(|motion| has_both_directions(motion)) else { return Vec::new() };
        let named = |name| Form { name, ..Form::without_shape() };
        if is_power(scene) {
            return ["slope", "step"].map(named).into();
        }
        // About which speed a slope is told is a choice.
        let about: Vec<_> = find_restless_speed(&motion).map(|about| ("about", about)).into_iter().collect();
        vec![named("level"), Form { name: "viscous", shape: about.clone(), known: about, ..Form::without_shape() }]
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let velocity = read_motion(scene)?;
        let (name, column) = match form.name {
            "step" => ("level", compute_directions(&velocity).collect()),
            "viscous" => {
                let about = form.shape_value("about").unwrap_or(0.0);
                ("slope", velocity.iter().map(|v| v.abs() - about).collect())
            }
            _ if is_power(scene) => ("slope", velocity),
            _ => ("level", compute_directions(&velocity).map(f64::abs).collect()),
        };
        Some(vec![(name, column)])
    }

    fn default_form(&self, scene: &Scene) -> Form {
        Form { name: if is_power(scene) { "slope" } else { "level" }, ..Form::without_shape() }
    }
}

/// Share of the rows from which an axis counts as resting at times.
const RESTS: f64 = 0.03;

/// The mean speed of an axis that never rests. Another level in each direction is then the same as a constant, and a
/// constant has a name of its own: the slope alone is told, about the middle of what was seen.
fn find_restless_speed(motion: &[f64]) -> Option<f64> {
    let rest = compute_rest_width(motion);
    let resting = count_to_f64(motion.iter().filter(|v| v.abs() < rest).count());
    (resting < RESTS * count_to_f64(motion.len())).then(|| mean(&motion.iter().map(|v| v.abs()).collect::<Vec<_>>()))
}
