//! An alarm as an event: a kind of the `NotificationEventType` of machine tools, with the code as its `Identifier`.

use super::layout;
use super::space::Numbers;
use super::values::to_opcua_time;
use adapter_core::clock::TimeNs;
use gateway_history::Alarm;
use opcua::nodes::{BaseEventType, Event, EventField};
use opcua::types::{AttributeId, ByteString, DateTime, LocalizedText, NodeId, NumericRange, QualifiedName, Variant};

/// Severities of OPC 10000-5: 1 to 1000. An alarm that ends is told with the least.
const CRITICAL: u16 = 900;
const WARNING: u16 = 500;
const INFO: u16 = 100;
const ENDED: u16 = 1;

pub(super) struct AlarmEvent {
    base: BaseEventType,
    code: String,
    machine_tool: u16,
}

impl AlarmEvent {
    pub(super) fn from_raised_alarm(numbers: Numbers, alarm: &Alarm) -> Self {
        let severity = match alarm.severity.as_str() {
            "critical" => CRITICAL,
            "warning" => WARNING,
            _ => INFO,
        };
        Self::new(numbers, (&alarm.code, &alarm.source), (&alarm.en, severity), alarm.at_ns)
    }

    /// The alarm of this code and source has ended.
    pub(super) fn from_cleared_alarm(numbers: Numbers, code: &str, source: &str, at_ns: TimeNs) -> Self {
        Self::new(numbers, (code, source), (&format!("{code}: cleared"), ENDED), at_ns)
    }

    fn new(numbers: Numbers, (code, source): (&str, &str), (text, severity): (&str, u16), at_ns: TimeNs) -> Self {
        let base = BaseEventType {
            event_id: ByteString::from(format!("{at_ns}/{severity}/{code}").into_bytes()),
            event_type: NodeId::new(numbers.own, layout::MESSAGE_EVENT),
            source_node: NodeId::new(numbers.own, layout::MESSAGES),
            source_name: source.into(),
            time: to_opcua_time(at_ns),
            receive_time: DateTime::now(),
            message: LocalizedText::new("en", text),
            severity,
            ..BaseEventType::default()
        };
        Self { base, code: code.to_owned(), machine_tool: numbers.machine_tool }
    }
}

impl EventField for AlarmEvent {
    fn get_value(&self, attribute: AttributeId, range: &NumericRange, path: &[QualifiedName]) -> Variant {
        match path {
            [name] if name.namespace_index == self.machine_tool && name.name.as_ref() == "Identifier" => {
                Variant::from(self.code.as_str())
            }
            _ => self.base.get_value(attribute, range, path),
        }
    }
}

impl Event for AlarmEvent {
    /// Fields are asked for of this type or of one above it.
    fn get_field(&self, _: &NodeId, attribute: AttributeId, range: &NumericRange, path: &[QualifiedName]) -> Variant {
        self.get_value(attribute, range, path)
    }

    fn time(&self) -> &DateTime {
        &self.base.time
    }

    fn event_type_id(&self) -> &NodeId {
        &self.base.event_type
    }
}
