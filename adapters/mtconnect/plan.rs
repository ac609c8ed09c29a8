//! Which data item of a device feeds which channel.

use crate::address::MtConnectTarget;
use crate::model::{Category, DataItem, Device};
use crate::own_data_item::OwnDataItem;
use crate::place::{ComponentPlace, find_path, find_places, name_component};
use crate::rows::{ChannelRow, LETTERS, ROWS, RowPlace, TEMPERATURE, TEMPERATURES};
use crate::standard::find_unit;
use crate::streams::ConditionLevel;
use crate::words::ObservationForm;
use adapter_core::channel::{ChannelId, find_nearest_name, on_path};
use adapter_core::conversion::{Conversion, find_conversion, is_known};
use adapter_core::driver::SourceProblem;
use adapter_core::own::Own;
use std::collections::{BTreeMap, HashMap};

/// A channel that an item feeds.
#[derive(Debug, Clone)]
pub(crate) struct FedChannel {
    pub(crate) channel: ChannelId,
    pub(crate) form: ObservationForm,
    /// `None` where the unit of the item does not fit.
    pub(crate) conversion: Option<Conversion>,
    /// The user's own channel.
    pub(crate) own: Option<Own<OwnDataItem>>,
}

/// A channel that tells what stands of some conditions.
#[derive(Debug, Clone)]
pub(crate) struct ConditionChannel {
    pub(crate) channel: ChannelId,
    pub(crate) level: ConditionLevel,
    pub(crate) items: Vec<String>,
}

/// What becomes of the observations of a device.
#[derive(Debug, Clone, Default)]
pub(crate) struct ChannelPlan {
    pub(crate) channels_by_item: HashMap<String, Vec<FedChannel>>,
    pub(crate) conditions: Vec<ConditionChannel>,
    /// The item that tells whether the adapter reaches the control.
    pub(crate) availability: Option<String>,
    /// Channels that this device does not have.
    pub(crate) absent: Vec<ChannelId>,
    pub(crate) problems: Vec<SourceProblem>,
}

/// How well an item fits: row, place, subtype and likeness, each the less the better.
type Fit = [usize; 4];

struct Candidates {
    fit: Fit,
    form: ObservationForm,
    /// Places of the items in the device that fit as well as each other.
    items: Vec<usize>,
}

/// Every channel that a device can feed, and the user's own; those that it does not have are absent with a reason.
#[must_use]
pub fn list_channels(target: &MtConnectTarget) -> Vec<ChannelId> {
    let mut names: Vec<String> = Vec::new();
    for row in ROWS {
        match row.place {
            RowPlace::Axis => names.extend(LETTERS.map(|letter| name_axis_channel(letter, row.channel))),
            RowPlace::Control => {
                names.extend((0..target.paths.len()).map(|at| name_path_channel(&target.paths, at, row.channel)))
            }
            _ => names.push(row.channel.to_owned()),
        }
    }
    names.extend((0..target.paths.len()).map(|at| name_path_channel(&target.paths, at, "alarm")));
    names.push("control_warning".to_owned());
    names.extend((1..=TEMPERATURES).map(name_temperature));
    let mut channels: Vec<ChannelId> = Vec::new();
    let own = target.own.iter().map(|own| own.id);
    for channel in names.iter().filter_map(|name| ChannelId::from_name(name)).chain(own) {
        if !channels.contains(&channel) {
            channels.push(channel);
        }
    }
    channels
}

fn name_temperature(number: usize) -> String {
    format!("temperature_{number}_c")
}

fn name_axis_channel(letter: char, channel: &str) -> String {
    format!("{}_{channel}", letter.to_ascii_lowercase())
}

/// The first of the paths that are read has the plain names.
fn name_path_channel(paths: &[u8], at: usize, channel: &str) -> String {
    if at == 0 { channel.to_owned() } else { on_path(channel, paths[at]) }
}

impl ChannelPlan {
    pub(crate) fn from_device(device: &Device, target: &MtConnectTarget) -> Self {
        let (places, problems) = find_places(device, target.spindle.as_deref());
        let mut plan = Self { problems, ..Self::default() };
        let availability = device.items.iter().find(|item| item.component == 0 && item.kind == "AVAILABILITY");
        plan.availability = availability.map(|item| item.id.clone());
        for (channel, candidates) in find_candidates(device, target, &places) {
            // Where the user has said what feeds a channel, that counts.
            if !target.own.iter().any(|own| own.id == channel) {
                plan.choose_item(device, channel, &candidates);
            }
        }
        target.own.iter().for_each(|own| plan.add_own(device, own));
        plan.add_temperatures(device);
        plan.add_conditions(device, target, &places);
        let fed = plan.channels_by_item.values().flatten().map(|fed| fed.channel);
        let fed: Vec<ChannelId> = fed.chain(plan.conditions.iter().map(|condition| condition.channel)).collect();
        plan.absent = list_channels(target).into_iter().filter(|channel| !fed.contains(channel)).collect();
        plan
    }

