//! What a script remembers: `memory`, and what the functions of the host remember for it.

use super::timers::Timers;
use rhai::{Dynamic, Map};
use serde_json::Value;

#[derive(Debug, Default, Clone)]
pub(super) struct ScriptMemory {
    pub(super) memory: Map,
    pub(super) timers: Timers,
}

impl ScriptMemory {
    /// What outlives the process.
    pub(super) fn take_snapshot(&self) -> Value {
        let mut snapshot = self.timers.take_snapshot();
        snapshot["memory"] = serde_json::to_value(Dynamic::from_map(self.memory.clone())).unwrap_or_default();
        snapshot
    }

    /// From a snapshot; what cannot be read is left out.
    pub(super) fn from_snapshot(snapshot: &Value) -> Self {
        let memory = serde_json::from_value::<Dynamic>(snapshot["memory"].clone()).ok();
        let memory = memory.and_then(|memory| memory.try_cast::<Map>()).unwrap_or_default();
        Self { memory, timers: Timers::from_snapshot(snapshot) }
    }
}
