//! What tells a block that is as it was written from one in which the disk has changed a bit.
//!
//! The last eight bytes of a directory are two CRC-32 (ISO-HDLC, as in gzip): of the columns, and of everything else in the
//! row of the block, that first one included. So the directory alone can be checked without reading the samples. One changed
//! bit is always noticed, any other change but once in four thousand million.

use super::varint::Bytes;
use adapter_core::clock::TimeNs;

/// Length of both sums.
const SUMS: usize = 8;

/// What stands beside directory and columns in the row of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BlockKey {
    pub(crate) segment: i64,
    pub(crate) first_row: i64,
    pub(crate) rows: i64,
    pub(crate) start_ns: TimeNs,
    pub(crate) end_ns: TimeNs,
}

impl BlockKey {
    fn sum(&self, directory: &[u8]) -> u32 {
        let mut sum = crc32fast::Hasher::new();
        for field in [self.segment, self.first_row, self.rows, self.start_ns, self.end_ns] {
            sum.update(&field.to_le_bytes());
        }
        sum.update(directory);
        sum.finalize()
    }

    /// Appends the sums to a directory.
    pub(crate) fn append_checksums(&self, directory: &mut Vec<u8>, columns: &[u8]) {
        directory.extend_from_slice(&crc32fast::hash(columns).to_le_bytes());
        let sum = self.sum(directory);
        directory.extend_from_slice(&sum.to_le_bytes());
    }

    /// The directory without its sums, if it is as it was written.
    pub(crate) fn strip_checksums<'a>(&self, directory: &'a [u8]) -> Option<&'a [u8]> {
        let (summed, sum) = directory.split_last_chunk::<4>()?;
        let body = summed.len().checked_sub(SUMS - 4)?;
        (self.sum(summed) == u32::from_le_bytes(*sum)).then(|| &summed[..body])
    }
}

/// Are these the columns that belong to a sealed directory?
pub(crate) fn matches_columns(directory: &[u8], columns: &[u8]) -> bool {
    let sum = directory.len().checked_sub(SUMS).and_then(|at| Bytes(&directory[at..]).read_bytes(4));
    sum.is_some_and(|sum| sum == crc32fast::hash(columns).to_le_bytes())
}
