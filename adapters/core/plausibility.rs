//! What is not believed, counted and told: the step between a driver and the merge.
//!
//! The limits stand in the table of channels and nowhere else; [`Reading::from_number`](crate::Reading::from_number) holds every number
//! against them, so that no driver can go around it. A driver that knows more (a meter without any supply voltage, phases that do
//! not make the sum) gives [`Reading::from_implausible`](crate::Reading::from_implausible). Either way the channel has no value, and what the device
//! said is counted here and told while it lasts. Nothing is ever cut off to fit.

use crate::channel::ChannelId;
use crate::driver::{Fact, SourceProblem};
use crate::reading::{Reading, Value};
use crate::text::{TEXT_BYTES_MAX, has_byte_mark};
use std::collections::BTreeMap;
use std::sync::Arc;

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
    /// Channels whose last text was longer than is kept, and how long the first of this stretch was, bytes.
    cut_texts: BTreeMap<ChannelId, usize>,
    /// Channels whose last text has bytes in it that are no text, with the first such text of this stretch.
    unread_texts: BTreeMap<ChannelId, Arc<str>>,
}

impl Plausibility {
    /// Takes the readings of a poll.
    pub fn record_readings(&mut self, readings: &[Reading]) {
        for reading in readings {
            match reading.cut_from_bytes() {
                Some(bytes) => drop(self.cut_texts.entry(reading.channel).or_insert(bytes)),
                None if reading.value.is_ok() => drop(self.cut_texts.remove(&reading.channel)),
                None => {}
            }
            match &reading.value {
                Ok(Value::Text(text)) if has_byte_mark(text) => {
                    self.unread_texts.entry(reading.channel).or_insert_with(|| text.clone());
                }
                Ok(_) => drop(self.unread_texts.remove(&reading.channel)),
                Err(_) => {}
            }
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
    pub fn count_implausible(&self) -> u64 {
        self.doubts.values().map(|doubt| doubt.count).sum()
    }

    /// The count as a fact of the source, once there is one.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "a count that is shown")]
    pub fn build_fact(&self) -> Option<Fact> {
        (self.count_implausible() > 0)
            .then(|| Fact::from_number("implausible_readings", self.count_implausible() as f64))
    }

    /// What is not believed or not kept whole at the moment, one sentence per channel.
    #[must_use]
    pub fn list_problems(&self) -> Vec<SourceProblem> {
        let standing = self.doubts.iter().filter_map(|(channel, doubt)| Some((channel, doubt.standing?)));
        standing
            .filter(|(channel, number)| !channel.channel().accepts_number(*number))
            .map(describe_implausible)
            .chain(self.cut_texts.iter().map(describe_cut_text))
            .chain(self.unread_texts.iter().map(describe_unread_text))
            .collect()
    }
}

fn describe_cut_text((id, bytes): (&ChannelId, &usize)) -> SourceProblem {
    SourceProblem {
        what: format!("{id} has a text of {bytes} bytes; only the first {TEXT_BYTES_MAX} are kept"),
        next: "Look at what sends it: names, messages and blocks are shorter; at a broker somebody else may publish in its place"
            .to_owned(),
    }
}

fn describe_unread_text((id, text): (&ChannelId, &Arc<str>)) -> SourceProblem {
    SourceProblem {
        what: format!("{id} has bytes that are no text in the character set of this source, or whose set is not known: {text}"),
        next: "Name the set of the control at the end of the address: encoding=gbk, shift_jis, euc-kr, big5 or windows-1252".to_owned(),
    }
}

fn describe_implausible((id, number): (&ChannelId, f64)) -> SourceProblem {
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
        Reading::from_number(
            ChannelId::from_name("supply_voltage_v").expect("in the table"),
            Stamp::from_exact_time(0),
            volts,
        )
    }

    #[test]
    fn what_cannot_be_is_no_value_and_is_told_with_its_number_while_it_lasts() {
        let mut plausibility = Plausibility::default();
        let wrong = reading(4.3e8);
        assert_eq!((&wrong.value, wrong.implausible), (&Err(Absence::OutOfRange), Some(4.3e8)));
        plausibility.record_readings(&[reading(400.0), wrong]);
        plausibility.record_readings(&[reading(4.4e8)]);
        let told = plausibility.list_problems();
        assert!(told.len() == 1 && told[0].what.contains("4.3") && told[0].what.contains("0 to 1000 V"), "{told:?}");
        assert_eq!(plausibility.count_implausible(), 2);
        plausibility.record_readings(&[reading(401.0)]);
        assert!(plausibility.list_problems().is_empty() && plausibility.count_implausible() == 2, "counted, and over");
    }

    #[test]
    fn a_text_that_is_too_long_is_told_while_it_lasts() {
        let program = ChannelId::from_name("program").expect("in the table");
        let read = |text: &str| [Reading::from_text(program, Stamp::from_exact_time(0), text.into())];
        let mut plausibility = Plausibility::default();
        plausibility.record_readings(&read(&"P".repeat(70_000)));
        plausibility.record_readings(&read(&"P".repeat(80_000)));
        let told = plausibility.list_problems();
        assert!(told.len() == 1 && told[0].what.contains("program has a text of 70000 bytes"), "{told:?}");
        plausibility.record_readings(&read("O1234"));
        assert_eq!(plausibility.list_problems(), []);
    }

    #[test]
    fn noise_about_zero_is_believed_where_a_quantity_begins_there() {
        let current = ChannelId::from_name("spindle_current_a").expect("in the table").channel();
        assert!(
            current.accepts_number(-0.04)
                && current.accepts_number(12.0)
                && !current.accepts_number(-50.0)
                && !current.accepts_number(f64::NAN)
        );
        let count = ChannelId::from_name("part_count").expect("in the table").channel();
        assert!(!count.accepts_number(-0.04), "a counter has no noise");
    }
}
