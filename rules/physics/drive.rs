//! Which drive an output belongs to, and how that drive moves, in SI units or thousands of revolutions.

use super::{OutputKind, Role, Scene};
use adapter_core::channel::quantity::{is_of_spindle, unit_of};
use numerics::statistics::find_greatest_magnitude;
use std::f64::consts::PI;

/// Greatest moment of inertia of a spindle with its work: a blank of 20 t and 2 m on a vertical lathe has 10,000 kg m2.
pub(crate) const INERTIA_KG_M2_MAX: f64 = 20_000.0;
/// Radians per second of one revolution per minute.
pub const RAD_PER_S_OF_RPM: f64 = PI / 30.0;

/// Slowest speed, in thousands of rpm, at which a load still counts as a torque.
const CREEP_KRPM: f64 = 0.05;

/// Does the output belong to a feed axis rather than to the spindle or the whole machine?
pub fn is_axis_output(scene: &Scene) -> bool {
    let name = scene.output_name();
    let lettered = ["x_", "y_", "z_"].iter().any(|letter| name.starts_with(letter));
    name.contains("axis")
        || lettered
        || (!is_of_spindle(name) && !name.contains("total") && scene.role_values(Role::Speed).is_none())
}

/// Is the output a power, or something that adds up like one?
pub(crate) fn is_power(scene: &Scene) -> bool {
    matches!(scene.output_kind(), OutputKind::Power | OutputKind::Other)
}

/// Is the output a displacement?
pub(crate) fn is_displacement(scene: &Scene) -> bool {
    scene.output_kind() == OutputKind::Displacement
}

/// Spindle speed without its sign, in thousands of rpm.
pub(crate) fn read_speed_krpm(scene: &Scene) -> Option<Vec<f64>> {
    Some(scene.role_values(Role::Speed)?.iter().map(|rpm| rpm.abs() / 1000.0).collect())
}

/// The same, where the output is a power or torque of the spindle or of the whole machine.
pub(crate) fn read_driven_speed_krpm(scene: &Scene) -> Option<Vec<f64>> {
    (!is_displacement(scene) && !is_axis_output(scene)).then(|| read_speed_krpm(scene))?
}

/// `(n / 1000 rpm)^exponent` in a power; one exponent less, with the sign of rotation, in a torque, current or load.
pub(crate) fn raise_speed_to_exponent(scene: &Scene, exponent: f64) -> Option<Vec<f64>> {
    let krpm = read_driven_speed_krpm(scene)?;
    let signed = is_signed(scene);
    let sides = scene.role_values(Role::Speed)?.iter().map(|rpm| find_motion_sign(*rpm, signed));
    Some(raise_to_exponent(scene, &krpm, sides, exponent))
}

/// The same law of a feed drive over its velocity in m/s: in a power, or with the direction in a force.
pub(crate) fn raise_velocity_to_exponent(scene: &Scene, velocity: &[f64], exponent: f64) -> Vec<f64> {
    let pace: Vec<f64> = velocity.iter().map(|v| v.abs()).collect();
    raise_to_exponent(scene, &pace, compute_directions(velocity), exponent)
}

/// `pace^exponent` in a power; one exponent less, with the side of the motion, in a torque, force, current or load.
fn raise_to_exponent(scene: &Scene, pace: &[f64], sides: impl Iterator<Item = f64>, exponent: f64) -> Vec<f64> {
    if scene.output_kind() != OutputKind::Force {
        return pace.iter().map(|n| n.powf(exponent)).collect();
    }
    let law = |(n, side): (&f64, f64)| if *n > 0.0 { n.powf(exponent - 1.0) * side } else { 0.0 };
    pace.iter().zip(sides).map(law).collect()
}

/// The velocity of the slide in m/s where the output is that of its feed drive.
pub fn read_slide_velocity(scene: &Scene) -> Option<Vec<f64>> {
    if is_rotary_drive(scene) { None } else { read_motion(scene) }
}

/// Does the output change its sign with the direction of motion? A true rms current of the spindle does not.
pub(crate) fn is_signed(scene: &Scene) -> bool {
    !is_of_spindle(scene.output_name())
        || scene.recorded_output().iter().zip(scene.usable_rows()).any(|(value, usable)| *usable && *value < 0.0)
}

fn find_motion_sign(motion: f64, signed: bool) -> f64 {
    if signed && motion < 0.0 { -1.0 } else { 1.0 }
}

/// The load over the speed in thousands of rpm: the torque of the cut, in the output's unit at 1000 rpm.
pub(crate) fn compute_torque_at_1000_rpm(scene: &Scene) -> Option<Vec<f64>> {
    let krpm = read_driven_speed_krpm(scene)?;
    Some(scene.load()?.iter().zip(&krpm).map(|(load, n)| load / n.max(CREEP_KRPM)).collect())
}

/// Correlation of a force with the velocity below which it is the force of the body on what moves it: whatever the laws,
/// what drives a body against friction puts energy into it on the whole. Springs and masses alone come near zero.
const OPPOSES: f64 = -0.3;

