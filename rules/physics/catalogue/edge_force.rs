//! Ploughing of the cutting edge: a force along the edge that does not depend on feed.

use crate::cut::{read_engagement, convert_to_output, count_teeth_in_cut};
use crate::drive::{is_axis_output, is_displacement};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Force along the cutting edge.
#[derive(Debug, Clone, Copy)]
pub struct EdgeForce;

static DOC: EffectDoc = EffectDoc {
    kind: "edge_force",
    family: "cutting",
    law: "P = kte * (ap + nose) * vc / 60 * engaged; milled: times the teeth that are in the work at once, \
          z * arccos(1 - 2 ae / D) / (2 pi); a force output takes kte * (ap + nose), a torque output D / 2000 of it",
    parameters: &[
        ParameterDoc::new_linear(
            "kte_n_per_mm",
            "N/mm",
            (0.0, 500.0),
            "force per length of edge in the cut",
            "单位切削刃长度的力",
        ),
        ParameterDoc::new_shape(
            "nose_mm",
            "mm",
            (0.0, 3.0),
            "length of edge around the nose that is in the cut besides the depth",
            "除切深外刀尖圆弧参与切削的刃长",
        ),
    ],
    needs: &["depth_of_cut_mm", "cutting_speed_m_min"],
    source: "edge-force model F = kt b h + kte b; kte 10-80 N/mm for steel and aluminium",
    experiment_minutes: 6.0,
    rivals: &["cutting_power", "flank_wear", "chip_thinning"],
    en: Texts {
        name: "edge force",
        statement: "The edge ploughs: part of the force is there even with hardly any feed",
        absence: "at small feeds the cut takes more than simulated, at large feeds less, constant over time",
        confused_with: "the chip-thickness exponent of the cutting law (absorbs nearly all of it unless feeds differ widely), wear (grows with time)",
        experiment: "cut at four feeds, the largest at least four times the smallest, same depth and speed",
    },
    zh: Texts {
        name: "刃口力",
        statement: "刀刃犁切：即使进给极小也存在的一部分力",
        absence: "小进给时实测偏大，大进给时偏小，不随时间变化",
        confused_with: "切削力公式中的厚度指数（进给范围不大时几乎完全吸收它）、磨损（随时间增长）",
        experiment: "切深和转速不变，用四种进给切削，最大至少为最小的四倍",
    },
};

impl Effect for EdgeForce {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &[MILLED]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let whole = [0.0, 0.8].map(|nose_mm| Form::from_shape(&[("nose_mm", nose_mm)]));
        let milled = Form { name: MILLED, ..Form::without_shape() };
        whole.into_iter().chain([milled]).filter(|form| self.compute_columns(scene, form).is_some()).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        if is_displacement(scene) || is_axis_output(scene) {
            return None;
        }
        let nose_mm = form.shape_value("nose_mm").unwrap_or(0.0);
        let mut length: Vec<f64> = scene.column("depth_of_cut_mm")?.iter().map(|depth| depth + nose_mm).collect();
        if form.name == MILLED {
            length.iter_mut().zip(count_teeth_in_cut(scene)?).for_each(|(length, teeth)| *length *= teeth);
        }
        let edge = convert_to_output(scene, &length)?;
        let engaged = read_engagement(scene);
        Some(vec![("kte_n_per_mm", edge.iter().zip(&engaged).map(|(edge, engaged)| edge * engaged).collect())])
    }
}

/// The form of a cutter whose teeth cut in turn.
const MILLED: &str = "milled";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::tests::{column, scene, set};
    use recording::Recording;

    #[test]
    fn the_teeth_of_a_cutter_plough_in_turn() {
        let mut recording = Recording::new("mill", vec![0.0, 1.0], None);
        for (name, value) in
            [("depth_of_cut_mm", 2.0), ("diameter_mm", 20.0), ("teeth", 4.0), ("cutting_speed_m_min", 60.0)]
        {
            set(&mut recording, name, |_| value);
        }
        // A slot, then a cut of half the diameter: of four teeth two and one are in the work.
        set(&mut recording, "width_of_cut_mm", |row| [20.0, 10.0][row]);
        set(&mut recording, "spindle_power_w", |_| 1.0);
        let milled = Form { name: "milled", ..Form::without_shape() };
        let power = column(&EdgeForce, &scene(&recording, "spindle_power_w"), &milled);
        assert!((power[0] - 4.0).abs() < 1e-9 && (power[1] - 2.0).abs() < 1e-9, "teeth * ap * vc / 60: {power:?}");
    }
}
