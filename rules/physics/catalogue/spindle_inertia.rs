//! Power and torque that accelerate spindle, chuck and work.

use crate::drive::{INERTIA_KG_M2_MAX, RAD_PER_S_OF_RPM, read_driven_speed_krpm, read_spindle_rate_rpm_per_s};
use crate::excitation::count_visits;
use numerics::statistics::find_greatest_magnitude;
use crate::{Effect, EffectDoc, Form, OutputKind, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Inertia of what the spindle turns.
#[derive(Debug, Clone, Copy)]
pub struct SpindleInertia;

static DOC: EffectDoc = EffectDoc {
    kind: "spindle_inertia",
    family: "spindle",
    law: "P = inertia_kg_m2 * w * dw/dt, w = 2 pi n / 60; returned_in_part: braking_kg_m2 in its place while the spindle slows down; a torque, current or load output takes per_rad_s2 * dw/dt",
    parameters: &[
        ParameterDoc::new_linear(
            "inertia_kg_m2",
            "kg m2",
            (0.0, INERTIA_KG_M2_MAX),
            "moment of inertia of spindle, chuck and work that the simulation lacks",
            "仿真中缺少的主轴、卡盘和工件转动惯量",
        ),
        ParameterDoc::new_linear(
            "braking_kg_m2",
            "kg m2",
            (0.0, INERTIA_KG_M2_MAX),
            "inertia times the share of braking power that comes back",
            "惯量乘以回馈的制动功率比例",
        ),
        ParameterDoc::new_linear(
            "per_rad_s2",
            "output/(rad/s2)",
            (0.0, f64::INFINITY),
            "output per angular acceleration",
            "单位角加速度的输出",
        ),
    ],
    needs: &["speed"],
    source: "d(J w^2 / 2)/dt; J 0.005-0.5 kg m2, in turning mostly chuck and blank; drives give 10 to 100 % of braking power back",
    experiment_minutes: 3.0,
    rivals: &["clock_lag", "regeneration", "meter_window"],
    en: Texts {
        name: "spindle inertia",
        statement: "Accelerating the spindle takes power, braking gives it back",
        absence: "a peak at every speed-up and a dip at every slow-down, nothing at constant speed",
        confused_with: "a time shift of the meter (also at cutting edges), braking power that is not fed back (only at slow-down)",
        experiment: "ramp the spindle up and down three times between rest and high speed",
    },
    zh: Texts {
        name: "主轴惯量",
        statement: "主轴加速需要功率，减速时返还功率",
        absence: "每次升速出现峰、每次降速出现谷，恒速时没有",
        confused_with: "仪表时间偏移（切入切出处也有）、制动功率未回馈（仅降速时）",
        experiment: "主轴在静止和高速之间升降速三次",
    },
};

/// The form of a drive that burns a part of the braking power.
const RETURNED_IN_PART: &str = "returned_in_part";
/// Rates below this share of the top speed per second are no ramp but the noise of the speed.
const RAMP_PER_S: f64 = 0.01;

impl Effect for SpindleInertia {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(speed) = scene.role_values(Role::Speed).filter(|_| read_driven_speed_krpm(scene).is_some()) else { return Vec::new() };
        let Some(rates) = read_spindle_rate_rpm_per_s(scene) else { return Vec::new() };
        let least = RAMP_PER_S * find_greatest_magnitude(speed);
        if count_visits(scene, |row| rates[row].abs() > least) < 2 {
            return Vec::new();
        }
        let mut forms = vec![Form::without_shape()];
        let is_seen = |sign: f64| count_visits(scene, |row| sign * rates[row] > least) >= 2;
        if scene.output_kind() == OutputKind::Power && is_seen(1.0) && is_seen(-1.0) {
            forms.push(Form { name: RETURNED_IN_PART, ..Form::without_shape() });
        }
        forms
    }

    fn form_names(&self) -> &'static [&'static str] {
        &[RETURNED_IN_PART]
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        read_driven_speed_krpm(scene)?;
        let speed = scene.role_values(Role::Speed)?;
        let rates = read_spindle_rate_rpm_per_s(scene)?.into_iter().map(|rpm_per_s| rpm_per_s * RAD_PER_S_OF_RPM);
        if scene.output_kind() == OutputKind::Force {
            return Some(vec![("per_rad_s2", rates.collect())]);
        }
        let power: Vec<f64> = speed.iter().zip(rates).map(|(rpm, rate)| rpm * RAD_PER_S_OF_RPM * rate).collect();
        if form.name == RETURNED_IN_PART {
            let (taken, returned) = power.iter().map(|power| (power.max(0.0), power.min(0.0))).unzip();
            return Some(vec![("inertia_kg_m2", taken), ("braking_kg_m2", returned)]);
        }
        Some(vec![("inertia_kg_m2", power)])
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{scene, set};
    use super::*;
    use recording::Recording;

    #[test]
    fn what_is_taken_and_what_comes_back_add_up_to_the_plain_law() {
        let mut recording = Recording::new("ramps", (0..80).map(f64::from).collect(), None);
        set(&mut recording, "spindle_speed_rpm", |row| 100.0 * (row % 20).min(20 - row % 20) as f64);
        set(&mut recording, "spindle_power_w", |_| 0.0);
        let scene = scene(&recording, "spindle_power_w");
        let forms = SpindleInertia.propose_forms(&scene);
        let columns = |form: &Form| SpindleInertia.compute_columns(&scene, form).expect("a speed");
        let (plain, parts) = (columns(&forms[0]), columns(&forms[1]));
        assert!(parts[0].1.iter().all(|x| *x >= 0.0) && parts[1].1.iter().all(|x| *x <= 0.0));
        assert!((0..80).all(|row| (parts[0].1[row] + parts[1].1[row] - plain[0].1[row]).abs() < 1e-9));
        assert!(parts[0].1.iter().any(|x| *x > 0.0) && parts[1].1.iter().any(|x| *x < 0.0));
    }
}
