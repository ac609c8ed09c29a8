//! The mains go up and down, and some consumers with them.

use crate::excitation::has_variation;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Output that follows the supply voltage.
#[derive(Debug, Clone, Copy)]
pub struct SupplyVoltage;

static DOC: EffectDoc = EffectDoc {
    kind: "supply_voltage",
    family: "measurement",
    law: "y = exponent * (U / U0 - 1) * S, S the simulated output, U0 the mean voltage",
    parameters: &[ParameterDoc::new_linear(
        "exponent",
        "1",
        (-2.5, 2.5),
        "exponent of the voltage: 2 for a heater, 0 for a drive with constant power, -1 for its current",
        "电压指数：电热为2，恒功率驱动为0，其电流为-1",
    )],
    needs: &["voltage", "the simulated output"],
    source: "P proportional to (U / U0)^(0..2), mains within 5-10 %",
    experiment_minutes: 15.0,
    rivals: &["sensor_gain", "zero_drift"],
    en: Texts {
        name: "supply voltage",
        statement: "The mains voltage goes up and down and the output with it",
        absence: "the residual follows the supply voltage, idle as in the cut",
        confused_with: "a gain of the meter (does not follow the voltage)",
        experiment: "record the voltage as well, and note when large consumers nearby switch",
    },
    zh: Texts {
        name: "供电电压",
        statement: "电网电压波动，输出随之变化",
        absence: "残差随供电电压变化，空转和切削时都有",
        confused_with: "仪表增益（不随电压）",
        experiment: "同时记录电压，并注意附近大功率设备的启停",
    },
};

impl Effect for SupplyVoltage {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let swings = scene.role_values(Role::Voltage).is_some_and(has_variation);
        if swings && scene.simulated_output().is_some() { vec![Form::without_shape()] } else { Vec::new() }
    }

    fn compute_columns(&self, scene: &Scene, _form: &Form) -> Option<ParameterColumns> {
        let voltage = scene.role_values(Role::Voltage)?;
        let simulated = scene.simulated_output()?;
        let mean = voltage.iter().sum::<f64>() / voltage.len().max(1) as f64;
        if mean <= 0.0 {
            return None;
        }
        Some(vec![("exponent", voltage.iter().zip(simulated).map(|(u, value)| (u / mean - 1.0) * value).collect())])
    }
}
