//! Thermal error: growth of spindle, screw and frame behind what heats them.

use super::drive::normalise_velocity;
use crate::evidence::inputs::RecordingInputs;
use crate::evidence::variant_bank::{Family, VariantBank};
use physics::OutputKind;
use physics::state::apply_continuous_lag;

const SPINDLE: Family = Family::from_kind("spindle_growth");
const AMBIENT: Family = Family::from_kind("ambient_drift").with_channels(&["ambient_temperature_c"]);
const COOLANT: Family = Family::from_kind("coolant_temperature").with_channels(&["coolant_temperature_c"]);
const SCREW: Family = Family::from_kind("screw_growth");

/// The families of a displacement.
pub(super) fn add_variants(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    if inputs.kind != OutputKind::Displacement {
        return;
    }
    add_spindle_growth(inputs, bank);
    add_temperature_lags(inputs, bank, AMBIENT, inputs.ambient.as_deref(), &[0.0, 600.0, 1800.0, 5400.0, 14_000.0]);
    add_temperature_lags(inputs, bank, COOLANT, inputs.coolant_temperature.as_deref(), &[0.0, 600.0, 1800.0]);
    add_screw_growth(inputs, bank);
}

/// What is left of an initial state.
fn compute_decay(inputs: &RecordingInputs<'_>, tau_s: f64) -> Vec<f64> {
    inputs.build_column(|row| (-(inputs.clock_s[row] - inputs.clock_s[0]) / tau_s.max(60.0)).exp())
}

fn add_spindle_growth(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    if let Some(rpm) = &inputs.speed {
        let top = rpm.iter().fold(1.0_f64, |top, n| top.max(*n));
        for exponent in [1.5, 2.0] {
            let heat = inputs.build_column(|row| (rpm[row] / top).powf(exponent));
            for tau_s in [180.0, 400.0, 900.0, 2000.0, 5000.0] {
                let fast = inputs.simulate_slow_state(&heat, tau_s, 0.0);
                let slow = inputs.simulate_slow_state(&heat, 6.0 * tau_s, 0.0);
                let columns = [(fast, 1.0), (slow, 1.0), (compute_decay(inputs, tau_s), 0.5)];
                bank.begin_variant(SPINDLE, format!("{exponent}, {tau_s} s")).add_columns(inputs, columns);
            }
        }
    }
    if let Some(temperature) = &inputs.temperature {
        let middle = inputs.compute_mean(temperature, false);
        bank.begin_variant(SPINDLE, "recorded")
            .with_ln_prior(-0.5)
            .add_column(inputs, inputs.build_column(|row| temperature[row] - middle));
    }
}

fn add_temperature_lags(
    inputs: &RecordingInputs<'_>,
    bank: &mut VariantBank,
    family: Family,
    temperature: Option<&[f64]>,
    taus_s: &[f64],
) {
    let Some(temperature) = temperature else { return };
    let middle = inputs.compute_mean(temperature, false);
    let over = inputs.build_column(|row| temperature[row] - middle);
    for tau_s in taus_s {
        let follows = if *tau_s > 0.0 { apply_continuous_lag(inputs.scene, &over, *tau_s) } else { over.clone() };
        bank.begin_variant(family.clone(), tau_s)
            .add_columns(inputs, [(follows, 1.0), (compute_decay(inputs, *tau_s), 0.5)]);
    }
}

fn add_screw_growth(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let Some(pace) = inputs.velocity.as_ref().and_then(|velocity| normalise_velocity(inputs, velocity)) else { return };
    let heat: Vec<f64> = pace.iter().map(|v| v.abs()).collect();
    for tau_s in [600.0, 1500.0, 3600.0] {
        let warmth = inputs.simulate_slow_state(&heat, tau_s, 0.0);
        let along = inputs.position.as_ref().map(|position| {
            let top = position.iter().fold(1e-9_f64, |top, z| top.max(z.abs()));
            (inputs.build_column(|row| warmth[row] * position[row] / top), 1.0)
        });
        let whole = (warmth.clone(), if along.is_some() { 0.4 } else { 1.0 });
        bank.begin_variant(SCREW, tau_s).add_columns(inputs, along.into_iter().chain([whole]));
    }
}
