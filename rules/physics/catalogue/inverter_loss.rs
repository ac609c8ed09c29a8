//! Losses in the inverter: grow with current.

use crate::drive::{is_power, read_speed_krpm, compute_torque_at_1000_rpm};
use crate::excitation::has_variation;
use numerics::statistics::find_greatest_magnitude;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use std::f64::consts::LN_2;

/// Losses in the inverter.
#[derive(Debug, Clone, Copy)]
pub struct InverterLoss;

static DOC: EffectDoc = EffectDoc {
    kind: "inverter_loss",
    family: "drive",
    law: "P = conduction * |i| + resistive * i^2; magnetised: P = conduction * (sqrt(i^2 + m^2) - m); i = L / (n / 1000 rpm) \
          stands for the current, L load, n at least 50 rpm, m = magnetising_share times the greatest i",
    parameters: &[
        ParameterDoc::new_linear(
            "conduction",
            "1",
            (0.0, 0.5),
            "loss per current, at 1000 rpm as a share of the load",
            "单位电流损耗，1000 rpm下相对负载的比例",
        ),
        ParameterDoc::new_linear(
            "resistive",
            "1/output",
            (0.0, 1.0),
            "loss per squared current, at 1000 rpm",
            "单位电流平方损耗，1000 rpm下",
        ),
        ParameterDoc::new_shape(
            "magnetising_share",
            "1",
            (0.0, 1.0),
            "magnetising current as a share of the greatest load current; flows without load, too",
            "励磁电流与最大负载电流之比，空载时也存在",
        ),
    ],
    needs: &["load", "speed"],
    source: "a + b I + c I^2; 2-4 % of power; the current of an induction motor is that of the torque and, at right angles \
             to it, the magnetising one",
    experiment_minutes: 8.0,
    rivals: &["copper_loss", "load_loss"],
    en: Texts {
        name: "inverter loss",
        statement: "Losses in the inverter, growing with the motor current",
        absence: "cuts at low speed take a little more than simulated, in proportion to torque",
        confused_with: "copper loss (square of torque only), load loss (follows power)",
        experiment: "make the same cutting power at a low and at a high speed, lightly and heavily",
    },
    zh: Texts {
        name: "变频器损耗",
        statement: "变频器损耗，随电机电流增长",
        absence: "低速切削时实测略大，与转矩成比例",
        confused_with: "铜损（仅随转矩平方）、负载损耗（随功率）",
        experiment: "在低速和高速下，分别以轻、重负载产生相同切削功率",
    },
};

impl Effect for InverterLoss {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["conduction", "both", MAGNETISED]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let turns = read_speed_krpm(scene).is_some_and(|krpm| has_variation(&krpm));
        let known = turns && is_power(scene) && scene.load().is_some_and(has_variation);
        if !known {
            return Vec::new();
        }
        let magnetising = vec![("magnetising_share", MAGNETISING_SHARE)];
        // How much it is hides in the coefficient; left open it would bend into the copper loss.
        let (shape, known, ln_choices) = (magnetising.clone(), magnetising, LN_2);
        let magnetised = Form { name: MAGNETISED, shape, known, ln_choices, ..Form::without_shape() };
        vec![Form { name: "conduction", ..Form::without_shape() }, magnetised]
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let current = is_power(scene).then(|| compute_torque_at_1000_rpm(scene))??;
        if form.name == MAGNETISED {
            let magnetising = form.shape_value("magnetising_share").unwrap_or(MAGNETISING_SHARE) * find_greatest_magnitude(&current);
            let beyond = |i: &f64| i.hypot(magnetising) - magnetising;
            return Some(vec![("conduction", current.iter().map(beyond).collect())]);
        }
        let mut columns = vec![("conduction", current.iter().map(|i| i.abs()).collect())];
        if form.name != "conduction" {
            columns.push(("resistive", current.iter().map(|i| i * i).collect()));
        }
        Some(columns)
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form { name: "both", ..Form::without_shape() }
    }
}

/// The form whose current has a magnetising part.
const MAGNETISED: &str = "magnetised";
/// What is usual in an induction motor near its rated torque.
const MAGNETISING_SHARE: f64 = 0.3;
