//! Power that the spindle takes when it turns and does not cut.

use crate::drive::read_driven_speed_krpm;
use crate::excitation::has_variation;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// No-load power of the spindle.
#[derive(Debug, Clone, Copy)]
pub struct NoLoadPower;

static DOC: EffectDoc = EffectDoc {
    kind: "no_load_power",
    family: "model",
    law: "P = p0 + p1 n + p2 n^2",
    parameters: &[
        ParameterDoc::new_linear(
            "p0_w",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "power with the spindle at rest",
            "主轴静止时的功率",
        ),
        ParameterDoc::new_linear(
            "p1_w_per_rpm",
            "output/rpm",
            (f64::NEG_INFINITY, f64::INFINITY),
            "growth with speed (friction torque)",
            "随转速线性增长（摩擦转矩）",
        ),
        ParameterDoc::new_linear(
            "p2_w_per_rpm2",
            "output/rpm2",
            (f64::NEG_INFINITY, f64::INFINITY),
            "growth with the square of speed (viscous drag)",
            "随转速平方增长（粘性阻力）",
        ),
    ],
    needs: &["speed"],
    source: "no-load power as a polynomial of speed, fitted to an idle ladder",
    experiment_minutes: 5.0,
    rivals: &["windage", "viscous_friction", "dry_friction", "iron_loss", "offset"],
    en: Texts {
        name: "no-load power",
        statement: "Power the spindle needs just to turn, without cutting",
        absence: "with no tool in the work the residual follows the speed, whatever was cut before",
        confused_with: "windage and iron loss (also follow speed only, with other exponents)",
        experiment: "run the spindle idle at five speeds, one minute each, up to the greatest speed",
    },
    zh: Texts {
        name: "空载功率",
        statement: "主轴仅旋转、不切削时所需的功率",
        absence: "空转时残差随转速变化，与之前的切削无关",
        confused_with: "风阻和铁损（同样只随转速变化，但指数不同）",
        experiment: "主轴空转五档转速（直到最高转速），每档一分钟",
    },
};

impl Effect for NoLoadPower {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let turns = read_driven_speed_krpm(scene).is_some_and(|krpm| has_variation(&krpm));
        turns.then(Form::without_shape).into_iter().collect()
    }

    fn compute_columns(&self, scene: &Scene, _form: &Form) -> Option<ParameterColumns> {
        let rpm: Vec<f64> = scene.role_values(Role::Speed)?.iter().map(|rpm| rpm.abs()).collect();
        let square = rpm.iter().map(|rpm| rpm * rpm).collect();
        Some(vec![("p0_w", vec![1.0; rpm.len()]), ("p1_w_per_rpm", rpm), ("p2_w_per_rpm2", square)])
    }
}
