//! Friction on a worn flank: grows with the cutting time of the tool, starts again with a new edge.

use crate::physics::drive::is_displacement;
use crate::physics::tool_load;
use crate::physics::{Columns, Effect, EffectDoc, Entry, Form, ParameterDoc, Role, Scene, Texts};

/// Friction between a worn flank and the work.
#[derive(Debug, Clone, Copy)]
pub struct FlankWear;

static DOC: EffectDoc = EffectDoc {
    kind: "flank_wear",
    family: "cutting",
    law: "P = k * ap * vc * W^p; W minutes in the cut since the edge was new; without ap and vc: y = k * engaged * W^p; followed: P = k_load * ap * vc * (0.15 W^(1/2) + g); g growth of the feed drive's load since the edge was new",
    parameters: &[
        ParameterDoc {
            name: "k",
            unit: "output/(mm m/min min^p)",
            entry: Entry::Linear,
            range: (0.0, f64::INFINITY),
            en: "growth of power per depth, cutting speed and cutting time",
            zh: "单位切深、切速、切削时间的功率增长",
        },
        ParameterDoc {
            name: "p",
            unit: "1",
            entry: Entry::Shape,
            range: (0.3, 4.0),
            en: "exponent of the cutting time: below 1 break-in, above 1 accelerating wear",
            zh: "切削时间指数：小于1为初期磨损，大于1为加速磨损",
        },
        ParameterDoc {
            name: "k_load",
            unit: "output/(mm m/min)",
            entry: Entry::Linear,
            range: (0.0, f64::INFINITY),
            en: "power per depth and cutting speed of an edge so worn that the feed drive's load has doubled",
            zh: "进给轴负载因磨损翻倍时，单位切深、切速的功率增量",
        },
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

impl Effect for FlankWear {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["followed"]
    }

    fn forms(&self, scene: &Scene) -> Vec<Form> {
        if is_displacement(scene) || scene.role(Role::Engaged).is_none() || scene.column("cutting_time_min").is_none() {
            return Vec::new();
        }
        // The same curve for every tool is only a clock: where a drive tells how worn each is, that is what counts.
        if scene.feed_load_growth().is_some() {
            return vec![Form { name: "followed", ..Form::plain() }];
        }
        [1.0, 0.5, 1.5, 2.5].iter().map(|p| Form::of(&[("p", *p)])).collect()
    }

    fn columns(&self, scene: &Scene, form: &Form) -> Option<Columns> {
        let engaged = scene.role(Role::Engaged)?;
        let minutes = scene.column("cutting_time_min")?;
        let depth = scene.column("depth_of_cut_mm");
        let speed = scene.column("cutting_speed_m_min");
        let width = |row: usize| match (depth, speed) {
            (Some(depth), Some(speed)) => depth[row] * speed[row],
            _ => 1.0,
        };
        let times =
            |worn: &dyn Fn(usize) -> f64| (0..scene.rows()).map(|row| engaged[row] * width(row) * worn(row)).collect();
        if form.name == "followed" {
            let growth = scene.feed_load_growth()?;
            return Some(vec![("k_load", times(&|row| tool_load::wear(minutes[row], growth[row])))]);
        }
        let p = form.value("p").unwrap_or(1.0);
        Some(vec![("k", times(&|row| minutes[row].max(0.0).powf(p)))])
    }

    fn has_hidden_state(&self) -> bool {
        true
    }
}
