//! Power of the cut after Kienzle: specific force times the section of the chip, falling with its thickness.

use crate::cut::{read_engagement, convert_to_output};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use std::f64::consts::PI;

/// Cutting power after Kienzle.
#[derive(Debug, Clone, Copy)]
pub struct CuttingPower;

static DOC: EffectDoc = EffectDoc {
    kind: "cutting_power",
    family: "model",
    law: "turning: P = kc11 ap f^(1-mc) vc / 60; milling and drilling: P = kc11 hm^(-mc) Q / 60; times engaged. A force output takes ap f^(1-mc), a torque output D / 2000 of it",
    parameters: &[
        ParameterDoc::new_linear(
            "kc11_n_per_mm2",
            "N/mm2",
            (0.0, 20000.0),
            "specific cutting force of a chip 1 mm thick and 1 mm wide",
            "单位切削力（切屑厚、宽各1 mm）",
        ),
        ParameterDoc::new_shape(
            "mc",
            "1",
            (0.0, 0.6),
            "how much the specific force falls with chip thickness",
            "切削力随切屑厚度下降的指数",
        ),
    ],
    needs: &["depth_of_cut_mm", "feed_per_rev_mm | removal_rate_cm3_min", "cutting_speed_m_min | removal_rate_cm3_min"],
    source: "Kienzle; kc1.1 1400-2600 N/mm2 and mc 0.13-0.30 for steels (workholding maker's kc table)",
    experiment_minutes: 6.0,
    rivals: &["edge_force", "load_loss", "sensor_gain", "hardness_batch"],
    en: Texts {
        name: "cutting power",
        statement: "Power that goes into the chip: specific cutting force times the volume cut per second",
        absence: "in the cut the residual follows depth, feed and speed together; idle agrees",
        confused_with: "edge force (does not depend on feed), a gain of the meter (also scales idle)",
        experiment: "cut at three feeds, the largest four times the smallest, with depth and speed unchanged",
    },
    zh: Texts {
        name: "切削功率",
        statement: "消耗在切屑上的功率：单位切削力乘以单位时间切除体积",
        absence: "切削时残差随切深、进给和转速共同变化，空转一致",
        confused_with: "刃口力（与进给无关）、仪表增益误差（空转也按比例变化）",
        experiment: "切深和转速不变，用三种进给切削，最大进给为最小的四倍",
    },
};

impl Effect for CuttingPower {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["turning", "milling", "drilling"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let milled = scene.column("width_of_cut_mm").is_some();
        let names = if milled { ["milling", "turning", "drilling"] } else { ["turning", "milling", "drilling"] };
        let names = names.into_iter();
        let known = names.filter(|name| compute_chip_section(scene, name, 0.23).is_some());
        known.take(1).flat_map(|name| [0.23, 0.15, 0.3].map(|mc| Form { name, ..Form::from_shape(&[("mc", mc)]) })).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let process = if form.name.is_empty() { "turning" } else { form.name };
        let section = compute_chip_section(scene, process, form.shape_value("mc").unwrap_or(0.23))?;
        let mut engaged = read_engagement(scene);
        if process == "milling" && is_instantaneous_rate(scene, &engaged) {
            engaged.iter_mut().for_each(|engaged| *engaged = f64::from(u8::from(*engaged > 0.0)));
        }
        Some(vec![("kc11_n_per_mm2", section.iter().zip(&engaged).map(|(power, engaged)| power * engaged).collect())])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form { name: "turning", ..Form::from_shape(&[("mc", 0.23)]) }
    }
}

/// Output per unit of `kc11`: section of the chip times what makes it a power, force or torque.
fn compute_chip_section(scene: &Scene, process: &str, mc: f64) -> Option<Vec<f64>> {
    match process {
        "turning" => compute_turning_section(scene, mc),
        "milling" => compute_milling_section(scene, mc),
        "drilling" => compute_drilling_section(scene, mc),
        _ => None,
    }
}

