//! The meter's clock is late or early against the controller's.

use crate::drive::{is_displacement, compute_rate};
use crate::excitation::{list_delays, has_variation};
use crate::state::delay_values;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Meter late or early against the controller.
#[derive(Debug, Clone, Copy)]
pub struct ClockLag;

static DOC: EffectDoc = EffectDoc {
    kind: "clock_lag",
    family: "measurement",
    law: "y = share * (S(t - delay) - S(t)), S the simulated output; small: y = -lag_s * dS/dt",
    parameters: &[
        ParameterDoc::new_linear("share", "1", (0.0, 1.5), "one, when the delay explains all", "为1时延时可完全解释"),
        ParameterDoc::new_linear(
            "lag_s",
            "s",
            (-2.0, 5.0),
            "how late the recording is, where it is small against the ramps",
            "记录滞后的时间（相对斜坡较小时）",
        ),
        ParameterDoc::new_shape(
            "delay_s",
            "s",
            (-3.0, 10.0),
            "how late the recording is; negative when early",
            "记录滞后的时间；超前为负",
        ),
    ],
    needs: &["the simulated output"],
    source: "definition; 0.1-3 s and 10-100 ppm between a power meter and a controller",
    experiment_minutes: 2.0,
    rivals: &["meter_window", "spindle_inertia", "engagement_timing", "override_delay"],
    en: Texts {
        name: "clock lag",
        statement: "The recorded output is later (or earlier) than what the controller reports",
        absence: "at every edge, of speed as of cutting, a pair of opposite peaks as large as the edge; nothing in steady states",
        confused_with: "inertia (only where speed changes), averaging in the meter (smears one way), a late engagement flag (cutting edges only)",
        experiment: "start and stop the spindle five times idle, and enter the cut five times",
    },
    zh: Texts {
        name: "时钟滞后",
        statement: "记录的输出比控制器报告的时间晚（或早）",
        absence: "每个跳变处（转速和切削）出现一对与跳变同样大的正负峰，稳态无差异",
        confused_with: "惯量（仅转速变化处）、仪表平均（单向拖尾）、切入标志滞后（仅切削边沿）",
        experiment: "空转启停主轴五次，再切入五次",
    },
};

impl Effect for ClockLag {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["delay", "small"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        // What grows over minutes shows no fraction of a second.
        if is_displacement(scene) || !scene.simulated_output().is_some_and(has_variation) {
            return Vec::new();
        }
        let delays = list_delays(scene, &[0.25, 0.5, 1.0, 1.5, 2.0, 3.0]);
        let both = delays.iter().flat_map(|delay| [*delay, -delay]);
        let late = |delay| Form { name: "delay", ..Form::from_shape(&[("delay_s", delay)]) }.with_full_share();
        both.map(late).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let simulated = scene.simulated_output()?;
        if form.name == "small" {
            return Some(vec![("lag_s", compute_rate(scene, simulated).iter().map(|rate| -rate).collect())]);
        }
        let late = delay_values(scene, simulated, form.shape_value("delay_s").unwrap_or(0.0));
        Some(vec![("share", late.iter().zip(simulated).map(|(late, now)| late - now).collect())])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form { name: "delay", ..Form::from_shape(&[("delay_s", 0.0)]) }
    }
}
