//! A FANUC controller read by ourselves and through the vendor's library, side by side.
//!
//! A machine goes on while it is read. Each value of the library is therefore held against two of ours, one from just
//! before and one from just after, and a channel differs only if it did so in every one of several rounds.

use super::{DoctorReport, ExamineError, ValueWithUnit, begin_examination};
use adapters::address::{FanucBackend, Target};
use adapters::channel::Kind;
use adapters::clock::SystemClock;
use adapters::{Address, ChannelId, Source, Value};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;

const ROUNDS: u32 = 3;

/// A channel on which the two do not agree.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelDifference {
    /// The channel that both ways of reading give.
    pub channel: ChannelId,
    /// What we read by ourselves.
    pub native: Value,
    /// What the vendor's library reads.
    pub vendor: Value,
}

/// What a comparison has shown.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// What we found by ourselves.
    pub ours: DoctorReport,
    /// What the library found.
    pub theirs: DoctorReport,
    /// Channels that both have.
    pub compared: usize,
    /// Those on which they differ.
    pub differences: Vec<ChannelDifference>,
    /// Channels that only we can read.
    pub only_native: Vec<ChannelId>,
    /// Channels that only the library can read.
    pub only_vendor: Vec<ChannelId>,
}

type ValuesByIndex = BTreeMap<usize, Value>;

/// Reads a controller in both ways and lists the channels on which they differ.
///
/// # Errors
/// The address is no FANUC controller that we talk to by ourselves, in words.
pub fn compare_backends(text: &str, library: &Path) -> Result<Comparison, ExamineError> {
    let address: Address = text.parse().map_err(ExamineError::Address)?;
    if !matches!(address.target(), Target::Fanuc { backend: FanucBackend::Native, .. }) {
        return Err(ExamineError::NotNative { address: text.to_owned() });
    }
    let clock = SystemClock::new();
    let (ours, mut native) = begin_examination(text, &clock)?;
    let (theirs, mut vendor) = begin_examination(&address_with_library(text, library), &clock)?;
    let mut rounds = Rounds::default();
    if ours.reachable && theirs.reachable {
        (0..ROUNDS).for_each(|_| {
            let before = read_values(&mut native, &clock);
            let between = read_values(&mut vendor, &clock);
            rounds.add(&before, &between, &read_values(&mut native, &clock));
        });
    }
    Ok(rounds.into_comparison(ours, theirs))
}

/// The same address through the library.
fn address_with_library(text: &str, library: &Path) -> String {
    let (at, keys) = text.split_once('?').unwrap_or((text, ""));
    let escaped = library.display().to_string().replace('%', "%25").replace('&', "%26").replace('?', "%3F");
    let kept = keys.split('&').filter(|key| !key.is_empty() && !key.starts_with("backend="));
    let own = ["backend=vendor".to_owned(), format!("library={escaped}")];
    let keys: Vec<String> = kept.map(str::to_owned).chain(own).collect();
    format!("{at}?{}", keys.join("&"))
}

/// Everything that has a value now. A source that fails in between is looked at again in the next round.
fn read_values(sources: &mut [Box<dyn Source>], clock: &SystemClock) -> ValuesByIndex {
    let mut readings = Vec::new();
    for source in sources {
        let _shown_by_the_report = source.read(clock, &mut readings);
    }
    readings.into_iter().filter_map(|reading| Some((reading.channel.index(), reading.value.ok()?))).collect()
}

/// A channel that both have.
#[derive(Default)]
struct Seen {
    rounds: u32,
    differed: u32,
    /// The last pair that did: ours, the library's.
    pair: Option<(Value, Value)>,
}

#[derive(Default)]
struct Rounds {
    seen: BTreeMap<usize, Seen>,
    native: ValuesByIndex,
    vendor: ValuesByIndex,
}

impl Rounds {
    fn add(&mut self, before: &ValuesByIndex, between: &ValuesByIndex, after: &ValuesByIndex) {
        for (index, vendor) in between {
            let (Some(first), Some(last)) = (before.get(index), after.get(index)) else { continue };
            let Some(channel) = ChannelId::from_index(*index) else { continue };
            let seen = self.seen.entry(*index).or_default();
            seen.rounds += 1;
            if !values_agree(channel, first, vendor, last) {
                seen.differed += 1;
                seen.pair = Some((last.clone(), vendor.clone()));
            }
        }
        self.native.extend(before.clone());
        self.vendor.extend(between.clone());
    }

    fn into_comparison(self, ours: DoctorReport, theirs: DoctorReport) -> Comparison {
        let only = |these: &ValuesByIndex, others: &ValuesByIndex| -> Vec<ChannelId> {
            these
                .keys()
                .filter(|index| !others.contains_key(index))
                .filter_map(|index| ChannelId::from_index(*index))
                .collect()
        };
        let (only_native, only_vendor) = (only(&self.native, &self.vendor), only(&self.vendor, &self.native));
        let compared = self.seen.len();
        let always = self.seen.into_iter().filter(|(_, seen)| seen.differed == seen.rounds);
        let differences = always.filter_map(|(index, seen)| {
            let (channel, (native, vendor)) = (ChannelId::from_index(index)?, seen.pair?);
            Some(ChannelDifference { channel, native, vendor })
        });
        let differences = differences.collect();
        Comparison { ours, theirs, compared, differences, only_native, only_vendor }
    }
}

