//! Losses of motor and gear that grow with the load.

use crate::drive::is_displacement;
use crate::excitation::has_variation;
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Losses that grow with the load.
#[derive(Debug, Clone, Copy)]
pub struct LoadLoss;

static DOC: EffectDoc = EffectDoc {
    kind: "load_loss",
    family: "drive",
    law: "P = linear * L + quadratic_per_w * L^2; L load of the cut",
    parameters: &[
        ParameterDoc::new_linear(
            "linear",
            "1",
            (-0.5, 1.0),
            "share of the load that is lost on the way",
            "负载中沿途损失的比例",
        ),
        ParameterDoc::new_linear(
            "quadratic_per_w",
            "1/output",
            (-0.01, 0.01),
            "growth of that share per unit of load; may be negative where efficiency rises with load",
            "损失比例随负载的增长；效率随负载上升时可为负",
        ),
    ],
    needs: &["load"],
    source: "Pad = a1 Pc + a2 Pc^2 with a1 0.15-0.25, a2 about 4e-5 1/W on a lathe; additional power up to 20 % of Pc and sometimes negative",
    experiment_minutes: 8.0,
    rivals: &["copper_loss", "cutting_power", "inverter_loss", "sensor_gain"],
    en: Texts {
        name: "load loss",
        statement: "Losses in motor, gear and belt that grow with the load of the cut",
        absence: "heavy cuts take more (or less) than simulated, light cuts agree, the same at every speed",
        confused_with: "copper loss (follows torque: strongest at low speed); the linear part cannot be told from a harder material by power alone",
        experiment: "make the same cutting power at two speeds, the higher twice the lower, lightly and heavily",
    },
    zh: Texts {
        name: "负载附加损耗",
        statement: "电机、齿轮和皮带中随切削负载增长的损耗",
        absence: "重切时实测偏大（或偏小），轻切时一致，各转速下相同",
        confused_with: "铜损（随转矩变化，低速最大）；线性部分仅凭功率无法与材料硬度区分",
        experiment: "以两种转速（高速为低速两倍）分别在轻、重负载下产生相同切削功率",
    },
};

impl Effect for LoadLoss {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["quadratic", "both"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let loaded = !is_displacement(scene) && scene.load().is_some_and(has_variation);
        let named = |name| Form { name, ..Form::without_shape() };
        if loaded { vec![named("quadratic"), named("both")] } else { Vec::new() }
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let load = scene.load()?;
        let quadratic = ("quadratic_per_w", load.iter().map(|load| load * load).collect());
        Some(if form.name == "quadratic" { vec![quadratic] } else { vec![("linear", load.to_vec()), quadratic] })
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form { name: "both", ..Form::without_shape() }
    }
}
