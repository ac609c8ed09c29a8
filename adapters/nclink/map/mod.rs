//! Which data item feeds which channel. The paths are those of Huazhong's default model.

use super::decode::{self, ChannelWord};
use super::item_conversion::ItemConversion;
use super::lenient_json::parse_integer;
use super::message::{NcLinkAnswer, RequestedItem};
use super::model::{Model, ModelItem};
use super::own_path::OwnPath;
use adapter_core::channel::ChannelId;
use adapter_core::driver::SourceProblem;
use adapter_core::own::Own;
use adapter_core::reading::{Absence, Reading, Stamp};
use serde_json::Value;
use std::sync::Arc;

/// What the address says about the controller behind the broker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct NcLinkLayout {
    /// Index of the channel's first F word.
    pub(super) f_channel: u32,
    /// Number of the spindle among the axes, where it is not 5.
    pub(super) spindle_axis: Option<u32>,
}

/// Element 23 of the channel data is the flag of rigid tapping, if the elements are those of the vendor's list.
const RIGID_TAPPING: u32 = 23;

/// How an answer becomes readings.
#[derive(Debug, Clone, Copy)]
enum How {
    Number,
    Text(fn(&Value) -> Option<String>),
    Status,
    ChannelWord,
    Tapping,
}

/// Path of an item, the channel it feeds, and how.
type ItemRow = (&'static str, &'static str, How);

const FIXED: [ItemRow; 10] = [
    ("FEED_SPEED", "feed_mm_min", How::Number),
    ("FEED_OVERRIDE", "feed_override_pct", How::Number),
    ("SPDL_OVERRIDE", "spindle_override_pct", How::Number),
    ("PART_COUNT", "part_count", How::Number),
    ("CONTROLLER/PROGRAM", "program", How::Text(decode::parse_program_name)),
    ("CONTROLLER/LINE_NUMBER", "block", How::Text(format_line)),
    ("CONTROLLER/TOOL_NUMBER", "tool", How::Text(format_tool)),
    ("CONTROLLER/WARNING", "alarm", How::Text(format_alarm)),
    ("STATUS", "execution", How::Status),
    ("CONTROLLER/VARIABLE@REG_F", "mode", How::ChannelWord),
];

/// Below `AXIS@n`: item, where others put it, ending of the channel's name.
const LINEAR: [(&str, &str, &str); 3] = [
    ("SCREW/POSITION", "POSITION", "axis_position_mm"),
    ("SCREW/SPEED", "SPEED", "axis_velocity_mm_min"),
    ("MOTOR/CURRENT", "CURRENT", "axis_current_a"),
];

const SPINDLE: [(&str, &str, &str); 3] = [
    ("SERVO_DRIVER/SPEED", "PROGRAMMED_SPEED", "spindle_programmed_rpm"),
    ("MOTOR/SPEED", "SPEED", "spindle_speed_rpm"),
    ("MOTOR/CURRENT", "CURRENT", "spindle_current_a"),
];

fn format_line(value: &Value) -> Option<String> {
    parse_numbered(value, 'N').map(|line| format!("N{line}"))
}

fn format_tool(value: &Value) -> Option<String> {
    parse_numbered(value, 'T').map(|tool| format!("T{tool}"))
}

/// `7`, `"07"` or, as the program writes it, `"T07"`.
fn parse_numbered(value: &Value, letter: char) -> Option<i64> {
    let word = |text: &str| {
        let digits = text.trim().strip_prefix([letter, letter.to_ascii_lowercase()])?;
        digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok())?
    };
    parse_integer(value).or_else(|| value.as_str().and_then(word))
}

fn format_alarm(value: &Value) -> Option<String> {
    Some(decode::format_alarms(value))
}

/// Every channel that a device can feed, and the user's own; those that it has not are absent with a reason.
#[must_use]
pub(super) fn list_channels(own: &[Own<OwnPath>]) -> Vec<ChannelId> {
    let fixed = FIXED.iter().map(|(_, channel, _)| (*channel).to_owned());
    let axes =
        ["x", "y", "z"].into_iter().flat_map(|axis| LINEAR.iter().map(move |(.., name)| format!("{axis}_{name}")));
    let spindle = SPINDLE.iter().map(|(.., name)| (*name).to_owned());
    let names = fixed.chain(axes).chain(spindle).chain(["operation".to_owned()]);
    let mut channels: Vec<ChannelId> = names.filter_map(|name| ChannelId::from_name(&name)).collect();
    for own in own {
        if !channels.contains(&own.id) {
            channels.push(own.id);
        }
    }
    channels
}

