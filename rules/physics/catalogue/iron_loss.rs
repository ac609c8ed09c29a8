//! Losses in the motor's iron: grow a little faster than speed.

use crate::drive::{read_driven_speed_krpm, raise_speed_to_exponent};
use crate::excitation::has_variation;
use crate::{Effect, EffectDoc, Form, OutputKind, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Losses in the iron of the motor.
#[derive(Debug, Clone, Copy)]
pub struct IronLoss;

static DOC: EffectDoc = EffectDoc {
    kind: "iron_loss",
    family: "drive",
    law: "P = level * (n / 1000 rpm)^p; a torque or current output takes one exponent less",
    parameters: &[
        ParameterDoc::new_linear("level", "output", (0.0, f64::INFINITY), "loss at 1000 rpm", "1000 rpm时的损耗"),
        ParameterDoc::new_shape("p", "1", (1.0, 2.0), "exponent of speed", "转速指数"),
    ],
    needs: &["speed"],
    source: "hysteresis with n^1 to n^1.3, eddy currents with n^2; 50-300 W at base speed",
    experiment_minutes: 10.0,
    rivals: &["no_load_power", "windage", "viscous_friction"],
    en: Texts {
        name: "iron loss",
        statement: "Losses in the iron of the motor, growing with speed, loaded or not",
        absence: "idle power bends with speed in a way a quadratic cannot follow",
        confused_with: "the no-load polynomial (absorbs it), windage (much steeper)",
        experiment: "run idle at five speeds, then let the spindle coast down from the top with the drive off",
    },
    zh: Texts {
        name: "铁损",
        statement: "电机铁芯损耗，随转速增长，与负载无关",
        absence: "空载功率随转速的弯曲无法用二次多项式表示",
        confused_with: "空载多项式（会吸收它）、风阻（陡得多）",
        experiment: "空转五档转速，然后断开驱动从最高转速自由停车",
    },
};

impl Effect for IronLoss {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let turns = read_driven_speed_krpm(scene).is_some_and(|krpm| has_variation(&krpm));
        // On a drive whose only motion is its own speed, a loss torque that hardly grows is a shape of its friction.
        let drive =
            scene.output_kind() == OutputKind::Force && scene.role_name(Role::Velocity) == scene.role_name(Role::Speed);
        (turns && !drive).then(|| self.default_form(scene)).into_iter().collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        Some(vec![("level", raise_speed_to_exponent(scene, form.shape_value("p").unwrap_or(1.3))?)])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form::from_shape(&[("p", 1.3)])
    }
}
