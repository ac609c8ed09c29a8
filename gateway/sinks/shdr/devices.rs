//! `devices.xml`: what an MTConnect agent must know of the machine before it reads the lines.
//!
//! Source: MTConnect Standard 1.4, Part 2, and its schema `MTConnectDevices_1.4.xsd`.

use super::conditions::{self, AlarmKind};
use super::model::{AVAILABILITY, Category, Component, DataItem, ITEMS};
use gateway_base::machine_path::MachinePath;
use std::fmt::Write;

/// The machine in the file of an agent.
#[derive(Debug, Clone, Copy)]
pub struct Described<'a> {
    /// Its name, as people know it.
    pub machine: &'a str,
    /// The `uuid`, and the name under which the agent's `Adapters` refer to it: the path of the machine, or else the name of the box.
    pub device: &'a str,
    /// What every identifier begins with, so that several machines can stand in one agent.
    pub prefix: &'a str,
}

/// Why devices of other machines cannot stand in the document.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DevicesError {
    /// Another program wrote the file, or it is empty.
    #[error("{name} holds no device that `cnc-gateway devices` wrote")]
    NoDevice {
        /// Name of the file, for the message.
        name: String,
    },
    /// An agent cannot tell two machines apart.
    #[error("{name} has a machine with the identifiers of another one: give each its own --prefix")]
    SameIdentifiers {
        /// Name of the file, for the message.
        name: String,
    },
}

/// The document. `delivered` tells of a channel whether the machine has it; `others` are such documents of other machines, which stand in
/// the same agent.
///
/// # Errors
/// Which of the others is none, or has the identifiers of another machine.
pub fn devices_xml(
    described: Described<'_>,
    created_utc: &str,
    delivered: impl Fn(&str) -> bool,
    others: &[(String, String)],
) -> Result<String, DevicesError> {
    let mut devices = vec![write_device(described, delivered)];
    for (name, text) in others {
        let found = devices_of(text);
        if found.is_empty() {
            return Err(DevicesError::NoDevice { name: name.clone() });
        }
        for one in found {
            if devices.iter().any(|known| first_id(known) == first_id(one)) {
                return Err(DevicesError::SameIdentifiers { name: name.clone() });
            }
            devices.push(format!("{one}\n"));
        }
    }
    Ok(format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <MTConnectDevices xmlns:m=\"urn:mtconnect.org:MTConnectDevices:1.4\" \
         xmlns=\"urn:mtconnect.org:MTConnectDevices:1.4\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
         xsi:schemaLocation=\"urn:mtconnect.org:MTConnectDevices:1.4 \
         http://schemas.mtconnect.org/schemas/MTConnectDevices_1.4.xsd\">\n\
         \u{20} <Header creationTime=\"{created_utc}\" sender=\"cnc-gateway\" instanceId=\"1\" bufferSize=\"131072\" \
         assetBufferSize=\"1024\" assetCount=\"0\" version=\"1.4.0.0\"/>\n  <Devices>\n{}  </Devices>\n</MTConnectDevices>\n",
        devices.concat()
    ))
}

const BEGIN: &str = "    <Device ";
const END: &str = "</Device>";

/// The devices of a document that this wrote.
fn devices_of(text: &str) -> Vec<&str> {
    let begins = text.match_indices(BEGIN).map(|(at, _)| at);
    begins.filter_map(|begin| text[begin..].find(END).map(|end| &text[begin..begin + end + END.len()])).collect()
}

fn first_id(device: &str) -> &str {
    device.split('"').nth(1).unwrap_or_default()
}

/// Writes one component after the other.
struct Tree<'a> {
    out: String,
    prefix: &'a str,
    items: Vec<&'static DataItem>,
}

