//! A connection that may change a history: by the layer that seals pages, as the gateway itself.

use rusqlite::{Connection, OpenFlags};
use std::path::Path;

pub(crate) fn connect(path: &Path) -> Connection {
    let layer = gateway::history::page_layer().expect("known to SQLite");
    Connection::open_with_flags_and_vfs(path, OpenFlags::default(), layer).expect("opens")
}
