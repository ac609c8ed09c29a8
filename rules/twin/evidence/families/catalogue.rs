//! Kinds without a family of their own: the laws of the catalogue as they are; and what users have written.

use crate::candidates::compute_law_columns;
use crate::evidence::inputs::RecordingInputs;
use crate::evidence::variant_bank::{Family, VariantBank};
use crate::model::Model;
use physics::{CATALOGUE, Effect};
use std::borrow::Cow;

/// Forms of one kind that are tried at most: of a kind without a family, and of one with its own.
const FORMS_MAX: usize = 24;
const FORMS_BESIDE: usize = 8;

/// Variants of every kind that has none yet, or whose own do not cover the catalogue's.
pub(super) fn add_variants(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    for effect in CATALOGUE {
        let own = bank.variants.iter().find_map(|variant| variant.family().filter(|f| f.kind == effect.doc().kind));
        let (family, most) = match own {
            Some(family) if family.covers => continue,
            Some(family) => (family.clone(), FORMS_BESIDE),
            None => (
                Family { sign: find_sign(*effect), ..Family::from_kind(effect.doc().kind).with_rarity(-1.0) },
                FORMS_MAX,
            ),
        };
        let forms = effect.propose_forms(inputs.scene);
        let step = forms.len().div_ceil(most).max(1);
        for form in forms.iter().step_by(step) {
            let Some(columns) = effect.compute_columns(inputs.scene, form) else { continue };
            let columns = columns.into_iter().map(|(_, column)| (column, 1.0));
            bank.begin_variant(family.clone(), format!("{form:?}")).add_columns(inputs, columns);
        }
    }
}

/// The sign that the range of its first parameter leaves a law.
fn find_sign(effect: &dyn Effect) -> f64 {
    let linear = effect.doc().parameters.iter().find(|parameter| parameter.entry == physics::Entry::Linear);
    match linear.map(|parameter| parameter.range) {
        Some((low, _)) if low >= 0.0 => 1.0,
        Some((_, high)) if high <= 0.0 => -1.0,
        _ => 0.0,
    }
}

/// The user's own hypotheses.
pub(super) fn add_hypotheses(inputs: &RecordingInputs<'_>, model: &Model, bank: &mut VariantBank) {
    for part in &model.hypotheses {
        let Some(columns) = compute_law_columns(part, inputs.scene) else { continue };
        let family = Family { kind: Cow::Owned(part.label().to_owned()), ..Family::from_kind("") };
        bank.begin_variant(family, "hypothesis").add_columns(inputs, columns.into_iter().map(|column| (column, 1.0)));
    }
}
