//! The nodes of a machine, and the values in them.

use super::layout::{self, Form};
use super::{PRODUCT, units};
use crate::history::{Cell, Reading, SeriesInfo, SeriesKind};
use adapters::clock::TimeNs;
use opcua::nodes::{
    DataTypeBuilder, NodeSetImport, NodeSetNamespaceMapper, ObjectBuilder, ObjectTypeBuilder, VariableBuilder,
};
use opcua::server::address_space::AddressSpace;
use opcua::types::{
    DataTypeId, DataValue, DateTime, ExtensionObject, LocalizedText, NodeId, ObjectId, ObjectTypeId, QualifiedName,
    Range, StatusCode, VariableTypeId, Variant,
};
use std::collections::HashMap;
use std::sync::Arc;

/// Hundred nanoseconds between 1601, where times of OPC UA begin, and 1970.
const EPOCH_TICKS: i64 = 116_444_736_000_000_000;

/// Makes the namespaces known to the server; the nodes come later, when their numbers are known.
pub(super) struct Namespaces;

impl NodeSetImport for Namespaces {
    fn register_namespaces(&self, namespaces: &mut NodeSetNamespaceMapper<'_>) {
        for (index, name) in (1..).zip(self.get_own_namespaces()) {
            namespaces.add_namespace(&name, index);
        }
    }

    fn get_own_namespaces(&self) -> Vec<String> {
        [layout::OWN, layout::DEVICES, layout::MACHINERY, layout::MACHINE_TOOL].map(str::to_owned).to_vec()
    }

    fn load<'a>(
        &'a self,
        _: &'a NodeSetNamespaceMapper<'_>,
    ) -> Box<dyn Iterator<Item = opcua::nodes::ImportedItem> + 'a> {
        Box::new(std::iter::empty())
    }
}

/// Numbers of the namespaces in this server.
#[derive(Debug, Clone, Copy)]
pub(super) struct Numbers {
    pub(super) own: u16,
    pub(super) devices: u16,
    pub(super) machinery: u16,
    pub(super) machine_tool: u16,
}

/// Which nodes show a series, each with how.
#[derive(Debug)]
pub(super) struct Shown {
    nodes: HashMap<Arc<str>, Vec<(NodeId, Option<Form>)>>,
    alarms: NodeId,
}

impl Shown {
    /// The nodes of these readings with their new values.
    pub(super) fn values(&self, readings: &[Reading], at_ns: TimeNs) -> Vec<(NodeId, DataValue)> {
        let of = |reading: &Reading| {
            let nodes = self.nodes.get(&reading.series.name).into_iter().flatten();
            let value = |(node, form): &(NodeId, Option<Form>)| (node.clone(), value(&reading.value, *form, at_ns));
            nodes.map(value).collect::<Vec<_>>()
        };
        readings.iter().flat_map(of).collect()
    }

    /// All of them without a value: nothing has come for too long.
    pub(super) fn nothing(&self) -> Vec<(NodeId, DataValue)> {
        let all = self.nodes.values().flatten().map(|(node, _)| node).chain([&self.alarms]);
        all.map(|node| (node.clone(), missing(StatusCode::BadNoCommunication))).collect()
    }

    /// The node of the alarms of the gateway with those that stand.
    pub(super) fn alarms(&self, standing: &[String], at_ns: TimeNs) -> (NodeId, DataValue) {
        (self.alarms.clone(), known(Variant::from(standing.to_vec()), at_ns))
    }
}

fn value(cell: &Cell, form: Option<Form>, at_ns: TimeNs) -> DataValue {
    let variant = match (cell, form) {
        (Cell::Number(number), Some(Form::Rotating)) => Ok(Variant::from(layout::rotates(*number))),
        (Cell::Number(number), _) => Ok(Variant::from(*number)),
        (Cell::Text(word), Some(Form::Word(_, number))) => Ok(Variant::from(number(word))),
        (Cell::Text(text), _) => Ok(Variant::from(&**text)),
        (Cell::Missing(reason), _) => Err(absent(reason)),
    };
    match variant {
        Ok(variant) => known(variant, at_ns),
        Err(status) => DataValue { source_timestamp: Some(time(at_ns)), ..missing(status) },
    }
}

fn known(variant: Variant, at_ns: TimeNs) -> DataValue {
    DataValue {
        value: Some(variant),
        status: Some(StatusCode::Good),
        source_timestamp: Some(time(at_ns)),
        server_timestamp: Some(DateTime::now()),
        ..DataValue::default()
    }
}

fn missing(status: StatusCode) -> DataValue {
    DataValue {
        // Not `None`: a node of the library forgets the status of a value that is not there, and then it would be read as good.
        value: Some(Variant::Empty),
        status: Some(status),
        server_timestamp: Some(DateTime::now()),
        ..DataValue::default()
    }
}

