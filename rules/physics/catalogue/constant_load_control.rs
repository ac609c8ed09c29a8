//! A controller holds the load by turning the feed: what the cut gains, the feed loses.

use crate::cut::{mark_cutting_rows, read_engagement};
use crate::excitation::has_variation;
use crate::state::apply_lag_in_each_pass;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use numerics::statistics::{count_to_f64, quantile};

/// Feed that a load controller turns down.
#[derive(Debug, Clone, Copy)]
pub struct ConstantLoadControl;

static DOC: EffectDoc = EffectDoc {
    kind: "constant_load_control",
    family: "control",
    law: "of a feed or its override: y = -response * ln(L / L0) * y0 in the cut; unseen, of a power: y = share * L * g, g = (L / L0)^-exponent - 1 in the cut behind a lag tau, zero when the cut begins; L0, y0 medians in the cut",
    parameters: &[
        ParameterDoc::new_linear(
            "response",
            "1",
            (0.0, 2.0),
            "relative fall of the feed per relative rise of the load",
            "负载相对上升时进给的相对下降",
        ),
        ParameterDoc::new_linear("share", "1", (0.0, 2.0), "1: the controller acts as a whole", "1：控制器完全起作用"),
        ParameterDoc::new_shape(
            "exponent",
            "1",
            (0.01, 1.5),
            "relative fall of the load per relative rise of the load that the program asks for",
            "程序要求的负载相对上升时实际负载的相对下降",
        ),
        ParameterDoc::new_shape("tau_s", "s", (0.2, 30.0), "time constant of the controller", "控制器时间常数"),
    ],
    needs: &["load", "engaged"],
    source: "f = f0 (P0 / P)^(1 / (1 - mc)): adaptive feed control at constant power",
    experiment_minutes: 4.0,
    rivals: &["override_delay", "flank_wear", "hardness_batch", "load_loss", "chip_thinning"],
    en: Texts {
        name: "constant-load control",
        statement: "A controller turns the feed down where the cut is heavy, so power stays flat and the change hides in the feed",
        absence: "power agrees although the tool is worn; the feed falls instead; where only the program's feed is recorded, heavy cuts take less than simulated, after a few seconds",
        confused_with: "wear, hardness and depth themselves: look for them in the feed; unseen, any law by which heavy cuts take less",
        experiment: "fix the feed override at 100 % for one part",
    },
    zh: Texts {
        name: "恒负载控制",
        statement: "控制器在负载大时降低进给，功率保持平稳，变化隐藏在进给中",
        absence: "刀具已磨损但功率一致，进给却下降；仅记录程序进给时，重切削在数秒后功率低于仿真",
        confused_with: "磨损、硬度和切深本身：应在进给中寻找；未记录时，任何使重切削功率偏低的规律",
        experiment: "将进给倍率固定为100%加工一个工件",
    },
};

impl Effect for ConstantLoadControl {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["feed", "unseen"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let tried = if is_feed(scene) {
            vec![Form { name: "feed", ..Form::without_shape() }]
        } else if has_programmed_feed_only(scene) {
            let unseen = |(exponent, tau_s)| build_unseen_form(exponent, tau_s).with_full_share();
            [(0.1, 1.0), (0.1, 3.0), (0.5, 1.0), (0.5, 3.0)].map(unseen).into()
        } else {
            Vec::new()
        };
        let acts = |form: &Form| self.compute_columns(scene, form).is_some_and(|columns| has_variation(&columns[0].1));
        tried.into_iter().filter(acts).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let load = scene.load()?;
        let engaged = read_engagement(scene);
        let cutting = |row: &usize| engaged[*row] > 0.5 && load[*row] > 0.0;
        let reference = quantile((0..scene.rows()).filter(cutting).map(|row| load[row]), 0.5)?;
        if form.name == "unseen" {
            let exponent = form.shape_value("exponent").unwrap_or(0.1);
            let wanted = |row: usize| if cutting(&row) { (load[row] / reference).powf(-exponent) - 1.0 } else { 0.0 };
            let wanted: Vec<f64> = (0..scene.rows()).map(wanted).collect();
            let tau_s = form.shape_value("tau_s").unwrap_or(1.0).max(f64::MIN_POSITIVE);
            let turned = apply_lag_in_each_pass(scene, &wanted, tau_s);
            return Some(vec![("share", load.iter().zip(&turned).map(|(load, turned)| load * turned).collect())]);
        }
        if !is_feed(scene) {
            return None;
        }
        let level = quantile((0..scene.rows()).filter(cutting).map(|row| scene.recorded_output()[row]), 0.5)?;
        let law = |row: usize| if cutting(&row) { -level * (load[row] / reference).ln() } else { 0.0 };
        Some(vec![("response", (0..scene.rows()).map(law).collect())])
    }

    fn default_form(&self, scene: &Scene) -> Form {
        if is_feed(scene) { Form { name: "feed", ..Form::without_shape() } } else { build_unseen_form(0.1, 1.0) }
    }
}

fn build_unseen_form(exponent: f64, tau_s: f64) -> Form {
    Form { name: "unseen", ..Form::from_shape(&[("exponent", exponent), ("tau_s", tau_s)]) }
}

/// Is the output what such a controller turns?
fn is_feed(scene: &Scene) -> bool {
    ["feed_override_pct", "feed_mm_min", "feed_per_rev_mm"].contains(&scene.output_name())
}

/// Share of the rows in the cut in which a feed may differ from the program's.
const DIFFERS: f64 = 0.02;

/// Is the feed that the program asks for recorded, and of what became of it no more than the dial's override? Then a
/// controller acts unseen.
fn has_programmed_feed_only(scene: &Scene) -> bool {
    let Some(program) = scene.column("feed_programmed_mm_min") else { return false };
    let Some(actual) = scene.column("feed_mm_min") else { return true };
    let cutting = mark_cutting_rows(scene);
    let rows: Vec<usize> = (0..scene.rows()).filter(|row| cutting[*row]).collect();
    let agrees = |asked: &dyn Fn(usize) -> f64| {
        let differs = |row: &&usize| (actual[**row] - asked(**row)).abs() > 0.01 * asked(**row).abs();
        count_to_f64(rows.iter().filter(differs).count()) <= DIFFERS * count_to_f64(rows.len())
    };
    let with_dial = |dial: &[f64]| agrees(&|row| program[row] * dial[row] / 100.0);
    agrees(&|row| program[row]) || scene.column("feed_override_pct").is_some_and(with_dial)
}
