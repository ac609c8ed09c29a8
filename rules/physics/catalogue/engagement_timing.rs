//! The flag that says the tool is in the work comes late or early.

use crate::cut::estimate_cut_load;
use crate::excitation::list_delays;
use crate::state::delay_values;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};

/// Engagement flag late or early.
#[derive(Debug, Clone, Copy)]
pub struct EngagementTiming;

static DOC: EffectDoc = EffectDoc {
    kind: "engagement_timing",
    family: "measurement",
    law: "y = share * (engaged(t - delay) - engaged(t)) * L, L held from the nearest row in the cut, losses included",
    parameters: &[
        ParameterDoc::new_linear("share", "1", (0.0, 1.5), "one, when the timing explains all", "为1时时序可完全解释"),
        ParameterDoc::new_shape(
            "delay_s",
            "s",
            (-10.0, 10.0),
            "how much later than flagged the tool cuts; negative when earlier",
            "实际切削比标志晚的时间；提前为负",
        ),
    ],
    needs: &["load", "engaged"],
    source: "definition; approach and overrun distances over the feed",
    experiment_minutes: 3.0,
    rivals: &["clock_lag", "entry_exit", "override_delay"],
    en: Texts {
        name: "engagement timing",
        statement: "The flag for the tool in the work comes early or late against the real cut",
        absence: "at the edges of every pass the residual is a full step of the cut for the same short time; at changes of speed nothing",
        confused_with: "a late meter (also where speed changes), entry and exit ramps (build up gradually)",
        experiment: "cut one pass with half the feed: if the time doubles it is a distance, else a delay",
    },
    zh: Texts {
        name: "切入标志时序",
        statement: "切入标志比实际切削早或晚",
        absence: "每次走刀边沿残差为一段固定时间的整幅跳变，转速变化处没有",
        confused_with: "仪表滞后（转速变化处也有）、切入切出斜坡（逐渐建立）",
        experiment: "进给减半走刀一次：时间加倍则为距离，否则为延时",
    },
};

impl Effect for EngagementTiming {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if scene.load().is_none() || estimate_cut_load(scene).is_none() || scene.passes().len() < 3 {
            return Vec::new();
        }
        let delays = list_delays(scene, &[0.5, 1.0, 2.0, 3.0, 5.0]);
        let both = delays.iter().flat_map(|delay| [*delay, -delay]);
        both.map(|delay| Form::from_shape(&[("delay_s", delay)]).with_full_share()).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let engaged = scene.role_values(Role::Engaged)?;
        let load = hold_cut_load(scene, scene.load_at_output()?, engaged);
        let shifted = delay_values(scene, engaged, form.shape_value("delay_s").unwrap_or(0.0));
        let law = |row: usize| (shifted[row] - engaged[row]) * load[row];
        Some(vec![("share", (0..scene.rows()).map(law).collect())])
    }

    fn reads_load_at_output(&self) -> bool {
        true
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form::from_shape(&[("delay_s", 0.0)])
    }
}

/// The load of a tool fully in the work; where it is not, that of the nearest row of the run in which it nearly is.
fn hold_cut_load(scene: &Scene, load: &[f64], engaged: &[f64]) -> Vec<f64> {
    let time_s = scene.time_s();
    let mut held = load.to_vec();
    for run in scene.runs() {
        let mut distance_s = vec![f64::INFINITY; run.len()];
        for rows in [run.clone().collect::<Vec<_>>(), run.clone().rev().collect()] {
            let mut last = None;
            for row in rows {
                last = if engaged[row] > 0.5 { Some(row) } else { last };
                let Some(near) = last else { continue };
                let away_s = (time_s[row] - time_s[near]).abs();
                if away_s < distance_s[row - run.start] {
                    distance_s[row - run.start] = away_s;
                    held[row] = load[near] / engaged[near];
                }
            }
        }
    }
    held
}
