//! The families: for every kind of the catalogue the textbook law and what its form may lack.
//!
//! Each file is one part of the machine. A family adds its variants to the bank where the recording has what it needs
//! and excites it; a kind without a family of its own takes its laws from the catalogue as they are.

mod axis;
mod catalogue;
mod cutting;
mod drive;
mod measurement;
mod nameless;
mod spindle;
pub(super) mod spindle_tones;
mod thermal;
mod wear;

use super::inputs::RecordingInputs;
use super::variant_bank::VariantBank;
use crate::candidates::{is_candidate_effect, is_time_shift_trivial};
use crate::model::Model;
use physics::find_effect;

/// Every variant that this recording can tell anything about.
pub(super) fn build_bank(inputs: &RecordingInputs<'_>, model: &Model) -> VariantBank {
    let mut bank = VariantBank::default();
    spindle::add_variants(inputs, &mut bank);
    drive::add_variants(inputs, &mut bank);
    axis::add_variants(inputs, &mut bank);
    cutting::add_variants(inputs, &mut bank);
    wear::add_variants(inputs, &mut bank);
    measurement::add_variants(inputs, &mut bank);
    thermal::add_variants(inputs, &mut bank);
    spindle_tones::add_variants(inputs, &mut bank);
    catalogue::add_variants(inputs, &mut bank);
    let in_vain = is_time_shift_trivial(model, inputs.scene);
    bank.variants.retain(|variant| {
        let Some(kind) = variant.kind() else { return true };
        let vain = in_vain && ["clock_lag", "meter_window"].contains(&kind);
        !vain && find_effect(kind).is_none_or(|effect| is_candidate_effect(effect, model))
    });
    catalogue::add_hypotheses(inputs, model, &mut bank);
    nameless::add_variants(inputs, model, &mut bank);
    bank
}
