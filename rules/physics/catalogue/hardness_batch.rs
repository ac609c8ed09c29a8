//! A lot of material is harder or softer than the one before.

use crate::cut::{estimate_cut_load, multiply_cut};
use crate::excitation::{
    FOLLOWED, NamedUnits, UNIT_TO_UNIT, compute_ln_count, find_run, list_units, follow_step_form, mark_rows_since_run, build_step_forms, mark_word_rows, mark_rows_within_runs, build_word_forms,
};
use crate::{Bound, Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Hardness that differs between lots.
#[derive(Debug, Clone, Copy)]
pub struct HardnessBatch;

static DOC: EffectDoc = EffectDoc {
    kind: "hardness_batch",
    family: "cutting",
    law: "y = gain * L in one lot, or from one run on, or in a stretch of runs; followed: from some run of a stretch on, as the earlier rows of each run tell; lots: y = gain_i * L in lot i against the first",
    parameters: &[
        ParameterDoc::new_linear("gain", "1", (-0.4, 0.4), "share by which the cut is heavier", "切削负载增加的比例"),
        ParameterDoc::new_linear(
            "gain_2",
            "1",
            (-0.4, 0.4),
            "the same for lot 2 against the first lot",
            "第2批相对第一批的比例",
        ),
        ParameterDoc::new_linear(
            "gain_3",
            "1",
            (-0.4, 0.4),
            "the same for lot 3 against the first lot",
            "第3批相对第一批的比例",
        ),
        ParameterDoc::new_linear(
            "gain_4",
            "1",
            (-0.4, 0.4),
            "the same for lot 4 against the first lot",
            "第4批相对第一批的比例",
        ),
        ParameterDoc::new_linear(
            "gain_5",
            "1",
            (-0.4, 0.4),
            "the same for lot 5 against the first lot",
            "第5批相对第一批的比例",
        ),
        ParameterDoc::new_linear(
            "gain_6",
            "1",
            (-0.4, 0.4),
            "the same for lot 6 against the first lot",
            "第6批相对第一批的比例",
        ),
        ParameterDoc::new_linear(
            "gain_7",
            "1",
            (-0.4, 0.4),
            "the same for lot 7 against the first lot",
            "第7批相对第一批的比例",
        ),
        ParameterDoc::new_shape("height", "1", (-0.4, 0.4), "the gain that is looked for in runs that may be of either lot", "在批次未知的运行中查找的比例"),
        ParameterDoc::new_shape(
            "deviation",
            "output",
            (0.0, 1e9),
            "noise behind which it is looked for",
            "识别批次时的噪声",
        ),
    ],
    needs: &["load | engaged", "lot | run"],
    source: "kc (1 + h) per lot, h 3-12 % either way",
    experiment_minutes: 6.0,
    rivals: &["flank_wear", "recipe_error", "sensor_gain", "coolant_regime"],
    en: Texts {
        name: "material batch",
        statement: "A lot of material is harder or softer than what the simulation assumes",
        absence: "from one lot on every cut is heavier by the same share; idle is unchanged; a new insert does not help",
        confused_with: "wear (grows with cutting time and resets), a gain of the meter (also scales idle), a wrong recipe (one operation only)",
        experiment: "cut a piece of the old lot again with the same insert",
    },
    zh: Texts {
        name: "材料批次硬度",
        statement: "某一批材料比仿真假设的更硬或更软",
        absence: "从某一批起每次切削都按同一比例变重，空转不变，换刀片无效",
        confused_with: "磨损（随切削时间增长并复位）、仪表增益（空转也变）、工艺参数错误（仅某一工序）",
        experiment: "用同一刀片再切一件旧批次材料",
    },
};

impl Effect for HardnessBatch {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn bound(&self) -> Bound {
        // lots of one material differ by 3 to 12 %, of two materials by 40 %
        Bound::Cut(0.5)
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["lot", "lots", "step", "stretch", "stretches", FOLLOWED]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if estimate_cut_load(scene).is_none() {
            return Vec::new();
        }
        let mut forms = build_word_forms(scene, "lot", "lot", GAINS.len() + 1);
        if forms.len() > 2 {
            let units = list_units(scene, "lot", GAINS.len() + 1);
            forms.extend(units.map(|units| Form { name: "lots", place: Some(units), ..Form::without_shape() }));
        }
        forms.extend(build_lot_step_forms(scene));
        forms
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        if form.name == "lots" {
            return compute_recorded_lots(scene, form);
        }
        let (column, word) = form.place.as_ref()?;
        if form.name == "stretches" {
            return compute_inferred_lots(scene, word);
        }
        if form.name == FOLLOWED {
            let begun = follow_step_form(scene, form, &multiply_cut(scene, |_| 1.0)?)?;
            return Some(vec![("gain", multiply_cut(scene, |row| begun[row])?)]);
        }
        let here = match column.as_str() {
            "run" => mark_rows_since_run(scene, word).or_else(|| mark_rows_within_runs(scene, word)),
            _ => mark_word_rows(scene, column, word),
        }?;
        Some(vec![("gain", multiply_cut(scene, |row| here[row])?)])
    }

    fn has_term_per_unit(&self, form: &Form) -> bool {
        matches!(form.name, "lots" | "stretches")
    }

    fn unit_column(&self, form: &Form) -> Option<&'static str> {
        (form.name == "lots").then_some("lot")
    }

    fn has_hidden_state(&self) -> bool {
        true
    }

    fn is_followed(&self, form: &Form) -> bool {
        form.name == FOLLOWED
    }

    fn find_followed_form(&self, form: &Form) -> Option<&'static str> {
        (form.name == "step").then_some(FOLLOWED)
    }
}

