//! Which value stands where in a machine tool of OPC 40501-1: the one table that the nodes are made of. Pure.
//!
//! Only what the box knows is there. The handbook says, requirement by requirement, what of the specification is met.
//!
//! Sources: OPC 40501-1 v1.02 (machine tools, monitoring and job), OPC 40001-1 (machinery); the numbers of types and states are those of
//! the published node set.

use adapter_core::words::{execution, mode};

/// The namespaces of the companion specifications.
pub(super) const MACHINE_TOOL: &str = "http://opcfoundation.org/UA/MachineTool/";
pub(super) const MACHINERY: &str = "http://opcfoundation.org/UA/Machinery/";
pub(super) const DEVICES: &str = "http://opcfoundation.org/UA/DI/";
/// That of the nodes of this machine.
pub(super) const OWN: &str = "urn:cnc-gateway:machine";

/// The folder of all machines of a server, in the namespace of machinery.
pub(super) const MACHINES: u32 = 1001;
/// The type of a machine tool.
pub(super) const MACHINE_TOOL_TYPE: u32 = 13;

/// Types that objects of a machine tool have, by number in the namespace of machine tools.
pub(super) const TYPES: [(u32, &str); 11] = [
    (7, "NotificationType"),
    (11, "MachineToolIdentificationType"),
    (MACHINE_TOOL_TYPE, "MachineToolType"),
    (14, "MonitoringType"),
    (15, "ProductionProgramStateMachineType"),
    (16, "ChannelMonitoringType"),
    (21, "ProductionType"),
    (22, "SpindleMonitoringType"),
    (26, "MachineOperationMonitoringType"),
    (32, "ProductionActiveProgramType"),
    (38, "MessagesType"),
];

/// Enumerations of values, by number in the same namespace.
pub(super) const ENUMERATIONS: [(u32, &str); 3] =
    [(64, "ChannelState"), (65, "MachineOperationMode"), (67, "ChannelMode")];

/// The event type of which that of the gateway's messages is a kind: it is abstract itself.
pub(super) const NOTIFICATION_EVENT: (u32, &str) = (35, "NotificationEventType");
/// The gateway's own event type, in its own namespace.
pub(super) const MESSAGE_EVENT: &str = "GatewayMessageEventType";
/// The object that sends events.
pub(super) const MESSAGES: &str = "Notification/Messages";

/// An object below the machine: path, and number of its type.
pub(super) const OBJECTS: [(&str, u32); 10] = [
    ("Identification", 11),
    ("Monitoring", 14),
    ("Monitoring/MachineTool", 26),
    ("Monitoring/Channel1", 16),
    ("Monitoring/Spindle", 22),
    ("Production", 21),
    ("Production/ActiveProgram", 32),
    ("Production/ActiveProgram/State", 15),
    ("Notification", 7),
    (MESSAGES, 38),
];

/// How a value of the box becomes one of the specification.
#[derive(Debug, Clone, Copy)]
pub(super) enum Form {
    /// The number as it is; percent.
    Percent,
    /// The text as it is.
    Text,
    /// Whether it turns, whichever way.
    Rotating,
    /// A word, as the number of an enumeration: its type, and what stands for which word.
    Word(u32, fn(&str) -> i32),
    /// Seconds as full hours.
    Hours,
    /// The state of the program: its name, its node in the type, or its number.
    State(StatePart),
}

/// What of a state a variable shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StatePart {
    Name,
    Node,
    Number,
}

/// A state of a program: name, number, and node of the type `ProductionProgramStateMachineType`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ProgramState {
    pub(super) name: &'static str,
    pub(super) number: u32,
    pub(super) node: u32,
}

/// The state of the program that an execution state of the controller means.
pub(super) fn program_state(word: &str) -> ProgramState {
    let (name, number, node) = match word {
        execution::ACTIVE => ("Running", 1, 5041),
        execution::PROGRAM_COMPLETED => ("Ended", 2, 5038),
        execution::INTERRUPTED | execution::FEED_HOLD | execution::STOPPED => ("Interrupted", 3, 5040),
        _ => ("Initializing", 0, 5039),
    };
    ProgramState { name, number, node }
}

