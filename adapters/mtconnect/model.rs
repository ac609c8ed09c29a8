//! What an agent's devices are made of: MTConnectDevices, the answer to `probe`.

use crate::xml::{XmlElement, XmlError, XmlEvent, XmlReader};
use std::collections::HashMap;
use thiserror::Error;

/// Most data items of all devices of an agent.
pub const ITEMS_MAX: usize = 20_000;
/// Deepest nesting of elements.
const DEPTH_MAX: usize = 64;

/// What a data item is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Category {
    /// A physical quantity, in a unit.
    Sample,
    /// A state, a name or a count.
    Event,
    /// Something that may be wrong with a component.
    Condition,
}

/// A part of a device, or the device itself.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Component {
    /// Its kind, as its element is called: `Rotary`.
    pub kind: String,
    /// Its identifier, which no other part of the agent has.
    pub id: String,
    /// Its name, where it has one.
    pub name: Option<String>,
    /// Its name at the control.
    pub native_name: Option<String>,
    /// What it is a part of, as a place among the components; `None` for the device itself.
    pub parent: Option<usize>,
    /// Is it, by its rotary mode, nothing but a spindle?
    pub is_spindle: bool,
}

/// Something that a device tells.
#[derive(Debug, Clone, PartialEq)]
pub struct DataItem {
    /// Its identifier, which no other part of the agent has.
    pub id: String,
    /// Its name, where it has one.
    pub name: Option<String>,
    /// What kind of observations it has.
    pub category: Category,
    /// Its type, in capitals: `PATH_FEEDRATE`.
    pub kind: String,
    /// `ACTUAL`, `PROGRAMMED` and so on.
    pub sub_type: Option<String>,
    /// Unit into which the agent converts.
    pub units: Option<String>,
    /// Unit in which the control counts.
    pub native_units: Option<String>,
    /// By which numbers of the control are divided.
    pub native_scale: Option<f64>,
    /// Is it a plain value, and no set, table or series?
    pub is_value: bool,
    /// Is it a mean or another figure over some time?
    pub has_statistic: bool,
    /// `MACHINE` or `WORK`, where it is a position.
    pub coordinate_system: Option<String>,
    /// Kind of the composition that it belongs to: `MOTOR`.
    pub composition: Option<String>,
    /// The component that it belongs to, as a place among the components.
    pub component: usize,
}

/// A device of an agent, with its parts and what it tells.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Device {
    /// Its name, by which the agent is asked for it.
    pub name: String,
    /// Its identifier, unique in the world.
    pub uuid: String,
    /// Who made it, and as what.
    pub description: String,
    /// Is it the agent itself?
    pub is_agent: bool,
    /// Its parts; the first one is the device itself.
    pub components: Vec<Component>,
    /// What it tells, in the order of the document.
    pub items: Vec<DataItem>,
}

impl Device {
    /// The data item with this identifier or name.
    #[must_use]
    pub fn find_item(&self, word: &str) -> Option<&DataItem> {
        self.items.iter().find(|item| item.id == word).or_else(|| {
            let mut named = self.items.iter().filter(|item| item.name.as_deref() == Some(word));
            // A name that two items have is none.
            named.next().filter(|_| named.next().is_none())
        })
    }

    /// The component that an item belongs to.
    #[must_use]
    pub fn component_of(&self, item: &DataItem) -> Option<&Component> {
        self.components.get(item.component)
    }

    /// Is this its name, uuid or identifier?
    #[must_use]
    pub fn has_name(&self, word: &str) -> bool {
        let id = self.components.first().map_or("", |device| device.id.as_str());
        !word.is_empty() && [self.name.as_str(), self.uuid.as_str(), id].contains(&word)
    }
}

/// Why a text is no list of devices.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ModelError {
    /// It is no XML, or broken.
    #[error(transparent)]
    Xml(#[from] XmlError),
    /// It is XML of another kind.
    #[error("it is {0} and not MTConnectDevices")]
    OtherDocument(String),
    /// It ends before its elements do.
    #[error("it ends in the middle")]
    Truncated,
    /// It has more data items than are read.
    #[error("it has more than {ITEMS_MAX} data items")]
    TooManyItems,
    /// It is nested deeper than any device.
    #[error("its elements are nested deeper than {DEPTH_MAX}")]
    TooDeep,
}

/// Every device of a document, also the agent itself.
///
/// # Errors
/// See [`ModelError`].
pub fn parse_devices(document: &[u8]) -> Result<Vec<Device>, ModelError> {
    let mut reader = XmlReader::new(document);
    let mut builder = ModelBuilder::default();
    loop {
        match reader.read_event()? {
            XmlEvent::Begin(element) => builder.begin_element(&element)?,
            XmlEvent::Text(text) => builder.record_text(&text),
            XmlEvent::End => builder.end_element(),
            XmlEvent::Eof => break,
        }
    }
    match builder.root {
        Some(root) if builder.stack.is_empty() && root == "MTConnectDevices" => Ok(builder.devices),
        Some(root) if builder.stack.is_empty() => Err(ModelError::OtherDocument(root)),
        _ => Err(ModelError::Truncated),
    }
}

