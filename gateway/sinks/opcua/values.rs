//! Values of the box as values of nodes, and which nodes show which series.

use super::layout::{self, Form, ProgramState, StatePart};
use super::space::Numbers;
use adapter_core::clock::TimeNs;
use gateway_history::{Cell, Reading};
use opcua::server::address_space::AddressSpace;
use opcua::types::{DataValue, DateTime, LocalizedText, NodeId, StatusCode, Variant};
use std::collections::HashMap;
use std::sync::Arc;

/// Hundred nanoseconds between 1601, where times of OPC UA begin, and 1970.
const EPOCH_TICKS: i64 = 116_444_736_000_000_000;

/// Which nodes show a series, each with how.
#[derive(Debug)]
pub(super) struct Shown {
    nodes: HashMap<Arc<str>, Vec<(NodeId, Option<Form>)>>,
    alarms: NodeId,
    numbers: Numbers,
}

impl Shown {
    pub(super) fn new(numbers: Numbers, alarms: NodeId) -> Self {
        Self { nodes: HashMap::new(), alarms, numbers }
    }

    /// This node shows this series.
    pub(super) fn add(&mut self, series: &Arc<str>, node: NodeId, form: Option<Form>) {
        self.nodes.entry(series.clone()).or_default().push((node, form));
    }

    /// The nodes of these readings with their new values.
    pub(super) fn build_node_values(&self, readings: &[Reading], at_ns: TimeNs) -> Vec<(NodeId, DataValue)> {
        let of = |reading: &Reading| {
            let nodes = self.nodes.get(&reading.series.name).into_iter().flatten();
            let value = |(node, form): &(NodeId, Option<Form>)| {
                (node.clone(), self.to_data_value(&reading.value, *form, at_ns))
            };
            nodes.map(value).collect::<Vec<_>>()
        };
        readings.iter().flat_map(of).collect()
    }

    /// All of them without a value: nothing has come for too long.
    pub(super) fn list_unavailable_values(&self) -> Vec<(NodeId, DataValue)> {
        let all = self.nodes.values().flatten().map(|(node, _)| node).chain([&self.alarms]);
        all.map(|node| (node.clone(), build_missing_value(StatusCode::BadNoCommunication))).collect()
    }

    fn to_data_value(&self, cell: &Cell, form: Option<Form>, at_ns: TimeNs) -> DataValue {
        let variant = match (cell, form) {
            (Cell::Number(number), Some(Form::Rotating)) => Ok(Variant::from(layout::is_rotating(*number))),
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, which is meant")]
            (Cell::Number(number), Some(Form::Hours)) => Ok(Variant::from((number / 3600.0) as u32)),
            (Cell::Number(number), _) => Ok(Variant::from(*number)),
            (Cell::Text(word), Some(Form::Word(_, number))) => Ok(Variant::from(number(word))),
            (Cell::Text(word), Some(Form::State(part))) => Ok(self.to_state_variant(layout::program_state(word), part)),
            (Cell::Text(text), _) => Ok(Variant::from(&**text)),
            (Cell::Missing(reason), _) => Err(to_status_code(reason)),
        };
        match variant {
            Ok(variant) => build_good_value(variant, at_ns),
            Err(status) => DataValue { source_timestamp: Some(to_opcua_time(at_ns)), ..build_missing_value(status) },
        }
    }

    fn to_state_variant(&self, state: ProgramState, part: StatePart) -> Variant {
        match part {
            StatePart::Name => Variant::from(LocalizedText::new("en", state.name)),
            StatePart::Node => Variant::from(NodeId::new(self.numbers.machine_tool, state.node)),
            StatePart::Number => Variant::from(state.number),
        }
    }

    /// The node of the alarms of the gateway with those that stand.
    pub(super) fn build_alarms_value(&self, standing: &[String], at_ns: TimeNs) -> (NodeId, DataValue) {
        (self.alarms.clone(), build_good_value(Variant::from(standing.to_vec()), at_ns))
    }
}

fn build_good_value(variant: Variant, at_ns: TimeNs) -> DataValue {
    DataValue {
        value: Some(variant),
        status: Some(StatusCode::Good),
        source_timestamp: Some(to_opcua_time(at_ns)),
        server_timestamp: Some(DateTime::now()),
        ..DataValue::default()
    }
}

fn build_missing_value(status: StatusCode) -> DataValue {
    DataValue {
        // Not `None`: a node of the library forgets the status of a value that is not there, and then it would be read as good.
        value: Some(Variant::Empty),
        status: Some(status),
        server_timestamp: Some(DateTime::now()),
        ..DataValue::default()
    }
}

pub(super) fn set_missing(space: &mut AddressSpace, node: &NodeId, status: StatusCode) {
    if let Some(opcua::nodes::NodeType::Variable(variable)) = space.find_mut(node) {
        variable.set_data_value(build_missing_value(status));
    }
}

pub(super) fn to_opcua_time(at_ns: TimeNs) -> DateTime {
    DateTime::from(at_ns.div_euclid(100).saturating_add(EPOCH_TICKS))
}

/// The status that says why there is no value.
fn to_status_code(reason: &str) -> StatusCode {
    match reason {
        "not_provided" | "not_supported" => StatusCode::BadNotSupported,
        "machine_off" | "disconnected" | "timeout" | "stale" => StatusCode::BadNoCommunication,
        "not_yet_read" => StatusCode::BadWaitingForInitialData,
        "out_of_range" => StatusCode::BadOutOfRange,
        _ => StatusCode::BadNoData,
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
    use opcua::nodes::VariableBuilder;
    use opcua::types::DataTypeId;

    #[test]
    fn what_is_missing_is_never_read_as_good() {
        let mut space = AddressSpace::new();
        space.add_namespace(layout::OWN, 1);
        let node = NodeId::new(1, "it");
        VariableBuilder::new(&node, "it", "it").value(1.0).data_type(DataTypeId::Double).insert(&mut space);
        for reason in ["not_provided", "timeout", "not_yet_read", "out_of_range", "stale", "not_learned"] {
            let status = to_status_code(reason);
            assert!(status.is_bad(), "{reason}");
            set_missing(&mut space, &node, status);
            assert_eq!(read(&space, &node).and_then(|value| value.status), Some(status), "{reason}");
        }
    }
}
