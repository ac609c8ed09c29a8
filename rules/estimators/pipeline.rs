//! From a sample to estimates.

use super::estimate::{Estimate, Estimates, NoEstimate};
use super::filter::AntiPulse;
use super::no_load::NoLoadTable;
use super::settings::Settings;
use super::state::State;
use adapters::{Absence, ChannelId, Sample};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why a snapshot cannot be used; start anew then.
#[derive(Debug, Error)]
#[error("the stored state of the estimators cannot be used ({0}); they start anew and learn again")]
pub struct RestoreError(#[from] serde_json::Error);

/// Everything the estimators remember between ticks. No allocation per tick, except when a new speed is learned.
#[derive(Debug, Clone)]
pub struct Pipeline {
    settings: Settings,
    memory: Memory,
    estimates: Estimates,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Memory {
    filter: AntiPulse,
    no_load: NoLoadTable,
}

impl Pipeline {
    /// A pipeline that knows nothing but its settings.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        let memory =
            Memory { filter: AntiPulse::new(settings.filter_samples as usize), no_load: NoLoadTable::new(&settings) };
        Self { settings, memory, estimates: Estimates::none(0) }
    }

    /// Takes one sample; samples come in the order of time.
    pub fn infer(&mut self, sample: &Sample) -> &Estimates {
        let number = |name: &str| ChannelId::of(name).map_or(Err(Absence::NotProvided), |id| sample.number(id));
        let state = match (number("total_power_w"), number("spindle_speed_rpm")) {
            (Ok(total), _) if total < self.settings.off_power_w => State::Off,
            (_, Err(Absence::MachineOff)) => State::Off,
            (_, Ok(speed)) if speed.abs() < self.settings.spindle_min_rpm => State::Standby,
            _ => State::Unknown,
        };
        let filtered = number("spindle_power_w").ok().and_then(|power| self.memory.filter.push(power));
        let gain = self.memory.filter.noise_gain();
        let since_ns = if state == self.estimates.state { self.estimates.since_ns } else { sample.at_ns };
        self.estimates = Estimates::none(sample.at_ns);
        self.estimates.state = state;
        self.estimates.since_ns = since_ns;
        self.estimates.filtered_power_w = filtered
            .map(|value| Estimate { value, sd: gain * self.settings.power_noise * value.abs() })
            .ok_or(NoEstimate::NotSettled);
        &self.estimates
    }

    /// The estimates of the last sample.
    #[must_use]
    pub fn estimates(&self) -> &Estimates {
        &self.estimates
    }

    /// No-load powers known by now.
    #[must_use]
    pub fn no_load(&self) -> &NoLoadTable {
        &self.memory.no_load
    }

    /// The settings in force.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Takes new settings and keeps what was learned.
    pub fn reconfigure(&mut self, settings: Settings) {
        let no_load = self.memory.no_load.clone();
        *self = Self::new(settings);
        self.memory.no_load = no_load;
    }

    /// Everything remembered, to be stored and given to [`Pipeline::restore`] after a restart.
    #[must_use]
    pub fn snapshot(&self) -> serde_json::Value {
        serde_json::to_value(&self.memory).unwrap_or(serde_json::Value::Null)
    }

    /// Continues where a snapshot was taken.
    ///
    /// # Errors
    /// The snapshot is not one of this version.
    pub fn restore(settings: Settings, snapshot: serde_json::Value) -> Result<Self, RestoreError> {
        let memory = serde_json::from_value(snapshot)?;
        Ok(Self { memory, ..Self::new(settings) })
    }
}