/// A variable: object, name, series of the box, form.
pub(super) const VARIABLES: [(&str, &str, &str, Form); 11] = [
    ("Monitoring/MachineTool", "OperationMode", "mode", Form::Word(65, operation_mode)),
    ("Monitoring/MachineTool", "FeedOverride", "feed_override_pct", Form::Percent),
    ("Monitoring/MachineTool", "PowerOnDuration", "power_on_time_s", Form::Hours),
    ("Monitoring/Channel1", "ChannelMode", "mode", Form::Word(67, channel_mode)),
    ("Monitoring/Channel1", "ChannelState", "execution", Form::Word(64, channel_state)),
    ("Monitoring/Channel1", "FeedOverride", "feed_override_pct", Form::Percent),
    ("Monitoring/Spindle", "Override", "spindle_override_pct", Form::Percent),
    ("Monitoring/Spindle", "IsRotating", "spindle_speed_rpm", Form::Rotating),
    ("Production/ActiveProgram", "Name", "program", Form::Text),
    ("Production/ActiveProgram/State", "CurrentState", "execution", Form::State(StatePart::Name)),
    (MESSAGES, "ControllerAlarm", "alarm", Form::Text),
];

/// A property of a variable: the variable, name, series of the box, form.
pub(super) const PROPERTIES: [(&str, &str, &str, Form); 2] = [
    ("Production/ActiveProgram/State/CurrentState", "Id", "execution", Form::State(StatePart::Node)),
    ("Production/ActiveProgram/State/CurrentState", "Number", "execution", Form::State(StatePart::Number)),
];

/// A spindle that is slower than this stands: controllers show noise of a revolution around 0.
const STANDS_RPM: f64 = 1.0;

/// Does a spindle of this speed turn?
pub(super) fn is_rotating(speed_rpm: f64) -> bool {
    speed_rpm.abs() >= STANDS_RPM
}

/// `MachineOperationMode`: 0 manual, 1 automatic, 2 setup, 5 other.
fn operation_mode(word: &str) -> i32 {
    match word {
        mode::MANUAL => 0,
        mode::AUTOMATIC | mode::SEMI_AUTOMATIC => 1,
        mode::MANUAL_DATA_INPUT | mode::EDIT => 2,
        _ => 5,
    }
}

/// `ChannelMode`: 0 automatic, 1 MDA or MDI, 2 jog, 7 other.
fn channel_mode(word: &str) -> i32 {
    match word {
        mode::AUTOMATIC | mode::SEMI_AUTOMATIC => 0,
        mode::MANUAL_DATA_INPUT => 1,
        mode::MANUAL => 2,
        _ => 7,
    }
}

/// `ChannelState`: 0 active, 1 interrupted, 2 reset.
fn channel_state(word: &str) -> i32 {
    match word {
        execution::ACTIVE => 0,
        execution::INTERRUPTED | execution::FEED_HOLD | execution::STOPPED => 1,
        _ => 2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::ChannelId;

    #[test]
    fn every_variable_is_of_a_channel_and_in_an_object() {
        for (object, name, channel, _) in VARIABLES {
            assert!(ChannelId::from_name(channel).is_some(), "{channel}");
            assert!(OBJECTS.iter().any(|(path, _)| *path == object), "{object}/{name}");
        }
        for (path, kind) in OBJECTS {
            assert!(TYPES.iter().any(|(number, _)| *number == kind), "{path}");
        }
    }

    #[test]
    fn every_word_of_a_controller_has_a_number() {
        assert!(mode::ALL.iter().all(|word| operation_mode(word) < 5));
        assert_eq!(mode::ALL.map(channel_mode), [0, 2, 1, 0, 7]);
        assert_eq!(execution::ALL.map(channel_state), [2, 0, 1, 1, 1, 2]);
    }
}
