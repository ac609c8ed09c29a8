//! The ball screw grows as its nut rubs: the error grows with the distance from the fixed bearing.

use adapter_core::channel::quantity::Quantity;
use crate::drive::{read_axis_velocities, convert_to_si, is_displacement};
use crate::excitation::{build_lag_forms, has_variation};
use crate::state::apply_first_order_lag;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Growth of the ball screw.
#[derive(Debug, Clone, Copy)]
pub struct ScrewGrowth;

static DOC: EffectDoc = EffectDoc {
    kind: "screw_growth",
    family: "thermal",
    law: "E = growth * w * z; dw/dt = (|v| - w) / tau, v in m/min; z position in m, 1 where none is recorded",
    parameters: &[
        ParameterDoc::new_linear(
            "growth",
            "output/(m m/min)",
            (f64::NEG_INFINITY, f64::INFINITY),
            "displacement per metre of screw once warm from 1 m/min",
            "在1 m/min下热透后每米丝杠的位移",
        ),
        ParameterDoc::new_shape("tau_s", "s", (300.0, 7200.0), "time constant of the screw", "丝杠时间常数"),
    ],
    needs: &["feed_mm_min | axis velocities"],
    source: "alpha L = 11.5 um/(m K), 20-60 min, driven by the mean speed of the axis",
    experiment_minutes: 40.0,
    rivals: &["spindle_growth", "ambient_drift"],
    en: Texts {
        name: "screw growth",
        statement: "The ball screw grows as its nut rubs",
        absence: "the displacement grows with how much the axis moves, and with the distance from the fixed bearing",
        confused_with: "spindle growth (the same at every position)",
        experiment: "move the axis back and forth for forty minutes and probe at two positions",
    },
    zh: Texts {
        name: "丝杠热伸长",
        statement: "滚珠丝杠因螺母摩擦发热伸长",
        absence: "位移随轴运动量以及离固定端的距离增大",
        confused_with: "主轴热伸长（与位置无关）",
        experiment: "轴往复运动四十分钟，并在两个位置测量",
    },
};

impl Effect for ScrewGrowth {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn follows_quantity(&self, _quantity: Quantity) -> bool {
        true
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let moves = read_axis_velocities(scene).iter().any(|velocity| has_variation(velocity));
        let grid: &[f64] = if moves && is_displacement(scene) { &[1200.0, 2400.0, 3600.0] } else { &[] };
        build_lag_forms(scene, "", grid)
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let velocities = read_axis_velocities(scene);
        if velocities.is_empty() {
            return None;
        }
        let m_min = |row: usize| velocities.iter().map(|v| 60.0 * v[row].abs()).sum();
        let rubbing: Vec<f64> = (0..scene.rows()).map(m_min).collect();
        let mut growth = apply_first_order_lag(scene, &rubbing, form.shape_value("tau_s").unwrap_or(2400.0));
        if let Some(position) = read_position_m(scene) {
            growth.iter_mut().zip(&position).for_each(|(growth, z)| *growth *= z);
        }
        Some(vec![("growth", growth)])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form::from_shape(&[("tau_s", 2400.0)])
    }
}

fn read_position_m(scene: &Scene) -> Option<Vec<f64>> {
    convert_to_si(scene, scene.role_name(Role::Position)?)
}