    /// Takes the only item that fits best; with several, nobody knows which is meant.
    fn choose_item(&mut self, device: &Device, channel: ChannelId, candidates: &Candidates) {
        match candidates.items.as_slice() {
            [only] => self.add_item(&device.items[*only], channel, candidates.form, None),
            several => {
                let words: Vec<String> =
                    several.iter().map(|item| describe_item(device, &device.items[*item])).collect();
                self.problems.push(SourceProblem {
                    what: format!(
                        "{channel} has no value: the device tells it in several places, {}",
                        words.join(", ")
                    ),
                    next: format!(
                        "Name one of them: [[source.channel]] with name = \"{channel}\" and read = \"{}\"",
                        device.items[several[0]].id
                    ),
                });
            }
        }
    }

    fn add_item(&mut self, item: &DataItem, channel: ChannelId, form: ObservationForm, own: Option<Own<OwnDataItem>>) {
        let conversion = if form.is_number() { self.find_conversion(item, channel) } else { None };
        self.channels_by_item.entry(item.id.clone()).or_default().push(FedChannel { channel, form, conversion, own });
    }

    fn add_own(&mut self, device: &Device, own: &Own<OwnDataItem>) {
        let word = &own.item.word;
        let form = if own.channel.new.unit.is_empty() { ObservationForm::Text } else { ObservationForm::Number };
        match device.find_item(word) {
            Some(item) if item.category != Category::Condition && item.is_value => {
                self.add_item(item, own.id, form, Some(own.clone()));
            }
            Some(_) => self.problems.push(SourceProblem {
                what: format!("{} has no value: {word} is a condition or holds several values", own.id),
                next:
                    "Conditions are told in the channels alarm and control_warning; name a data item that is one value"
                        .to_owned(),
            }),
            None => {
                let words =
                    device.items.iter().flat_map(|item| [Some(item.id.as_str()), item.name.as_deref()]).flatten();
                let next = match find_nearest_name(word, words) {
                    Some(near) => format!("Did you mean {near}?"),
                    None => "Write the identifier as doctor --all lists it".to_owned(),
                };
                self.problems.push(SourceProblem {
                    what: format!("{} has no value: the device has no data item {word}", own.id),
                    next,
                });
            }
        }
    }

    /// Temperatures that feed no other channel, in the order of the device.
    fn add_temperatures(&mut self, device: &Device) {
        let is_free = |item: &&DataItem| {
            item.kind == TEMPERATURE
                && item.category == Category::Sample
                && item.is_value
                && !self.channels_by_item.contains_key(&item.id)
        };
        let free: Vec<&DataItem> = device.items.iter().filter(is_free).take(TEMPERATURES).collect();
        for (item, number) in free.into_iter().zip(1..) {
            let taken =
                |channel: &ChannelId| !self.channels_by_item.values().flatten().any(|fed| fed.channel == *channel);
            if let Some(channel) = ChannelId::from_name(&name_temperature(number)).filter(taken) {
                self.add_item(item, channel, ObservationForm::Number, None);
            }
        }
    }

    fn add_conditions(&mut self, device: &Device, target: &MtConnectTarget, places: &[ComponentPlace]) {
        let conditions: Vec<&DataItem> =
            device.items.iter().filter(|item| item.category == Category::Condition).collect();
        let further = |item: &DataItem| {
            let path = find_path(device, places, item.component)?;
            target.paths.iter().position(|known| *known == path).filter(|at| *at > 0)
        };
        for at in 0..target.paths.len() {
            let of_path = conditions.iter().filter(|item| further(item).unwrap_or(0) == at).map(|item| item.id.clone());
            let items: Vec<String> = of_path.collect();
            let names = [("alarm", ConditionLevel::Fault), ("control_warning", ConditionLevel::Warning)];
            for (name, level) in names {
                let channel = ChannelId::from_name(&name_path_channel(&target.paths, at, name));
                let channel =
                    channel.filter(|channel| !items.is_empty() && !target.own.iter().any(|own| own.id == *channel));
                if let Some(channel) = channel {
                    self.conditions.push(ConditionChannel { channel, level, items: items.clone() });
                }
            }
        }
    }

