//! The meter or drive shows no more than its ceiling.

use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use numerics::statistics::quantile;

/// Ceiling of the meter.
#[derive(Debug, Clone, Copy)]
pub struct Saturation;

static DOC: EffectDoc = EffectDoc {
    kind: "saturation",
    family: "measurement",
    law: "y = share * min(0, ceiling - S), S the simulated output",
    parameters: &[
        ParameterDoc::new_linear("share", "1", (0.0, 1.5), "one, when the ceiling explains all", "为1时上限可完全解释"),
        ParameterDoc::new_shape(
            "ceiling",
            "output",
            (-1000000000.0, 1000000000.0),
            "greatest value that is shown",
            "显示的最大值",
        ),
    ],
    needs: &["the simulated output"],
    source: "min(P, Pmax): range of meter, transformer or controller display",
    experiment_minutes: 3.0,
    rivals: &["load_loss", "sensor_gain"],
    en: Texts {
        name: "saturation",
        statement: "The meter or the controller shows no more than a ceiling",
        absence: "the largest values are all the same, and the simulation lies above them",
        confused_with: "load loss with a negative sign (bends, but does not stop)",
        experiment: "make a cut lighter by a third: the ceiling is not reached any more",
    },
    zh: Texts {
        name: "饱和",
        statement: "仪表或控制器显示不超过上限",
        absence: "最大值全部相同，而仿真值更高",
        confused_with: "负号的负载损耗（弯曲但不封顶）",
        experiment: "切削减轻三分之一：不再达到上限",
    },
};

impl Effect for Saturation {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(simulated) = scene.simulated_output() else { return Vec::new() };
        let form = |ceiling: f64| Form::from_shape(&[("ceiling", ceiling)]);
        if let Some(ceiling) = find_saturation_limit(scene) {
            return vec![form(ceiling)];
        }
        // Noise after the clipping smears the pile: then the ceiling lies a little below the greatest recorded values,
        // and a fair number of rows is simulated beyond it.
        let usable = || (0..scene.rows()).filter(|row| scene.usable_rows()[*row]);
        let levels = [0.995, 0.98, 0.95, 0.9]
            .into_iter()
            .filter_map(|share| quantile(usable().map(|row| scene.recorded_output()[row]), share));
        let beyond = |ceiling: f64| usable().filter(|row| simulated[*row] > ceiling).count() >= 8;
        levels.filter(|ceiling| beyond(*ceiling)).map(form).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let ceiling = form.shape_value("ceiling")?;
        Some(vec![("share", scene.simulated_output()?.iter().map(|value| (ceiling - value).min(0.0)).collect())])
    }
}

/// The greatest recorded value, where at least five rows share it and more do than share the value below it.
fn find_saturation_limit(scene: &Scene) -> Option<f64> {
    let usable = scene.recorded_output().iter().zip(scene.usable_rows()).filter(|(_, usable)| **usable);
    let values: Vec<f64> = usable.map(|(value, _)| *value).collect();
    let top = values.iter().copied().reduce(f64::max)?;
    let next = values.iter().copied().filter(|value| *value < top).reduce(f64::max)?;
    let count = |level: f64| values.iter().filter(|value| (**value - level).abs() <= 1e-9 * level.abs()).count();
    (count(top) >= 5 && count(top) > 2 * count(next)).then_some(top)
}
