//! The shop's scripts on disk: their texts, their settings, what was last active, what somebody is writing.

pub mod active_scripts;
pub mod drafts;
pub mod reload;
pub mod settings;