#[derive(Default)]
struct ModelBuilder {
    root: Option<String>,
    devices: Vec<Device>,
    /// Names of the elements that have begun.
    stack: Vec<String>,
    /// Places of the components that have begun, with their depth.
    parts: Vec<(usize, usize)>,
    /// Kinds of compositions and coordinate systems of the device, by their identifiers.
    kinds: HashMap<String, String>,
    items: usize,
    /// Values that the rotary mode is constrained to.
    rotary_modes: Vec<String>,
    is_rotary_mode: bool,
}

impl ModelBuilder {
    fn begin_element(&mut self, element: &XmlElement) -> Result<(), ModelError> {
        let parent = self.stack.last().map_or("", String::as_str);
        match (parent, element.name.as_str()) {
            ("", name) => self.root = Some(name.to_owned()),
            ("Devices", name) => self.begin_device(name, element),
            ("Components", name) => self.begin_component(name, element),
            ("Compositions", _) | ("CoordinateSystems", _) => {
                if let (Some(id), Some(kind)) = (element.copy_attribute("id"), element.copy_attribute("type")) {
                    self.kinds.insert(id, kind);
                }
            }
            ("DataItems", "DataItem") => self.add_item(element)?,
            (_, "Description") if self.parts.len() == 1 => {
                let words = ["manufacturer", "model", "serialNumber"].map(|word| element.find_attribute(word));
                let words: Vec<&str> = words.into_iter().flatten().filter(|word| !word.is_empty()).collect();
                if let Some(device) = self.devices.last_mut() {
                    device.description = words.join(" ");
                }
            }
            _ => {}
        }
        self.stack.push(element.name.clone());
        if self.stack.len() > DEPTH_MAX { Err(ModelError::TooDeep) } else { Ok(()) }
    }

    fn begin_device(&mut self, name: &str, element: &XmlElement) {
        self.kinds.clear();
        let text = |attribute| element.copy_attribute(attribute).unwrap_or_default();
        self.devices.push(Device {
            name: text("name"),
            uuid: text("uuid"),
            is_agent: name == "Agent",
            ..Device::default()
        });
        self.begin_component(name, element);
    }

    fn begin_component(&mut self, kind: &str, element: &XmlElement) {
        let parent = self.parts.last().map(|(_, place)| *place);
        let Some(device) = self.devices.last_mut() else { return };
        let place = device.components.len();
        device.components.push(Component {
            kind: kind.to_owned(),
            id: element.copy_attribute("id").unwrap_or_default(),
            name: element.copy_attribute("name"),
            native_name: element.copy_attribute("nativeName"),
            parent,
            is_spindle: kind == "Spindle",
        });
        self.parts.push((self.stack.len(), place));
    }

    fn add_item(&mut self, element: &XmlElement) -> Result<(), ModelError> {
        let (Some(id), Some(kind)) = (element.copy_attribute("id"), element.copy_attribute("type")) else {
            return Ok(());
        };
        let category = match element.find_attribute("category") {
            Some("SAMPLE") => Category::Sample,
            Some("CONDITION") => Category::Condition,
            _ => Category::Event,
        };
        self.items += 1;
        if self.items > ITEMS_MAX {
            return Err(ModelError::TooManyItems);
        }
        (self.is_rotary_mode, self.rotary_modes) = (kind == "ROTARY_MODE", Vec::new());
        let kind_of = |attribute| self.kinds.get(element.find_attribute(attribute)?).cloned();
        let coordinate_system = element.copy_attribute("coordinateSystem").or_else(|| kind_of("coordinateSystemIdRef"));
        let composition = kind_of("compositionId");
        let (Some(device), Some((_, component))) = (self.devices.last_mut(), self.parts.last()) else { return Ok(()) };
        device.items.push(DataItem {
            id,
            name: element.copy_attribute("name"),
            category,
            kind,
            sub_type: element.copy_attribute("subType"),
            units: element.copy_attribute("units"),
            native_units: element.copy_attribute("nativeUnits"),
            native_scale: element
                .parse_attribute("nativeScale")
                .filter(|scale: &f64| scale.is_finite() && *scale != 0.0),
            is_value: element.find_attribute("representation").is_none_or(|form| form == "VALUE" || form == "DISCRETE"),
            has_statistic: element.find_attribute("statistic").is_some(),
            coordinate_system,
            composition,
            component: *component,
        });
        Ok(())
    }

    fn record_text(&mut self, text: &str) {
        if self.is_rotary_mode && self.stack.last().is_some_and(|name| name == "Value") {
            self.rotary_modes.push(text.trim().to_owned());
        }
    }

