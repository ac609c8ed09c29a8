//! The meter averages over a window: edges are smeared.

use crate::drive::is_displacement;
use crate::excitation::{list_delays, has_variation};
use crate::state::delay_values;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Averaging in the meter.
#[derive(Debug, Clone, Copy)]
pub struct MeterWindow;

static DOC: EffectDoc = EffectDoc {
    kind: "meter_window",
    family: "measurement",
    law: "y = share * (A(S) - S), S the simulated output; lag: A first order with time constant window_s; mean: A mean over the last window_s; late: lag, delay_s later",
    parameters: &[
        ParameterDoc::new_linear("share", "1", (0.0, 1.5), "one, when the window explains all", "为1时平均窗口可完全解释"),
        ParameterDoc::new_shape(
            "window_s",
            "s",
            (0.01, 30.0),
            "time constant, or length of the window",
            "时间常数或窗口长度",
        ),
        ParameterDoc::new_shape(
            "delay_s",
            "s",
            (0.0, 30.0),
            "time by which what was averaged is reported late",
            "平均之后报告的延迟",
        ),
    ],
    needs: &["the simulated output"],
    source: "power meters average over 0.2-3 s, by a running mean or a first-order filter",
    experiment_minutes: 2.0,
    rivals: &["clock_lag", "spindle_inertia", "entry_exit"],
    en: Texts {
        name: "meter window",
        statement: "The meter averages over a while, so edges come smeared",
        absence: "after every edge the residual decays the same way, upwards edges one sign, downwards the other; nothing before the edge",
        confused_with: "a pure delay (sharp pairs, also before), inertia (only where speed changes)",
        experiment: "start and stop the spindle five times idle; halve the meter's averaging time and repeat",
    },
    zh: Texts {
        name: "仪表平均窗口",
        statement: "仪表在一段时间内取平均，边沿被抹平",
        absence: "每个边沿之后残差以相同方式衰减，上升沿与下降沿符号相反，边沿之前没有",
        confused_with: "纯延时（尖锐的成对峰）、惯量（仅转速变化处）",
        experiment: "空转启停主轴五次；将仪表平均时间减半后重复",
    },
};

impl Effect for MeterWindow {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["lag", "mean", LATE]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        // What grows over minutes shows no fraction of a second.
        if is_displacement(scene) || !scene.simulated_output().is_some_and(has_variation) {
            return Vec::new();
        }
        let windows = list_delays(scene, &[0.5, 1.0, 2.0, 4.0]);
        let form = |name| move |window_s: &f64| Form { name, ..Form::from_shape(&[("window_s", *window_s)]) }.with_full_share();
        let late_windows = list_delays(scene, &LATE_WINDOWS_S);
        let late = late_windows.iter().flat_map(|window_s| LATE_SHARES.map(|share| (*window_s, share * window_s)));
        let late = late.map(|(window_s, delay_s)| {
            let shape = [("window_s", window_s), ("delay_s", delay_s)];
            Form { name: LATE, ..Form::from_shape(&shape) }.with_full_share()
        });
        windows.iter().map(form("lag")).chain(windows.iter().map(form("mean"))).chain(late).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let simulated = scene.simulated_output()?;
        let window_s = form.shape_value("window_s").unwrap_or(1.0).max(1e-6);
        let mut smeared = vec![0.0; scene.rows()];
        for run in scene.runs() {
            let inside = &simulated[run.clone()];
            let time_s = &scene.time_s()[run.clone()];
            let average = if form.name == "mean" { compute_running_mean } else { apply_linear_lag };
            smeared[run.clone()].copy_from_slice(&average(time_s, inside, window_s));
        }
        if form.name == LATE {
            smeared = delay_values(scene, &smeared, form.shape_value("delay_s").unwrap_or(0.0));
        }
        Some(vec![("share", smeared.iter().zip(simulated).map(|(smeared, now)| smeared - now).collect())])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form { name: "lag", ..Form::from_shape(&[("window_s", 1.0)]) }
    }
}

/// Averaged and reported late, in whole or in part: what meters on a bus do, and filters with an echo.
pub(crate) const LATE: &str = "late";
/// Time constants that are tried, s, and delays as shares of them; the fit moves both.
const LATE_WINDOWS_S: [f64; 3] = [0.5, 1.5, 4.0];
const LATE_SHARES: [f64; 2] = [0.5, 1.5];

/// First-order lag, settled at the start, exact for an input that is linear between rows.
fn apply_linear_lag(time_s: &[f64], input: &[f64], tau_s: f64) -> Vec<f64> {
    let mut state = input.to_vec();
    for row in 1..input.len() {
        let dt_s = time_s[row] - time_s[row - 1];
        if dt_s > 0.0 {
            let behind = (input[row] - input[row - 1]) / dt_s * tau_s;
            let left = (-dt_s / tau_s).exp();
            state[row] = input[row] - behind + (state[row - 1] - input[row - 1] + behind) * left;
        }
    }
    state
}

/// Mean over the last `window_s` of an input that is linear between rows, constant before the first.
fn compute_running_mean(time_s: &[f64], input: &[f64], window_s: f64) -> Vec<f64> {
    let mut area = vec![0.0; input.len()];
    for row in 1..input.len() {
        let dt_s = (time_s[row] - time_s[row - 1]).max(0.0);
        area[row] = area[row - 1] + 0.5 * dt_s * (input[row] + input[row - 1]);
    }
    let mut at = 0;
    let mean = |row: usize| {
        let from_s = time_s[row] - window_s;
        while at + 1 < row && time_s[at + 1] <= from_s {
            at += 1;
        }
        (area[row] - integrate_until(time_s, input, &area, at, from_s)) / window_s
    };
    (0..input.len()).map(mean).collect()
}

fn integrate_until(time_s: &[f64], input: &[f64], area: &[f64], at: usize, until_s: f64) -> f64 {
    let into_s = until_s - time_s[at];
    let Some(next) = time_s.get(at + 1) else { return area[at] + input[at] * into_s };
    let dt_s = next - time_s[at];
    if into_s <= 0.0 || dt_s <= 0.0 {
        return area[at] + input[at] * into_s;
    }
    let slope = (input[at + 1] - input[at]) / dt_s;
    area[at] + input[at] * into_s + 0.5 * slope * into_s * into_s
}