/// How far two numbers of a standing machine may be apart: what the two ways round differently.
fn tolerance(channel: ChannelId, number: f64) -> f64 {
    match (channel.channel().kind, channel.channel().unit) {
        (Kind::Held | Kind::Text, _) => 1e-9,
        (Kind::Continuous, "mm") => 0.011,
        (Kind::Continuous, _) => (0.01 * number.abs()).max(1.0),
    }
}

/// Is the library's value one that could have been between two of ours?
fn values_agree(channel: ChannelId, before: &Value, vendor: &Value, after: &Value) -> bool {
    match (before, vendor, after) {
        (Value::Number(before), Value::Number(vendor), Value::Number(after)) => {
            let tolerance = tolerance(channel, *vendor);
            (before.min(*after) - tolerance..=before.max(*after) + tolerance).contains(vendor)
        }
        (before, vendor, after) => vendor == before || vendor == after,
    }
}

impl Comparison {
    /// Do both ways work, and does nothing differ?
    #[must_use]
    pub fn is_well(&self) -> bool {
        self.compared > 0
            && self.differences.is_empty()
            && self.ours.problems.is_empty()
            && self.theirs.problems.is_empty()
    }

    /// For `doctor --json`: our own report, with the rest beside it.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        let names = |channels: &[ChannelId]| channels.iter().map(|channel| channel.name()).collect::<Vec<_>>();
        let mut document = self.ours.to_json();
        document["vendor"] = self.theirs.to_json();
        document["compared"] = json!(self.compared);
        document["differences"] = self.differences.iter().map(ChannelDifference::to_json).collect();
        document["only_native"] = json!(names(&self.only_native));
        document["only_vendor"] = json!(names(&self.only_vendor));
        document
    }

    /// For people: what was compared, then line by line what differs.
    #[must_use]
    pub fn format_lines(&self) -> Vec<String> {
        if self.compared == 0 {
            return vec!["  nothing could be compared: see the problems above".to_owned()];
        }
        let count = self.differences.len();
        let mut lines = vec![
            format!("  read once: native {:.1} ms, library {:.1} ms", self.ours.read_ms, self.theirs.read_ms),
            format!("  {} channels compared in {ROUNDS} rounds, {count} differ", self.compared),
        ];
        lines.extend(self.differences.iter().map(ChannelDifference::format_line));
        for (who, channels) in [("native", &self.only_native), ("the library", &self.only_vendor)] {
            let names: Vec<&str> = channels.iter().map(|channel| channel.name()).collect();
            if !names.is_empty() {
                lines.push(format!("  only {who} has: {}", names.join(", ")));
            }
        }
        lines
    }
}

impl ChannelDifference {
    /// Names and both values, for `doctor --json`.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        let value = |value: &Value| match value {
            Value::Number(number) => json!(number),
            Value::Text(text) => json!(&**text),
        };
        let (native, vendor) = (value(&self.native), value(&self.vendor));
        json!({"channel": self.channel.name(), "native": native, "vendor": vendor})
    }

    fn format_line(&self) -> String {
        let shown = |value: &Value| ValueWithUnit(self.channel, value.clone()).to_string();
        let (native, vendor) = (shown(&self.native), shown(&self.vendor));
        format!("    {:<26} native {native:<16} library {vendor}", self.channel.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(name: &str) -> ChannelId {
        ChannelId::from_name(name).expect("in the table")
    }

    #[test]
    fn a_moving_axis_does_not_differ_and_a_flag_does() {
        let agrees = |name: &str, before: f64, vendor: f64, after: f64| {
            values_agree(channel(name), &Value::Number(before), &Value::Number(vendor), &Value::Number(after))
        };
        assert!(agrees("x_axis_position_mm", 10.0, 14.0, 20.0), "it was there in between");
        assert!(!agrees("x_axis_position_mm", 10.0, 10.5, 10.0), "it stood somewhere else");
        assert!(!agrees("gear_stage", 1.0, 2.0, 1.0) && !agrees("rapid", 0.0, 1.0, 0.0));
        assert!(agrees("spindle_speed_rpm", 3000.0, 3020.0, 3000.0));
        let text = |text: &str| Value::Text(text.into());
        assert!(values_agree(channel("block"), &text("N10"), &text("N20"), &text("N20")));
        assert!(!values_agree(channel("block"), &text("N10"), &text("N20"), &text("N10")));
    }

    #[test]
    fn the_address_through_the_library_keeps_its_keys() {
        let through = |text| address_with_library(text, Path::new("/opt/a&b.so"));
        assert_eq!(through("fanuc://cnc"), "fanuc://cnc?backend=vendor&library=/opt/a%26b.so");
        let text = through("fanuc://cnc?backend=native&path=2");
        assert_eq!(text, "fanuc://cnc?path=2&backend=vendor&library=/opt/a%26b.so");
    }
}
