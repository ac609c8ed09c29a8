//! Heat in the windings: grows with the square of torque.

use adapter_core::channel::quantity::Quantity;
use crate::drive::{is_power, read_speed_krpm, compute_torque_at_1000_rpm};
use crate::excitation::has_variation;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Heat in the motor windings.
#[derive(Debug, Clone, Copy)]
pub struct CopperLoss;

static DOC: EffectDoc = EffectDoc {
    kind: "copper_loss",
    family: "drive",
    law: "P = per_load2 * (L / (n / 1000 rpm))^2; L load, n at least 50 rpm; weakened: times (n / base_speed_rpm)^2 above that speed",
    parameters: &[
        ParameterDoc::new_linear(
            "per_load2",
            "1/output",
            (0.0, 1.0),
            "loss per squared load at 1000 rpm",
            "1000 rpm下单位负载平方的损耗",
        ),
        ParameterDoc::new_shape(
            "base_speed_rpm",
            "rpm",
            (10.0, 100_000.0),
            "speed above which the field is weakened, so that a torque takes more current",
            "弱磁起始转速，超过后同样转矩需要更大电流",
        ),
    ],
    needs: &["load", "speed"],
    source: "3 R I^2 with I = T / kt; R 0.05-1 ohm, kt 0.5-3 N m/A",
    experiment_minutes: 8.0,
    rivals: &["load_loss", "field_weakening", "gear_stage", "inverter_loss"],
    en: Texts {
        name: "copper loss",
        statement: "Heat in the motor windings, growing with the square of the torque",
        absence: "heavy cuts at low speed take more than simulated; the same power at high speed does not",
        confused_with: "quadratic load loss (follows power, not torque)",
        experiment: "make the same cutting power at a low and at a high speed",
    },
    zh: Texts {
        name: "铜损",
        statement: "电机绕组发热，随转矩平方增长",
        absence: "低速重切时实测偏大；高速相同功率时没有",
        confused_with: "负载二次损耗（随功率而非转矩变化）",
        experiment: "在低速和高速下产生相同的切削功率",
    },
};

impl Effect for CopperLoss {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn follows_quantity(&self, _quantity: Quantity) -> bool {
        true
    }

    fn form_names(&self) -> &'static [&'static str] {
        &[WEAKENED]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let turns = read_speed_krpm(scene).filter(|krpm| has_variation(krpm));
        let columns = turns.as_ref().and_then(|_| self.compute_columns(scene, &Form::without_shape()));
        let (Some(krpm), Some(_)) = (turns, columns.filter(|columns| has_variation(&columns[0].1))) else { return Vec::new() };
        let top_rpm = 1000.0 * krpm.iter().copied().fold(0.0, f64::max);
        let weakened =
            BASE_SHARES.map(|share| Form { name: WEAKENED, ..Form::from_shape(&[("base_speed_rpm", share * top_rpm)]) });
        std::iter::once(Form::without_shape()).chain(weakened).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let torque = is_power(scene).then(|| compute_torque_at_1000_rpm(scene))??;
        let krpm = read_speed_krpm(scene)?;
        let base_krpm = match form.name {
            WEAKENED => form.shape_value("base_speed_rpm").unwrap_or(1000.0).max(1.0) / 1000.0,
            _ => f64::INFINITY,
        };
        let squared = |(torque, n): (&f64, &f64)| (torque * (n / base_krpm).max(1.0)).powi(2);
        Some(vec![("per_load2", torque.iter().zip(&krpm).map(squared).collect())])
    }
}

/// With the field weakened above a base speed: the torque of a current falls there in proportion to the speed.
const WEAKENED: &str = "weakened";
/// Base speeds that are tried, as shares of the greatest speed; the fit moves them.
const BASE_SHARES: [f64; 3] = [0.25, 0.45, 0.7];
