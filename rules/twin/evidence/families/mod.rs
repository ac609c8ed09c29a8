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
mod thermal;
pub(super) mod waves;
mod wear;

use super::bank::VariantBank;
use super::inputs::RecordingInputs;
use crate::candidates::{shifts_time_in_vain, wanted};
use crate::model::Model;
use physics::find_effect;

/// Every variant that this recording can tell anything about.
pub(super) fn bank(inputs: &RecordingInputs<'_>, model: &Model) -> VariantBank {
    let mut bank = VariantBank::default();
    spindle::add(inputs, &mut bank);
    drive::add(inputs, &mut bank);
    axis::add(inputs, &mut bank);
    cutting::add(inputs, &mut bank);
    wear::add(inputs, &mut bank);
    measurement::add(inputs, &mut bank);
    thermal::add(inputs, &mut bank);
    waves::add(inputs, &mut bank);
    catalogue::add(inputs, &mut bank);
    let in_vain = shifts_time_in_vain(model, inputs.scene);
    bank.variants.retain(|variant| {
        let Some(kind) = variant.kind() else { return true };
        let vain = in_vain && ["clock_lag", "meter_window"].contains(&kind);
        !vain && find_effect(kind).is_none_or(|effect| wanted(effect, model))
    });
    catalogue::hypotheses(inputs, model, &mut bank);
    nameless::add(inputs, model, &mut bank);
    bank
}
