//! A block as it lies in its row.

use super::checksum::{BlockKey, matches_columns};
use super::directory::{Directory, is_sealed};
use super::{Decoder, Encoder};
use rusqlite::Row;

/// The columns that [`StoredBlock::of_row`] reads, in their order.
pub(crate) const BLOCK_COLUMNS: &str = "segment, first_row, rows, start_ns, end_ns, directory, columns";

/// Bytes of a block that nobody has looked at yet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct StoredBlock {
    pub(crate) key: BlockKey,
    pub(crate) directory: Vec<u8>,
    pub(crate) columns: Vec<u8>,
}

impl StoredBlock {
    /// From a row of [`BLOCK_COLUMNS`].
    pub(crate) fn of_row(row: &Row<'_>) -> Result<Self, rusqlite::Error> {
        let key = BlockKey {
            segment: row.get(0)?,
            first_row: row.get(1)?,
            rows: row.get(2)?,
            start_ns: row.get(3)?,
            end_ns: row.get(4)?,
        };
        Ok(Self { key, directory: row.get(5)?, columns: row.get(6)? })
    }

    /// The directory, if the block is as it was written. A block of an older version has no checksum: there the directory alone
    /// has to make sense.
    pub(crate) fn verify_directory(&self) -> Option<Directory> {
        let (key, bytes) = (&self.key, self.directory.as_slice());
        let directory = if is_sealed(bytes) {
            Directory::parse(key.strip_checksums(bytes)?).filter(|_| matches_columns(bytes, &self.columns))?
        } else {
            Directory::parse(bytes)?
        };
        (i64::try_from(directory.rows) == Ok(key.rows)).then_some(directory)
    }

    /// The same samples `by_ns` later, with checksums; `None` when the block is damaged.
    pub(crate) fn with_shifted_times(&self, by_ns: i64, encoder: &mut Encoder, decoder: &mut Decoder) -> Option<Self> {
        let mut directory = self.verify_directory()?;
        let mut times = decoder.decode_times(&directory, &self.columns)?;
        times.iter_mut().for_each(|at_ns| *at_ns = at_ns.saturating_add(by_ns));
        // The times come first, and places follow from the lengths: what comes after them stays as it is.
        let rest = self.columns.get(directory.times.stored..)?;
        let (span, mut columns) = encoder.encode_times(&times);
        columns.extend_from_slice(rest);
        directory.times = span;
        let key = BlockKey {
            start_ns: self.key.start_ns.saturating_add(by_ns),
            end_ns: self.key.end_ns.saturating_add(by_ns),
            ..self.key
        };
        let mut directory = directory.to_bytes();
        key.append_checksums(&mut directory, &columns);
        Some(Self { key, directory, columns })
    }

    /// The same with checksums, where it has none; `None` when it does not decode.
    pub(crate) fn with_checksums(&self, decoder: &mut Decoder) -> Option<Self> {
        let directory = self.verify_directory()?;
        decoder.decode_times(&directory, &self.columns)?;
        let whole = |entry| decoder.decode_cells(&directory, entry, &self.columns).is_some();
        if !directory.entries.iter().all(whole) {
            return None;
        }
        let mut bytes = directory.to_bytes();
        self.key.append_checksums(&mut bytes, &self.columns);
        Some(Self { directory: bytes, ..self.clone() })
    }

    /// Has it a checksum?
    pub(crate) fn is_sealed(&self) -> bool {
        is_sealed(&self.directory)
    }
}