/// One item that is asked for at every poll.
#[derive(Debug, Clone)]
struct PolledItem {
    channel: ChannelId,
    how: How,
    /// From the unit of the device to that of the channel.
    conversion: ItemConversion<'static>,
    /// The user's own channel, whose way of reading goes before `how`.
    own: Option<Own<OwnPath>>,
}

/// What is asked of this device, and what becomes of its answers.
#[derive(Debug, Clone, Default)]
pub(super) struct NcLinkPoll {
    requested_items: Vec<RequestedItem>,
    items: Vec<PolledItem>,
    operation: Option<ChannelId>,
    execution: Option<ChannelId>,
    /// Channels that this device does not have.
    absent: Vec<ChannelId>,
    /// Channels whose place the user has told.
    named: Vec<ChannelId>,
    /// What of the model cannot be used as it is.
    problems: Vec<SourceProblem>,
}

impl NcLinkPoll {
    /// The plan for a device; its items are named by path or by node number.
    pub(super) fn from_model(model: &Model, layout: NcLinkLayout, own: &[Own<OwnPath>], by_path: bool) -> Self {
        let named: Vec<ChannelId> = own.iter().map(|own| own.id).collect();
        let computed = |name| ChannelId::from_name(name).filter(|channel| !named.contains(channel));
        let mut plan =
            Self { operation: computed("operation"), execution: computed("execution"), named, ..Self::default() };
        for (path, channel, how) in FIXED {
            let indexes: &[u32] = if matches!(how, How::ChannelWord) { &[layout.f_channel] } else { &[] };
            plan.add(model, (path, channel, how), indexes, by_path);
        }
        plan.add(model, ("CONTROLLER/VARIABLE@CHAN_0", "operation", How::Tapping), &[RIGID_TAPPING], by_path);
        for (number, letter) in list_axes(model, layout) {
            let (rows, beginning): (&[(&str, &str, &str)], _) = match letter {
                Some(letter) => (&LINEAR, format!("{letter}_")),
                None => (&SPINDLE, String::new()),
            };
            for (item, other, channel) in rows {
                let path = [item, other].map(|item| format!("AXIS@{number}/{item}"));
                let path = path.iter().find(|path| model.find_item(path).is_some()).unwrap_or(&path[0]);
                plan.add(model, (path, &format!("{beginning}{channel}"), How::Number), &[], by_path);
            }
        }
        own.iter().for_each(|own| plan.add_own(model, own, by_path));
        let fed: Vec<ChannelId> = plan.items.iter().map(|entry| entry.channel).collect();
        plan.absent = list_channels(own).into_iter().filter(|channel| !fed.contains(channel)).collect();
        plan
    }

    fn add(&mut self, model: &Model, row: (&str, &str, How), indexes: &[u32], by_path: bool) {
        let (path, channel, how) = row;
        // Where the user has said what feeds a channel, that counts.
        let Some(channel) = ChannelId::from_name(channel).filter(|channel| !self.named.contains(channel)) else {
            return;
        };
        let Some(item) = model.find_item(path).or_else(|| self.find_elsewhere(model, path, channel)) else { return };
        let conversion = self.find_conversion(item, channel, matches!(how, How::Number));
        self.requested_items.push(RequestedItem::with_elements(name_item(item, by_path).as_str(), indexes));
        self.items.push(PolledItem { channel, how, conversion, own: None });
    }

    fn add_own(&mut self, model: &Model, own: &Own<OwnPath>, by_path: bool) {
        let Some(item) = model.find_item(&own.item.name) else {
            return self.problems.push(SourceProblem {
                what: format!("{} has no value: the device's model has no {}", own.id, own.item.name),
                next: "Write the path as doctor --all lists it".to_owned(),
            });
        };
        let conversion = self.find_conversion(item, own.id, !own.channel.new.unit.is_empty());
        let indexes: Vec<u32> = own.item.index.into_iter().collect();
        self.requested_items.push(RequestedItem::with_elements(name_item(item, by_path).as_str(), &indexes));
        self.items.push(PolledItem { channel: own.id, how: How::Number, conversion, own: Some(own.clone()) });
    }

