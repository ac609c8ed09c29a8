//! The ripple of the mains, sampled too slowly, looks like a slow wave.

use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use std::f64::consts::PI;

/// Mains ripple folded by slow sampling.
#[derive(Debug, Clone, Copy)]
pub struct RippleAlias;

static DOC: EffectDoc = EffectDoc {
    kind: "ripple_alias",
    family: "measurement",
    law: "y = cosine * cos(2 pi f t) + sine * sin(2 pi f t), f = |2 f_mains - k f_sampling|; as a candidate: scale * a wave near f whose phase wanders with the mains, followed row by row",
    parameters: &[
        ParameterDoc::new_linear(
            "scale",
            "1",
            (0.0, 3.0),
            "size over that of the wave as it is followed",
            "相对于跟踪所得波动的比例",
        ),
        ParameterDoc::new_linear(
            "cosine",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "part in step with the clock",
            "与时钟同相部分",
        ),
        ParameterDoc::new_linear(
            "sine",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "part a quarter period later",
            "滞后四分之一周期部分",
        ),
        ParameterDoc::new_shape(
            "frequency_hz",
            "Hz",
            (1e-05, 50.0),
            "frequency as it appears in the recording",
            "记录中的表观频率",
        ),
    ],
    needs: &[],
    source: "three-phase power ripples at twice the mains frequency; 100 Hz sampled at 1 Hz wanders with the mains within 0.05 Hz",
    experiment_minutes: 5.0,
    rivals: &["runout", "zero_drift", "auxiliary_switch"],
    en: Texts {
        name: "mains ripple",
        statement: "The ripple of the mains, sampled slowly, shows as a slow wave",
        absence: "a narrow line in the spectrum of the residual that moves when the polling rate changes",
        confused_with: "run-out (follows the spindle), zero drift (no fixed period)",
        experiment: "poll at 1.1 Hz instead of 1 Hz: the wave changes its period",
    },
    zh: Texts {
        name: "电源纹波混叠",
        statement: "采样过慢时，电源纹波表现为缓慢波动",
        absence: "残差频谱中有一条窄线，改变采样周期时移动",
        confused_with: "径向跳动（随主轴）、零点漂移（无固定周期）",
        experiment: "将采样由1 Hz改为1.1 Hz：波动周期随之改变",
    },
};

impl Effect for RippleAlias {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, _scene: &Scene) -> Vec<Form> {
        Vec::new()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let turn = 2.0 * PI * form.shape_value("frequency_hz")?;
        let wave = |law: fn(f64) -> f64| scene.time_s().iter().map(|t| law(turn * t)).collect();
        Some(vec![("cosine", wave(f64::cos)), ("sine", wave(f64::sin))])
    }

    fn default_form(&self, scene: &Scene) -> Form {
        Form::from_shape(&[("frequency_hz", 0.1 / scene.period_s())])
    }

    fn has_hidden_state(&self) -> bool {
        true
    }
}
