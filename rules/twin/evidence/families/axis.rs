//! Feed axes as consumers of a power or current that another drive dominates.

use super::drive::{is_drive, normalise_velocity};
use crate::evidence::inputs::RecordingInputs;
use crate::evidence::variant_bank::{Family, VariantBank};
use physics::OutputKind;

const VELOCITY: &[&str] = &["axis_velocity_mm_min", "z_axis_velocity_mm_min", "velocity_m_s", "velocity"];

const FRICTION: Family =
    Family::from_kind("axis_friction").with_catalogue_forms().with_sign(1.0).with_channels(VELOCITY);
const INERTIA: Family = Family::from_kind("axis_inertia").with_sign(1.0);
const GRAVITY: Family = Family::from_kind("gravity_axis").with_channels(VELOCITY).without_widening();
const ASYMMETRY: Family = Family::from_kind("direction_asymmetry").with_containment().with_rarity(-0.7);

/// The families of feed axes beside a spindle.
pub(super) fn add_variants(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let Some(velocity) = &inputs.velocity else { return };
    if is_drive(inputs) || inputs.kind == OutputKind::Displacement {
        return;
    }
    let Some(pace) = normalise_velocity(inputs, velocity) else { return };
    let size = inputs.build_column(|row| pace[row].abs());
    let square = inputs.build_column(|row| pace[row].powi(2));
    let moving = inputs.build_column(|row| f64::from(u8::from(pace[row].abs() > 0.01)));
    let vertical = inputs.scene.role_name(physics::Role::Vertical).is_some();
    // Where an axis moves against gravity, the difference of directions is its weight.
    let uneven = (!vertical).then(|| (pace.clone(), 0.3));
    let columns = [(size.clone(), 1.0), (square, 0.3), (moving.clone(), 0.3)].into_iter().chain(uneven.clone());
    bank.begin_variant(FRICTION, "v").add_columns(inputs, columns);
    bank.begin_variant(FRICTION, "level").add_columns(inputs, [(moving, 1.0), (size, 0.4)].into_iter().chain(uneven));
    let rate = inputs.differentiate_values(&pace);
    bank.begin_variant(INERTIA, "v a").add_column(inputs, inputs.build_column(|row| pace[row] * rate[row]));
    if vertical {
        let pace = read_vertical_velocity(inputs).unwrap_or(pace);
        let (up, down) =
            (inputs.build_column(|row| pace[row].max(0.0)), inputs.build_column(|row| (-pace[row]).max(0.0)));
        bank.begin_variant(GRAVITY, "whole").add_column(inputs, pace);
        bank.begin_variant(GRAVITY, "counterweight").with_ln_prior(-0.7).add_columns(inputs, [(up, 1.0), (down, 1.0)]);
    } else {
        bank.begin_variant(ASYMMETRY, "v").add_column(inputs, pace);
    }
}

/// Velocity of the axis that moves against gravity, where it has a column of its own.
fn read_vertical_velocity(inputs: &RecordingInputs<'_>) -> Option<Vec<f64>> {
    let name = inputs.scene.role_name(physics::Role::Vertical)?;
    let letter = name.chars().next().filter(|_| name.len() == 1);
    let own = letter.map(|letter| format!("{letter}_axis_velocity_mm_min"));
    let column =
        inputs.scene.column(own.as_deref().unwrap_or(name)).filter(|_| name.contains("velocity") || own.is_some());
    normalise_velocity(inputs, column?)
}