impl Tree<'_> {
    fn write_line(&mut self, indent: usize, line: &str) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.out, "{:indent$}{line}", "");
    }

    /// The data items and conditions of a component.
    fn data_items(&mut self, indent: usize, component: Component) {
        let prefix = self.prefix;
        let items: Vec<String> =
            self.items.iter().filter(|item| item.component == component).map(|item| data_item(prefix, item)).collect();
        let conditions = conditions::ALL.iter().filter(|condition| condition.component == component);
        let lines: Vec<String> =
            items.into_iter().chain(conditions.map(|condition| condition_item(prefix, condition))).collect();
        self.write_line(indent, "<DataItems>");
        lines.iter().for_each(|line| self.write_line(indent + 2, line));
        self.write_line(indent, "</DataItems>");
    }

    fn is_empty(&self, component: Component) -> bool {
        !self.items.iter().any(|item| item.component == component)
            && !conditions::ALL.iter().any(|condition| condition.component == component)
    }

    fn open_element(&mut self, indent: usize, tag: &str, id: &str, name: &str) {
        let prefix = self.prefix;
        self.write_line(indent, &format!("<{tag} id=\"{prefix}{id}\" name=\"{name}\">"));
    }

    fn write_leaf(&mut self, indent: usize, (component, tag, id, name): DevicePart) {
        if self.is_empty(component) {
            return;
        }
        self.open_element(indent, tag, id, name);
        self.data_items(indent + 2, component);
        self.write_line(indent, &format!("</{tag}>"));
    }

    /// A component that holds others, and what stands at itself.
    fn write_group(&mut self, (own, tag, id): (Option<Component>, &str, &str), parts: &[DevicePart]) {
        if own.is_none() && parts.iter().all(|(component, ..)| self.is_empty(*component)) {
            return;
        }
        self.open_element(8, tag, id, id);
        if let Some(own) = own {
            self.data_items(10, own);
        }
        if parts.iter().any(|(component, ..)| !self.is_empty(*component)) {
            self.write_line(10, "<Components>");
            parts.iter().for_each(|part| self.write_leaf(12, *part));
            self.write_line(10, "</Components>");
        }
        self.write_line(8, &format!("</{tag}>"));
    }
}

/// Component, its tag, identifier and name. A name is optional in the standard; some agents cannot do without.
type DevicePart = (Component, &'static str, &'static str, &'static str);

const AXES: [DevicePart; 4] = [
    (Component::Spindle, "Rotary", "spindle", "C"),
    (Component::X, "Linear", "x_axis", "X"),
    (Component::Y, "Linear", "y_axis", "Y"),
    (Component::Z, "Linear", "z_axis", "Z"),
];
const SYSTEMS: [DevicePart; 2] =
    [(Component::Electric, "Electric", "electric", "electric"), (Component::Coolant, "Coolant", "coolant", "coolant")];

fn write_device(described: Described<'_>, delivered: impl Fn(&str) -> bool) -> String {
    let Described { machine, device, prefix } = described;
    let items = ITEMS.iter().filter(|item| delivered(item.channel)).collect();
    let mut tree = Tree { out: String::new(), prefix, items };
    tree.write_line(4, &format!("<Device id=\"{prefix}machine\" name=\"{device}\" uuid=\"{device}\">"));
    tree.write_line(6, &format!("<Description>{}</Description>", escape_text(machine)));
    tree.write_line(6, "<DataItems>");
    let availability = format!("id=\"{prefix}{AVAILABILITY}\" name=\"{AVAILABILITY}\" category=\"EVENT\"");
    tree.write_line(8, &format!("<DataItem {availability} type=\"AVAILABILITY\"/>"));
    tree.write_line(6, "</DataItems>");
    tree.write_line(6, "<Components>");
    tree.write_group((Some(Component::Axes), "Axes", "axes"), &AXES);
    tree.write_group(
        (Some(Component::Controller), "Controller", "controller"),
        &[(Component::Path, "Path", "path", "path")],
    );
    tree.write_group((None, "Systems", "systems"), &SYSTEMS);
    // The standard has a component of its own for it from 1.6 on.
    tree.write_leaf(8, (Component::Environment, "Sensor", "environment", "environment"));
    tree.write_line(6, "</Components>");
    tree.write_line(4, END);
    tree.out
}

fn data_item(prefix: &str, item: &DataItem) -> String {
    let category = if item.category == Category::Sample { "SAMPLE" } else { "EVENT" };
    let (name, kind) = (item.channel, item.kind);
    let optional =
        |name: &str, value: Option<&str>| value.map_or(String::new(), |value| format!(" {name}=\"{value}\""));
    format!(
        "<DataItem id=\"{prefix}{name}\" name=\"{name}\" category=\"{category}\" type=\"{kind}\"{}{}{}/>",
        optional("subType", item.sub_type),
        optional("units", item.units),
        optional("nativeUnits", item.native_units)
    )
}

fn condition_item(prefix: &str, condition: &AlarmKind) -> String {
    let AlarmKind { name, kind, .. } = condition;
    format!("<DataItem id=\"{prefix}{name}\" name=\"{name}\" category=\"CONDITION\" type=\"{kind}\"/>")
}

/// What identifiers begin with where nobody says otherwise: the path of the machine, or else the digits of the box, behind a letter as XML
/// wants it.
#[must_use]
pub fn prefix_of(path: Option<&MachinePath>, box_id: &str) -> String {
    match path {
        Some(path) => format!("m_{}_", path.format_dotted()),
        None => format!("m{}_", box_id.rsplit('-').next().unwrap_or_default()),
    }
}

/// Can identifiers of XML begin with this?
#[must_use]
pub fn is_prefix(text: &str) -> bool {
    text.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
        && text.chars().all(|letter| letter.is_ascii_alphanumeric() || "-_.".contains(letter))
}

fn escape_text(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
