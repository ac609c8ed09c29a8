//! Room on disk: how much is free, and a reserve that is given up when there is none.
//!
//! Even deleting needs room, for the write-ahead log. So a file of a few megabytes is kept beside the database; when
//! the disk is full it is removed, the oldest raw samples are deleted, their pages are used again, and the reserve is
//! written again once there is room.

use super::lock::append_suffix;
use gateway_base::convert::clamp_to_length;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Free and total bytes of a disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DiskRoom {
    /// Bytes that this process may still use.
    pub free: u64,
    /// Size of the file system, bytes.
    pub total: u64,
}

/// The room on the disk that holds `path`; `None` where the system does not tell.
#[must_use]
pub fn disk_room(path: &Path) -> Option<DiskRoom> {
    let place = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let stat = rustix::fs::statvfs(place).ok()?;
    Some(DiskRoom {
        free: stat.f_bavail.saturating_mul(stat.f_frsize),
        total: stat.f_blocks.saturating_mul(stat.f_frsize),
    })
}

/// The file that is given back when the disk is full.
#[derive(Debug)]
pub(crate) struct Reserve {
    path: PathBuf,
    bytes: u64,
    held: bool,
}

impl Reserve {
    /// The reserve beside the history at `path`, at most a sixteenth of its disk.
    pub(crate) fn new_beside(path: &Path, bytes: u64) -> Self {
        let total = disk_room(path).map_or(u64::MAX, |room| room.total);
        Self { path: append_suffix(path, ".reserve"), bytes: bytes.min(total / 16), held: false }
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Gives the room back to the disk.
    pub(crate) fn release_space(&mut self) {
        self.held = false;
        // A reserve that is already gone is as good as released.
        let _ = std::fs::remove_file(&self.path);
    }

    /// Takes the room when there is twice as much free. Real bytes: a sparse file would reserve nothing.
    pub(crate) fn claim_space(&mut self) {
        let room = disk_room(&self.path).map_or(u64::MAX, |room| room.free);
        if self.held || self.bytes == 0 || room < self.bytes.saturating_mul(2) {
            return;
        }
        self.held = self.is_there() || self.fill_file().is_ok();
        if !self.held {
            self.release_space();
        }
    }

    fn is_there(&self) -> bool {
        std::fs::metadata(&self.path).is_ok_and(|file| file.len() == self.bytes)
    }

    fn fill_file(&self) -> std::io::Result<()> {
        let mut file = File::create(&self.path)?;
        let chunk = [0xa5u8; 65_536];
        let mut left = self.bytes;
        while left > 0 {
            let take = left.min(chunk.len() as u64);
            file.write_all(&chunk[..clamp_to_length(take)])?;
            left -= take;
        }
        file.sync_all()
    }
}
