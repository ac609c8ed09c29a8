//! Coulomb friction: a level with the sign of motion in a force, proportional to speed in a power.

use crate::physics::drive::{RAD_PER_S_OF_RPM, motion, soft_sign, turns};
use crate::physics::excitation::greatest;
use crate::physics::{Columns, Effect, EffectDoc, Entry, Form, OutputKind, ParameterDoc, Scene, Texts};

/// Coulomb friction of a drive.
#[derive(Debug, Clone, Copy)]
pub struct DryFriction;

static DOC: EffectDoc = EffectDoc {
    kind: "dry_friction",
    family: "axis",
    law: "F = level * tanh(v / v0); in a power: P = level * |v| / (1 m/s), of a spindle / (1000 rpm)",
    parameters: &[
        ParameterDoc {
            name: "level",
            unit: "output",
            entry: Entry::Linear,
            range: (0.0, f64::INFINITY),
            en: "friction level; in a power its loss at 1 m/s or 1000 rpm",
            zh: "摩擦力大小；功率输出时为1 m/s或1000 rpm下的损耗",
        },
        ParameterDoc {
            name: "reversal_share",
            unit: "1",
            entry: Entry::Shape,
            range: (1e-5, 0.2),
            en: "speed at which the level is reached, as a share of the greatest speed",
            zh: "达到摩擦力的速度与最大速度之比",
        },
    ],
    needs: &["velocity | speed"],
    source: "Coulomb; smoothed at reversal so that rows at rest carry no sign of noise",
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

    fn forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(velocity) = motion(scene) else { return Vec::new() };
        if velocity.iter().all(|v| *v == 0.0) {
            return Vec::new();
        }
        match scene.output_kind() {
            OutputKind::Power => vec![Form::plain()],
            _ => [1e-4, 0.002, 0.01, 0.04].iter().map(|share| Form::of(&[("reversal_share", *share)])).collect(),
        }
    }

    fn columns(&self, scene: &Scene, form: &Form) -> Option<Columns> {
        let velocity = motion(scene)?;
        let top = greatest(&velocity);
        let reference = if turns(scene) { 1000.0 * RAD_PER_S_OF_RPM } else { 1.0 };
        let share = form.value("reversal_share").unwrap_or(0.01);
        let law = |v: &f64| match scene.output_kind() {
            OutputKind::Power => v.abs() / reference,
            _ => soft_sign(*v, share * top),
        };
        Some(vec![("level", velocity.iter().map(law).collect())])
    }
}