/// Names of the gains of the second and further lots.
const GAINS: [&str; 6] = ["gain_2", "gain_3", "gain_4", "gain_5", "gain_6", "gain_7"];

/// Steps at the start of a run; where the lots are recorded, only of a run that begins one.
fn build_lot_step_forms(scene: &Scene) -> Vec<Form> {
    let mut steps = build_step_forms(scene, "step");
    let Some(lots) = scene.text_column("lot").filter(|lots| lots.words().len() > 1) else { return steps };
    let begins_a_lot = |form: &Form| {
        let run = form.place.as_ref().and_then(|(_, run)| find_run(scene, run));
        run.is_some_and(|run| lots.get(scene.runs()[run].start) != lots.get(scene.runs()[run - 1].start))
    };
    steps.retain(begins_a_lot);
    let ln_choices = compute_ln_count(steps.len());
    steps.iter_mut().for_each(|form| form.ln_choices = ln_choices);
    steps
}

fn compute_inferred_lots(scene: &Scene, starts: &str) -> Option<ParameterColumns> {
    let row = |name: &str| Some(scene.runs()[find_run(scene, name)?].start);
    let mut rows: Vec<usize> = starts.split(UNIT_TO_UNIT).map(row).collect::<Option<_>>()?;
    rows.push(scene.rows());
    let gain = |(gain, lot): (&&'static str, &[usize])| {
        let here = |row: usize| f64::from(u8::from((lot[0]..lot[1]).contains(&row)));
        Some((*gain, multiply_cut(scene, here)?))
    };
    GAINS.iter().zip(rows.windows(2)).map(gain).collect()
}

/// The gain of each lot that the form names against the first of them; without names those of the recording. A lot that nobody has measured
/// yet is like the others in the mean.
fn compute_recorded_lots(scene: &Scene, form: &Form) -> Option<ParameterColumns> {
    let lots = scene.text_column("lot")?;
    let named: Vec<&str> = match &form.place {
        Some((_, named)) => named.split(UNIT_TO_UNIT).collect(),
        None => lots.words().iter().map(String::as_str).collect(),
    };
    let units = NamedUnits::new(scene, "lot", named);
    let column = |(gain, lot): (&&'static str, &&str)| {
        Some((*gain, multiply_cut(scene, |row| units.compute_share(lot, row))?))
    };
    GAINS.iter().zip(units.names.iter().skip(1)).map(column).collect()
}
