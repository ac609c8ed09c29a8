//! Inner rings warm before the housing: preload and friction rise, and fall again when the housing follows.

use adapter_core::channel::quantity::Quantity;
use crate::drive::{read_driven_speed_krpm, read_speed_krpm, raise_speed_to_exponent};
use crate::excitation::build_lag_forms;
use crate::state::apply_first_order_lag;
use crate::{Bound, Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Friction that rises with bearing preload.
#[derive(Debug, Clone, Copy)]
pub struct PreloadGrowth;

static DOC: EffectDoc = EffectDoc {
    kind: "preload_growth",
    family: "spindle",
    law: "P = growth * (n / 1000 rpm)^2 * w; dw/dt = ((n / 1000 rpm)^(5/3) - w) / tau; gradient: w is the difference between a quick and a slow state",
    parameters: &[
        ParameterDoc::new_linear(
            "growth",
            "output",
            (0.0, f64::INFINITY),
            "rise of power at 1000 rpm once warm from 1000 rpm",
            "在1000 rpm下热透后功率的上升量",
        ),
        ParameterDoc::new_shape("tau_s", "s", (20.0, 3600.0), "time constant of the inner ring", "内圈时间常数"),
        ParameterDoc::new_shape("slow_tau_s", "s", (120.0, 14400.0), "time constant of the housing", "轴承座时间常数"),
    ],
    needs: &["speed"],
    source: "angular-contact bearings: thermally induced preload, grows with speed squared and the temperature difference of the rings",
    experiment_minutes: 20.0,
    rivals: &["bearing_warm_up", "viscous_friction", "windage"],
    en: Texts {
        name: "preload growth",
        statement: "Bearings run tighter as the inner ring warms before the housing",
        absence: "after a step to high speed the no-load power rises for minutes before it settles or falls",
        confused_with: "bearing warm-up (same places, opposite sign: the two hide each other)",
        experiment: "step from rest to the highest speed, hold twenty minutes idle",
    },
    zh: Texts {
        name: "预紧力增长",
        statement: "内圈先于轴承座升温，轴承变紧",
        absence: "阶跃到高转速后，空载功率先上升几分钟再稳定或下降",
        confused_with: "轴承热机（位置相同、符号相反，两者相互掩盖）",
        experiment: "从静止阶跃到最高转速，空转保持二十分钟",
    },
};

impl Effect for PreloadGrowth {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn follows_quantity(&self, _quantity: Quantity) -> bool {
        true
    }

    fn bound(&self) -> Bound {
        // a preload that doubles the friction of the bearings seizes them
        Bound::NoLoad(0.8)
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["lag", "gradient"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if read_driven_speed_krpm(scene).is_none_or(|krpm| krpm.iter().all(|n| *n == 0.0)) {
            return Vec::new();
        }
        let mut forms = build_lag_forms(scene, "lag", &[120.0, 300.0, 600.0]);
        let gradient = |form: &Form| {
            let tau_s = form.shape_value("tau_s").unwrap_or(TAU_S);
            Form { name: "gradient", ..Form::from_shape(&[("tau_s", tau_s), ("slow_tau_s", SLOWER * tau_s)]) }
        };
        let gradients: Vec<Form> = forms.iter().take(2).map(gradient).collect();
        forms.extend(gradients);
        forms
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let friction = raise_speed_to_exponent(scene, 2.0)?;
        let heat: Vec<f64> = read_speed_krpm(scene)?.iter().map(|n| n.powf(5.0 / 3.0)).collect();
        let tau_s = form.shape_value("tau_s").unwrap_or(TAU_S);
        let mut warmth = apply_first_order_lag(scene, &heat, tau_s);
        if form.name == "gradient" {
            let slow = apply_first_order_lag(scene, &heat, form.shape_value("slow_tau_s").unwrap_or(SLOWER * tau_s));
            warmth.iter_mut().zip(&slow).for_each(|(warmth, slow)| *warmth -= slow);
        }
        Some(vec![("growth", friction.iter().zip(&warmth).map(|(g, w)| g * w).collect())])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form { name: "lag", ..Form::from_shape(&[("tau_s", TAU_S)]) }
    }
}

const TAU_S: f64 = 300.0;

/// How much slower the housing is than the inner ring, to start with.
const SLOWER: f64 = 6.0;
