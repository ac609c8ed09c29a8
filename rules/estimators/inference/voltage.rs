//! Power as it would be at the reference of the supply voltage.

use super::{Inference, InferenceState};
use crate::inputs::TickInputs;
use crate::learning::Observation;
use crate::no_load::{NoLoad, NoLoadPoint};
use crate::settings::Settings;
use crate::supply::MeasuredIdlePower;

impl Inference {
    /// Takes off the power what the supply voltage does to no-load power, so that all that follows compares like with like; no
    /// effect without a voltage. Where no-load power is not known yet, the whole power is taken for it.
    pub(super) fn take_to_reference_voltage(&mut self, inputs: &mut TickInputs) {
        if !inputs.basis.in_watts() {
            return;
        }
        inputs.supply_log = self.state.supply.observe_voltage(inputs.voltage);
        let Ok(power_w) = inputs.power else { return };
        let ratio = self.state.supply.power_ratio(inputs.supply_log);
        let known = self.select_no_load_reference(inputs).ok().filter(NoLoad::is_estimate);
        inputs.by_voltage_w = known.map_or(power_w * (1.0 - 1.0 / ratio), |known| known.power_w * (ratio - 1.0));
        inputs.power = Ok(power_w - inputs.by_voltage_w);
    }

    /// The same no-load power at the voltage of this tick.
    pub(super) fn at_voltage(&self, known: NoLoad, inputs: &TickInputs) -> NoLoad {
        let ratio = self.state.supply.power_ratio(inputs.supply_log);
        NoLoad { power_w: ratio * known.power_w, sd_w: ratio * known.sd_w, ..known }
    }
}

impl InferenceState {
    /// An idle power tells how no-load power goes with the voltage, if it was measured at another one than before.
    pub(super) fn follow_voltage(&mut self, seen: &Observation, settings: &Settings) {
        if !seen.is_settled() {
            return;
        }
        let NoLoadPoint { stage, speed_rpm, power_w } = seen.point;
        let (at_ns, sd_w, supply_log) = (seen.at_ns, seen.sd_w, seen.supply_log);
        let change = self
            .supply
            .learn_exponent(MeasuredIdlePower { at_ns, stage, speed_rpm, power_w, sd_w, supply_log }, settings);
        self.no_load.correct_exponent(change);
    }
}
