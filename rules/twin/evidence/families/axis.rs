//! Feed axes as consumers of a power or current that another drive dominates.

use super::drive::{is_drive, pace};
use crate::evidence::bank::{Family, VariantBank};
use crate::evidence::inputs::RecordingInputs;
use physics::OutputKind;

const VELOCITY: &[&str] = &["axis_velocity_mm_min", "z_axis_velocity_mm_min", "velocity_m_s", "velocity"];

const FRICTION: Family = Family::of("axis_friction").beside_catalogue().signed(1.0).through(VELOCITY);
const INERTIA: Family = Family::of("axis_inertia").signed(1.0);
const GRAVITY: Family = Family::of("gravity_axis").through(VELOCITY).wide();
const ASYMMETRY: Family = Family::of("direction_asymmetry").contained().rare(-0.7);

/// The families of feed axes beside a spindle.
pub(super) fn add(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let Some(velocity) = &inputs.velocity else { return };
    if is_drive(inputs) || inputs.kind == OutputKind::Displacement {
        return;
    }
    let Some(pace) = pace(inputs, velocity) else { return };
    let size = inputs.column(|row| pace[row].abs());
    let square = inputs.column(|row| pace[row].powi(2));
    let moving = inputs.column(|row| f64::from(u8::from(pace[row].abs() > 0.01)));
    let vertical = inputs.scene.role_name(physics::Role::Vertical).is_some();
    // Where an axis moves against gravity, the difference of directions is its weight.
    let uneven = (!vertical).then(|| (pace.clone(), 0.3));
    let columns = [(size.clone(), 1.0), (square, 0.3), (moving.clone(), 0.3)].into_iter().chain(uneven.clone());
    bank.of(FRICTION, "v").columns(inputs, columns);
    bank.of(FRICTION, "level").columns(inputs, [(moving, 1.0), (size, 0.4)].into_iter().chain(uneven));
    let rate = inputs.rate(&pace);
    bank.of(INERTIA, "v a").column(inputs, inputs.column(|row| pace[row] * rate[row]));
    if vertical {
        let pace = vertical_pace(inputs).unwrap_or(pace);
        let (up, down) = (inputs.column(|row| pace[row].max(0.0)), inputs.column(|row| (-pace[row]).max(0.0)));
        bank.of(GRAVITY, "whole").column(inputs, pace);
        bank.of(GRAVITY, "counterweight").prior(-0.7).columns(inputs, [(up, 1.0), (down, 1.0)]);
    } else {
        bank.of(ASYMMETRY, "v").column(inputs, pace);
    }
}

/// Velocity of the axis that moves against gravity, where it has a column of its own.
fn vertical_pace(inputs: &RecordingInputs<'_>) -> Option<Vec<f64>> {
    let name = inputs.scene.role_name(physics::Role::Vertical)?;
    let letter = name.chars().next().filter(|_| name.len() == 1);
    let own = letter.map(|letter| format!("{letter}_axis_velocity_mm_min"));
    let column =
        inputs.scene.column(own.as_deref().unwrap_or(name)).filter(|_| name.contains("velocity") || own.is_some());
    pace(inputs, column?)
}
