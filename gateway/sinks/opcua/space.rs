//! The nodes of a machine.

use super::layout::{self, Form, StatePart};
use super::values::{Shown, set_missing};
use super::{MachineIdentity, units};
use gateway_history::{Reading, SeriesInfo, SeriesKind};
use opcua::nodes::{
    DataTypeBuilder, EventNotifier, NodeSetImport, NodeSetNamespaceMapper, ObjectBuilder, ObjectTypeBuilder,
    VariableBuilder,
};
use opcua::server::address_space::AddressSpace;
use opcua::types::{
    DataTypeId, ExtensionObject, LocalizedText, NodeId, ObjectId, ObjectTypeId, QualifiedName, Range, StatusCode,
    VariableTypeId, Variant,
};

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

/// Builds the nodes of the machine of this name and box, with one for each series.
pub(super) fn build_nodes(
    space: &mut AddressSpace,
    numbers: Numbers,
    identity: &MachineIdentity,
    series: &[Reading],
) -> Shown {
    let machine = identity.machine.as_str();
    add_types(space, numbers);
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
        let object = ObjectBuilder::new(&NodeId::new(numbers.own, path), QualifiedName::new(namespace, name), name)
            .has_type_definition(NodeId::new(numbers.machine_tool, kind))
            .component_of(NodeId::new(numbers.own, parent));
        let sends = if path == layout::MESSAGES { EventNotifier::SUBSCRIBE_TO_EVENTS } else { EventNotifier::empty() };
        object.event_notifier(sends).insert(space);
    }
    add_identification(space, numbers, identity);
    let mut shown = Shown::new(numbers, add_alarms_node(space, numbers));
    for (object, name, channel, form) in layout::VARIABLES {
        let Some(reading) = series.iter().find(|reading| &*reading.series.name == channel) else { continue };
        let node = NodeId::new(numbers.own, format!("{object}/{name}"));
        // The state machine is one of the base specification.
        let namespace = if matches!(form, Form::State(_)) { 0 } else { numbers.machine_tool };
        let variable = VariableBuilder::new(&node, QualifiedName::new(namespace, name), name)
            .component_of(NodeId::new(numbers.own, object));
        insert_typed_variable(space, numbers, variable, &reading.series, Some(form));
        shown.add(&reading.series.name, node, Some(form));
    }
    for (variable, name, channel, form) in layout::PROPERTIES {
        let Some(reading) = series.iter().find(|reading| &*reading.series.name == channel) else { continue };
        let node = NodeId::new(numbers.own, format!("{variable}/{name}"));
        let property = VariableBuilder::new(&node, QualifiedName::new(0, name), name)
            .property_of(NodeId::new(numbers.own, variable));
        insert_typed_variable(space, numbers, property, &reading.series, Some(form));
        shown.add(&reading.series.name, node, Some(form));
    }
    add_series_nodes(space, numbers, series, &mut shown);
    shown
}

/// Every series under its own name.
fn add_series_nodes(space: &mut AddressSpace, numbers: Numbers, series: &[Reading], shown: &mut Shown) {
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
        insert_typed_variable(space, numbers, variable, &reading.series, None);
        shown.add(name, node, None);
    }
}

/// Inserts a variable with the type of its value, and unit and range where it has them.
fn insert_typed_variable(
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
        Some(Form::Hours) => {
            let variable = variable.data_type(DataTypeId::UInt32);
            variable.has_type_definition(VariableTypeId::BaseDataVariableType).insert(space);
        }
        Some(Form::State(part)) => {
            let (data, kind) = match part {
                StatePart::Name => (DataTypeId::LocalizedText, VariableTypeId::FiniteStateVariableType),
                StatePart::Node => (DataTypeId::NodeId, VariableTypeId::PropertyType),
                StatePart::Number => (DataTypeId::UInt32, VariableTypeId::PropertyType),
            };
            variable.data_type(data).has_type_definition(kind).insert(space);
        }
        _ if series.kind == SeriesKind::Number => {
            variable.data_type(DataTypeId::Double).has_type_definition(VariableTypeId::AnalogUnitType).insert(space);
            add_unit_properties(space, numbers, &node, series);
        }
        _ => {
            let variable = variable.data_type(DataTypeId::String);
            variable.has_type_definition(VariableTypeId::BaseDataVariableType).insert(space);
        }
    }
    set_missing(space, &node, StatusCode::BadWaitingForInitialData);
}

/// `EngineeringUnits`, and `EURange` where the range is known.
fn add_unit_properties(space: &mut AddressSpace, numbers: Numbers, node: &NodeId, series: &SeriesInfo) {
    let information = units::to_unit_information(&series.unit);
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
fn add_alarms_node(space: &mut AddressSpace, numbers: Numbers) -> NodeId {
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

/// What is known of the machine's identity: no controller tells its maker and serial number, so a person has to.
fn add_identification(space: &mut AddressSpace, numbers: Numbers, identity: &MachineIdentity) {
    let localized = |text: &String| Variant::from(LocalizedText::new("", text));
    let rows = [
        ("Manufacturer", DataTypeId::LocalizedText, identity.manufacturer.as_ref().map(localized)),
        ("Model", DataTypeId::LocalizedText, identity.model.as_ref().map(localized)),
        ("SerialNumber", DataTypeId::String, identity.serial_number.as_ref().map(|text| Variant::from(text.as_str()))),
        ("ProductInstanceUri", DataTypeId::String, Some(Variant::from(identity.uri().as_str()))),
        ("ComponentName", DataTypeId::LocalizedText, Some(localized(&identity.machine))),
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
fn add_types(space: &mut AddressSpace, numbers: Numbers) {
    for (number, name) in layout::TYPES {
        let node = NodeId::new(numbers.machine_tool, number);
        ObjectTypeBuilder::new(&node, QualifiedName::new(numbers.machine_tool, name), name)
            .subtype_of(ObjectTypeId::BaseObjectType)
            .insert(space);
    }
    let (number, name) = layout::NOTIFICATION_EVENT;
    let notification = NodeId::new(numbers.machine_tool, number);
    ObjectTypeBuilder::new(&notification, QualifiedName::new(numbers.machine_tool, name), name)
        .is_abstract(true)
        .subtype_of(ObjectTypeId::BaseEventType)
        .insert(space);
    let identifier = NodeId::new(numbers.own, format!("{name}/Identifier"));
    VariableBuilder::new(&identifier, QualifiedName::new(numbers.machine_tool, "Identifier"), "Identifier")
        .data_type(DataTypeId::String)
        .has_type_definition(VariableTypeId::PropertyType)
        .property_of(notification.clone())
        .insert(space);
    let own = NodeId::new(numbers.own, layout::MESSAGE_EVENT);
    ObjectTypeBuilder::new(&own, QualifiedName::new(numbers.own, layout::MESSAGE_EVENT), layout::MESSAGE_EVENT)
        .subtype_of(notification)
        .insert(space);
    for (number, name) in layout::ENUMERATIONS {
        let node = NodeId::new(numbers.machine_tool, number);
        DataTypeBuilder::new(&node, QualifiedName::new(numbers.machine_tool, name), name)
            .subtype_of(DataTypeId::Enumeration)
            .insert(space);
    }
}
