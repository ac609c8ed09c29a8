//! `devices.xml`: what an MTConnect agent must know of the machine before it reads the lines.
//!
//! Source: MTConnect Standard 1.6, Part 2, and its schema `MTConnectDevices_1.6.xsd`.

use super::model::{ALARMS, AVAILABILITY, Category, Component, DataItem, ITEMS};
use std::fmt::Write;

/// The document for a machine of this name. `delivered` tells of a channel whether the machine has it.
#[must_use]
pub fn devices_xml(machine: &str, created_utc: &str, delivered: impl Fn(&str) -> bool) -> String {
    let items: Vec<&DataItem> = ITEMS.iter().filter(|item| delivered(item.channel)).collect();
    let (name, uuid) = (xml_name(machine), uuid(machine));
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <MTConnectDevices xmlns:m=\"urn:mtconnect.org:MTConnectDevices:1.6\" \
         xmlns=\"urn:mtconnect.org:MTConnectDevices:1.6\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
         xsi:schemaLocation=\"urn:mtconnect.org:MTConnectDevices:1.6 \
         http://schemas.mtconnect.org/schemas/MTConnectDevices_1.6.xsd\">\n\
         \u{20} <Header creationTime=\"{created_utc}\" sender=\"cnc-gateway\" instanceId=\"1\" bufferSize=\"131072\" \
         assetBufferSize=\"1024\" assetCount=\"0\" version=\"1.6.0.0\"/>\n  <Devices>\n    \
         <Device id=\"machine\" name=\"{name}\" uuid=\"{uuid}\">\n"
    );
    let mut put = |indent: usize, line: &str| {
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{:indent$}{line}", "");
    };
    put(6, &format!("<Description>{}</Description>", escaped(machine)));
    put(6, "<DataItems>");
    put(
        8,
        &format!("<DataItem id=\"{AVAILABILITY}\" name=\"{AVAILABILITY}\" category=\"EVENT\" type=\"AVAILABILITY\"/>"),
    );
    put(6, "</DataItems>");
    put(6, "<Components>");
    let of = |component| items.iter().copied().filter(|item| item.component == component).collect::<Vec<_>>();
    axes(&of, &mut put);
    controller(&of, &mut put);
    systems(&of, &mut put);
    put(6, "</Components>");
    out + "    </Device>\n  </Devices>\n</MTConnectDevices>\n"
}

/// Identifies the machine over all agents of a plant.
#[must_use]
pub(super) fn uuid(machine: &str) -> String {
    format!("cnc-gateway-{}", xml_name(machine))
}

type Of<'a> = dyn Fn(Component) -> Vec<&'a DataItem> + 'a;
type WriteLine<'a> = dyn FnMut(usize, &str) + 'a;

fn axes(of: &Of<'_>, put: &mut WriteLine<'_>) {
    let parts = [
        (Component::Spindle, "Rotary", "spindle", "C"),
        (Component::X, "Linear", "x_axis", "X"),
        (Component::Y, "Linear", "y_axis", "Y"),
        (Component::Z, "Linear", "z_axis", "Z"),
    ];
    group(put, "Axes", "axes", &parts.map(|(part, tag, id, name)| (tag, id, Some(name), of(part))));
}

fn controller(of: &Of<'_>, put: &mut WriteLine<'_>) {
    put(8, "<Controller id=\"controller\" name=\"controller\">");
    put(10, "<DataItems>");
    of(Component::Controller).iter().for_each(|item| put(12, &data_item(item)));
    put(12, &format!("<DataItem id=\"{ALARMS}\" name=\"{ALARMS}\" category=\"CONDITION\" type=\"SYSTEM\"/>"));
    put(10, "</DataItems>");
    let path = of(Component::Path);
    if !path.is_empty() {
        put(10, "<Components>");
        component(put, 12, "Path", "path", Some("path"), &path);
        put(10, "</Components>");
    }
    put(8, "</Controller>");
}

fn systems(of: &Of<'_>, put: &mut WriteLine<'_>) {
    let systems = [(Component::Electric, "Electric", "electric"), (Component::Coolant, "Coolant", "coolant")];
    group(put, "Systems", "systems", &systems.map(|(part, tag, id)| (tag, id, None, of(part))));
    let around = [("Environmental", "environment", None, of(Component::Environment))];
    group(put, "Auxiliaries", "auxiliaries", &around);
}

/// A component that only holds others; left out where they are all empty.
fn group(put: &mut WriteLine<'_>, tag: &str, id: &str, parts: &[(&str, &str, Option<&str>, Vec<&DataItem>)]) {
    if parts.iter().all(|(.., items)| items.is_empty()) {
        return;
    }
    put(8, &format!("<{tag} id=\"{id}\">"));
    put(10, "<Components>");
    for (tag, id, name, items) in parts.iter().filter(|(.., items)| !items.is_empty()) {
        component(put, 12, tag, id, *name, items);
    }
    put(10, "</Components>");
    put(8, &format!("</{tag}>"));
}

fn component(put: &mut WriteLine<'_>, indent: usize, tag: &str, id: &str, name: Option<&str>, items: &[&DataItem]) {
    // A name is optional in the standard; some agents cannot do without.
    put(indent, &format!("<{tag} id=\"{id}\" name=\"{}\">", name.unwrap_or(id)));
    put(indent + 2, "<DataItems>");
    items.iter().for_each(|item| put(indent + 4, &data_item(item)));
    put(indent + 2, "</DataItems>");
    put(indent, &format!("</{tag}>"));
}

fn data_item(item: &DataItem) -> String {
    let category = if item.category == Category::Sample { "SAMPLE" } else { "EVENT" };
    let (id, kind) = (item.channel, item.kind);
    let optional =
        |name: &str, value: Option<&str>| value.map_or(String::new(), |value| format!(" {name}=\"{value}\""));
    format!(
        "<DataItem id=\"{id}\" name=\"{id}\" category=\"{category}\" type=\"{kind}\"{}{}{}/>",
        optional("subType", item.sub_type),
        optional("units", item.units),
        optional("nativeUnits", item.native_units)
    )
}

/// A name as XML allows it: begins with a letter, no blanks.
fn xml_name(text: &str) -> String {
    let plain = |letter: char| if letter.is_ascii_alphanumeric() || letter == '-' { letter } else { '_' };
    let name: String = text.chars().map(plain).collect();
    if name.starts_with(|first: char| first.is_ascii_alphabetic()) { name } else { format!("machine_{name}") }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
