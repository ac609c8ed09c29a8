//! Cutting wet needs another force than cutting dry.

use crate::physics::cut::{cut, cut_times, cutting_rows};
use crate::physics::excitation::visits;
use crate::physics::{Columns, Effect, EffectDoc, Entry, Form, ParameterDoc, Scene, Texts};

/// Cut that differs wet and dry.
#[derive(Debug, Clone, Copy)]
pub struct CoolantRegime;

static DOC: EffectDoc = EffectDoc {
    kind: "coolant_regime",
    family: "cutting",
    law: "y = change * L * coolant_on",
    parameters: &[ParameterDoc {
        name: "change",
        unit: "1",
        entry: Entry::Linear,
        range: (-0.3, 0.3),
        en: "share by which the cut changes with coolant; negative is lighter",
        zh: "有冷却液时切削变化的比例，负值为变轻",
    }],
    needs: &["load | engaged", "coolant_on"],
    source: "friction on rake and flank wet against dry: 5-15 % of cutting power",
    experiment_minutes: 5.0,
    rivals: &["auxiliary_switch", "hardness_batch", "speed_softening"],
    en: Texts {
        name: "coolant in the cut",
        statement: "Cutting wet needs another force than cutting dry",
        absence: "cuts with coolant differ from cuts without by the same share; idle does not depend on the coolant",
        confused_with: "the power of the pump itself (also idle)",
        experiment: "cut the same pass wet and dry, and run idle wet and dry",
    },
    zh: Texts {
        name: "冷却润滑状态",
        statement: "湿切与干切所需的力不同",
        absence: "有冷却液的切削与无冷却液的按同一比例不同，空转与冷却液无关",
        confused_with: "冷却泵自身功率（空转也有）",
        experiment: "同一走刀分别湿切和干切，并分别空转",
    },
};

impl Effect for CoolantRegime {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(coolant) = scene.column("coolant_on") else { return Vec::new() };
        let cutting = cutting_rows(scene);
        let wet = visits(scene, |row| cutting[row] && coolant[row] > 0.5);
        let dry = visits(scene, |row| cutting[row] && coolant[row] < 0.5);
        if wet.min(dry) == 0 || cut(scene).is_none() { Vec::new() } else { vec![Form::plain()] }
    }

    fn columns(&self, scene: &Scene, _form: &Form) -> Option<Columns> {
        let coolant = scene.column("coolant_on")?;
        Some(vec![("change", cut_times(scene, |row| coolant[row])?)])
    }
}
