//! At creep the oil film breaks down: friction is higher than when moving.

use crate::drive::{is_power, read_motion, compute_soft_sign, is_rotary_drive};
use crate::excitation::{has_variation, count_visits};
use numerics::statistics::find_greatest_magnitude;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Extra friction at creep speed.
#[derive(Debug, Clone, Copy)]
pub struct Stribeck;

static DOC: EffectDoc = EffectDoc {
    kind: "stribeck",
    family: "axis",
    law: "F = level * sign(v) * s, s = exp(-(v / vs)^2), or exp(-|v| / vs) (exponential), or 1 / (1 + (v / vs)^2) (lorentzian), vs = stribeck_speed; in a power: P = level * |v| / vs * s; v in m/s, of a spindle in rad/s",
    parameters: &[
        ParameterDoc::new_linear(
            "level",
            "output",
            (0.0, f64::INFINITY),
            "extra friction near standstill",
            "接近静止时的附加摩擦",
        ),
        ParameterDoc::new_shape(
            "stribeck_speed",
            "velocity",
            (1e-06, 1000.0),
            "speed at which the film carries; of a spindle in rad/s",
            "油膜形成速度；主轴单位为rad/s",
        ),
    ],
    needs: &["velocity | speed"],
    source: "Stribeck curve F = Fc + (Fs - Fc) s(v / vs): s Gaussian, exponential (Tustin 1947) or Lorentzian (Hess and Soom 1990), see Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994), section 2.1; spindles: vs 50-300 rpm",
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

    fn form_names(&self) -> &'static [&'static str] {
        &FALLS[1..]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(velocity) = read_motion(scene).filter(|velocity| has_variation(velocity)) else { return Vec::new() };
        let top = find_greatest_magnitude(&velocity);
        let creeps = |speed: f64| count_visits(scene, |row| (0.02 * speed..speed).contains(&velocity[row].abs())) >= 3;
        let speeds = [0.01, 0.03, 0.1, 0.2].into_iter().map(|share| share * top).filter(|speed| creeps(*speed));
        // How the film of a guide carries differs; of a spindle's bearings a long tail is but any bend over speed.
        let falls = if is_rotary_drive(scene) { &FALLS[..1] } else { &FALLS };
        let form = |name, speed| Form { name, ..Form::from_shape(&[("stribeck_speed", speed)]) };
        speeds.flat_map(|speed| falls.iter().map(move |name| form(*name, speed))).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let velocity = read_motion(scene)?;
        let speed = form.shape_value("stribeck_speed").unwrap_or(0.05 * find_greatest_magnitude(&velocity)).max(f64::MIN_POSITIVE);
        let law = |v: &f64| {
            let share = v / speed;
            let level = if is_power(scene) { share.abs() } else { compute_soft_sign(share, 0.05) };
            level * compute_falloff(form.name, share)
        };
        Some(vec![("level", velocity.iter().map(law).collect())])
    }

    fn default_form(&self, scene: &Scene) -> Form {
        let top = read_motion(scene).map_or(1.0, |velocity| find_greatest_magnitude(&velocity));
        Form::from_shape(&[("stribeck_speed", 0.05 * top)])
    }
}

const EXPONENTIAL: &str = "exponential";
const LORENTZIAN: &str = "lorentzian";
/// Names of the forms; the first is the Gaussian.
const FALLS: [&str; 3] = ["", EXPONENTIAL, LORENTZIAN];

/// Share of the extra friction that is left at so many times the Stribeck speed.
fn compute_falloff(form: &str, share: f64) -> f64 {
    match form {
        EXPONENTIAL => (-share.abs()).exp(),
        LORENTZIAN => 1.0 / (1.0 + share * share),
        _ => (-share * share).exp(),
    }
}
