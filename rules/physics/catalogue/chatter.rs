//! Self-excited vibration above a depth of cut: noise grows, the mean hardly.

use crate::cut::{estimate_cut_load, multiply_cut, mark_cutting_rows};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use numerics::statistics::quantile;

/// Self-excited vibration in the cut.
#[derive(Debug, Clone, Copy)]
pub struct Chatter;

static DOC: EffectDoc = EffectDoc {
    kind: "chatter",
    family: "cutting",
    law: "y = gain * L * (ap / limit - 1) where ap > limit; mostly the scatter grows, the mean by 0-10 %",
    parameters: &[
        ParameterDoc::new_linear(
            "gain",
            "1",
            (0.0, 1.0),
            "growth of the mean cut at twice the limit",
            "切深为极限两倍时平均切削量的增长",
        ),
        ParameterDoc::new_shape("limit_mm", "mm", (0.05, 20.0), "depth of cut above which it chatters", "开始颤振的切深"),
    ],
    needs: &["load | engaged", "depth_of_cut_mm"],
    source: "stability lobes; above the limit the cutting force grows with the vibration",
    experiment_minutes: 6.0,
    rivals: &["runout", "built_up_edge", "edge_force"],
    en: Texts {
        name: "chatter",
        statement: "Tool and work swing against each other above a certain depth of cut",
        absence: "above a certain depth of cut the scatter of the residual grows, its mean hardly",
        confused_with: "built-up edge (low cutting speed), interrupted cut (follows the work)",
        experiment: "repeat the cut with half the depth, and with the speed changed by a tenth",
    },
    zh: Texts {
        name: "颤振",
        statement: "超过某一切深时刀具与工件自激振动",
        absence: "超过某一切深后残差离散增大，均值几乎不变",
        confused_with: "积屑瘤（低切速）、断续切削（随工件变化）",
        experiment: "切深减半重复切削，再将转速改变十分之一",
    },
};

impl Effect for Chatter {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(depth) = scene.column("depth_of_cut_mm").filter(|_| estimate_cut_load(scene).is_some()) else { return Vec::new() };
        let cutting = mark_cutting_rows(scene);
        let depths = || depth.iter().zip(&cutting).filter(|(_, cutting)| **cutting).map(|(depth, _)| *depth);
        let limits = [0.4, 0.55, 0.7, 0.85].into_iter().filter_map(|share| quantile(depths(), share));
        let mut limits: Vec<f64> = limits.filter(|limit| depths().any(|depth| depth > *limit)).collect();
        limits.dedup();
        limits.into_iter().map(|limit| Form::from_shape(&[("limit_mm", limit)])).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let depth = scene.column("depth_of_cut_mm")?;
        let limit_mm = form.shape_value("limit_mm").unwrap_or(2.0);
        Some(vec![("gain", multiply_cut(scene, |row| (depth[row] / limit_mm - 1.0).max(0.0))?)])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form::from_shape(&[("limit_mm", 2.0)])
    }
}
