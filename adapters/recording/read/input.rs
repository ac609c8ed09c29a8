//! The bytes of a recording, readable as often as needed: a file or a text in memory, unpacked where it is gzipped.

use super::error::RecordingError;
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

#[derive(Debug, Clone)]
pub(super) struct Input {
    /// The name for messages.
    pub(super) file: String,
    place: InputPlace,
}

#[derive(Debug, Clone)]
enum InputPlace {
    Path(PathBuf),
    Memory(Vec<u8>),
    /// Everything, unpacked already.
    Unpacked(Vec<u8>),
}

/// What a format reader that jumps about needs.
pub(super) trait Seekable: Read + Seek {}
impl<T: Read + Seek> Seekable for T {}

/// A pipe or a device has no end, or never begins.
fn open_regular_file(path: &Path) -> std::io::Result<File> {
    let kind = std::fs::metadata(path)?;
    if !kind.is_file() {
        return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, "it is no regular file"));
    }
    File::open(path)
}

const GZIP: [u8; 2] = [0x1f, 0x8b];

impl Input {
    pub(super) fn from_path(path: &Path) -> Self {
        Self { file: path.display().to_string(), place: InputPlace::Path(path.to_owned()) }
    }

    pub(super) fn from_memory(bytes: Vec<u8>, file: &str) -> Self {
        Self { file: file.to_owned(), place: InputPlace::Memory(bytes) }
    }

    pub(super) fn build_io_error(&self, error: std::io::Error) -> RecordingError {
        RecordingError::Io { file: self.file.clone(), error }
    }

    /// As it is stored.
    pub(super) fn open_raw(&self) -> Result<Box<dyn Seekable + '_>, RecordingError> {
        Ok(match &self.place {
            InputPlace::Path(path) => Box::new(BufReader::with_capacity(
                1 << 16,
                open_regular_file(path).map_err(|error| self.build_io_error(error))?,
            )),
            InputPlace::Memory(bytes) | InputPlace::Unpacked(bytes) => Box::new(Cursor::new(bytes.as_slice())),
        })
    }

    /// Unpacked where it is gzipped.
    pub(super) fn open(&self) -> Result<Box<dyn Read + '_>, RecordingError> {
        if let InputPlace::Unpacked(bytes) = &self.place {
            return Ok(Box::new(bytes.as_slice()));
        }
        let mut buffered = BufReader::with_capacity(1 << 16, self.open_raw()?);
        let packed = buffered.fill_buf().map_err(|error| self.build_io_error(error))?.starts_with(&GZIP);
        Ok(if packed { Box::new(flate2::bufread::MultiGzDecoder::new(buffered)) } else { Box::new(buffered) })
    }

    /// Unpacks everything into memory, so that going through it again costs little; left as it is where it is more than so many bytes.
    pub(super) fn keep_in_memory(&mut self, most: u64) -> Result<(), RecordingError> {
        if let Some(bytes) = self.read_whole(most)? {
            self.place = InputPlace::Unpacked(bytes);
        }
        Ok(())
    }

    /// Everything unpacked, where it was put into memory.
    pub(super) fn bytes_in_memory(&self) -> Option<&[u8]> {
        match &self.place {
            InputPlace::Unpacked(bytes) => Some(bytes),
            InputPlace::Path(_) | InputPlace::Memory(_) => None,
        }
    }

    /// The first bytes after unpacking, at most so many.
    pub(super) fn read_head(&self, most: usize) -> Result<Vec<u8>, RecordingError> {
        let mut head = Vec::new();
        self.open()?.take(most as u64).read_to_end(&mut head).map_err(|error| self.build_io_error(error))?;
        Ok(head)
    }

    /// Everything after unpacking, for formats that jump about; `None` beyond this many bytes.
    pub(super) fn read_whole(&self, most: u64) -> Result<Option<Vec<u8>>, RecordingError> {
        let mut bytes = Vec::new();
        self.open()?.take(most + 1).read_to_end(&mut bytes).map_err(|error| self.build_io_error(error))?;
        Ok((bytes.len() as u64 <= most).then_some(bytes))
    }
}
