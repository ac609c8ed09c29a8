//! The scripts that come with the gateway: examples that run, are tested, and are meant to be edited.

use super::compile::ScriptFile;

const SHIPPED: [(&str, &str); 7] = [
    ("alarms.rhai", include_str!("../scripts/alarms.rhai")),
    ("constant_load.rhai", include_str!("../scripts/constant_load.rhai")),
    ("energy.rhai", include_str!("../scripts/energy.rhai")),
    ("state.rhai", include_str!("../scripts/state.rhai")),
    ("teach.rhai", include_str!("../scripts/teach.rhai")),
    ("thermal.rhai", include_str!("../scripts/thermal.rhai")),
    ("tool_wear.rhai", include_str!("../scripts/tool_wear.rhai")),
];

/// Every script that comes with the gateway.
#[must_use]
pub fn list_shipped_scripts() -> Vec<ScriptFile> {
    SHIPPED.iter().map(|(name, text)| ScriptFile { name: (*name).to_owned(), text: (*text).to_owned() }).collect()
}
