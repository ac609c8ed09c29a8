//! A drive on its own: friction of a slide or of a shaft whose velocity is recorded.

use crate::evidence::inputs::RecordingInputs;
use crate::evidence::variant_bank::{Family, VariantBank};
use physics::OutputKind;

const VELOCITY: &[&str] = &["velocity_m_s", "axis_velocity_mm_min", "velocity"];

const DRY: Family = Family::from_kind("dry_friction").with_catalogue_forms().with_sign(1.0).with_channels(VELOCITY);
const VISCOUS: Family = Family::from_kind("viscous_friction").with_sign(1.0);
const ASYMMETRY: Family =
    Family::from_kind("direction_asymmetry").with_catalogue_forms().with_containment().with_rarity(-0.5);
const AXIS_FRICTION: Family = Family::from_kind("axis_friction").with_channels(VELOCITY).with_rarity(-1.0);
const STRIBECK: Family = Family::from_kind("stribeck").with_catalogue_forms().with_sign(1.0).with_channels(VELOCITY);
const INERTIA: Family = Family::from_kind("axis_inertia");
const OFFSET: Family = Family::from_kind("offset").without_widening();
const WINDAGE: Family = Family::from_kind("windage").with_rarity(-1.0);
const GRAVITY: Family = Family::from_kind("gravity_axis").without_widening();

/// Is the output a force, torque or current of a drive whose velocity is recorded?
pub(super) fn is_drive(inputs: &RecordingInputs<'_>) -> bool {
    inputs.velocity.is_some()
        && inputs.kind != OutputKind::Displacement
        && (inputs.is_axis || inputs.speed.is_none())
        && inputs.kind != OutputKind::Power
}

/// The families of such a drive.
pub(super) fn add_variants(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let Some(velocity) = inputs.velocity.as_ref().filter(|_| is_drive(inputs)) else { return };
    let Some(pace) = normalise_velocity(inputs, velocity) else { return };
    let moving = |row: usize| if pace[row].abs() > 0.005 { pace[row].signum() } else { 0.0 };
    for width in [0.01, 0.03, 0.08] {
        bank.begin_variant(DRY, width).add_column(inputs, inputs.build_column(|row| (pace[row] / width).tanh()));
    }
    bank.begin_variant(DRY, "sign").add_column(inputs, inputs.build_column(moving));
    // Friction of gears and screws grows with what they carry.
    let with_load = inputs.build_column(|row| moving(row) * inputs.simulated[row].abs());
    bank.begin_variant(DRY, "grows with the load")
        .with_ln_prior(-1.0)
        .add_columns(inputs, [(with_load, 1.0), (inputs.build_column(moving), 0.5)]);
    bank.begin_variant(VISCOUS, "v").with_ln_prior(-0.5).add_column(inputs, pace.clone());
    let forward = inputs.build_column(|row| f64::from(u8::from(pace[row] > 0.005)));
    let backward = inputs.build_column(|row| f64::from(u8::from(pace[row] < -0.005)));
    bank.begin_variant(ASYMMETRY, "levels").add_columns(inputs, [(forward, 1.0), (backward, 1.0)]);
    bank.begin_variant(AXIS_FRICTION, "v|v|")
        .add_column(inputs, inputs.build_column(|row| pace[row] * pace[row].abs()));
    for width in [0.02, 0.05, 0.1, 0.2] {
        let law = inputs.build_column(|row| moving(row) * (-(pace[row] / width).powi(2)).exp());
        bank.begin_variant(STRIBECK, width).add_column(inputs, law);
    }
    let acceleration = inputs.acceleration.clone().unwrap_or_else(|| inputs.differentiate_values(&pace));
    bank.begin_variant(INERTIA, "a").add_column(inputs, acceleration);
    bank.begin_variant(OFFSET, "level").add_column(inputs, vec![1.0; inputs.rows]);
    bank.begin_variant(WINDAGE, "v3").add_column(inputs, inputs.build_column(|row| pace[row].powi(3)));
    if inputs.scene.role_name(physics::Role::Vertical).is_some() {
        bank.begin_variant(GRAVITY, "level").add_column(inputs, vec![1.0; inputs.rows]);
    }
}

/// Velocity as a share of what it exceeds in a hundredth of the rows only; `None` at rest.
pub(super) fn normalise_velocity(inputs: &RecordingInputs<'_>, velocity: &[f64]) -> Option<Vec<f64>> {
    let top = numerics::statistics::quantile(inputs.fitted_rows(false).map(|row| velocity[row].abs()), 0.99)?;
    (top > 0.0).then(|| velocity.iter().map(|v| v / top).collect())
}
