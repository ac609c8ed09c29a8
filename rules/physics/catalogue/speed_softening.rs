//! Faster cutting heats the chip and softens it: the specific force falls.

use crate::cut::{multiply_cut, mark_cutting_rows};
use crate::excitation::has_variation;
use crate::{Bound, Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use numerics::statistics::quantile;

/// Specific force that falls with cutting speed.
#[derive(Debug, Clone, Copy)]
pub struct SpeedSoftening;

static DOC: EffectDoc = EffectDoc {
    kind: "speed_softening",
    family: "cutting",
    law: "y = -q * L * ln(vc / v0); v0 the nearest of ... 50, 100, 200, 400 ... m/min to the median of the cut",
    parameters: &[ParameterDoc::new_linear("q", "1", (0.0, 0.5), "exponent of the cutting speed", "切削速度指数")],
    needs: &["load | engaged", "cutting_speed_m_min"],
    source: "kc proportional to (vc / v0)^(-q), q 0.05-0.2; thermal softening as in Johnson and Cook",
    experiment_minutes: 6.0,
    rivals: &["built_up_edge", "gear_stage", "field_weakening", "copper_loss"],
    en: Texts {
        name: "speed softening",
        statement: "Faster cutting softens the chip, so each cubic centimetre takes less energy",
        absence: "cuts at high cutting speed take less than simulated, at low speed more, in proportion to the cut",
        confused_with: "gear stage and field weakening (follow spindle speed, not cutting speed), built-up edge (only at low cutting speed)",
        experiment: "cut two diameters at one spindle speed, and one diameter at two speeds",
    },
    zh: Texts {
        name: "高速软化",
        statement: "切削速度越高切屑越软，单位体积耗能越少",
        absence: "高切速时实测偏小，低切速时偏大，与切削功率成比例",
        confused_with: "档位和弱磁（随主轴转速而非切削速度变化）、积屑瘤（仅低切速）",
        experiment: "同一转速下切两种直径，再同一直径下用两种转速",
    },
};

impl Effect for SpeedSoftening {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn bound(&self) -> Bound {
        // exponents of 0.05 to 0.2 over a range of speeds of ten to one
        Bound::Cut(0.7)
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let columns = self.compute_columns(scene, &Form::without_shape());
        let cutting = mark_cutting_rows(scene);
        let speeds =
            |speed: &[f64]| speed.iter().zip(&cutting).filter(|(_, cutting)| **cutting).map(|(v, _)| *v).collect();
        let differ = scene.column("cutting_speed_m_min").map(speeds).is_some_and(|speeds: Vec<f64>| has_variation(&speeds));
        columns.filter(|_| differ).map(|_| Form::without_shape()).into_iter().collect()
    }

    fn compute_columns(&self, scene: &Scene, _form: &Form) -> Option<ParameterColumns> {
        let speed = scene.column("cutting_speed_m_min")?;
        let cutting = mark_cutting_rows(scene);
        let middle =
            quantile(speed.iter().zip(&cutting).filter(|(_, cutting)| **cutting).map(|(v, _)| v.max(1.0)), 0.5);
        let reference = 100.0 * (middle.unwrap_or(100.0) / 100.0).log2().round().exp2();
        Some(vec![("q", multiply_cut(scene, |row| -(speed[row].max(1.0) / reference).ln())?)])
    }
}
