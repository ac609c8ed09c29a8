//! At depths below the nose radius the chip is thinner and the force per area higher.

use crate::cut::{estimate_cut_load, multiply_cut, mark_cutting_rows};
use crate::excitation::{has_variation, count_visits};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use numerics::statistics::quantile;

/// Thinner chips at small depth.
#[derive(Debug, Clone, Copy)]
pub struct ChipThinning;

static DOC: EffectDoc = EffectDoc {
    kind: "chip_thinning",
    family: "cutting",
    law: "y = gain * L * max(0, 1 - ap / r); of a mill, over the mean chip thickness: y = share * L * ((h / h0)^-mc - 1), \
          h = 2 fz (ae / D) / arccos(1 - 2 ae / D), h0 its median in the cut, fz the feed per turn where the teeth are not recorded \
          (their number falls out of h / h0); width: the same with fz = 1, where the simulated cut has the feed in its force already",
    parameters: &[
        ParameterDoc::new_linear(
            "gain",
            "1",
            (0.0, 1.5),
            "share by which the cut is heavier at vanishing depth",
            "切深趋近零时切削负载增加的比例",
        ),
        ParameterDoc::new_shape("r_mm", "mm", (0.1, 3.0), "nose radius of the insert", "刀尖圆弧半径"),
        ParameterDoc::new_linear(
            "share",
            "1",
            (0.0, 3.0),
            "1: the force per area rises with thin chips as its exponent says",
            "1：薄切屑的单位切削力按指数规律上升",
        ),
        ParameterDoc::new_shape("mc", "1", (0.05, 0.6), "exponent of the chip thickness", "切屑厚度指数"),
    ],
    needs: &["load | engaged", "depth_of_cut_mm"],
    source: "h = f sin(kappa), with kappa falling where ap is below the nose radius 0.4-1.2 mm; mean chip thickness of a \
             mill and kc = kc1.1 h^-mc: Altintas, Manufacturing Automation, 2nd ed., chapter 2; Kienzle, mc 0.13-0.35",
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

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let told = MILLED.into_iter().filter(|name| thickness_varies(scene, name));
        let mut forms: Vec<Form> =
            told.flat_map(|name| EXPONENTS.map(|mc| Form { name, ..Form::from_shape(&[("mc", mc)]) })).collect();
        let Some(depth) = scene.column("depth_of_cut_mm").filter(|_| estimate_cut_load(scene).is_some()) else { return forms };
        let cutting = mark_cutting_rows(scene);
        let depths: Vec<f64> = (0..scene.rows()).filter(|row| cutting[*row]).map(|row| depth[row]).collect();
        let shallow = |r_mm: &f64| count_visits(scene, |row| cutting[row] && depth[row] < *r_mm) >= 3;
        let radii = [0.8, 0.4, 1.2].into_iter().filter(|r_mm| has_variation(&depths) && shallow(r_mm));
        forms.extend(radii.map(|r_mm| Form::from_shape(&[("r_mm", r_mm)])));
        forms
    }

    fn form_names(&self) -> &'static [&'static str] {
        &MILLED
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        if MILLED.contains(&form.name) {
            let mc = form.shape_value("mc").unwrap_or(0.25);
            let thickness = compute_relative_thickness(scene, form.name)?;
            let law = |row: usize| if thickness[row] > 0.0 { thickness[row].powf(-mc) - 1.0 } else { 0.0 };
            return Some(vec![("share", multiply_cut(scene, law)?)]);
        }
        let depth = scene.column("depth_of_cut_mm")?;
        let r_mm = form.shape_value("r_mm").unwrap_or(0.8).max(f64::MIN_POSITIVE);
        Some(vec![("gain", multiply_cut(scene, |row| (1.0 - depth[row] / r_mm).max(0.0))?)])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form::from_shape(&[("r_mm", 0.8)])
    }
}