fn compute_turning_section(scene: &Scene, mc: f64) -> Option<Vec<f64>> {
    let depth = scene.column("depth_of_cut_mm")?;
    let feed = scene.column("feed_per_rev_mm")?;
    let mut thinned = cache_last_value(|feed: f64| feed.max(0.0).powf(1.0 - mc));
    let area: Vec<f64> = depth.iter().zip(feed).map(|(depth, feed)| depth * thinned(*feed)).collect();
    convert_to_output(scene, &area)
}

fn compute_milling_section(scene: &Scene, mc: f64) -> Option<Vec<f64>> {
    let rate = scene.column("removal_rate_cm3_min")?;
    let tooth = scene.column("feed_per_tooth_mm").or_else(|| scene.column("feed_per_rev_mm"))?;
    let width = scene.column("width_of_cut_mm");
    let diameter = scene.column("diameter_mm");
    let share = |row: usize| match (width, diameter) {
        (Some(width), Some(diameter)) if diameter[row] > 0.0 => (width[row] / diameter[row]).clamp(0.0, 1.0).sqrt(),
        _ => 1.0,
    };
    let mut thinned = cache_last_value(|thickness_mm| compute_thinning_factor(thickness_mm, mc));
    Some((0..scene.rows()).map(|row| thinned(tooth[row] * share(row)) * rate[row] / 60.0).collect())
}

/// Engagements between which a row tells whether a removal rate has the engagement in it already.
const PARTLY: std::ops::Range<f64> = 0.05..0.95;
/// Rows that must tell it.
const TELLING_ROWS_MIN: usize = 5;

/// Is the recorded removal rate that of the moment, as a CAM system works it out, which is less while the tool enters? Then
/// the engagement is in it already. Told by the rows in which the tool is partly in the work.
fn is_instantaneous_rate(scene: &Scene, engaged: &[f64]) -> bool {
    let columns = ["removal_rate_cm3_min", "depth_of_cut_mm", "width_of_cut_mm", "feed_mm_min"];
    let [Some(rate), Some(depth), Some(width), Some(feed)] = columns.map(|name| scene.column(name)) else {
        return false;
    };
    let (mut telling, mut of_the_moment) = (0, 0);
    for row in (0..scene.rows()).filter(|row| PARTLY.contains(&engaged[*row])) {
        let full = depth[row] * width[row] * feed[row] / 1000.0;
        if full > 0.0 {
            telling += 1;
            of_the_moment += usize::from((rate[row] - full * engaged[row]).abs() < (rate[row] - full).abs());
        }
    }
    telling >= TELLING_ROWS_MIN && 2 * of_the_moment > telling
}

fn compute_drilling_section(scene: &Scene, mc: f64) -> Option<Vec<f64>> {
    let diameter = scene.column("diameter_mm")?;
    let feed = scene.column("feed_mm_min")?;
    let per_rev = scene.column("feed_per_rev_mm")?;
    let tooth = scene.column("feed_per_tooth_mm");
    let thickness = |row: usize| tooth.map_or(per_rev[row] / 2.0, |tooth| tooth[row]);
    let rate = |row: usize| PI * diameter[row].powi(2) * feed[row] / 4000.0;
    let mut thinned = cache_last_value(|thickness_mm| compute_thinning_factor(thickness_mm, mc));
    Some((0..scene.rows()).map(|row| thinned(thickness(row)) * rate(row) / 60.0).collect())
}

/// A law that is worked out anew only where its argument changes: feeds are held over many rows, and powers are dear.
fn cache_last_value(law: impl Fn(f64) -> f64) -> impl FnMut(f64) -> f64 {
    let mut last: Option<(f64, f64)> = None;
    move |x| match last {
        Some((known, value)) if known == x => value,
        _ => {
            let value = law(x);
            last = Some((x, value));
            value
        }
    }
}

/// `h^(-mc)`; zero without a chip.
fn compute_thinning_factor(thickness_mm: f64, mc: f64) -> f64 {
    if thickness_mm > 0.0 { thickness_mm.powf(-mc) } else { 0.0 }
}
