//! The machine follows the temperature of the shop, late.

use adapter_core::channel::quantity::Quantity;
use crate::drive::is_displacement;
use crate::excitation::{build_lag_forms, compute_spread};
use crate::state::apply_continuous_lag;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};
use std::f64::consts::LN_2;

/// Displacement that follows the shop.
#[derive(Debug, Clone, Copy)]
pub struct AmbientDrift;

static DOC: EffectDoc = EffectDoc {
    kind: "ambient_drift",
    family: "thermal",
    law: "E = per_k * w; dw/dt = ((T - T0) - w) / tau, T0 at the start; without tau: w = T - T0; two_masses: the same once more behind w, with half the tau",
    parameters: &[
        ParameterDoc::new_linear(
            "per_k",
            "output/K",
            (-100.0, 100.0),
            "displacement per kelvin of the shop",
            "环境每变化1 K的位移",
        ),
        ParameterDoc::new_shape(
            "tau_s",
            "s",
            (60.0, 43200.0),
            "time the machine takes to follow",
            "机床跟随环境的时间常数",
        ),
    ],
    needs: &["ambient"],
    source: "ISO 230-3 environmental variation: 1-6 um/K, 1-4 h",
    experiment_minutes: 720.0,
    rivals: &["spindle_growth", "coolant_temperature", "zero_drift"],
    en: Texts {
        name: "ambient drift",
        statement: "The machine bends and grows with the temperature of the shop, hours late",
        absence: "the displacement follows day and night and open doors, also at standstill",
        confused_with: "spindle growth (follows speed), coolant (only when it runs)",
        experiment: "measure the displacement overnight at standstill, with the shop temperature",
    },
    zh: Texts {
        name: "环境温度漂移",
        statement: "机床随车间温度变形，滞后数小时",
        absence: "位移随昼夜和开门变化，静止时也有",
        confused_with: "主轴热伸长（随转速）、冷却液（仅运行时）",
        experiment: "静止状态下整夜测量位移和环境温度",
    },
};

impl Effect for AmbientDrift {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn follows_quantity(&self, _quantity: Quantity) -> bool {
        true
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["direct", "lag", TWO_MASSES]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let known = scene.role_values(Role::Ambient).is_some_and(|ambient| compute_spread(ambient) > 0.2);
        if !known || !is_displacement(scene) {
            return Vec::new();
        }
        let direct = Form { name: "direct", ..Form::without_shape() };
        let lags = |name| build_lag_forms(scene, name, &[1800.0, 3600.0, 7200.0]);
        let two_masses = lags(TWO_MASSES).into_iter().map(|form| Form { ln_choices: LN_2, ..form });
        [direct].into_iter().chain(lags("lag")).chain(two_masses).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let ambient = scene.role_values(Role::Ambient)?;
        let first = *ambient.first()?;
        let change: Vec<f64> = ambient.iter().map(|t| t - first).collect();
        let followed = match form.shape_value("tau_s") {
            Some(tau_s) if form.name == TWO_MASSES => {
                let skin = apply_continuous_lag(scene, &change, SKIN_SHARE * tau_s);
                apply_continuous_lag(scene, &skin, tau_s)
            }
            Some(tau_s) => apply_continuous_lag(scene, &change, tau_s),
            None => change,
        };
        Some(vec![("per_k", followed)])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form { name: "lag", ..Form::from_shape(&[("tau_s", 3600.0)]) }
    }
}

/// The form in which the air warms covers and column, and these the bed.
const TWO_MASSES: &str = "two_masses";
/// Time constant of the first mass as a share of that of the second; which share it is hardly shows.
const SKIN_SHARE: f64 = 0.5;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::tests::{column, scene, set};
    use recording::Recording;

    #[test]
    fn the_air_changes_while_the_machine_rests() {
        // Ten minutes at 20 degrees, a night, ten minutes at 14.
        let time_s = |row: u32| 60.0 * f64::from(row) + if row < 10 { 0.0 } else { 36_000.0 };
        let mut recording = Recording::new("night", (0..20).map(time_s).collect(), None);
        set(&mut recording, "ambient_temperature_c", |row| if row < 10 { 20.0 } else { 14.0 });
        set(&mut recording, "thermal_error_um", |_| 1.0);
        let scene = scene(&recording, "thermal_error_um");
        let lag = Form { name: "lag", ..Form::from_shape(&[("tau_s", 3600.0)]) };
        let column = column(&AmbientDrift, &scene, &lag);
        // It fell all night, so that the column is an hour behind: 0.6 K.
        assert!(column[9] == 0.0 && (column[10] + 5.4).abs() < 0.01, "{column:?}");
    }

    #[test]
    fn behind_two_masses_the_bed_begins_slowly() {
        let mut recording = Recording::new("door", (0..240).map(|row| 60.0 * f64::from(row)).collect(), None);
        set(&mut recording, "ambient_temperature_c", |row| if row < 10 { 20.0 } else { 16.0 });
        set(&mut recording, "thermal_error_um", |_| 1.0);
        let scene = scene(&recording, "thermal_error_um");
        let after = |name, minutes: usize| {
            let form = Form { name, ..Form::from_shape(&[("tau_s", 3600.0)]) };
            column(&AmbientDrift, &scene, &form)[10 + minutes]
        };
        assert!(after("two_masses", 10) > 0.4 * after("lag", 10), "{}", after("two_masses", 10));
        assert!(after("two_masses", 220) < -3.7, "{}", after("two_masses", 220));
    }
}
