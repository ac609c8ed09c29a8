//! A file on its way into the folder of the files that persons bring. It is written block by block and never stands in memory as a
//! whole; where it does not come to its end, nothing of it is left.

use gateway_base::files::{EMPTY_DIGEST, extend_digest};
use gateway_base::owner;
use gateway_history::{Retention, disk_room};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use thiserror::Error;

/// Why a file is not taken.
#[derive(Debug, Error)]
pub enum ArrivalError {
    /// The disk has not so much room.
    #[error(
        "the disk has no room for the file: {} MB are needed, {} MB are free beside the {} MB that the history keeps free",
        needed_bytes.div_ceil(1 << 20), free_bytes >> 20, kept_bytes >> 20
    )]
    NoRoom {
        /// Bytes that the file needs more.
        needed_bytes: u64,
        /// Bytes that files may still take.
        free_bytes: u64,
        /// Bytes that are left to the history.
        kept_bytes: u64,
    },
    /// The system does not let the file be written.
    #[error("the file cannot be kept: {0}")]
    Io(#[from] std::io::Error),
}

/// A file that is being written; dropped before it has taken its place it is removed.
#[derive(Debug)]
pub struct ArrivingFile {
    path: PathBuf,
    file: File,
    digest: u64,
    bytes: usize,
}

/// Tells files apart that arrive at once.
static NEXT: AtomicU64 = AtomicU64::new(0);

impl ArrivingFile {
    /// Begins a file of so many bytes in a directory.
    ///
    /// # Errors
    /// There is no room for it, or the directory cannot be written.
    pub(super) fn create(directory: &Path, bytes: u64) -> Result<Self, ArrivalError> {
        owner::create_directories(directory)?;
        let path = directory.join(NEXT.fetch_add(1, Ordering::Relaxed).to_string());
        require_room(&path, bytes)?;
        let file = File::create(&path)?;
        Ok(Self { path, file, digest: EMPTY_DIGEST, bytes: 0 })
    }

    /// Takes the next bytes.
    ///
    /// # Errors
    /// There is no room for them any more, or the system refuses.
    pub fn append(&mut self, block: &[u8]) -> Result<(), ArrivalError> {
        require_room(&self.path, block.len() as u64)?;
        self.file.write_all(block)?;
        self.digest = extend_digest(self.digest, block);
        self.bytes += block.len();
        Ok(())
    }

    /// Digest of what has come.
    pub(super) fn digest(&self) -> u64 {
        self.digest
    }

    /// How many bytes have come.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    pub(super) fn take_place(&self, path: &Path) -> std::io::Result<()> {
        std::fs::rename(&self.path, path)
    }
}

impl Drop for ArrivingFile {
    fn drop(&mut self) {
        let _has_taken_its_place = std::fs::remove_file(&self.path);
    }
}

/// What is left of a disk beside what the history keeps free, bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct FileRoom {
    pub(super) free_bytes: u64,
    kept_bytes: u64,
}

/// The room on the disk that holds `path`; `None` where the system does not tell.
pub(super) fn find_room(path: &Path) -> Option<FileRoom> {
    let room = disk_room(path)?;
    let kept_bytes = Retention::default().bytes_kept_free(room);
    Some(FileRoom { free_bytes: room.free.saturating_sub(kept_bytes), kept_bytes })
}

fn require_room(path: &Path, needed_bytes: u64) -> Result<(), ArrivalError> {
    match find_room(path) {
        Some(FileRoom { free_bytes, kept_bytes }) if needed_bytes > free_bytes => {
            Err(ArrivalError::NoRoom { needed_bytes, free_bytes, kept_bytes })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_takes_its_place_or_nothing_of_it_is_left() {
        let directory = tempfile::tempdir().expect("a directory");
        let arriving = directory.path().join("arriving");
        let count = || std::fs::read_dir(&arriving).expect("there").count();
        let mut file = ArrivingFile::create(&arriving, 6).expect("room");
        file.append(b"time_s").and_then(|()| file.append(b",a\n0,1\n")).expect("written");
        assert_eq!((file.bytes(), count()), (13, 1));
        drop(file);
        assert_eq!(count(), 0);
        let mut file = ArrivingFile::create(&arriving, 6).expect("room");
        file.append(b"time_s,a\n").expect("written");
        let place = directory.path().join("data");
        file.take_place(&place).expect("renamed");
        drop(file);
        assert_eq!((std::fs::read(&place).expect("kept"), count()), (b"time_s,a\n".to_vec(), 0));
        let refused = ArrivingFile::create(&arriving, u64::MAX / 2).expect_err("no disk is so large").to_string();
        assert!(refused.contains("no room") && count() == 0, "{refused}");
    }
}
