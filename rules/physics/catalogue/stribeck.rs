//! At creep the oil film breaks down: friction is higher than when moving.

use crate::physics::drive::{is_power, motion, soft_sign};
use crate::physics::excitation::{greatest, varies, visits};
use crate::physics::{Columns, Effect, EffectDoc, Entry, Form, ParameterDoc, Scene, Texts};

/// Extra friction at creep speed.
#[derive(Debug, Clone, Copy)]
pub struct Stribeck;

static DOC: EffectDoc = EffectDoc {
    kind: "stribeck",
    family: "axis",
    law: "F = level * sign(v) * exp(-(v / vs)^2), vs = stribeck_speed; in a power: P = level * |v| / vs * exp(-(v / vs)^2); v in m/s, of a spindle in rad/s",
    parameters: &[
        ParameterDoc {
            name: "level",
            unit: "output",
            entry: Entry::Linear,
            range: (0.0, f64::INFINITY),
            en: "extra friction near standstill",
            zh: "接近静止时的附加摩擦",
        },
        ParameterDoc {
            name: "stribeck_speed",
            unit: "velocity",
            entry: Entry::Shape,
            range: (1e-06, 1000.0),
            en: "speed at which the film carries; of a spindle in rad/s",
            zh: "油膜形成速度；主轴单位为rad/s",
        },
    ],
    needs: &["velocity | speed"],
    source: "Stribeck curve F = Fc + (Fs - Fc) exp(-(v / vs)^2); spindles: vs 50-300 rpm",
    experiment_minutes: 4.0,
    rivals: &["dry_friction", "viscous_friction", "direction_asymmetry"],
    en: Texts {
        name: "Stribeck friction",
        statement: "Near standstill the oil film breaks down and friction is higher than when moving",
        absence: "only at creep speed, near reversals, the recording lies beyond the simulation, with the sign of motion",
        confused_with: "dry friction (the same at every speed)",
        experiment: "creep at five speeds below a twentieth of the top speed, both ways",
    },
    zh: Texts {
        name: "斯特里贝克摩擦",
        statement: "接近静止时油膜破裂，摩擦大于运动时",
        absence: "仅在爬行速度、换向附近实测超出仿真，符号随运动方向",
        confused_with: "干摩擦（各速度相同）",
        experiment: "以低于最高速度二十分之一的五种速度双向爬行",
    },
};

impl Effect for Stribeck {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(velocity) = motion(scene).filter(|velocity| varies(velocity)) else { return Vec::new() };
        let top = greatest(&velocity);
        let creeps = |speed: f64| visits(scene, |row| (0.02 * speed..speed).contains(&velocity[row].abs())) >= 3;
        let speeds = [0.01, 0.03, 0.1, 0.2].into_iter().map(|share| share * top).filter(|speed| creeps(*speed));
        speeds.map(|speed| Form::of(&[("stribeck_speed", speed)])).collect()
    }

    fn columns(&self, scene: &Scene, form: &Form) -> Option<Columns> {
        let velocity = motion(scene)?;
        let speed = form.value("stribeck_speed").unwrap_or(0.05 * greatest(&velocity)).max(f64::MIN_POSITIVE);
        let law = |v: &f64| {
            let share = v / speed;
            let level = if is_power(scene) { share.abs() } else { soft_sign(share, 0.05) };
            level * (-share * share).exp()
        };
        Some(vec![("level", velocity.iter().map(law).collect())])
    }

    fn default_form(&self, scene: &Scene) -> Form {
        let top = motion(scene).map_or(1.0, |velocity| greatest(&velocity));
        Form::of(&[("stribeck_speed", 0.05 * top)])
    }
}