/// The form of a mill in which the feed is in the force of the simulated cut already.
const WIDTH: &str = "width";
/// The forms of a mill, over the mean thickness of its chips.
const MILLED: [&str; 2] = ["thickness", WIDTH];
/// Exponents that are tried.
const EXPONENTS: [f64; 2] = [0.2, 0.35];
/// Deviation of the logarithm of the thickness from which it tells anything.
const VARIES: f64 = 0.05;

/// Mean thickness of the chips of a mill in this form, over its median in the cut; zero where there is no chip.
fn compute_relative_thickness(scene: &Scene, form: &str) -> Option<Vec<f64>> {
    let [tooth, turn, width, diameter] =
        ["feed_per_tooth_mm", "feed_per_rev_mm", "width_of_cut_mm", "diameter_mm"].map(|name| scene.column(name));
    let (width, diameter) = (width?, diameter?);
    let feed = if form == WIDTH { None } else { Some(tooth.or(turn)?) };
    let cutting = mark_cutting_rows(scene);
    let of = |row: usize| {
        let share = if diameter[row] > 0.0 { (width[row] / diameter[row]).clamp(0.0, 1.0) } else { 0.0 };
        let feed = feed.map_or(1.0, |feed| feed[row]);
        if !cutting[row] || share <= 0.0 { 0.0 } else { 2.0 * feed * share / (1.0 - 2.0 * share).acos() }
    };
    let all: Vec<f64> = (0..scene.rows()).map(of).collect();
    let usual = quantile(all.iter().copied().filter(|h| *h > 0.0), 0.5)?;
    Some(all.iter().map(|h| h / usual).collect())
}

fn thickness_varies(scene: &Scene, form: &str) -> bool {
    let Some(thickness) = compute_relative_thickness(scene, form).filter(|_| estimate_cut_load(scene).is_some()) else { return false };
    let ln: Vec<f64> = thickness.iter().filter(|h| **h > 0.0).map(|h| h.ln()).collect();
    let middle = numerics::statistics::mean(&ln);
    numerics::statistics::rms(&ln.iter().map(|x| x - middle).collect::<Vec<_>>()) > VARIES
}

#[cfg(test)]
mod tests {
    use super::super::law_tests::{column, forms, with_inputs};
    use crate::Form;

    /// The mean thickness of a chip at a quarter of the diameter is 2 (1/4) / arccos(1/2) of the feed per tooth, at a half 1 / arccos(0).
    #[test]
    fn thin_chips_of_a_mill_need_no_number_of_teeth() {
        let width = |row: usize| [10.0, 20.0, 20.0, 0.0][row % 4];
        let engaged = |row: usize| f64::from(u8::from(!row.is_multiple_of(4) || row.is_multiple_of(8)));
        let (diameter, turn, load) = (|_: usize| 40.0, |_: usize| 0.3, |_: usize| 100.0);
        let inputs: [(&str, &dyn Fn(usize) -> f64); 5] = [
            ("engaged", &engaged),
            ("width_of_cut_mm", &width),
            ("diameter_mm", &diameter),
            ("feed_per_rev_mm", &turn),
            ("load", &load),
        ];
        let mut mill = with_inputs(400, 1.0, "spindle_power_w", &inputs);
        mill.set_load(Some(vec![100.0; 400]));
        let names: Vec<&str> = forms("chip_thinning", &mill).iter().map(|form| form.name).collect();
        assert_eq!(names, ["thickness", "thickness", "width", "width"]);
        let h = |q: f64| 2.0 * q / (1.0 - 2.0 * q).acos();
        let expected = 100.0 * ((h(0.25) / h(0.5)).powf(-0.2) - 1.0);
        for name in ["thickness", "width"] {
            let law = column("chip_thinning", &mill, &Form { name, ..Form::from_shape(&[("mc", 0.2)]) });
            assert!((law[8] - expected).abs() < 1e-9 && law[1].abs() < 1e-9, "{name}: {:?} for {expected}", &law[..9]);
        }
    }
}
