//! Friction on a worn flank: grows with the cutting time of the tool, starts again with a new edge.

use crate::drive::is_displacement;
use crate::excitation::{NamedUnits, UNIT_TO_UNIT, list_units};
use crate::tool_load;
use crate::{Effect, EffectDoc, Entry, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};
use numerics::statistics::find_greatest_magnitude;
use std::borrow::Cow;

/// Friction between a worn flank and the work.
#[derive(Debug, Clone, Copy)]
pub struct FlankWear;

static DOC: EffectDoc = EffectDoc {
    kind: "flank_wear",
    family: "cutting",
    law: "P = k * ap * vc * W^p; W minutes in the cut since the edge was new; of a drill D / 2 in place of ap; without ap or D and vc: y = k * engaged * W^p; break_in: P = (k_break_in * (1 - exp(-W / W0)) + k * W) * ap * vc; edges: every edge its own k_i, another one their mean; followed: P = k_load * ap * vc * (0.15 W^(1/2) + g); g growth of the feed drive's load since the edge was new",
    parameters: &[
        ParameterDoc::new_linear(
            "k",
            "output/(mm m/min min^p)",
            (0.0, f64::INFINITY),
            "growth of power per depth, cutting speed and cutting time",
            "单位切深、切速、切削时间的功率增长",
        ),
        ParameterDoc::new_shape(
            "p",
            "1",
            (0.3, 4.0),
            "exponent of the cutting time: below 1 break-in, above 1 accelerating wear",
            "切削时间指数：小于1为初期磨损，大于1为加速磨损",
        ),
        ParameterDoc::new_linear(
            "k_break_in",
            "output/(mm m/min)",
            (0.0, f64::INFINITY),
            "power per depth and cutting speed of an edge that has broken in",
            "初期磨损结束后，单位切深、切速的功率增量",
        ),
        ParameterDoc::new_shape(
            "break_in_min",
            "min",
            (0.05, 60.0),
            "cutting time in which an edge breaks in",
            "初期磨损的切削时间常数",
        ),
        define_wear_rate(
            "k_1",
            "growth of the first edge, per depth, cutting speed and cutting time",
            "第1个刀刃单位切深、切速、切削时间的功率增长",
        ),
        define_wear_rate("k_2", "the same of the second edge", "第2个刀刃的功率增长"),
        define_wear_rate("k_3", "the same of the third edge", "第3个刀刃的功率增长"),
        define_wear_rate("k_4", "the same of the fourth edge", "第4个刀刃的功率增长"),
        define_wear_rate("k_5", "the same of the fifth edge", "第5个刀刃的功率增长"),
        define_wear_rate("k_6", "the same of the sixth edge", "第6个刀刃的功率增长"),
        define_wear_rate("k_7", "the same of the seventh edge", "第7个刀刃的功率增长"),
        define_wear_rate("k_8", "the same of the eighth edge", "第8个刀刃的功率增长"),
        ParameterDoc::new_linear(
            "k_load",
            "output/(mm m/min)",
            (0.0, f64::INFINITY),
            "power per depth and cutting speed of an edge so worn that the feed drive's load has doubled",
            "进给轴负载因磨损翻倍时，单位切深、切速的功率增量",
        ),
    ],
    needs: &["engaged"],
    source: "patent CHK460: dPc = mu H VB s vc; VB over cutting time in three stages",
    experiment_minutes: 4.0,
    rivals: &["hardness_batch", "edge_force", "sensor_gain", "zero_drift"],
    en: Texts {
        name: "flank wear",
        statement: "Friction on a worn flank, growing with cutting time, reset at tool change",
        absence: "in the cut the residual grows with the cutting time of the tool and falls back at a tool change; idle is unchanged",
        confused_with: "harder material (scales with the whole cutting power, steps at a lot), gain drift (does not reset)",
        experiment: "change the insert and run one part",
    },
    zh: Texts {
        name: "后刀面磨损",
        statement: "后刀面磨损引起的摩擦，随切削时间增长，换刀后复位",
        absence: "切削时残差随刀具切削时间增长，换刀后回落；空转不变",
        confused_with: "材料变硬（与切削功率成比例，换批时跳变）、增益漂移（不复位）",
        experiment: "更换刀片后加工一个工件",
    },
};

