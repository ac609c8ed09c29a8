//! Thermal error: growth of spindle, screw and frame behind what heats them.

use super::drive::pace;
use crate::evidence::bank::{Family, VariantBank};
use crate::evidence::inputs::RecordingInputs;
use physics::OutputKind;
use physics::state::first_order_behind;

const SPINDLE: Family = Family::of("spindle_growth");
const AMBIENT: Family = Family::of("ambient_drift").through(&["ambient_temperature_c"]);
const COOLANT: Family = Family::of("coolant_temperature").through(&["coolant_temperature_c"]);
const SCREW: Family = Family::of("screw_growth");

/// The families of a displacement.
pub(super) fn add(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    if inputs.kind != OutputKind::Displacement {
        return;
    }
    spindle(inputs, bank);
    behind(inputs, bank, AMBIENT, inputs.ambient.as_deref(), &[0.0, 600.0, 1800.0, 5400.0, 14_000.0]);
    behind(inputs, bank, COOLANT, inputs.coolant_temperature.as_deref(), &[0.0, 600.0, 1800.0]);
    screw(inputs, bank);
}

/// What is left of an initial state.
fn fading(inputs: &RecordingInputs<'_>, tau_s: f64) -> Vec<f64> {
    inputs.column(|row| (-(inputs.clock_s[row] - inputs.clock_s[0]) / tau_s.max(60.0)).exp())
}

fn spindle(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    if let Some(rpm) = &inputs.speed {
        let top = rpm.iter().fold(1.0_f64, |top, n| top.max(*n));
        for exponent in [1.5, 2.0] {
            let heat = inputs.column(|row| (rpm[row] / top).powf(exponent));
            for tau_s in [180.0, 400.0, 900.0, 2000.0, 5000.0] {
                let fast = inputs.state(&heat, tau_s, 0.0);
                let slow = inputs.state(&heat, 6.0 * tau_s, 0.0);
                let columns = [(fast, 1.0), (slow, 1.0), (fading(inputs, tau_s), 0.5)];
                bank.of(SPINDLE, format!("{exponent}, {tau_s} s")).columns(inputs, columns);
            }
        }
    }
    if let Some(temperature) = &inputs.temperature {
        let middle = inputs.mean_of(temperature, false);
        bank.of(SPINDLE, "recorded").prior(-0.5).column(inputs, inputs.column(|row| temperature[row] - middle));
    }
}

fn behind(
    inputs: &RecordingInputs<'_>,
    bank: &mut VariantBank,
    family: Family,
    temperature: Option<&[f64]>,
    taus_s: &[f64],
) {
    let Some(temperature) = temperature else { return };
    let middle = inputs.mean_of(temperature, false);
    let over = inputs.column(|row| temperature[row] - middle);
    for tau_s in taus_s {
        let follows = if *tau_s > 0.0 { first_order_behind(inputs.scene, &over, *tau_s) } else { over.clone() };
        bank.of(family.clone(), tau_s).columns(inputs, [(follows, 1.0), (fading(inputs, *tau_s), 0.5)]);
    }
}

fn screw(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let Some(pace) = inputs.velocity.as_ref().and_then(|velocity| pace(inputs, velocity)) else { return };
    let heat: Vec<f64> = pace.iter().map(|v| v.abs()).collect();
    for tau_s in [600.0, 1500.0, 3600.0] {
        let warmth = inputs.state(&heat, tau_s, 0.0);
        let along = inputs.position.as_ref().map(|position| {
            let top = position.iter().fold(1e-9_f64, |top, z| top.max(z.abs()));
            (inputs.column(|row| warmth[row] * position[row] / top), 1.0)
        });
        let whole = (warmth.clone(), if along.is_some() { 0.4 } else { 1.0 });
        bank.of(SCREW, tau_s).columns(inputs, along.into_iter().chain([whole]));
    }
}
