//! The real feed follows the reported one late.

use crate::cut::{estimate_cut_load, mark_cutting_rows};
use crate::excitation::{list_delays, count_visits};
use crate::state::delay_values;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Feed that follows late.
#[derive(Debug, Clone, Copy)]
pub struct OverrideDelay;

static DOC: EffectDoc = EffectDoc {
    kind: "override_delay",
    family: "control",
    law: "y = share * L * ((f(t - delay) / f(t))^0.75 - 1)",
    parameters: &[
        ParameterDoc::new_linear("share", "1", (0.0, 1.5), "one, when the delay explains all", "为1时延时可完全解释"),
        ParameterDoc::new_shape("delay_s", "s", (0.0, 5.0), "how late the real feed follows", "实际进给的滞后时间"),
    ],
    needs: &["load", "feed_mm_min | feed_programmed_mm_min"],
    source: "f_actual(t) = f_commanded(t - d), 50-500 ms and a ramp",
    experiment_minutes: 3.0,
    rivals: &["clock_lag", "engagement_timing", "entry_exit"],
    en: Texts {
        name: "override delay",
        statement: "The real feed follows the command late",
        absence: "after every change of the feed in the cut the residual is a short peak with the sign of the old feed",
        confused_with: "a late meter (also where the spindle speed changes)",
        experiment: "step the feed override between 80 and 120 % ten times in one cut",
    },
    zh: Texts {
        name: "倍率延时",
        statement: "实际进给滞后于指令",
        absence: "切削中每次进给变化后残差出现短峰，符号取决于原进给",
        confused_with: "仪表滞后（主轴转速变化处也有）",
        experiment: "一次切削中进给倍率在80%和120%之间阶跃十次",
    },
};

impl Effect for OverrideDelay {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(feed) = read_feed(scene).filter(|_| scene.load().is_some() && estimate_cut_load(scene).is_some()) else {
            return Vec::new();
        };
        let cutting = mark_cutting_rows(scene);
        let changes =
            |row: usize| row > 0 && cutting[row] && cutting[row - 1] && (feed[row] / feed[row - 1] - 1.0).abs() > 0.02;
        if count_visits(scene, changes) < 3 {
            return Vec::new();
        }
        list_delays(scene, &[0.1, 0.25, 0.5, 1.0, 2.0]).iter().map(|delay| Form::from_shape(&[("delay_s", *delay)])).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let feed = hold_feed_before_cut(scene)?;
        let before = delay_values(scene, &feed, form.shape_value("delay_s").unwrap_or(0.25));
        let law = |((load, before), now): ((&f64, &f64), &f64)| {
            let ratio = if *now > 0.0 { (before / now).clamp(0.0, 4.0) } else { 1.0 };
            load * (ratio.powf(0.75) - 1.0)
        };
        Some(vec![("share", scene.load_at_output()?.iter().zip(&before).zip(&feed).map(law).collect())])
    }

    fn reads_load_at_output(&self) -> bool {
        true
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form::from_shape(&[("delay_s", 0.25)])
    }
}

/// The feed, before each pass that of its first row: the delay acts on changes while cutting, not on the approach.
fn hold_feed_before_cut(scene: &Scene) -> Option<Vec<f64>> {
    let mut feed = read_feed(scene)?;
    for pass in scene.passes() {
        let start = scene.runs().iter().find(|run| run.contains(&pass.start)).map_or(0, |run| run.start);
        let engaged = scene.role_values(Role::Engaged)?;
        // The way in and what lies before it, up to where the tool leaves the pass before.
        let mut idle = false;
        let is_before = |row: &usize| {
            idle |= engaged[*row] <= 0.0;
            engaged[*row] <= if idle { 0.0 } else { 0.5 }
        };
        let approach = (start..pass.start).rev().take_while(is_before).collect::<Vec<_>>();
        let first = feed[pass.start];
        approach.into_iter().for_each(|row| feed[row] = first);
    }
    Some(feed)
}

/// The feed as reported, or else as commanded times its override.
fn read_feed(scene: &Scene) -> Option<Vec<f64>> {
    if let Some(feed) = scene.column("feed_mm_min") {
        return Some(feed.to_vec());
    }
    let programmed = scene.column("feed_programmed_mm_min")?;
    let percent = scene.column("feed_override_pct");
    Some(
        programmed
            .iter()
            .enumerate()
            .map(|(row, feed)| feed * percent.map_or(1.0, |percent| percent[row] / 100.0))
            .collect(),
    )
}
