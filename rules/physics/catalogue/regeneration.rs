//! Braking power does not come back: it is burnt in a resistor, or the meter does not count it.

use crate::drive::{INERTIA_KG_M2_MAX, RAD_PER_S_OF_RPM, read_driven_speed_krpm, read_spindle_rate_rpm_per_s};
use crate::excitation::count_visits;
use crate::{Effect, EffectDoc, Form, OutputKind, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Braking power that is not fed back.
#[derive(Debug, Clone, Copy)]
pub struct Regeneration;

static DOC: EffectDoc = EffectDoc {
    kind: "regeneration",
    family: "drive",
    law: "P = braking_kg_m2 * |w dw/dt| while the spindle slows down; clipped: P = share * |S| where the simulated power S is negative",
    parameters: &[
        ParameterDoc::new_linear(
            "braking_kg_m2",
            "kg m2",
            (0.0, INERTIA_KG_M2_MAX),
            "inertia times the share of braking power that is lost",
            "惯量乘以损失的制动功率比例",
        ),
        ParameterDoc::new_linear(
            "share",
            "1",
            (0.0, 1.0),
            "share of the negative power that is not shown",
            "未显示的负功率比例",
        ),
    ],
    needs: &["speed"],
    source: "drives with a braking resistor, and meters that count one direction only: 0-90 % of braking power",
    experiment_minutes: 3.0,
    rivals: &["spindle_inertia", "clock_lag", "meter_window"],
    en: Texts {
        name: "braking power",
        statement: "Braking power is burnt in a resistor, or not counted by the meter",
        absence: "at every slow-down the recording lies above the simulation, at speed-up they agree",
        confused_with: "inertia (both ways), a time shift (pairs of opposite peaks)",
        experiment: "ramp the spindle up and down five times, with the same time for both",
    },
    zh: Texts {
        name: "制动功率",
        statement: "制动功率消耗在制动电阻上，或仪表不计",
        absence: "每次降速时实测高于仿真，升速时一致",
        confused_with: "惯量（升降速都有）、时间偏移（成对正负峰）",
        experiment: "以相同时间升降速五次",
    },
};

impl Effect for Regeneration {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["braking", "clipped"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        ["braking", "clipped"]
            .into_iter()
            .map(|name| Form { name, ..Form::without_shape() })
            .filter(|form| is_active(scene, form))
            .collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        if scene.output_kind() != OutputKind::Power {
            return None;
        }
        if form.name == "clipped" {
            return Some(vec![("share", scene.simulated_output()?.iter().map(|power| (-power).max(0.0)).collect())]);
        }
        read_driven_speed_krpm(scene)?;
        let speed = scene.role_values(Role::Speed)?;
        let braking = |(rpm, rate): (&f64, f64)| (-rpm * rate * RAD_PER_S_OF_RPM.powi(2)).max(0.0);
        Some(vec![("braking_kg_m2", speed.iter().zip(read_spindle_rate_rpm_per_s(scene)?).map(braking).collect())])
    }
}

fn is_active(scene: &Scene, form: &Form) -> bool {
    Regeneration.compute_columns(scene, form).is_some_and(|columns| count_visits(scene, |row| columns[0].1[row] > 0.0) >= 3)
}
