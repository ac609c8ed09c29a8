//! A controller holds the load by turning the feed: what the cut gains, the feed loses.

use crate::physics::cut::engaged;
use crate::physics::excitation::varies;
use crate::physics::{Columns, Effect, EffectDoc, Entry, Form, ParameterDoc, Scene, Texts};
use crate::statistics::quantile;

/// Feed that a load controller turns down.
#[derive(Debug, Clone, Copy)]
pub struct ConstantLoadControl;

static DOC: EffectDoc = EffectDoc {
    kind: "constant_load_control",
    family: "control",
    law: "y = -response * ln(L / L0) * y0 in the cut; L0, y0 medians in the cut; the output is a feed or its override",
    parameters: &[ParameterDoc {
        name: "response",
        unit: "1",
        entry: Entry::Linear,
        range: (0.0, 2.0),
        en: "relative fall of the feed per relative rise of the load",
        zh: "负载相对上升时进给的相对下降",
    }],
    needs: &["load", "engaged"],
    source: "f = f0 (P0 / P)^(1 / (1 - mc)): adaptive feed control at constant power",
    experiment_minutes: 4.0,
    rivals: &["override_delay", "flank_wear", "hardness_batch"],
    en: Texts {
        name: "constant-load control",
        statement: "A controller turns the feed down where the cut is heavy, so power stays flat and the change hides in the feed",
        absence: "power agrees although the tool is worn; the feed falls instead",
        confused_with: "wear, hardness and depth themselves: look for them in the feed",
        experiment: "fix the feed override at 100 % for one part",
    },
    zh: Texts {
        name: "恒负载控制",
        statement: "控制器在负载大时降低进给，功率保持平稳，变化隐藏在进给中",
        absence: "刀具已磨损但功率一致，进给却下降",
        confused_with: "磨损、硬度和切深本身：应在进给中寻找",
        experiment: "将进给倍率固定为100%加工一个工件",
    },
};

impl Effect for ConstantLoadControl {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn forms(&self, scene: &Scene) -> Vec<Form> {
        let columns = self.columns(scene, &Form::plain());
        columns.filter(|columns| varies(&columns[0].1)).map(|_| Form::plain()).into_iter().collect()
    }

    fn columns(&self, scene: &Scene, _form: &Form) -> Option<Columns> {
        if !["feed_override_pct", "feed_mm_min", "feed_per_rev_mm"].contains(&scene.output()) {
            return None;
        }
        let load = scene.load()?;
        let engaged = engaged(scene);
        let cutting = |row: &usize| engaged[*row] > 0.5 && load[*row] > 0.0;
        let reference = quantile((0..scene.rows()).filter(cutting).map(|row| load[row]), 0.5)?;
        let level = quantile((0..scene.rows()).filter(cutting).map(|row| scene.recorded()[row]), 0.5)?;
        let law = |row: usize| if cutting(&row) { -level * (load[row] / reference).ln() } else { 0.0 };
        Some(vec![("response", (0..scene.rows()).map(law).collect())])
    }
}
