//! The zero of the meter creeps, with cabinet temperature or age.

use adapter_core::channel::quantity::Quantity;
use crate::excitation::{compute_clock_elapsed_s, compute_recording_share};
use crate::{Effect, EffectDoc, Entry, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use std::f64::consts::PI;

/// Zero of the meter that creeps.
#[derive(Debug, Clone, Copy)]
pub struct ZeroDrift;

/// A coefficient of a wander or a bend.
const fn define_wave_coefficient(name: &'static str, en: &'static str, zh: &'static str) -> ParameterDoc {
    let range = (f64::NEG_INFINITY, f64::INFINITY);
    ParameterDoc { name, unit: "output", entry: Entry::Linear, range, en, zh }
}

/// Names of the cosines.
const WAVES: [&str; 8] = ["c1", "c2", "c3", "c4", "c5", "c6", "c7", "c8"];

/// Where a bent drift may change its pace, as shares of the recording.
const BENDS: [(&str, f64); 3] = [("bend_1", 0.25), ("bend_2", 0.5), ("bend_3", 0.75)];

static DOC: EffectDoc = EffectDoc {
    kind: "zero_drift",
    family: "measurement",
    law: "linear: y = drift * (share of the recording - 1/2); bent: the same with other paces from each quarter on; settling: y = settled * (1 - exp(-t/tau)); wander: y = sum of c_k cos(k pi share), k up to 4, restless: up to 8",
    parameters: &[
        ParameterDoc::new_linear(
            "drift",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "change over the recording",
            "整个记录期间的变化量",
        ),
        ParameterDoc::new_linear(
            "settled",
            "output",
            (f64::NEG_INFINITY, f64::INFINITY),
            "change once settled",
            "稳定后的变化量",
        ),
        define_wave_coefficient(
            "bend_1",
            "change of pace at a quarter of the recording, over its whole length",
            "记录四分之一处速率的变化",
        ),
        define_wave_coefficient("bend_2", "change of pace at the middle of the recording, over its whole length", "记录中点处速率的变化"),
        define_wave_coefficient(
            "bend_3",
            "change of pace at three quarters of the recording, over its whole length",
            "记录四分之三处速率的变化",
        ),
        define_wave_coefficient("c1", "wander with 1 half waves over the recording", "整个记录内1个半波的缓变"),
        define_wave_coefficient("c2", "wander with 2 half waves over the recording", "整个记录内2个半波的缓变"),
        define_wave_coefficient("c3", "wander with 3 half waves over the recording", "整个记录内3个半波的缓变"),
        define_wave_coefficient("c4", "wander with 4 half waves over the recording", "整个记录内4个半波的缓变"),
        define_wave_coefficient("c5", "wander with 5 half waves over the recording", "整个记录内5个半波的缓变"),
        define_wave_coefficient("c6", "wander with 6 half waves over the recording", "整个记录内6个半波的缓变"),
        define_wave_coefficient("c7", "wander with 7 half waves over the recording", "整个记录内7个半波的缓变"),
        define_wave_coefficient("c8", "wander with 8 half waves over the recording", "整个记录内8个半波的缓变"),
        ParameterDoc::new_shape("tau_s", "s", (60.0, 14400.0), "time constant of settling", "稳定时间常数"),
    ],
    needs: &[],
    source: "meter electronics: 5-40 W over 10-60 min with cabinet temperature",
    experiment_minutes: 30.0,
    rivals: &["offset", "bearing_warm_up", "sensor_gain", "ambient_drift"],
    en: Texts {
        name: "zero drift",
        statement: "The zero of the meter creeps over minutes to hours",
        absence: "the residual wanders slowly and is the same at standstill, idle and in the cut",
        confused_with: "bearing warm-up (scales with speed, absent at standstill), a gain that drifts (scales with the output), a constant offset",
        experiment: "record half an hour at standstill with the drives on",
    },
    zh: Texts {
        name: "零点漂移",
        statement: "仪表零点在数分钟到数小时内缓慢变化",
        absence: "残差缓慢漂移，静止、空转和切削时相同",
        confused_with: "轴承热机（随转速变化，静止时没有）、增益漂移（与输出成比例）、常量偏差",
        experiment: "驱动使能、静止状态下记录半小时",
    },
};

impl Effect for ZeroDrift {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn follows_quantity(&self, _quantity: Quantity) -> bool {
        true
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["linear", "settling", "bent", "wander", "restless"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if scene.rows() < 20 {
            return Vec::new();
        }
        let whole_s = compute_clock_elapsed_s(scene).last().copied().unwrap_or(0.0);
        let mut forms = vec![Form { name: "linear", ..Form::without_shape() }];
        let grid = [600.0, 1200.0, 2400.0, 4800.0].into_iter().filter(|tau_s| *tau_s < 0.5 * whole_s);
        forms.extend(grid.map(|tau_s| Form { name: "settling", ..Form::from_shape(&[("tau_s", tau_s)]) }));
        forms.extend(["bent", "wander", "restless"].map(|name| Form { name, ..Form::without_shape() }));
        forms
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let share = compute_recording_share(scene);
        match form.name {
            "settling" => {
                let tau_s = form.shape_value("tau_s").unwrap_or(1200.0);
                let elapsed_s = compute_clock_elapsed_s(scene);
                Some(vec![("settled", elapsed_s.iter().map(|t| 1.0 - (-t / tau_s).exp()).collect())])
            }
            "wander" | "restless" => {
                let most = if form.name == "wander" { 4 } else { WAVES.len() };
                let wave = |k: f64| share.iter().map(|share| (k * PI * share).cos()).collect();
                Some(WAVES[..most].iter().zip(1..).map(|(name, k)| (*name, wave(f64::from(k)))).collect())
            }
            "bent" => {
                let bend = |at: f64| share.iter().map(|share| (share - at).max(0.0)).collect();
                let mut columns = vec![("drift", share.iter().map(|share| share - 0.5).collect())];
                columns.extend(BENDS.iter().map(|(name, at)| (*name, bend(*at))));
                Some(columns)
            }
            _ => Some(vec![("drift", share.iter().map(|share| share - 0.5).collect())]),
        }
    }

    fn has_hidden_state(&self) -> bool {
        true
    }
}