    /// From the unit of the agent's numbers to that of the channel.
    fn find_conversion(&mut self, item: &DataItem, channel: ChannelId) -> Option<Conversion> {
        let wanted = channel.channel().unit;
        let (unit, scale) = match (&item.units, &item.native_units) {
            (Some(units), _) => (plain_unit(units), 1.0),
            // Without a unit to convert into the agent passes the numbers of the control on.
            (None, Some(native)) => (plain_unit(native), item.native_scale.unwrap_or(1.0)),
            (None, None) => (find_unit(&item.kind).unwrap_or(wanted), 1.0),
        };
        let found = find_conversion(unit, wanted);
        if found.is_none() {
            let why = if is_known(unit) { "which measures something else" } else { "which is no unit that is known" };
            self.problems.push(SourceProblem {
                what: format!(
                    "{channel} has no value: the agent gives {} in {unit:?}, {why}; {wanted} is wanted",
                    item.id
                ),
                next: "Correct the unit in the agent's devices file, or read another item as a channel of your own"
                    .to_owned(),
            });
        }
        found.map(|conversion| Conversion { scale: conversion.scale / scale, ..conversion })
    }
}

/// `MILLIMETER_3D` are three numbers in `MILLIMETER`.
fn plain_unit(unit: &str) -> &str {
    unit.strip_suffix("_3D").unwrap_or(unit)
}

fn describe_item(device: &Device, item: &DataItem) -> String {
    let place = device.component_of(item).map_or("", name_component);
    format!("{} ({place})", item.id)
}

/// Of every channel the items that fit best.
fn find_candidates(
    device: &Device,
    target: &MtConnectTarget,
    places: &[ComponentPlace],
) -> BTreeMap<ChannelId, Candidates> {
    let mut found: BTreeMap<ChannelId, Candidates> = BTreeMap::new();
    for (index, item) in device.items.iter().enumerate() {
        if !item.is_value || item.category == Category::Condition {
            continue;
        }
        for (row_index, row) in ROWS.iter().enumerate().filter(|(_, row)| row.kind == item.kind) {
            let Some((place_rank, sub_rank)) = rank_item(row, item, places) else { continue };
            let Some(channel) = find_row_channel(row, device, target, places, item.component) else { continue };
            let fit = [row_index, place_rank, sub_rank, rank_likeness(item)];
            let entry = found.entry(channel).or_insert(Candidates { fit, form: row.form, items: Vec::new() });
            if fit < entry.fit {
                *entry = Candidates { fit, form: row.form, items: Vec::new() };
            }
            if fit == entry.fit {
                entry.items.push(index);
            }
        }
    }
    found
}

fn rank_item(row: &ChannelRow, item: &DataItem, places: &[ComponentPlace]) -> Option<(usize, usize)> {
    let place_rank = row.place.rank_place(*places.get(item.component)?)?;
    let sub_type = item.sub_type.as_deref().unwrap_or("");
    let sub_rank = row.sub_types.iter().position(|known| *known == sub_type)?;
    match row.form {
        ObservationForm::OfComposition(kind) if item.composition.as_deref() != Some(kind) => None,
        _ => Some((place_rank, sub_rank)),
    }
}

/// Positions of the machine count before those of the work piece, as with other controls; a value before its mean; the whole component
/// before a part of it.
fn rank_likeness(item: &DataItem) -> usize {
    let coordinates = match item.coordinate_system.as_deref() {
        Some("MACHINE") => 0,
        None => 1,
        Some(_) => 2,
    };
    coordinates + if item.has_statistic { 3 } else { 0 } + if item.composition.is_some() { 6 } else { 0 }
}

fn find_row_channel(
    row: &ChannelRow,
    device: &Device,
    target: &MtConnectTarget,
    places: &[ComponentPlace],
    component: usize,
) -> Option<ChannelId> {
    let name = match (row.place, places.get(component)?) {
        (RowPlace::Axis, ComponentPlace::Linear(letter)) => name_axis_channel(*letter, row.channel),
        (RowPlace::Control, _) => {
            let path = find_path(device, places, component);
            let at = path.map_or(Some(0), |path| target.paths.iter().position(|known| *known == path))?;
            name_path_channel(&target.paths, at, row.channel)
        }
        _ => row.channel.to_owned(),
    };
    ChannelId::from_name(&name)
}

#[cfg(test)]
#[path = "plan_tests.rs"]
pub(crate) mod tests;
