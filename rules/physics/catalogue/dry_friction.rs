//! Coulomb friction: a level with the sign of motion in a force, proportional to speed in a power.

use adapter_core::channel::quantity::Quantity;
use crate::drive::{RAD_PER_S_OF_RPM, read_motion, compute_soft_sign, is_rotary_drive};
use numerics::statistics::find_greatest_magnitude;
use crate::state::{compute_presliding_state, measure_strokes};
use crate::{Effect, EffectDoc, Form, OutputKind, ParameterColumns, ParameterDoc, Scene, Texts};

/// Coulomb friction of a drive.
#[derive(Debug, Clone, Copy)]
pub struct DryFriction;

static DOC: EffectDoc = EffectDoc {
    kind: "dry_friction",
    family: "axis",
    law: "F = level * tanh(v / v0); presliding: F = level * z, dz = (sign(v) - z) |dx| / way, held at rest; \
          in a power: P = level * |v| / (1 m/s), of a spindle / (1000 rpm)",
    parameters: &[
        ParameterDoc::new_linear(
            "level",
            "output",
            (0.0, f64::INFINITY),
            "friction level; in a power its loss at 1 m/s or 1000 rpm",
            "摩擦力大小；功率输出时为1 m/s或1000 rpm下的损耗",
        ),
        ParameterDoc::new_shape(
            "reversal_share",
            "1",
            (1e-5, 0.2),
            "speed at which the level is reached, as a share of the greatest speed",
            "达到摩擦力的速度与最大速度之比",
        ),
        ParameterDoc::new_shape(
            "presliding_way",
            "m",
            (1e-7, 10.0),
            "way after a reversal in which two thirds of the change of friction build up; rad where the drive turns",
            "换向后摩擦力变化建立三分之二所经过的位移；旋转驱动时单位为rad",
        ),
    ],
    needs: &["velocity | speed"],
    source: "Coulomb; smoothed at reversal so that rows at rest carry no sign of noise; presliding: Dahl, A solid friction \
             model, Aerospace Corporation TOR-0158(3107-18)-1, 1968",
    experiment_minutes: 3.0,
    rivals: &["viscous_friction", "stribeck", "offset", "direction_asymmetry"],
    en: Texts {
        name: "dry friction",
        statement: "Friction with a fixed level that changes sign with the direction of motion",
        absence: "the residual jumps at every reversal and is flat between reversals",
        confused_with: "viscous friction (grows with speed), a difference between directions (same sign both ways)",
        experiment: "move back and forth at four constant speeds, the slowest a tenth of the fastest",
    },
    zh: Texts {
        name: "干摩擦（库仑摩擦）",
        statement: "大小固定、方向随运动方向改变的摩擦",
        absence: "残差在每次换向时跳变，换向之间保持平直",
        confused_with: "粘性摩擦（随速度增大）、方向差异（两个方向符号相同）",
        experiment: "以四种恒定速度往复运动，最慢速度为最快速度的十分之一",
    },
};

impl Effect for DryFriction {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn follows_quantity(&self, _quantity: Quantity) -> bool {
        true
    }

    fn form_names(&self) -> &'static [&'static str] {
        &[PRESLIDING]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(velocity) = read_motion(scene) else { return Vec::new() };
        if velocity.iter().all(|v| *v == 0.0) {
            return Vec::new();
        }
        match scene.output_kind() {
            OutputKind::Power => vec![Form::without_shape()],
            _ => {
                let sudden = [1e-4, 0.002, 0.01, 0.04].map(|share| Form::from_shape(&[("reversal_share", share)]));
                sudden.into_iter().chain(build_presliding_forms(scene, &velocity)).collect()
            }
        }
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let velocity = read_motion(scene)?;
        if form.name == PRESLIDING {
            let way = form.shape_value("presliding_way").unwrap_or(PRESLIDING_WAY_M);
            return Some(vec![("level", compute_presliding_state(scene, &velocity, way))]);
        }
        let top = find_greatest_magnitude(&velocity);
        let reference = if is_rotary_drive(scene) { 1000.0 * RAD_PER_S_OF_RPM } else { 1.0 };
        let share = form.shape_value("reversal_share").unwrap_or(0.01);
        let law = |v: &f64| match scene.output_kind() {
            OutputKind::Power => v.abs() / reference,
            _ => compute_soft_sign(*v, share * top),
        };
        Some(vec![("level", velocity.iter().map(law).collect())])
    }
}

/// The form in which guides and seals bend before they slip.
const PRESLIDING: &str = "presliding";
/// What is usual in a guide, m.
const PRESLIDING_WAY_M: f64 = 1e-4;
/// Ways that are tried, as shares of the longest stroke.
const STROKE_SHARES: [f64; 3] = [3e-4, 3e-3, 0.02];
/// Strokes below which nothing is seen of what happens at reversals.
const STROKES_MIN: usize = 4;

/// Where the motion reverses, forms that build up over a share of the longest stroke.
fn build_presliding_forms(scene: &Scene, velocity: &[f64]) -> Vec<Form> {
    let strokes = measure_strokes(scene, velocity);
    let longest = find_greatest_magnitude(&strokes);
    if strokes.len() < STROKES_MIN || longest <= 0.0 {
        return Vec::new();
    }
    let form = |share: &f64| Form { name: PRESLIDING, ..Form::from_shape(&[("presliding_way", share * longest)]) };
    STROKE_SHARES.iter().map(form).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::tests::{column, scene, set};
    use recording::Recording;

    #[test]
    fn friction_that_bends_before_it_slips_is_held_at_rest() {
        // A second forwards at 0.1 m/s, a second at rest, then backwards.
        let velocity = |row: usize| [0.1, 0.0, -0.1][(row / 100).min(2)];
        let mut recording = Recording::new("guide", (0..300).map(|row| 0.01 * f64::from(row)).collect(), None);
        set(&mut recording, "velocity_m_s", velocity);
        set(&mut recording, "axis_force_n", |_| 1.0);
        let form = Form { name: "presliding", ..Form::from_shape(&[("presliding_way", 0.01)]) };
        let friction = column(&DryFriction, &scene(&recording, "axis_force_n"), &form);
        assert!((friction[10] - (1.0 - (-1.0_f64).exp())).abs() < 1e-9, "one way forwards: {}", friction[10]);
        assert!(
            (friction[150] - 1.0).abs() < 1e-3 && friction[150] == friction[199],
            "held at rest: {}",
            friction[150]
        );
        // Half a millimetre while it starts, then one a row: turned about after ln 2 of the way.
        assert!(friction[206] > 0.0 && friction[208] < 0.0, "{:?}", &friction[205..210]);
        assert!((friction[299] + 1.0).abs() < 1e-3, "slips backwards: {}", friction[299]);
    }

    #[test]
    fn presliding_is_asked_for_where_the_motion_reverses() {
        let forms = |period: usize| {
            let mut recording = Recording::new("guide", (0..300).map(|row| 0.01 * f64::from(row)).collect(), None);
            set(&mut recording, "velocity_m_s", |row| if (row / period).is_multiple_of(2) { 0.1 } else { -0.1 });
            set(&mut recording, "axis_force_n", |_| 1.0);
            let forms = DryFriction.propose_forms(&scene(&recording, "axis_force_n"));
            forms.iter().filter(|form| form.name == "presliding").count()
        };
        assert_eq!((forms(30), forms(200)), (3, 0));
    }
}
