//! The spindle grows as it warms, quickly at the nose and slowly in the housing.

use adapter_core::channel::quantity::Quantity;
use crate::drive::{is_displacement, read_speed_krpm};
use crate::excitation::{build_lag_forms, list_time_constants, has_variation};
use crate::state::{compute_decay, apply_first_order_lag};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Growth of the spindle with its own heat.
#[derive(Debug, Clone, Copy)]
pub struct SpindleGrowth;

static DOC: EffectDoc = EffectDoc {
    kind: "spindle_growth",
    family: "thermal",
    law: "E = growth * w + initial * exp(-t/tau); dw/dt = ((n / 1000 rpm)^1.5 - w) / tau; two: a second, slower state; measured: E = per_k * (T - T0)",
    parameters: &[
        ParameterDoc::new_linear(
            "growth",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "growth once warm from 1000 rpm",
            "在1000 rpm下热透后的伸长",
        ),
        ParameterDoc::new_linear(
            "initial",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "growth left over at the start of the recording",
            "记录开始时残留的伸长",
        ),
        ParameterDoc::new_linear(
            "slow_growth",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "the same for the slow state",
            "慢速状态的伸长",
        ),
        ParameterDoc::new_linear(
            "slow_initial",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "growth of the slow state left over at the start",
            "记录开始时慢速状态残留的伸长",
        ),
        ParameterDoc::new_linear(
            "per_k",
            "output/K",
            (f64::NEG_INFINITY, f64::INFINITY),
            "growth per kelvin of the bearing",
            "轴承每升高1 K的伸长",
        ),
        ParameterDoc::new_shape("tau_s", "s", (60.0, 14400.0), "time constant of the nose", "主轴端时间常数"),
        ParameterDoc::new_shape("slow_tau_s", "s", (600.0, 43200.0), "time constant of the housing", "主轴箱时间常数"),
    ],
    needs: &["speed | temperature"],
    source: "ISO 230-3 tests: two states, 3-10 min and 30-120 min, 10-80 um",
    experiment_minutes: 60.0,
    rivals: &["ambient_drift", "coolant_temperature", "screw_growth", "zero_drift"],
    en: Texts {
        name: "spindle growth",
        statement: "The spindle grows as it warms, and shrinks when it rests",
        absence: "the displacement follows the spindle speed late, and draws a loop over temperature",
        confused_with: "ambient drift (does not follow speed), growth of the screw (depends on position)",
        experiment: "step the speed up, hold one hour, rest one hour, measuring the displacement",
    },
    zh: Texts {
        name: "主轴热伸长",
        statement: "主轴升温时伸长，停机时收缩",
        absence: "位移滞后于主轴转速变化，与温度构成回线",
        confused_with: "环境漂移（不随转速）、丝杠热伸长（与位置有关）",
        experiment: "转速阶跃后保持一小时，停机一小时，测量位移",
    },
};

impl Effect for SpindleGrowth {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn follows_quantity(&self, _quantity: Quantity) -> bool {
        true
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["one", "two", "measured"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if !is_displacement(scene) {
            return Vec::new();
        }
        let turns = read_speed_krpm(scene).is_some_and(|krpm| krpm.iter().any(|n| *n > 0.0));
        let grid: &[f64] = if turns { &[180.0, 600.0, 1800.0, 3600.0, 7200.0] } else { &[] };
        let mut forms = build_lag_forms(scene, "one", grid);
        let taus = list_time_constants(scene, grid);
        for (quick, slow) in [(180.0, 1800.0), (600.0, 3600.0), (600.0, 7200.0)] {
            if taus.contains(&slow) {
                forms.push(Form { name: "two", ..Form::from_shape(&[("tau_s", quick), ("slow_tau_s", slow)]) });
            }
        }
        let measured = scene.role_values(Role::Temperature).filter(|temperature| has_variation(temperature));
        forms.extend(measured.map(|_| Form { name: "measured", ..Form::without_shape() }));
        forms
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        if form.name == "measured" {
            let temperature = scene.role_values(Role::Temperature)?;
            let first = *temperature.first()?;
            return Some(vec![("per_k", temperature.iter().map(|t| t - first).collect())]);
        }
        let heat: Vec<f64> = read_speed_krpm(scene)?.iter().map(|n| n.powf(1.5)).collect();
        let tau_s = form.shape_value("tau_s").unwrap_or(TAU_S);
        let mut columns = vec![("growth", apply_first_order_lag(scene, &heat, tau_s)), ("initial", compute_decay(scene, tau_s))];
        if form.name == "two" {
            let slow_s = form.shape_value("slow_tau_s").unwrap_or(6.0 * tau_s);
            columns.push(("slow_growth", apply_first_order_lag(scene, &heat, slow_s)));
            columns.push(("slow_initial", compute_decay(scene, slow_s)));
        }
        Some(columns)
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form { name: "one", ..Form::from_shape(&[("tau_s", TAU_S)]) }
    }
}

const TAU_S: f64 = 600.0;