    /// The only item that ends in the same word, wherever it stands; with several, nobody knows which is meant.
    fn find_elsewhere<'a>(&mut self, model: &'a Model, path: &'a str, channel: ChannelId) -> Option<&'a ModelItem> {
        if path.starts_with("AXIS@") || path.contains("VARIABLE@") {
            return None;
        }
        let found: Vec<&ModelItem> = model.list_items_elsewhere(path).collect();
        if let [only] = found.as_slice() {
            return Some(only);
        }
        if !found.is_empty() {
            let places: Vec<&str> = found.iter().map(|item| item.path.as_str()).collect();
            self.problems.push(SourceProblem {
                what: format!("{channel} has no value: the device has {path} in several places, {}", places.join(", ")),
                next: format!(
                    "Name one of them: [[source.channel]] with name = \"{channel}\" and read = \"{}\"",
                    places[0]
                ),
            });
        }
        None
    }

    /// From the unit that the model tells to that of the channel, where the item gives numbers.
    fn find_conversion(&mut self, item: &ModelItem, channel: ChannelId, of_numbers: bool) -> ItemConversion<'static> {
        let (unit, wanted) = (item.unit.as_deref().filter(|_| of_numbers), channel.channel().unit);
        let conversion = ItemConversion::new(unit, wanted);
        if let (Some(unit), Some(why)) = (unit, conversion.problem()) {
            self.problems.push(SourceProblem {
                what: format!(
                    "{channel} has no value: the device gives {} in {unit:?}, {why}; {wanted} is wanted",
                    item.path
                ),
                next: "Correct the unit in the device's model, or read it as a channel of your own with a scale"
                    .to_owned(),
            });
        }
        conversion
    }

    /// What of the model cannot be used as it is.
    pub(super) fn problems(&self) -> &[SourceProblem] {
        &self.problems
    }

    /// The channel that takes the item of this name and, of a list, any of its elements.
    pub(super) fn find_channel(&self, id: &str) -> Option<ChannelId> {
        let at = self.requested_items.iter().position(|ask| ask.id == id)?;
        self.items.get(at).map(|entry| entry.channel)
    }

    /// One request for everything.
    pub(super) fn requested_items(&self) -> &[RequestedItem] {
        &self.requested_items
    }

    /// The readings of one answer, with a reason for every channel that has none.
    pub(super) fn append_readings(&self, answers: &[Option<NcLinkAnswer>], stamp: Stamp, out: &mut Vec<Reading>) {
        let mut tapping = None;
        let mut word = None;
        for (entry, answer) in self.items.iter().zip(answers) {
            match entry.how {
                How::Tapping => tapping = entry.find_value(answer).ok().and_then(parse_integer),
                How::ChannelWord => word = entry.find_value(answer).ok().and_then(parse_integer).map(ChannelWord),
                _ => {}
            }
        }
        for (entry, answer) in self.items.iter().zip(answers) {
            let reading = match entry.how {
                How::Tapping => continue,
                How::ChannelWord => entry.build_text_reading(answer, stamp, |value| {
                    Some(ChannelWord(parse_integer(value)?).name_mode().to_owned())
                }),
                // The channel's word says it better, where there is one.
                How::Status if word.is_some() => continue,
                How::Status => {
                    entry.build_text_reading(answer, stamp, |value| decode::status_word(value).map(str::to_owned))
                }
                How::Number => entry.build_number_reading(answer, stamp),
                How::Text(text) => entry.build_text_reading(answer, stamp, text),
            };
            out.push(reading);
        }
        if let (Some(channel), Some(word)) = (self.execution, word) {
            out.push(Reading::from_text(channel, stamp, Arc::from(word.name_execution())));
        }
        self.append_operation(word, tapping, stamp, out);
        let none = |channel: &ChannelId| Reading::from_absence(*channel, stamp, Absence::NotSupported);
        out.extend(self.absent.iter().filter(|channel| self.operation != Some(**channel)).map(none));
    }

    /// The device does not name operations; it only tells when the feed follows the spindle.
    fn append_operation(&self, word: Option<ChannelWord>, tapping: Option<i64>, stamp: Stamp, out: &mut Vec<Reading>) {
        let Some(channel) = self.operation else { return };
        let threading = word.is_some_and(ChannelWord::is_threading);
        out.push(match decode::locked_operation(threading, tapping.is_some_and(|flag| flag != 0)) {
            Some(word) => Reading::from_text(channel, stamp, Arc::from(word)),
            None => Reading::from_absence(channel, stamp, Absence::NotSupported),
        });
    }
}