fn set_missing(space: &mut AddressSpace, node: &NodeId, status: StatusCode) {
    if let Some(opcua::nodes::NodeType::Variable(variable)) = space.find_mut(node) {
        variable.set_data_value(missing(status));
    }
}

fn time(at_ns: TimeNs) -> DateTime {
    DateTime::from(at_ns.div_euclid(100).saturating_add(EPOCH_TICKS))
}

/// The status that says why there is no value.
fn absent(reason: &str) -> StatusCode {
    match reason {
        "not_provided" | "not_supported" => StatusCode::BadNotSupported,
        "machine_off" | "disconnected" | "timeout" | "stale" => StatusCode::BadNoCommunication,
        "not_yet_read" => StatusCode::BadWaitingForInitialData,
        "out_of_range" => StatusCode::BadOutOfRange,
        _ => StatusCode::BadNoData,
    }
}

/// Builds the nodes of the machine of this name and box, with one for each series.
pub(super) fn build(
    space: &mut AddressSpace,
    numbers: Numbers,
    (machine, box_id): (&str, &str),
    series: &[Reading],
) -> Shown {
    types(space, numbers);
    let machines = NodeId::new(numbers.machinery, layout::MACHINES);
    ObjectBuilder::new(&machines, QualifiedName::new(numbers.machinery, "Machines"), "Machines")
        .is_folder()
        .organized_by(ObjectId::ObjectsFolder)
        .insert(space);
    let root = NodeId::new(numbers.own, "Machine");
    ObjectBuilder::new(&root, QualifiedName::new(numbers.own, machine), machine)
        .has_type_definition(NodeId::new(numbers.machine_tool, layout::MACHINE_TOOL_TYPE))
        .organized_by(machines)
        .insert(space);
    for (path, kind) in layout::OBJECTS {
        let (parent, name) = path.rsplit_once('/').unwrap_or(("Machine", path));
        // The identification comes from the specification of devices, the rest from that of machine tools.
        let namespace = if name == "Identification" { numbers.devices } else { numbers.machine_tool };
        ObjectBuilder::new(&NodeId::new(numbers.own, path), QualifiedName::new(namespace, name), name)
            .has_type_definition(NodeId::new(numbers.machine_tool, kind))
            .component_of(NodeId::new(numbers.own, parent))
            .insert(space);
    }
    identification(space, numbers, (machine, box_id));
    let mut shown = Shown { nodes: HashMap::new(), alarms: alarms(space, numbers) };
    for (object, name, channel, form) in layout::VARIABLES {
        let Some(reading) = series.iter().find(|reading| &*reading.series.name == channel) else { continue };
        let node = NodeId::new(numbers.own, format!("{object}/{name}"));
        let variable = VariableBuilder::new(&node, QualifiedName::new(numbers.machine_tool, name), name)
            .component_of(NodeId::new(numbers.own, object));
        typed(space, numbers, variable, &reading.series, Some(form));
        shown.nodes.entry(reading.series.name.clone()).or_default().push((node, Some(form)));
    }
    values(space, numbers, series, &mut shown);
    shown
}

/// Every series under its own name.
fn values(space: &mut AddressSpace, numbers: Numbers, series: &[Reading], shown: &mut Shown) {
    let folder = NodeId::new(numbers.own, "Values");
    ObjectBuilder::new(&folder, QualifiedName::new(numbers.own, "Values"), "Values")
        .is_folder()
        .component_of(NodeId::new(numbers.own, "Machine"))
        .insert(space);
    for reading in series {
        let name = &reading.series.name;
        let node = NodeId::new(numbers.own, format!("Values/{name}"));
        let variable = VariableBuilder::new(&node, QualifiedName::new(numbers.own, &**name), &**name)
            .description(LocalizedText::new("en", &reading.series.en))
            .component_of(folder.clone());
        typed(space, numbers, variable, &reading.series, None);
        shown.nodes.entry(name.clone()).or_default().push((node, None));
    }
}

/// Inserts a variable with the type of its value, and unit and range where it has them.
fn typed(
    space: &mut AddressSpace,
    numbers: Numbers,
    variable: VariableBuilder,
    series: &SeriesInfo,
    form: Option<Form>,
) {
    let node = variable.get_node_id().clone();
    let variable = variable.value(Variant::Empty);
    match form {
        Some(Form::Word(kind, _)) => {
            let kind = NodeId::new(numbers.machine_tool, kind);
            variable.data_type(kind).has_type_definition(VariableTypeId::BaseDataVariableType).insert(space);
        }
        Some(Form::Rotating) => {
            let variable = variable.data_type(DataTypeId::Boolean);
            variable.has_type_definition(VariableTypeId::BaseDataVariableType).insert(space);
        }
        _ if series.kind == SeriesKind::Number => {
            variable.data_type(DataTypeId::Double).has_type_definition(VariableTypeId::AnalogUnitType).insert(space);
            unit(space, numbers, &node, series);
        }
        _ => {
            let variable = variable.data_type(DataTypeId::String);
            variable.has_type_definition(VariableTypeId::BaseDataVariableType).insert(space);
        }
    }
    set_missing(space, &node, StatusCode::BadWaitingForInitialData);
}

