//! Files of the box: replaced in one step, noticed when a person edits them, owned by whoever owns their directory.

pub mod files;
pub mod owner;
