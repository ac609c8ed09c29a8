//! Air drag on spindle, chuck and fan: grows with the cube of speed.

use crate::drive::{read_driven_speed_krpm, raise_speed_to_exponent};
use crate::excitation::has_variation;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Air drag of what turns.
#[derive(Debug, Clone, Copy)]
pub struct Windage;

static DOC: EffectDoc = EffectDoc {
    kind: "windage",
    family: "spindle",
    law: "P = level * (n / 1000 rpm)^p; a torque or current output takes one exponent less",
    parameters: &[
        ParameterDoc::new_linear("level", "output", (0.0, f64::INFINITY), "drag at 1000 rpm", "1000 rpm时的风阻"),
        ParameterDoc::new_shape("p", "1", (2.5, 3.2), "exponent of speed", "转速指数"),
    ],
    needs: &["speed"],
    source: "turbulent drag on a rotating body: exponent 2.6 (smooth) to 3 (chuck, fan)",
    experiment_minutes: 5.0,
    rivals: &["no_load_power", "viscous_friction", "iron_loss", "field_weakening"],
    en: Texts {
        name: "windage",
        statement: "Air drag on chuck, tool and fan, growing with the cube of speed",
        absence: "idle at the highest speeds takes more than simulated, in the middle less, cold or warm alike",
        confused_with: "viscous friction and the no-load polynomial (absorb it unless the speeds span a wide range), warm-up (fades with time)",
        experiment: "run idle at five speeds, the highest at least two and a half times the lowest",
    },
    zh: Texts {
        name: "风阻",
        statement: "卡盘、刀具和风扇的空气阻力，随转速三次方增长",
        absence: "最高转速空转时实测偏大，中速偏小，冷态热态相同",
        confused_with: "粘性摩擦和空载多项式（转速范围窄时会吸收它）、热机过程（随时间消退）",
        experiment: "空转五档转速，最高至少为最低的两倍半",
    },
};

impl Effect for Windage {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let turns = read_driven_speed_krpm(scene).is_some_and(|krpm| has_variation(&krpm));
        if turns { vec![Form::from_shape(&[("p", 3.0)]), Form::from_shape(&[("p", 2.6)])] } else { Vec::new() }
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        Some(vec![("level", raise_speed_to_exponent(scene, form.shape_value("p").unwrap_or(3.0))?)])
    }
}
