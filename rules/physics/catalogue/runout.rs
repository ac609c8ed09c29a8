//! Tool or work runs out of true: the cut swells and fades once per turn.

use crate::cut::{estimate_cut_load, multiply_cut};
use crate::drive::RAD_PER_S_OF_RPM;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Cut that swells once per turn.
#[derive(Debug, Clone, Copy)]
pub struct Runout;

static DOC: EffectDoc = EffectDoc {
    kind: "runout",
    family: "cutting",
    law: "y = (cosine * cos(phi) + sine * sin(phi)) * L; dphi/dt = 2 pi n / 60, phi = 0 at the start of each run; as a candidate also: scale * a tone of each cut's own size and phase, followed row by row",
    parameters: &[
        ParameterDoc::new_linear(
            "scale",
            "1",
            (0.0, 3.0),
            "size over that of the tone as it is followed",
            "相对于跟踪所得单音的比例",
        ),
        ParameterDoc::new_linear("cosine", "1", (-1.0, 1.0), "share of the cut in step with the turn", "与转角同相的比例"),
        ParameterDoc::new_linear("sine", "1", (-1.0, 1.0), "share a quarter turn later", "滞后四分之一转的比例"),
    ],
    needs: &["load | engaged", "speed"],
    source: "P (1 + e cos(w t + phi)), e 0.05-0.5; only where the sampling is faster than 2.2 samples per turn",
    experiment_minutes: 2.0,
    rivals: &["chatter", "ripple_alias", "entry_exit"],
    en: Texts {
        name: "run-out",
        statement: "Tool or work runs out of true, so the cut swells and fades once per turn",
        absence: "in the cut the residual is a tone at the frequency of the spindle",
        confused_with: "chatter (a frequency that does not follow the spindle), mains ripple (does not follow it either)",
        experiment: "cut at two speeds, and measure the run-out with a dial gauge",
    },
    zh: Texts {
        name: "径向跳动",
        statement: "刀具或工件偏心，每转一周切削量起伏一次",
        absence: "切削时残差是主轴转频的单音",
        confused_with: "颤振（频率不随主轴）、电源纹波（也不随主轴）",
        experiment: "用两种转速切削，并用千分表测量跳动",
    },
};

impl Effect for Runout {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let (Some(speed), Some(cut)) = (scene.role_values(Role::Speed), estimate_cut_load(scene)) else { return Vec::new() };
        let in_cut = cut.iter().zip(speed).filter(|(cut, _)| **cut != 0.0).map(|(_, speed)| speed.abs());
        let fastest_rpm = in_cut.fold(0.0, f64::max);
        let told = fastest_rpm > 1.0 && fastest_rpm / 60.0 * scene.period_s() * 2.2 < 1.0;
        told.then(Form::without_shape).into_iter().collect()
    }

    fn compute_columns(&self, scene: &Scene, _form: &Form) -> Option<ParameterColumns> {
        let turn = compute_turn_rad(scene)?;
        let cosine = multiply_cut(scene, |row| turn[row].cos())?;
        let sine = multiply_cut(scene, |row| turn[row].sin())?;
        Some(vec![("cosine", cosine), ("sine", sine)])
    }
}

/// Angle of the spindle since the start of the run.
fn compute_turn_rad(scene: &Scene) -> Option<Vec<f64>> {
    let speed = scene.role_values(Role::Speed)?;
    let mut turn = vec![0.0; scene.rows()];
    for run in scene.runs() {
        for row in run.start + 1..run.end {
            let dt_s = scene.time_s()[row] - scene.time_s()[row - 1];
            turn[row] = turn[row - 1] + 0.5 * (speed[row] + speed[row - 1]) * RAD_PER_S_OF_RPM * dt_s;
        }
    }
    Some(turn)
}
