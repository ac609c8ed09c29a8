//! The answer to a probe: a tree of devices, components and data items, flattened to paths.
//!
//! A path is the types of the components above an item, each with `@` and its number where it has one:
//! `AXIS@5/MOTOR/CURRENT`, `CONTROLLER/VARIABLE@REG_G`. The device itself is not part of it.

use super::lenient_json::{find_flag, find_list, find_text, parse_number};
use serde_json::Value;
use std::collections::HashMap;
use thiserror::Error;

/// At most so many data items are kept of a model; the rest is left out.
pub const ITEMS_MAX: usize = 20_000;
/// Components are followed so deep.
const DEPTH_MAX: usize = 16;

/// A data item or configuration item.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelItem {
    /// Node number by which the device knows it.
    pub id: String,
    /// See the [module](self); in capitals, without a leading `/`.
    pub path: String,
    /// May it be written?
    pub settable: bool,
    /// The value that the model itself tells, as the name of an axis.
    pub value: Option<Value>,
    /// The unit of its number, as the device writes it.
    pub unit: Option<String>,
}

/// A channel on which the device sends values by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleChannel {
    /// Its name, the last part of its topic.
    pub id: String,
    /// Between two values, ms.
    pub interval_ms: f64,
    /// Between two messages, ms.
    pub upload_ms: f64,
    /// The items, by node number or path as the device names them.
    pub items: Vec<String>,
}

/// What a device says it has.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Model {
    /// Name of the device.
    pub name: String,
    /// Everything that can be asked for.
    pub items: Vec<ModelItem>,
    /// What it sends by itself.
    pub samples: Vec<SampleChannel>,
    by_name: HashMap<String, usize>,
}

/// A model without a list of devices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the model has no \"devices\"")]
pub struct NoDevices;

impl Model {
    /// Reads the answer to a probe, or a model alone.
    ///
    /// # Errors
    /// The message holds no device.
    pub fn parse(message: &Value) -> Result<Self, NoDevices> {
        let root = message.get("probe").unwrap_or(message);
        // Some devices send the model as text within the text.
        let inner = root.as_str().and_then(|text| serde_json::from_str(text).ok());
        let root = inner.as_ref().unwrap_or(root);
        let devices = find_list(root, &["devices", "device"]);
        if devices.is_empty() {
            return Err(NoDevices);
        }
        let mut model = Self::default();
        for device in devices {
            if model.name.is_empty() {
                model.name = find_text(device, &["name", "description"]).unwrap_or_default();
            }
            model.add_component(device, "", 0);
            model.add_aliases(device);
        }
        Ok(model)
    }

    /// The item that a device means by this name: node number, or path with or without a leading `/` and its device.
    #[must_use]
    pub fn find_item(&self, name: &str) -> Option<&ModelItem> {
        let index = self.by_name.get(name).or_else(|| self.by_name.get(&normalize_name(name)))?;
        self.items.get(*index)
    }

    /// Items that end as `path` does and stand elsewhere, outside the axes: what another maker has put under another
    /// component.
    pub fn list_items_elsewhere<'a>(&'a self, path: &'a str) -> impl Iterator<Item = &'a ModelItem> {
        let end = path.rsplit('/').next().unwrap_or(path);
        let of_axis = |item: &&ModelItem| item.path.split('/').any(|part| part.starts_with("AXIS@"));
        self.items
            .iter()
            .filter(move |item| item.path.rsplit('/').next() == Some(end))
            .filter(move |item| !of_axis(item))
    }

    /// Does this device call its items by path? Seen in its sample channels.
    #[must_use]
    pub fn names_by_path(&self) -> bool {
        self.samples.iter().flat_map(|channel| &channel.items).any(|name| name.contains('/'))
    }

    fn add_component(&mut self, node: &Value, above: &str, depth: usize) {
        for item in find_list(node, &["dataItems", "dataitems"]) {
            self.add_item(item, above);
        }
        for config in find_list(node, &["configs", "config"]) {
            match find_text(config, &["type"]).as_deref() {
                Some("SAMPLE_CHANNEL") => self.samples.extend(sample_channel(config)),
                _ => self.add_item(config, above),
            }
        }
        if depth < DEPTH_MAX {
            for part in find_list(node, &["components", "component"]) {
                self.add_component(part, &join_path(above, part), depth + 1);
            }
        }
    }

    fn add_item(&mut self, item: &Value, above: &str) {
        let Some(id) = find_text(item, &["id"]) else { return };
        if self.items.len() >= ITEMS_MAX {
            return;
        }
        let path = normalize_name(&join_path(above, item));
        let settable = find_flag(item, &["setable", "settable"]);
        self.by_name.entry(id.clone()).or_insert(self.items.len());
        self.by_name.entry(path.clone()).or_insert(self.items.len());
        if let Some(source) = find_text(item, &["source"]) {
            self.by_name.entry(normalize_name(&format!("{source}/{path}"))).or_insert(self.items.len());
        }
        self.items.push(ModelItem {
            id,
            path,
            settable,
            unit: find_text(item, &["units", "unit", "Units"]).filter(|unit| !unit.trim().is_empty()),
            value: item.get("value").filter(|value| !value.is_null()).cloned(),
        });
    }

    /// `MACHINE/STATUS` is `STATUS` where the device is a `MACHINE`.
    fn add_aliases(&mut self, device: &Value) {
        let Some(kind) = find_text(device, &["type"]) else { return };
        for (index, item) in self.items.iter().enumerate() {
            self.by_name.entry(normalize_name(&format!("{kind}/{}", item.path))).or_insert(index);
        }
    }
}

