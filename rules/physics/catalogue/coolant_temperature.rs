//! Coolant warms bed, work and fixture.

use adapter_core::channel::quantity::Quantity;
use crate::drive::is_displacement;
use crate::excitation::{build_lag_forms, compute_spread, has_variation};
use crate::state::apply_continuous_lag;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Displacement that follows the coolant.
#[derive(Debug, Clone, Copy)]
pub struct CoolantTemperature;

const COOLANT: &str = "coolant_temperature_c";

static DOC: EffectDoc = EffectDoc {
    kind: "coolant_temperature",
    family: "thermal",
    law: "E = per_k * w; dw/dt = ((Tc - Tc0) - w) / tau, Tc0 at the start; without tau: w = Tc - Tc0; flowing: w = (Tc - Tc0) while the coolant is on",
    parameters: &[
        ParameterDoc::new_linear(
            "per_k",
            "output/K",
            (-100.0, 100.0),
            "displacement per kelvin of the coolant",
            "冷却液每变化1 K的位移",
        ),
        ParameterDoc::new_shape(
            "tau_s",
            "s",
            (30.0, 14400.0),
            "time bed and work take to follow",
            "床身和工件跟随的时间常数",
        ),
    ],
    needs: &[COOLANT],
    source: "expansion of what the coolant washes: 11.5 um/(m K) for steel",
    experiment_minutes: 40.0,
    rivals: &["ambient_drift", "spindle_growth"],
    en: Texts {
        name: "coolant temperature",
        statement: "Warm coolant warms bed, work and fixture",
        absence: "the displacement follows the temperature of the coolant",
        confused_with: "ambient drift (also without coolant), spindle growth (follows speed)",
        experiment: "run the coolant for forty minutes with the spindle stopped",
    },
    zh: Texts {
        name: "冷却液温度",
        statement: "温热的冷却液加热床身、工件和夹具",
        absence: "位移随冷却液温度变化",
        confused_with: "环境漂移（无冷却液时也有）、主轴热伸长（随转速）",
        experiment: "主轴停止，冷却液运行四十分钟",
    },
};

impl Effect for CoolantTemperature {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn follows_quantity(&self, _quantity: Quantity) -> bool {
        true
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["direct", "flowing", "lag"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let known = scene.column(COOLANT).is_some_and(|coolant| compute_spread(coolant) > 0.2);
        if !known || !is_displacement(scene) {
            return Vec::new();
        }
        let direct = Form { name: "direct", ..Form::without_shape() };
        // Only coolant that flows carries its warmth anywhere.
        let flowing =
            scene.column("coolant_on").filter(|on| has_variation(on)).map(|_| Form { name: "flowing", ..Form::without_shape() });
        [direct].into_iter().chain(flowing).chain(build_lag_forms(scene, "lag", &[600.0, 1800.0])).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let coolant = scene.column(COOLANT)?;
        let first = *coolant.first()?;
        let change: Vec<f64> = coolant.iter().map(|t| t - first).collect();
        let followed = match (form.name, form.shape_value("tau_s")) {
            ("flowing", _) => change.iter().zip(scene.column("coolant_on")?).map(|(change, on)| change * on).collect(),
            (_, Some(tau_s)) => apply_continuous_lag(scene, &change, tau_s),
            (_, None) => change,
        };
        Some(vec![("per_k", followed)])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form { name: "direct", ..Form::without_shape() }
    }
}
