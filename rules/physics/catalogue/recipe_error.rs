//! Depth or width of cut is mis-stated for one operation.

use crate::cut::{estimate_cut_load, multiply_cut};
use crate::excitation::{mark_word_rows, build_word_forms};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};

/// Depth or width mis-stated for an operation.
#[derive(Debug, Clone, Copy)]
pub struct RecipeError;

static DOC: EffectDoc = EffectDoc {
    kind: "recipe_error",
    family: "measurement",
    law: "y = gain * L in one operation",
    parameters: &[ParameterDoc::new_linear(
        "gain",
        "1",
        (-0.8, 3.0),
        "share by which the real cut is heavier than stated",
        "实际切削比给定值重的比例",
    )],
    needs: &["load | engaged", "operation | pass | program"],
    source: "definition; an edited offset or a blank of another size",
    experiment_minutes: 5.0,
    rivals: &["hardness_batch", "depth_taper", "flank_wear"],
    en: Texts {
        name: "recipe error",
        statement: "Depth or width of cut is not what the recipe says for one operation",
        absence: "in one operation every cut is off by the same share, in the others it agrees",
        confused_with: "harder material (every operation), wear (grows)",
        experiment: "measure the part before and after that operation",
    },
    zh: Texts {
        name: "工艺参数错误",
        statement: "某一工序的切深或切宽与工艺表不符",
        absence: "某一工序每次切削按同一比例偏离，其他工序一致",
        confused_with: "材料变硬（所有工序）、磨损（逐渐增长）",
        experiment: "在该工序前后测量工件",
    },
};

impl Effect for RecipeError {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn acts_in_cut(&self) -> bool {
        true
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["word"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if estimate_cut_load(scene).is_none() {
            return Vec::new();
        }
        let forms = |column| build_word_forms(scene, "word", column, MOST_WORDS);
        ["operation", "pass", "program"].into_iter().map(forms).find(|forms| !forms.is_empty()).unwrap_or_default()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let (column, word) = form.place.as_ref()?;
        let here = mark_word_rows(scene, column, word)?;
        Some(vec![("gain", multiply_cut(scene, |row| here[row])?)])
    }
}

/// More words than this name blocks or parts rather than operations.
const MOST_WORDS: usize = 20;
