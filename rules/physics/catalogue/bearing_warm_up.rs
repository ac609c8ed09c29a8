//! Grease and bearings get thinner and freer as they warm: no-load power falls.

use adapter_core::channel::quantity::Quantity;
use crate::drive::{read_speed_krpm, raise_velocity_to_exponent, read_slide_velocity, raise_speed_to_exponent};
use crate::excitation::{build_lag_forms, has_variation};
use crate::state::{compute_decay, apply_first_order_lag};
use crate::{Bound, Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Friction that falls as the bearings warm.
#[derive(Debug, Clone, Copy)]
pub struct BearingWarmUp;

static DOC: EffectDoc = EffectDoc {
    kind: "bearing_warm_up",
    family: "spindle",
    law: "P = -drop * g * w + initial * g * exp(-t/tau); g = (n / 1000 rpm)^(5/3), of a feed drive (v / 1 m/s)^(5/3), dw/dt = (g - w) / tau; in a force g / v; measured: P = -drop_per_k * g * f * (1 - exp(-(T - T0) / f)), f = fade_k; without fade_k P = -drop_per_k * g * (T - T0)",
    parameters: &[
        ParameterDoc::new_linear(
            "drop",
            "output",
            (0.0, f64::INFINITY),
            "fall of power at 1000 rpm once warm from 1000 rpm; of a feed drive, of power or force at 1 m/s",
            "在1000 rpm下热透后功率的下降量；进给轴按1 m/s的功率或力",
        ),
        ParameterDoc::new_linear(
            "initial",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "what the warmth at the start of the recording changes at 1000 rpm or 1 m/s",
            "记录开始时的热状态在1000 rpm或1 m/s下的影响",
        ),
        ParameterDoc::new_linear(
            "drop_per_k",
            "output/K",
            (0.0, f64::INFINITY),
            "fall at 1000 rpm or 1 m/s per kelvin of the bearing",
            "轴承温度每升高1 K，1000 rpm或1 m/s下的下降量",
        ),
        ParameterDoc::new_shape("tau_s", "s", (60.0, 14400.0), "time constant of warming", "升温时间常数"),
        ParameterDoc::new_shape(
            "fade_k",
            "K",
            (8.0, 200.0),
            "warming by which the fall per kelvin becomes 1/e of itself",
            "每升高1 K的下降量衰减到1/e所需的温升",
        ),
    ],
    needs: &["speed | velocity"],
    source: "Palmgren: friction moment grows with (viscosity * n)^(2/3), viscosity falls by 3 to 8 % per kelvin (Walther), so that f is 1.5 / 0.03 to 1.5 / 0.08 K; idle power 10-40 % lower warm",
    experiment_minutes: 20.0,
    rivals: &["preload_growth", "zero_drift", "flank_wear", "viscous_friction"],
    en: Texts {
        name: "bearing warm-up",
        statement: "Cold bearings and grease turn heavily: power or force without load falls as the drive warms, and rises again after a pause",
        absence: "at the start of a shift or after a pause idle takes more than later, in proportion to speed",
        confused_with: "zero drift of the meter (does not grow with speed), preload growth (opposite sign)",
        experiment: "run idle at one high speed for twenty minutes from cold, and again warm",
    },
    zh: Texts {
        name: "轴承热机",
        statement: "冷态轴承和润滑脂阻力大：空载功率或力随驱动升温下降，停机后又回升",
        absence: "开班或停机后空转功率比之后大，且与转速相关",
        confused_with: "仪表零点漂移（不随转速增长）、预紧力增长（符号相反）",
        experiment: "从冷态起以某一高转速空转二十分钟，热态再重复一次",
    },
};

impl Effect for BearingWarmUp {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn follows_quantity(&self, _quantity: Quantity) -> bool {
        true
    }

    fn bound(&self) -> Bound {
        // cold grease takes 10 to 40 % more at idle; twice that leaves room for a cold start
        Bound::NoLoad(0.8)
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["lag", "measured"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let velocity = read_slide_velocity(scene);
        if compute_friction(scene, velocity.as_deref()).is_none_or(|friction| friction.iter().all(|g| *g == 0.0)) {
            return Vec::new();
        }
        // A nut warms faster than a spindle.
        let fast: &[f64] = if velocity.is_some() { &[75.0, 150.0] } else { &[] };
        let mut forms = build_lag_forms(scene, "lag", &[fast, &[300.0, 600.0, 1200.0, 2400.0]].concat());
        let measured = scene.role_values(Role::Temperature).filter(|temperature| has_variation(temperature));
        if measured.is_some() {
            forms.push(Form { name: "measured", ..Form::without_shape() });
            forms.extend(FADES_K.map(|fade_k| Form { name: "measured", ..Form::from_shape(&[("fade_k", fade_k)]) }));
        }
        forms
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let velocity = read_slide_velocity(scene);
        let friction = compute_friction(scene, velocity.as_deref())?;
        if form.name == "measured" {
            let temperature = scene.role_values(Role::Temperature)?;
            let first = *temperature.first()?;
            let fall = |warming: f64| match form.shape_value("fade_k") {
                Some(fade_k) => -fade_k * (-warming / fade_k).exp_m1(),
                None => warming,
            };
            let law = |(g, t): (&f64, &f64)| -g * fall(t - first);
            return Some(vec![("drop_per_k", friction.iter().zip(temperature).map(law).collect())]);
        }
        let tau_s = form.shape_value("tau_s").unwrap_or(900.0);
        let warmth = apply_first_order_lag(scene, &compute_heat(scene, velocity.as_deref())?, tau_s);
        let left = compute_decay(scene, tau_s);
        Some(vec![
            ("drop", friction.iter().zip(&warmth).map(|(g, w)| -g * w).collect()),
            ("initial", friction.iter().zip(&left).map(|(g, left)| g * left).collect()),
        ])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form { name: "lag", ..Form::from_shape(&[("tau_s", 900.0)]) }
    }
}

/// Friction in the output: of a feed drive over its velocity in m/s, else of the spindle over thousands of rpm.
fn compute_friction(scene: &Scene, velocity: Option<&[f64]>) -> Option<Vec<f64>> {
    match velocity {
        Some(velocity) => Some(raise_velocity_to_exponent(scene, velocity, EXPONENT)),
        None => raise_speed_to_exponent(scene, EXPONENT),
    }
}

/// The heat that friction makes, whatever the output.
fn compute_heat(scene: &Scene, velocity: Option<&[f64]>) -> Option<Vec<f64>> {
    let heat = |speeds: &[f64]| speeds.iter().map(|speed| speed.abs().powf(EXPONENT)).collect();
    velocity.map(heat).or_else(|| Some(heat(&read_speed_krpm(scene)?)))
}

/// Fades from which the fit of a measured warm-up begins: those of a grease in the cold and of a thin oil.
const FADES_K: [f64; 2] = [15.0, 40.0];
/// Power of friction over speed: torque with the power 2/3.
const EXPONENT: f64 = 5.0 / 3.0;

#[cfg(test)]
mod tests {
    use super::super::tests::{column, scene, set};
    use super::*;
    use recording::Recording;

    #[test]
    fn a_measured_warm_up_fades_and_begins_as_the_straight_one() {
        let mut recording = Recording::new("warm", (0..60).map(f64::from).collect(), None);
        set(&mut recording, "spindle_speed_rpm", |_| 1000.0);
        set(&mut recording, "bearing_temperature_c", |row| 20.0 + 0.5 * row as f64);
        set(&mut recording, "spindle_power_w", |_| 500.0);
        let scene = scene(&recording, "spindle_power_w");
        let of = |form: Form| column(&BearingWarmUp, &scene, &Form { name: "measured", ..form });
        let (straight, fading) = (of(Form::without_shape()), of(Form::from_shape(&[("fade_k", 15.0)])));
        assert!((straight[30] + 15.0).abs() < 1e-9, "1 W/K at 1000 rpm, 15 K warmer: {}", straight[30]);
        assert!((fading[1] / straight[1] - 1.0).abs() < 0.02, "{} {}", fading[1], straight[1]);
        assert!((fading[30] + 15.0 * (1.0 - (-1.0_f64).exp())).abs() < 1e-9, "{}", fading[30]);
    }
}