/// How fast one of several edges wears.
const fn define_wear_rate(name: &'static str, en: &'static str, zh: &'static str) -> ParameterDoc {
    ParameterDoc { name, unit: "output/(mm m/min min^p)", entry: Entry::Linear, range: (0.0, f64::INFINITY), en, zh }
}

/// Names of the rates of the edges.
const RATES: [&str; 8] = ["k_1", "k_2", "k_3", "k_4", "k_5", "k_6", "k_7", "k_8"];
/// Shares of the longest cutting time in which an edge may break in.
const BREAK_INS: [f64; 2] = [0.06, 0.2];

impl Effect for FlankWear {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["break_in", "edges", "followed"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if is_displacement(scene) || scene.role_values(Role::Engaged).is_none() || scene.column("cutting_time_min").is_none() {
            return Vec::new();
        }
        // The same curve for every tool is only a clock: where a drive tells how worn each is, that is what counts.
        if scene.feed_load_growth().is_some() {
            return vec![Form { name: "followed", ..Form::without_shape() }];
        }
        let longest_min = find_greatest_magnitude(scene.column("cutting_time_min").unwrap_or_default());
        let powers = [1.0, 0.5, 1.5, 2.5].map(|p| Form::from_shape(&[("p", p)]));
        let break_ins =
            BREAK_INS.map(|share| Form { name: "break_in", ..Form::from_shape(&[("break_in_min", share * longest_min)]) });
        let edges = list_units(scene, "tool", RATES.len()).map(|edges| {
            [1.0, 0.5].map(|p| Form { name: "edges", place: Some(edges.clone()), ..Form::from_shape(&[("p", p)]) })
        });
        powers.into_iter().chain(break_ins).chain(edges.into_iter().flatten()).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let engaged = scene.role_values(Role::Engaged)?;
        let minutes = scene.column("cutting_time_min")?;
        let depth = read_edge_length(scene);
        let speed = scene.column("cutting_speed_m_min");
        let width = |row: usize| match (&depth, speed) {
            (Some(depth), Some(speed)) => depth[row] * speed[row],
            _ => 1.0,
        };
        let times =
            |worn: &dyn Fn(usize) -> f64| (0..scene.rows()).map(|row| engaged[row] * width(row) * worn(row)).collect();
        if form.name == "followed" {
            let growth = scene.feed_load_growth()?;
            return Some(vec![("k_load", times(&|row| tool_load::estimate_wear(minutes[row], growth[row])))]);
        }
        if form.name == "break_in" {
            let whole_min = form.shape_value("break_in_min").unwrap_or(1.0).max(f64::MIN_POSITIVE);
            let broken_in = times(&|row| 1.0 - (-minutes[row].max(0.0) / whole_min).exp());
            return Some(vec![("k_break_in", broken_in), ("k", times(&|row| minutes[row].max(0.0)))]);
        }
        let p = form.shape_value("p").unwrap_or(1.0);
        if form.name == "edges" {
            let units = NamedUnits::new(scene, "tool", form.place.as_ref()?.1.split(UNIT_TO_UNIT).collect());
            let worn = |edge: &str| times(&|row| units.compute_share(edge, row) * minutes[row].max(0.0).powf(p));
            return Some(RATES.into_iter().zip(&units.names).map(|(rate, edge)| (rate, worn(edge))).collect());
        }
        Some(vec![("k", times(&|row| minutes[row].max(0.0).powf(p)))])
    }

    fn has_term_per_unit(&self, form: &Form) -> bool {
        form.name == "edges"
    }

    fn unit_column(&self, form: &Form) -> Option<&'static str> {
        self.has_term_per_unit(form).then_some("tool")
    }

    fn has_hidden_state(&self) -> bool {
        true
    }
}

/// How much of an edge cuts, mm: the depth of cut, of a drill its radius.
fn read_edge_length(scene: &Scene) -> Option<Cow<'_, [f64]>> {
    let radius = || scene.column("diameter_mm").map(|diameter| diameter.iter().map(|d| 0.5 * d).collect());
    scene.column("depth_of_cut_mm").map(Cow::Borrowed).or_else(radius)
}