/// `EngineeringUnits`, and `EURange` where the range is known.
fn unit(space: &mut AddressSpace, numbers: Numbers, node: &NodeId, series: &SeriesInfo) {
    let information = units::information(&series.unit);
    let mut property = |name: &str, kind: DataTypeId, value: ExtensionObject| {
        let own = NodeId::new(numbers.own, format!("{}/{name}", node.identifier));
        VariableBuilder::new(&own, name, name)
            .data_type(kind)
            .value(Variant::from(value))
            .has_type_definition(VariableTypeId::PropertyType)
            .property_of(node.clone())
            .insert(space);
    };
    property("EngineeringUnits", DataTypeId::EUInformation, ExtensionObject::from_message(information));
    if let Some((low, high)) = series.range {
        property("EURange", DataTypeId::Range, ExtensionObject::from_message(Range { low, high }));
    }
}

/// The alarms of the gateway that stand: the specification has none of a list, so it is in the box's own namespace.
fn alarms(space: &mut AddressSpace, numbers: Numbers) -> NodeId {
    let node = NodeId::new(numbers.own, "Notification/Messages/GatewayAlarms");
    VariableBuilder::new(&node, QualifiedName::new(numbers.own, "GatewayAlarms"), "GatewayAlarms")
        .data_type(DataTypeId::String)
        .value_rank(1)
        .value(Variant::Empty)
        .has_type_definition(VariableTypeId::BaseDataVariableType)
        .component_of(NodeId::new(numbers.own, "Notification/Messages"))
        .insert(space);
    node
}

/// What the box knows of the machine's identity: the name that it was given. Maker and serial number are not told by a controller.
fn identification(space: &mut AddressSpace, numbers: Numbers, (machine, box_id): (&str, &str)) {
    let uri = format!("{PRODUCT}:{box_id}");
    let rows = [
        ("Manufacturer", DataTypeId::LocalizedText, None),
        ("SerialNumber", DataTypeId::String, None),
        ("ProductInstanceUri", DataTypeId::String, Some(Variant::from(uri.as_str()))),
        ("ComponentName", DataTypeId::LocalizedText, Some(Variant::from(LocalizedText::new("", machine)))),
    ];
    for (name, kind, value) in rows {
        let node = NodeId::new(numbers.own, format!("Identification/{name}"));
        let known = value.is_some();
        VariableBuilder::new(&node, QualifiedName::new(numbers.devices, name), name)
            .data_type(kind)
            .value(value.unwrap_or(Variant::Empty))
            .has_type_definition(VariableTypeId::PropertyType)
            .property_of(NodeId::new(numbers.own, "Identification"))
            .insert(space);
        if !known {
            set_missing(space, &node, StatusCode::BadNotSupported);
        }
    }
}

/// The names of the types that the objects have.
fn types(space: &mut AddressSpace, numbers: Numbers) {
    for (number, name) in layout::TYPES {
        let node = NodeId::new(numbers.machine_tool, number);
        ObjectTypeBuilder::new(&node, QualifiedName::new(numbers.machine_tool, name), name)
            .subtype_of(ObjectTypeId::BaseObjectType)
            .insert(space);
    }
    for (number, name) in layout::ENUMERATIONS {
        let node = NodeId::new(numbers.machine_tool, number);
        DataTypeBuilder::new(&node, QualifiedName::new(numbers.machine_tool, name), name)
            .subtype_of(DataTypeId::Enumeration)
            .insert(space);
    }
}

/// The value of a node as a client reads it.
#[cfg(test)]
pub(super) fn read(space: &AddressSpace, node: &NodeId) -> Option<DataValue> {
    use opcua::types::{AttributeId, DataEncoding, NumericRange, TimestampsToReturn};
    let (stamps, encoding) = (TimestampsToReturn::Both, DataEncoding::Binary);
    space.find(node)?.as_node().get_attribute(stamps, AttributeId::Value, &NumericRange::None, &encoding)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_never_read_as_good() {
        let mut space = AddressSpace::new();
        space.add_namespace(layout::OWN, 1);
        let node = NodeId::new(1, "it");
        VariableBuilder::new(&node, "it", "it").value(1.0).data_type(DataTypeId::Double).insert(&mut space);
        for reason in ["not_provided", "timeout", "not_yet_read", "out_of_range", "stale", "not_learned"] {
            let status = absent(reason);
            assert!(status.is_bad(), "{reason}");
            set_missing(&mut space, &node, status);
            assert_eq!(read(&space, &node).and_then(|value| value.status), Some(status), "{reason}");
        }
    }
}
