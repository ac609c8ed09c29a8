//! At low cutting speed a built-up edge forms and changes the force.

use crate::cut::{estimate_cut_load, multiply_cut, mark_cutting_rows};
use crate::excitation::count_visits;
use crate::{Bound, Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Built-up edge at low cutting speed.
#[derive(Debug, Clone, Copy)]
pub struct BuiltUpEdge;

static DOC: EffectDoc = EffectDoc {
    kind: "built_up_edge",
    family: "cutting",
    law: "y = -drop * L * exp(-((vc - centre) / 15 m/min)^2)",
    parameters: &[
        ParameterDoc::new_linear(
            "drop",
            "1",
            (0.0, 0.5),
            "share by which the built-up edge lowers the force",
            "积屑瘤使切削力降低的比例",
        ),
        ParameterDoc::new_shape(
            "centre_m_min",
            "m/min",
            (15.0, 70.0),
            "cutting speed at which it is strongest",
            "最强时的切削速度",
        ),
    ],
    needs: &["load | engaged", "cutting_speed_m_min"],
    source: "built-up edge in steel at 20-60 m/min: sharper effective rake, force lower and noisier",
    experiment_minutes: 6.0,
    rivals: &["speed_softening", "chatter", "chip_thinning"],
    en: Texts {
        name: "built-up edge",
        statement: "At low cutting speed work material sticks to the edge and changes the force",
        absence: "in a window of low cutting speed the cut takes less than simulated and is noisier",
        confused_with: "speed softening (every speed, other sign at low speed)",
        experiment: "cut at 20, 35, 50, 80 and 120 m/min with the same feed and depth",
    },
    zh: Texts {
        name: "积屑瘤",
        statement: "低切速时材料粘附在刀刃上，改变切削力",
        absence: "在低切速的某一范围内实测偏小且噪声增大",
        confused_with: "高速软化（所有速度，低速时符号相反）",
        experiment: "进给和切深不变，以20、35、50、80、120 m/min切削",
    },
};

impl Effect for BuiltUpEdge {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn bound(&self) -> Bound {
        // a built-up edge takes up to half of the force
        Bound::Cut(0.7)
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(speed) = scene.column("cutting_speed_m_min").filter(|_| estimate_cut_load(scene).is_some()) else {
            return Vec::new();
        };
        let cutting = mark_cutting_rows(scene);
        let near = |centre: f64| move |row: usize| (speed[row] - centre).abs() < WIDTH_M_MIN;
        let inside = |centre: f64| count_visits(scene, |row| cutting[row] && near(centre)(row));
        let outside = |centre: f64| count_visits(scene, |row| cutting[row] && !near(centre)(row));
        let centres = [40.0, 30.0, 50.0].into_iter().filter(|centre| inside(*centre) >= 3 && outside(*centre) >= 3);
        centres.map(|centre| Form::from_shape(&[("centre_m_min", centre)])).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let speed = scene.column("cutting_speed_m_min")?;
        let centre = form.shape_value("centre_m_min").unwrap_or(40.0);
        let window = |row: usize| -(-((speed[row] - centre) / WIDTH_M_MIN).powi(2)).exp();
        Some(vec![("drop", multiply_cut(scene, window)?)])
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form::from_shape(&[("centre_m_min", 40.0)])
    }
}

/// Half-width of the window of cutting speed.
const WIDTH_M_MIN: f64 = 15.0;
