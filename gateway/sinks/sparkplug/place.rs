//! Where the machine stands among the nodes of Sparkplug: as the address says, or as its path does.

use crate::broker::BrokerTarget;
use crate::target_error::TargetError;
use adapter_core::address::Keys;
use gateway_base::machine_path::MachinePath;

/// Where to, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct SparkplugTarget {
    /// Address, TLS files and login of the broker.
    pub broker: BrokerTarget,
    /// Group, node and device; `None`: those of the machine's path.
    pub place: Option<SparkplugPlace>,
    /// The host that must be there before anything is sent.
    pub host: Option<String>,
}

/// Under which names hosts know the machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SparkplugPlace {
    /// Group of nodes, for example the plant.
    pub group: String,
    /// Name of the edge node in its group.
    pub node: String,
    /// The machine; `None`: the metrics are those of the node.
    pub device: Option<String>,
}

impl SparkplugTarget {
    pub(in super::super) fn parse(body: &str, keys: &mut Keys, secured: bool) -> Result<Self, TargetError> {
        let host = keys.take_text("host").filter(|host| !host.contains(['+', '#', '/']));
        let (broker, rest) = BrokerTarget::parse(body, keys, secured)?;
        let place = if rest.is_empty() { None } else { Some(SparkplugPlace::parse(rest)?) };
        Ok(Self { broker, place, host })
    }
}

impl SparkplugPlace {
    fn parse(text: &str) -> Result<Self, TargetError> {
        let parts: Vec<&str> = text.split('/').collect();
        let (group, node, device) = match parts[..] {
            [group, node] => (group, node, None),
            [group, node, device] => (group, node, Some(device)),
            _ => return Err(TargetError::NoNode),
        };
        if let Some(part) = parts.iter().find(|part| part.is_empty() || part.contains(['+', '#'])) {
            return Err(TargetError::NodeName { part: (*part).to_owned() });
        }
        Ok(Self { group: group.to_owned(), node: node.to_owned(), device: device.map(str::to_owned) })
    }

    /// The group is made of the levels before the machine, the node is the machine: a node has one connection, as a box has.
    pub(super) fn of_path(path: &MachinePath) -> Self {
        Self { group: path.format_group(), node: path.machine_word().to_owned(), device: None }
    }

    /// Where neither the address nor a path says one, as when `doctor` asks.
    pub(super) fn of_nobody() -> Self {
        Self { group: "doctor".to_owned(), node: "doctor".to_owned(), device: None }
    }

    pub(super) fn format_topic(&self, kind: &str) -> String {
        let Self { group, node, .. } = self;
        match self.device.as_ref().filter(|_| kind.starts_with('D')) {
            Some(device) => format!("spBv1.0/{group}/{kind}/{node}/{device}"),
            None => format!("spBv1.0/{group}/{kind}/{node}"),
        }
    }
}
