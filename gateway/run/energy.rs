//! Energy since the start, from each power that is measured.

use adapters::clock::{SECOND_NS, TimeNs};
use adapters::{ChannelId, Sample};
use gateway_status::ChannelEnergy;

/// Powers of which the energy is counted.
const POWERS: [&str; 2] = ["total_power_w", "spindle_power_w"];
/// Between two ticks that are further apart nobody knows what was drawn; the history calls it a gap.
const LONGEST_NS: i64 = 2 * SECOND_NS;

/// Counts what was drawn. Energy that a braking spindle gives back is not taken off: a counter never falls.
#[derive(Debug, Default)]
pub struct EnergyCounter {
    last_ns: Option<TimeNs>,
    joules: [Option<f64>; POWERS.len()],
}

impl EnergyCounter {
    /// A tick: each power counts for the time since the tick before. One without a value counts nothing.
    pub fn count_tick(&mut self, sample: &Sample) {
        let before_ns = self.last_ns.replace(sample.at_ns);
        let span_ns = before_ns.map_or(0, |before_ns| sample.at_ns.saturating_sub(before_ns));
        let seconds = if (0..=LONGEST_NS).contains(&span_ns) { span_ns as f64 / SECOND_NS as f64 } else { 0.0 };
        for (joules, name) in self.joules.iter_mut().zip(POWERS) {
            let power = ChannelId::from_name(name).and_then(|id| sample.number(id).ok());
            if let Some(watts) = power {
                *joules = Some(joules.unwrap_or(0.0) + watts.max(0.0) * seconds);
            }
        }
    }

    /// What was drawn by each power that has had a value.
    #[must_use]
    pub fn list_energies(&self) -> Vec<ChannelEnergy> {
        let each = self.joules.iter().zip(POWERS);
        each.filter_map(|(joules, channel)| joules.map(|joules| ChannelEnergy { channel, joules })).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapters::{Slot, Value};

    #[test]
    fn energy_is_power_by_time_and_neither_falls_nor_counts_what_nobody_saw() {
        let mut counter = EnergyCounter::default();
        let mut tick = |at_ms: i64, watts: Option<f64>| {
            let mut sample = Sample::new_empty(at_ms * 1_000_000);
            let id = ChannelId::from_name("total_power_w").expect("in the table");
            watts
                .into_iter()
                .for_each(|watts| sample.set_slot(id, Slot { value: Ok(Value::Number(watts)), age_ns: 0 }));
            counter.count_tick(&sample);
            counter.list_energies().first().map(|energy| (energy.channel, energy.joules))
        };
        let of = |joules: f64| Some(("total_power_w", joules));
        assert_eq!(tick(0, None), None);
        assert_eq!(tick(1000, Some(500.0)), of(500.0));
        assert_eq!(tick(1500, Some(1000.0)), of(1000.0));
        assert_eq!(tick(2500, None), of(1000.0), "no value");
        assert_eq!(tick(3500, Some(-800.0)), of(1000.0), "given back");
        assert_eq!(tick(9000, Some(1000.0)), of(1000.0), "a pause");
        assert_eq!(tick(8000, Some(1000.0)), of(1000.0), "a clock that went back");
        assert_eq!(tick(8100, Some(1000.0)), of(1100.0));
    }
}
