//! Heat in the windings: grows with the square of torque.

use crate::physics::drive::{is_power, krpm, torque_at_1000_rpm};
use crate::physics::excitation::varies;
use crate::physics::{Columns, Effect, EffectDoc, Entry, Form, ParameterDoc, Scene, Texts};

/// Heat in the motor windings.
#[derive(Debug, Clone, Copy)]
pub struct CopperLoss;

static DOC: EffectDoc = EffectDoc {
    kind: "copper_loss",
    family: "drive",
    law: "P = per_load2 * (L / (n / 1000 rpm))^2; L load, n at least 50 rpm",
    parameters: &[ParameterDoc {
        name: "per_load2",
        unit: "1/output",
        entry: Entry::Linear,
        range: (0.0, 1.0),
        en: "loss per squared load at 1000 rpm",
        zh: "1000 rpm下单位负载平方的损耗",
    }],
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

    fn forms(&self, scene: &Scene) -> Vec<Form> {
        let turns = krpm(scene).is_some_and(|krpm| varies(&krpm));
        let columns = turns.then(|| self.columns(scene, &Form::plain())).flatten();
        columns.filter(|columns| varies(&columns[0].1)).map(|_| Form::plain()).into_iter().collect()
    }

    fn columns(&self, scene: &Scene, _form: &Form) -> Option<Columns> {
        let torque = is_power(scene).then(|| torque_at_1000_rpm(scene))??;
        Some(vec![("per_load2", torque.iter().map(|torque| torque * torque).collect())])
    }
}
