//! A gateway whose data directory is a small disk of its own.

use crate::process::{Gateway, program};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A box on a tmpfs of so many megabytes, and the way to its data directory; `None` where this user may not mount one.
pub fn start_on_tmpfs(megabytes: usize, arguments: &[&str]) -> Option<(tempfile::TempDir, Gateway, PathBuf)> {
    let directory = tempfile::tempdir().expect("a directory");
    let disk = directory.path().join("data");
    std::fs::create_dir(&disk).expect("a directory");
    let script = format!("mount -t tmpfs -o size={megabytes}m tmpfs \"$1\" && shift && exec \"$@\"");
    let possible = Command::new("unshare").args(["-rm", "sh", "-c", "mount -t tmpfs tmpfs /mnt"]).status();
    if !possible.is_ok_and(|status| status.success()) {
        return None;
    }
    let mut command = Command::new("unshare");
    command.args(["-rm", "sh", "-c", &script, "sh"]).arg(&disk).arg(program().get_program());
    command.args(["run", "--listen", "127.0.0.1:0", "--data-dir"]).arg(&disk).args(arguments);
    let gateway = Gateway::spawn(command);
    // The disk is in a name space of its own; this is the way to it.
    let inside = Path::new("/proc").join(gateway.pid().to_string()).join("root");
    let inside = inside.join(disk.strip_prefix("/").expect("absolute"));
    Some((directory, gateway, inside))
}