fn join_path(above: &str, node: &Value) -> String {
    let kind = find_text(node, &["type"]).unwrap_or_default();
    let own = match find_text(node, &["number"]) {
        Some(number) => format!("{kind}@{number}"),
        None => kind,
    };
    if above.is_empty() { own } else { format!("{above}/{own}") }
}

/// In capitals, without a leading `/`, with one spelling of what is spelt in two ways.
fn normalize_name(name: &str) -> String {
    name.trim_start_matches('/').to_ascii_uppercase().replace("WARNNING", "WARNING")
}

fn sample_channel(config: &Value) -> Option<SampleChannel> {
    let positive = |names: &[&str]| {
        names.iter().find_map(|name| config.get(name)).and_then(parse_number).filter(|ms| *ms > 0.0 && *ms < 1e9)
    };
    let interval_ms = positive(&["sampleInterval", "sampleinterval", "interval"])?;
    let items = find_list(config, &["ids", "paths"]).iter();
    let named = |item: &Value| item.as_str().map(str::to_owned).or_else(|| find_text(item, &["id", "path"]));
    Some(SampleChannel {
        id: find_text(config, &["id"])?,
        interval_ms,
        upload_ms: positive(&["uploadInterval", "uploadinterval"]).unwrap_or(interval_ms),
        items: items.filter_map(named).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn machine() -> Value {
        json!({"@id": "m", "code": "OK", "probe": {"type": "NC_LINK_ROOT", "devices": [{
            "type": "MACHINE", "id": "0103", "name": "mill",
            "configs": [{"id": "sample_channel1", "type": "SAMPLE_CHANNEL", "sampleInterval": "1", "uploadInterval": 200,
                         "ids": [{"id": "0103532102"}, {"id": "010302"}]}],
            "dataItems": [{"id": "010302", "type": "STATUS"}],
            "components": [
                {"type": "AXIS", "number": "5", "id": "010353", "configs": [{"id": "x1", "type": "NAME", "value": "C"}],
                 "components": [{"type": "MOTOR", "dataItems": [{"id": "0103532102", "type": "SPEED"}]}]},
                {"type": "CONTROLLER", "dataItems": [
                    {"id": "01035412", "type": "WARNNING"},
                    {"id": "01035436", "type": "VARIABLE", "number": "REG_D", "datatype": "LIST", "setable": true}]}]}]}})
    }

    #[test]
    fn paths_numbers_and_sample_channels_are_read() {
        let model = Model::parse(&machine()).expect("a model");
        let paths: Vec<&str> = model.items.iter().map(|item| item.path.as_str()).collect();
        assert_eq!(
            paths,
            ["STATUS", "AXIS@5/NAME", "AXIS@5/MOTOR/SPEED", "CONTROLLER/WARNING", "CONTROLLER/VARIABLE@REG_D"]
        );
        assert_eq!(model.name, "mill");
        assert!(model.find_item("CONTROLLER/VARIABLE@REG_D").is_some_and(|item| item.settable));
        let channel = &model.samples[0];
        assert_eq!((channel.id.as_str(), channel.interval_ms, channel.upload_ms), ("sample_channel1", 1.0, 200.0));
        assert_eq!(channel.items, ["0103532102", "010302"]);
        assert!(!model.names_by_path());
    }

    #[test]
    fn an_item_is_found_by_number_and_by_every_form_of_its_path() {
        let model = Model::parse(&machine()).expect("a model");
        for name in ["010302", "STATUS", "/STATUS", "/MACHINE/STATUS", "status"] {
            assert_eq!(model.find_item(name).map(|item| item.id.as_str()), Some("010302"), "{name}");
        }
        assert!(model.find_item("CONTROLLER/WARNNING").is_some() && model.find_item("/AXIS@5/MOTOR/SPEED").is_some());
        assert!(model.find_item("NOTHING").is_none());
    }

    #[test]
    fn the_other_dialect_names_by_path_and_source() {
        let model = json!({"devices": [{"id": "02", "type": "PLC",
            "configs": [{"id": "s2", "type": "SAMPLE_CHANNEL", "sampleInterval": 1000,
                         "ids": [{"id": "/PLC/STATUS"}, {"id": "/CONTROLLER/WARNNING"}]}],
            "dataItems": [{"id": "030001", "type": "STATUS", "settable": false},
                          {"id": "030003", "type": "WARNNING", "source": "CONTROLLER"}]}]});
        let as_text = json!({"probe": model.to_string()});
        for message in [model, as_text] {
            let model = Model::parse(&message).expect("a model");
            assert!(model.names_by_path());
            assert_eq!(model.samples[0].upload_ms, 1000.0);
            for (name, id) in [("/PLC/STATUS", "030001"), ("/CONTROLLER/WARNNING", "030003")] {
                assert_eq!(model.find_item(name).map(|item| item.id.as_str()), Some(id));
            }
        }
    }

    #[test]
    fn a_message_without_devices_is_refused_and_depth_is_bounded() {
        assert!(Model::parse(&json!({"probe": {}})).is_err());
        let mut deep = json!({"type": "A", "dataItems": [{"id": "1", "type": "X"}]});
        for _ in 0..40 {
            deep = json!({"type": "A", "components": [deep]});
        }
        let model = Model::parse(&json!({"devices": [deep]})).expect("a model");
        assert!(model.items.is_empty(), "what lies deeper than {DEPTH_MAX} is left out");
    }
}
