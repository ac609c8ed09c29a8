//! A drive on its own: friction of a slide or of a shaft whose velocity is recorded.

use crate::evidence::bank::{Family, VariantBank};
use crate::evidence::inputs::RecordingInputs;
use physics::OutputKind;

const VELOCITY: &[&str] = &["velocity_m_s", "axis_velocity_mm_min", "velocity"];

const DRY: Family = Family::of("dry_friction").beside_catalogue().signed(1.0).through(VELOCITY);
const VISCOUS: Family = Family::of("viscous_friction").signed(1.0);
const ASYMMETRY: Family = Family::of("direction_asymmetry").beside_catalogue().contained().rare(-0.5);
const AXIS_FRICTION: Family = Family::of("axis_friction").through(VELOCITY).rare(-1.0);
const STRIBECK: Family = Family::of("stribeck").beside_catalogue().signed(1.0).through(VELOCITY);
const INERTIA: Family = Family::of("axis_inertia");
const OFFSET: Family = Family::of("offset").wide();
const WINDAGE: Family = Family::of("windage").rare(-1.0);
const GRAVITY: Family = Family::of("gravity_axis").wide();

/// Is the output a force, torque or current of a drive whose velocity is recorded?
pub(super) fn is_drive(inputs: &RecordingInputs<'_>) -> bool {
    inputs.velocity.is_some()
        && inputs.kind != OutputKind::Displacement
        && (inputs.is_axis || inputs.speed.is_none())
        && inputs.kind != OutputKind::Power
}

/// The families of such a drive.
pub(super) fn add(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let Some(velocity) = inputs.velocity.as_ref().filter(|_| is_drive(inputs)) else { return };
    let Some(pace) = pace(inputs, velocity) else { return };
    let moving = |row: usize| if pace[row].abs() > 0.005 { pace[row].signum() } else { 0.0 };
    for width in [0.01, 0.03, 0.08] {
        bank.of(DRY, width).column(inputs, inputs.column(|row| (pace[row] / width).tanh()));
    }
    bank.of(DRY, "sign").column(inputs, inputs.column(moving));
    // Friction of gears and screws grows with what they carry.
    let with_load = inputs.column(|row| moving(row) * inputs.simulated[row].abs());
    bank.of(DRY, "grows with the load").prior(-1.0).columns(inputs, [(with_load, 1.0), (inputs.column(moving), 0.5)]);
    bank.of(VISCOUS, "v").prior(-0.5).column(inputs, pace.clone());
    let forward = inputs.column(|row| f64::from(u8::from(pace[row] > 0.005)));
    let backward = inputs.column(|row| f64::from(u8::from(pace[row] < -0.005)));
    bank.of(ASYMMETRY, "levels").columns(inputs, [(forward, 1.0), (backward, 1.0)]);
    bank.of(AXIS_FRICTION, "v|v|").column(inputs, inputs.column(|row| pace[row] * pace[row].abs()));
    for width in [0.02, 0.05, 0.1, 0.2] {
        let law = inputs.column(|row| moving(row) * (-(pace[row] / width).powi(2)).exp());
        bank.of(STRIBECK, width).column(inputs, law);
    }
    let acceleration = inputs.acceleration.clone().unwrap_or_else(|| inputs.rate(&pace));
    bank.of(INERTIA, "a").column(inputs, acceleration);
    bank.of(OFFSET, "level").column(inputs, vec![1.0; inputs.rows]);
    bank.of(WINDAGE, "v3").column(inputs, inputs.column(|row| pace[row].powi(3)));
    if inputs.scene.role_name(physics::Role::Vertical).is_some() {
        bank.of(GRAVITY, "level").column(inputs, vec![1.0; inputs.rows]);
    }
}

/// Velocity as a share of what it exceeds in a hundredth of the rows only; `None` at rest.
pub(super) fn pace(inputs: &RecordingInputs<'_>, velocity: &[f64]) -> Option<Vec<f64>> {
    let top = numerics::statistics::quantile(inputs.taken(false).map(|row| velocity[row].abs()), 0.99)?;
    (top > 0.0).then(|| velocity.iter().map(|v| v / top).collect())
}
