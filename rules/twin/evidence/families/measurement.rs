//! The measurement: a zero that drifts, a gain that follows the supply, a clock that is late, a meter that averages or
//! clips.

use crate::evidence::inputs::RecordingInputs;
use crate::evidence::variant_bank::{Family, VariantBank};
use physics::OutputKind;

const DRIFT: Family = Family::from_kind("zero_drift").with_channels(&["time"]).without_widening();
const VOLTAGE: Family = Family::from_kind("supply_voltage").with_channels(&["supply_voltage_v"]);
const LAG: Family = Family::from_kind("clock_lag").with_sign(1.0).with_edge_action();
const WINDOW: Family = Family::from_kind("meter_window").with_sign(1.0);
const SATURATION: Family = Family::from_kind("saturation").with_catalogue_forms().with_sign(1.0).with_rarity(-1.0);

/// Widths of the bumps of a drift, as shares of the recording.
const WIDTHS: [f64; 4] = [0.5, 0.2, 0.08, 0.04];
/// Seconds below which no zero drifts: electronics warm up over minutes.
const DRIFT_MIN_S: f64 = 60.0;
/// Natural logarithm of how much rarer the zero of a displacement drifts than what it measures: odds of 20 to 1, so that a
/// slow curve has no sure name. A wrong value costs the name of a drifting probe.
const DRIFT_OF_DISPLACEMENT: f64 = -3.0;
/// Delays in samples and in seconds.
const SAMPLES: [f64; 8] = [0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 15.0, 30.0];
const SECONDS: [f64; 4] = [0.2, 0.5, 1.0, 2.0];
/// Longest delay, s, unless six samples are longer.
const DELAY_MAX_S: f64 = 6.5;

/// The families of the meter.
pub(super) fn add_variants(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    add_drift(inputs, bank);
    add_voltage(inputs, bank);
    if inputs.kind != OutputKind::Displacement {
        add_delays(inputs, bank);
    }
    for share in [0.8, 0.9, 0.95] {
        let Some(limit) =
            numerics::statistics::quantile(inputs.fitted_rows(false).map(|row| inputs.simulated[row]), share)
        else {
            continue;
        };
        let law = inputs.build_column(|row| -(inputs.simulated[row] - limit).max(0.0));
        bank.begin_variant(SATURATION, format!("{limit:.0}")).add_column(inputs, law);
    }
}

fn add_drift(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let span_s = inputs.span_s();
    let time = inputs.build_column(|row| (inputs.clock_s[row] - inputs.clock_s[0]) / span_s);
    let several = inputs.scene.runs().len() > 3;
    // Everything in a shop that is warm by turns moves a machine slowly.
    let rarity = if inputs.kind == OutputKind::Displacement { DRIFT_OF_DISPLACEMENT } else { 0.0 };
    for width in WIDTHS {
        if width * span_s <= (20.0 * inputs.period_s).max(DRIFT_MIN_S) || width < 0.2 && !several {
            continue;
        }
        let bump =
            |centre: f64| inputs.build_column(|row| (-0.5 * ((time[row] - centre) / (0.9 * width)).powi(2)).exp());
        let mut centre = -width;
        let mut columns = Vec::new();
        while centre < 1.0 + 2.0 * width {
            columns.push((bump(centre), 1.0));
            centre += width;
        }
        bank.begin_variant(DRIFT, width).with_ln_prior(rarity).with_given_size().add_columns(inputs, columns);
    }
    if span_s < DRIFT_MIN_S {
        return;
    }
    let linear = inputs.build_column(|row| time[row] - 0.5);
    let bent = inputs.build_column(|row| (time[row] - 0.5).powi(2) - 1.0 / 12.0);
    bank.begin_variant(DRIFT, "line").with_ln_prior(rarity).add_columns(inputs, [(linear, 1.0), (bent, 0.6)]);
}

fn add_voltage(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let Some(voltage) = &inputs.voltage else { return };
    if inputs.compute_deviation(voltage, false) <= 0.0 {
        return;
    }
    let usual = inputs.compute_mean(voltage, false);
    let relative = inputs.build_column(|row| voltage[row] / usual - 1.0);
    let output = inputs.build_column(|row| inputs.simulated[row] * relative[row]);
    let cut = inputs.build_column(|row| relative[row] * inputs.cut.as_ref().map_or(1.0, |cut| cut[row]));
    bank.begin_variant(VOLTAGE, "").add_columns(inputs, [(output, 1.0), (cut, 0.4), (relative, 0.4)]);
}

/// A delay, a smoothing, and both: one causal kernel.
fn add_delays(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let mut taus: Vec<f64> = SAMPLES.iter().map(|k| k * inputs.period_s).chain(SECONDS).collect();
    taus.sort_by(f64::total_cmp);
    taus.dedup_by(|b, a| (*b - *a).abs() < 1e-6);
    let least = if inputs.speed.is_some() { 0.3 } else { 1.0 };
    taus.retain(|tau| *tau >= least * inputs.period_s && (*tau <= DELAY_MAX_S || *tau <= 6.0 * inputs.period_s));
    let simulated = &inputs.simulated;
    let less = |late: Vec<f64>| inputs.build_column(|row| late[row] - simulated[row]);
    for tau_s in taus {
        let delayed = less(inputs.delay_values(simulated, tau_s));
        let smoothed = less(inputs.smooth_values(simulated, tau_s));
        let both = less(inputs.delay_values(&inputs.smooth_values(simulated, 0.35 * tau_s), 0.8 * tau_s));
        bank.begin_variant(LAG, format!("{tau_s} s"))
            .with_largest_size(3.0)
            .add_columns(inputs, [(delayed, 1.0), (smoothed.clone(), 0.2)]);
        bank.begin_variant(LAG, format!("{tau_s} s, smoothed")).with_ln_prior(-0.5).add_column(inputs, both);
        if tau_s >= 0.5 * inputs.period_s {
            bank.begin_variant(WINDOW, format!("{tau_s} s, first order")).add_column(inputs, smoothed);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few samples")]
            let window = ((2.0 * tau_s / inputs.period_s).round() as usize).max(2);
            let mean = less(inputs.compute_moving_average(simulated, window));
            bank.begin_variant(WINDOW, format!("{tau_s} s, mean")).with_ln_prior(-0.7).add_column(inputs, mean);
        }
    }
}
