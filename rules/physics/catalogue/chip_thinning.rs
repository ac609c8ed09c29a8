//! At depths below the nose radius the chip is thinner and the force per area higher.

use crate::physics::cut::{cut, cut_times, cutting_rows};
use crate::physics::excitation::{varies, visits};
use crate::physics::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Thinner chips at small depth.
#[derive(Debug, Clone, Copy)]
pub struct ChipThinning;

static DOC: EffectDoc = EffectDoc {
    kind: "chip_thinning",
    family: "cutting",
    law: "y = gain * L * max(0, 1 - ap / r)",
    parameters: &[
        ParameterDoc::linear(
            "gain",
            "1",
            (0.0, 1.5),
            "share by which the cut is heavier at vanishing depth",
            "切深趋近零时切削负载增加的比例",
        ),
        ParameterDoc::shape("r_mm", "mm", (0.1, 3.0), "nose radius of the insert", "刀尖圆弧半径"),
    ],
    needs: &["load | engaged", "depth_of_cut_mm"],
    source: "h = f sin(kappa), with kappa falling where ap is below the nose radius 0.4-1.2 mm",
    experiment_minutes: 5.0,
    rivals: &["edge_force", "cutting_power", "built_up_edge"],
    en: Texts {
        name: "chip thinning",
        statement: "Below the nose radius of the insert the chip gets thin and costs more energy",
        absence: "passes with a depth below the nose radius take more than simulated, in proportion to the cut; deep passes agree",
        confused_with: "edge force (in every pass, in proportion to depth)",
        experiment: "cut at four depths, two below and two above the nose radius, same feed and speed",
    },
    zh: Texts {
        name: "切屑变薄",
        statement: "切深小于刀尖圆弧时切屑变薄，单位能耗升高",
        absence: "切深小于刀尖圆弧的走刀实测偏大，深切时一致",
        confused_with: "刃口力（每次走刀都有，与切深成比例）",
        experiment: "进给和转速不变，用四种切深切削，两种小于、两种大于刀尖圆弧半径",
    },
};

impl Effect for ChipThinning {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(depth) = scene.column("depth_of_cut_mm").filter(|_| cut(scene).is_some()) else { return Vec::new() };
        let cutting = cutting_rows(scene);
        let depths: Vec<f64> = (0..scene.rows()).filter(|row| cutting[*row]).map(|row| depth[row]).collect();
        let shallow = |r_mm: &f64| visits(scene, |row| cutting[row] && depth[row] < *r_mm) >= 3;
        let radii = [0.8, 0.4, 1.2].into_iter().filter(|r_mm| varies(&depths) && shallow(r_mm));
        radii.map(|r_mm| Form::of(&[("r_mm", r_mm)])).collect()
    }

    fn columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let depth = scene.column("depth_of_cut_mm")?;
        let r_mm = form.value("r_mm").unwrap_or(0.8).max(f64::MIN_POSITIVE);
        Some(vec![("gain", cut_times(scene, |row| (1.0 - depth[row] / r_mm).max(0.0))?)])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form::of(&[("r_mm", 0.8)])
    }
}
