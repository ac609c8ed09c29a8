//! What is not believed, counted and told: the step between a driver and the merge.
//!
//! The limits stand in the table of channels and nowhere else; [`Reading::number`](crate::Reading::number) holds every number
//! against them, so that no driver can go around it. A driver that knows more (a meter without any supply voltage, phases that do
//! not make the sum) gives [`Reading::implausible`](crate::Reading::implausible). Either way the channel has no value, and what the device
//! said is counted here and told while it lasts. Nothing is ever cut off to fit.

use crate::channel::ChannelId;
use crate::driver::{Fact, SourceProblem};
use crate::reading::Reading;
use std::collections::BTreeMap;

/// What was said of one channel and not believed.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Doubt {
    /// So many readings since the start.
    count: u64,
    /// The first number of this stretch; `None` while the last reading was believed.
    standing: Option<f64>,
}

/// The readings of one source that were not believed.
#[derive(Debug, Clone, Default)]
pub struct Plausibility {
    doubts: BTreeMap<ChannelId, Doubt>,
}

impl Plausibility {
    /// Takes the readings of a poll.
    pub fn see(&mut self, readings: &[Reading]) {
        for reading in readings {
            match (reading.implausible, self.doubts.get_mut(&reading.channel)) {
                (Some(number), Some(doubt)) => {
                    doubt.count += 1;
                    doubt.standing.get_or_insert(number);
                }
                (Some(number), None) => {
                    self.doubts.insert(reading.channel, Doubt { count: 1, standing: Some(number) });
                }
                (None, Some(doubt)) => doubt.standing = None,
                (None, None) => {}
            }
        }
    }

    /// Readings that were not believed since the start.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.doubts.values().map(|doubt| doubt.count).sum()
    }

    /// The count as a fact of the source, once there is one.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "a count that is shown")]
    pub fn fact(&self) -> Option<Fact> {
        (self.count() > 0).then(|| Fact::number("implausible_readings", self.count() as f64))
    }

    /// What is not believed at the moment, one sentence per channel whose range tells against it.
    #[must_use]
    pub fn problems(&self) -> Vec<SourceProblem> {
        let standing = self.doubts.iter().filter_map(|(channel, doubt)| Some((channel, doubt.standing?)));
        standing.filter(|(channel, number)| !channel.channel().holds(*number)).map(told).collect()
    }
}

fn told((id, number): (&ChannelId, f64)) -> SourceProblem {
    let channel = id.channel();
    let (least, greatest) = channel.range;
    SourceProblem {
        what: format!(
            "{id} has no value: the device says {number:.6e} {unit}, which cannot be ({least} to {greatest} {unit})",
            unit = channel.unit
        ),
        next:
            "Compare with the device's own display: address, type, word order, unit or scale of this value may be wrong"
                .to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reading::{Absence, Stamp};

    fn reading(volts: f64) -> Reading {
        Reading::number(ChannelId::of("supply_voltage_v").expect("in the table"), Stamp::exact(0), volts)
    }

    #[test]
    fn what_cannot_be_is_no_value_and_is_told_with_its_number_while_it_lasts() {
        let mut plausibility = Plausibility::default();
        let wrong = reading(4.3e8);
        assert_eq!((&wrong.value, wrong.implausible), (&Err(Absence::OutOfRange), Some(4.3e8)));
        plausibility.see(&[reading(400.0), wrong]);
        plausibility.see(&[reading(4.4e8)]);
        let told = plausibility.problems();
        assert!(told.len() == 1 && told[0].what.contains("4.3") && told[0].what.contains("0 to 1000 V"), "{told:?}");
        assert_eq!(plausibility.count(), 2);
        plausibility.see(&[reading(401.0)]);
        assert!(plausibility.problems().is_empty() && plausibility.count() == 2, "counted, and over");
    }

    #[test]
    fn noise_about_zero_is_believed_where_a_quantity_begins_there() {
        let current = ChannelId::of("spindle_current_a").expect("in the table").channel();
        assert!(current.holds(-0.04) && current.holds(12.0) && !current.holds(-50.0) && !current.holds(f64::NAN));
        let count = ChannelId::of("part_count").expect("in the table").channel();
        assert!(!count.holds(-0.04), "a counter has no noise");
    }
}