impl PolledItem {
    fn find_value<'a>(&self, answer: &'a Option<NcLinkAnswer>) -> Result<&'a Value, Absence> {
        match answer {
            Some(Ok(values)) => values.first().ok_or(Absence::NotYetRead),
            Some(Err(_)) => Err(Absence::Refused),
            None => Err(Absence::NotSupported),
        }
    }

    fn build_number_reading(&self, answer: &Option<NcLinkAnswer>, stamp: Stamp) -> Reading {
        if let Some(own) = &self.own {
            return own.to_reading(stamp, own.item.extract_value(&own.channel, answer.as_ref(), &self.conversion));
        }
        match self.find_value(answer).and_then(|value| self.conversion.convert_value(value)) {
            Ok(number) => Reading::from_number(self.channel, stamp, number),
            Err(reason) => Reading::from_absence(self.channel, stamp, reason),
        }
    }

    fn build_text_reading(
        &self,
        answer: &Option<NcLinkAnswer>,
        stamp: Stamp,
        text: impl Fn(&Value) -> Option<String>,
    ) -> Reading {
        // No value at all is the way in which some devices say that there is no alarm.
        let silent_alarm = matches!(answer, Some(Ok(values)) if values.is_empty()) && self.channel.name() == "alarm";
        let found = match silent_alarm {
            true => Ok(String::new()),
            false => self.find_value(answer).and_then(|value| text(value).ok_or(Absence::OutOfRange)),
        };
        match found {
            Ok(text) => Reading::from_text(self.channel, stamp, Arc::from(text)),
            Err(reason) => Reading::from_absence(self.channel, stamp, reason),
        }
    }
}

/// The name by which the device knows an item.
pub(super) fn name_item(item: &ModelItem, by_path: bool) -> String {
    if by_path { format!("/{}", item.path) } else { item.id.clone() }
}

/// The axes of the model that feed channels: X, Y and Z by their letters, the spindle without one.
fn list_axes(model: &Model, layout: NcLinkLayout) -> Vec<(u32, Option<char>)> {
    let number = |item: &ModelItem| item.path.strip_prefix("AXIS@")?.split('/').next()?.parse().ok();
    let mut numbers: Vec<u32> = model.items.iter().filter_map(number).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let spindle = layout.spindle_axis.or_else(|| numbers.iter().copied().find(|number| *number == 5));
    let spindle = spindle
        .or_else(|| numbers.iter().copied().find(|number| matches!(find_axis_letter(model, *number), Some('S' | 'C'))));
    let linear = numbers.into_iter().filter(|number| Some(*number) != spindle);
    let linear = linear.filter_map(|number| {
        let letter = find_axis_letter(model, number)?.to_ascii_lowercase();
        matches!(letter, 'x' | 'y' | 'z').then_some((number, Some(letter)))
    });
    linear.chain(spindle.map(|number| (number, None))).collect()
}

/// The first letter of the axis' name; without a name 0, 1, 2 are X, Y, Z.
fn find_axis_letter(model: &Model, number: u32) -> Option<char> {
    let named =
        model.find_item(&format!("AXIS@{number}/NAME")).and_then(|item| item.value.as_ref()?.as_str()?.chars().next());
    named
        .or_else(|| ['X', 'Y', 'Z'].get(usize::try_from(number).ok()?).copied())
        .map(|letter| letter.to_ascii_uppercase())
}

#[cfg(test)]
mod tests;