/// Is a force recorded as the one that opposes the motion, instead of the one that drives it?
fn is_force_opposing(scene: &Scene, velocity: &[f64]) -> bool {
    let rows = || (0..velocity.len()).filter(|row| scene.usable_rows()[*row] && velocity[*row].is_finite());
    let force = scene.recorded_output();
    let sum = |of: &dyn Fn(usize) -> f64| rows().map(of).sum::<f64>();
    let (along, force_2, speed_2) =
        (sum(&|row| force[row] * velocity[row]), sum(&|row| force[row].powi(2)), sum(&|row| velocity[row].powi(2)));
    along < OPPOSES * (force_2 * speed_2).sqrt()
}

/// How the drive of the output moves: axis velocity in m/s, or spindle speed in rad/s, with its sign; against it where the
/// force is recorded as the one that opposes the motion, so that friction is positive in either convention.
pub(crate) fn read_motion(scene: &Scene) -> Option<Vec<f64>> {
    if is_displacement(scene) {
        return None;
    }
    let role = if is_rotary_drive(scene) { Role::Speed } else { Role::Velocity };
    let motion = convert_to_si(scene, scene.role_name(role)?)?;
    let unsigned = scene.output_kind() == OutputKind::Force && !is_signed(scene);
    if unsigned {
        return Some(motion.iter().map(|v| v.abs()).collect());
    }
    let opposes = scene.output_kind() == OutputKind::Force && is_force_opposing(scene, &motion);
    Some(if opposes { motion.iter().map(|v| -v).collect() } else { motion })
}

/// Does the drive of the output turn (rad/s) rather than slide (m/s)?
pub(crate) fn is_rotary_drive(scene: &Scene) -> bool {
    !is_axis_output(scene) || scene.role_values(Role::Velocity).is_none()
}

/// A quantity in m, m/s, m/s2 or rad/s, by the unit at the end of its name.
pub(crate) fn convert_to_si(scene: &Scene, column: &str) -> Option<Vec<f64>> {
    let scale = match unit_of(column) {
        Some("mm/min") => 1.0 / 60_000.0,
        Some("mm" | "mm/s" | "mm/s2") => 1e-3,
        Some("rpm") => RAD_PER_S_OF_RPM,
        _ => 1.0,
    };
    Some(scene.column(column)?.iter().map(|value| value * scale).collect())
}

/// Velocities of the feed axes in m/s: of every axis, else of the one axis, else the feed along the path.
pub(crate) fn read_axis_velocities(scene: &Scene) -> Vec<Vec<f64>> {
    let named = ["x_axis_velocity_mm_min", "y_axis_velocity_mm_min", "z_axis_velocity_mm_min"];
    let axes: Vec<_> = named.iter().filter_map(|name| convert_to_si(scene, name)).collect();
    if !axes.is_empty() {
        return axes;
    }
    let one = scene.role_name(Role::Velocity).and_then(|name| convert_to_si(scene, name));
    one.or_else(|| convert_to_si(scene, "feed_mm_min")).into_iter().collect()
}

/// Rate of change per second: central difference within a run, one-sided at its ends.
pub fn compute_rate(scene: &Scene, values: &[f64]) -> Vec<f64> {
    let mut rates = vec![0.0; values.len()];
    for run in scene.runs() {
        for row in run.clone() {
            let before = row.saturating_sub(1).max(run.start);
            let after = (row + 1).min(run.end - 1);
            let dt_s = scene.time_s()[after] - scene.time_s()[before];
            rates[row] = if dt_s > 0.0 { (values[after] - values[before]) / dt_s } else { 0.0 };
        }
    }
    rates
}

/// Change of the spindle speed in rpm per second: as recorded, or from the speed where it is not.
pub(crate) fn read_spindle_rate_rpm_per_s(scene: &Scene) -> Option<Vec<f64>> {
    if let Some(recorded) = scene.column("spindle_acceleration_rpm_per_s") {
        return Some(recorded.to_vec());
    }
    Some(compute_rate(scene, scene.role_values(Role::Speed)?))
}

/// Both directions are visited, each in at least a fiftieth of the rows.
pub fn has_both_directions(motion: &[f64]) -> bool {
    let least = motion.len().div_ceil(50);
    let forward = motion.iter().filter(|v| **v > 0.0).count();
    let backward = motion.iter().filter(|v| **v < 0.0).count();
    forward.min(backward) >= least.max(2)
}

/// The direction of a motion, -1 to 1: a reversal passes through zero within a hundredth of the greatest velocity.
pub fn compute_directions(motion: &[f64]) -> impl Iterator<Item = f64> {
    let width = compute_rest_width(motion);
    motion.iter().map(move |v| compute_soft_sign(*v, width))
}

/// Speed below which a motion counts as resting, in its own unit: a hundredth of the greatest.
pub(crate) fn compute_rest_width(motion: &[f64]) -> f64 {
    0.01 * find_greatest_magnitude(motion)
}

/// A sign that passes smoothly through zero within `width`.
pub(crate) fn compute_soft_sign(value: f64, width: f64) -> f64 {
    (value / width.max(f64::MIN_POSITIVE)).tanh()
}