    fn end_element(&mut self) {
        let ended = self.stack.pop();
        if ended.as_deref() == Some("DataItem") && self.is_rotary_mode {
            let only_spindle = !self.rotary_modes.is_empty() && self.rotary_modes.iter().all(|mode| mode == "SPINDLE");
            self.is_rotary_mode = false;
            if let (Some(device), Some((_, place))) = (self.devices.last_mut(), self.parts.last()) {
                device.components[*place].is_spindle |= only_spindle;
            }
        }
        if self.parts.last().is_some_and(|(depth, _)| *depth == self.stack.len()) {
            self.parts.pop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEVICES: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<MTConnectDevices xmlns="urn:mtconnect.org:MTConnectDevices:1.7"><Header instanceId="1" bufferSize="1024"/><Devices>
<Agent id="agent" name="Agent" uuid="a-1"><DataItems><DataItem category="EVENT" id="a1" type="AVAILABILITY"/></DataItems></Agent>
<Device id="d1" name="M1" uuid="u-1"><Description manufacturer="Maker" model="V 5">text</Description>
 <Configuration><CoordinateSystems><CoordinateSystem id="mc" type="MACHINE"/></CoordinateSystems></Configuration>
 <DataItems><DataItem category="EVENT" id="av" name="avail" type="AVAILABILITY"/></DataItems>
 <Components><Axes id="ax"><Components>
  <Linear id="x" name="X"><DataItems><DataItem category="SAMPLE" id="xp" type="POSITION" subType="ACTUAL" units="MILLIMETER" coordinateSystemIdRef="mc"/></DataItems></Linear>
  <Rotary id="c" name="C" nativeName="S"><Compositions><Composition id="m" type="MOTOR"/></Compositions><DataItems>
   <DataItem category="EVENT" id="cm" type="ROTARY_MODE"><Constraints><Value>SPINDLE</Value></Constraints></DataItem>
   <DataItem category="SAMPLE" id="ct" type="TEMPERATURE" units="CELSIUS" compositionId="m" nativeUnits="FAHRENHEIT" nativeScale="10"/></DataItems></Rotary>
  <Rotary id="b" name="B"><DataItems><DataItem category="EVENT" id="bm" type="ROTARY_MODE"><Constraints><Value>INDEX</Value><Value>SPINDLE</Value></Constraints></DataItem></DataItems></Rotary>
 </Components></Axes></Components></Device></Devices></MTConnectDevices>"#;

    #[test]
    fn components_items_and_constraints_are_read() {
        let devices = parse_devices(DEVICES.as_bytes()).expect("devices");
        assert!(devices[0].is_agent && !devices[1].is_agent);
        let device = &devices[1];
        assert!(device.has_name("M1") && device.has_name("u-1") && device.has_name("d1") && !device.has_name(""));
        assert_eq!(device.description, "Maker V 5");
        let position = device.find_item("xp").expect("there");
        assert_eq!(
            (position.coordinate_system.as_deref(), device.component_of(position).expect("there").kind.as_str()),
            (Some("MACHINE"), "Linear")
        );
        let temperature = device.find_item("ct").expect("there");
        assert_eq!((temperature.composition.as_deref(), temperature.native_scale), (Some("MOTOR"), Some(10.0)));
        let spindles: Vec<&str> =
            device.components.iter().filter(|part| part.is_spindle).map(|part| part.id.as_str()).collect();
        assert_eq!(spindles, ["c"]);
        assert_eq!(device.find_item("avail").map(|item| item.id.as_str()), Some("av"));
    }

    #[test]
    fn what_is_no_list_of_devices_is_refused_with_the_reason() {
        let refused = |text: &str| parse_devices(text.as_bytes()).expect_err("refused");
        assert_eq!(refused("<html></html>"), ModelError::OtherDocument("html".to_owned()));
        assert_eq!(refused("<MTConnectDevices><Devices>"), ModelError::Truncated);
        assert_eq!(refused(""), ModelError::Truncated);
        assert!(matches!(refused("<a></b>"), ModelError::Xml(_)));
        let deep = format!("<MTConnectDevices>{}", "<Components>".repeat(100));
        assert_eq!(refused(&deep), ModelError::TooDeep);
        let item = "<DataItem id=\"a\" type=\"LOAD\" category=\"SAMPLE\"/>";
        let many = format!("<MTConnectDevices><Devices><Device><DataItems>{}", item.repeat(ITEMS_MAX + 1));
        assert_eq!(refused(&many), ModelError::TooManyItems);
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "(<(/?)(MTConnectDevices|Devices|Device|Components|Rotary|DataItems|DataItem|Value)( id=\"x\"| type=\"ROTARY_MODE\"| category=\"SAMPLE\")*(/?)>|SPINDLE){0,30}") {
            let _ = parse_devices(text.as_bytes());
        }
    }
}
