//! A block: every series of one minute (after compaction: ten minutes), column by column.
//!
//! # Why blocks and not a row per sample
//! Measured with `cargo test --release --test records history::figures::layouts -- --ignored --nocapture` (20 series at 10 Hz); see the
//! figures in the module documentation of [`history`](super). The rows of a minute share one database row: a small
//! directory with the summary of every series, and one compressed stream per series, so that a query reads the series
//! it asks for and an overview reads no samples at all.

mod block_row;
mod cells;
mod checksum;
mod directory;
mod integers;
mod varint;

pub(crate) use block_row::{BLOCK_COLUMNS, StoredBlock};
pub(crate) use cells::Encoding;
pub use cells::{Cells, NumberCells, ValueSummary, WordCells};
pub(crate) use checksum::BlockKey;
pub(crate) use directory::{ByteSpan, Directory, SeriesEntry};

use super::reason::{PRESENT, Reasons};
use super::rows::{Column, SeriesRows, Word};
use super::series::Series;
use adapter_core::clock::TimeNs;
use cells::Scratch;
use varint::Bytes;

/// Streams shorter than this are not worth compressing.
const PACK_FROM: usize = 24;
/// A stream is never longer than this when decompressed: refuses a damaged length before memory is claimed.
const UNPACKED_MAX: usize = 1 << 26;

/// Compression level of fresh blocks.
pub(crate) const LEVEL_FRESH: i32 = 3;
/// Compression level of compacted blocks.
pub(crate) const LEVEL_COMPACT: i32 = 9;

/// A block as it goes into the database.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Block {
    pub(crate) key: BlockKey,
    /// The encoded directory, with its checksums.
    pub(crate) directory: Vec<u8>,
    pub(crate) columns: Vec<u8>,
    /// Series number and summary of every quantity that has a value.
    pub(crate) summaries: Vec<(i64, ValueSummary)>,
}

impl Block {
    pub(crate) fn size_bytes(&self) -> usize {
        self.directory.len() + self.columns.len()
    }
}

/// Turns rows into blocks. Keeps its memory from block to block.
pub(crate) struct Encoder {
    zstd: zstd::bulk::Compressor<'static>,
    scratch: Scratch,
    plain: Vec<u8>,
    integers: Vec<i64>,
}

impl Encoder {
    pub(crate) fn new(level: i32) -> Result<Self, std::io::Error> {
        let mut zstd = zstd::bulk::Compressor::new(level)?;
        // The lengths stand in the directory.
        zstd.include_contentsize(false)?;
        Ok(Self { zstd, scratch: Scratch::default(), plain: Vec::new(), integers: Vec::new() })
    }

    /// The block of `rows`, which must not be empty. Series without a single value or reason take no room.
    pub(crate) fn encode_block(
        &mut self,
        rows: &SeriesRows,
        series: &[Series],
        reasons: &Reasons,
        segment: i64,
        first_row: i64,
    ) -> Block {
        debug_assert!(!rows.at_ns.is_empty() && first_row >= 0, "a block has a row, and rows are numbered from 0");
        debug_assert!(rows.at_ns.is_sorted(), "times of a segment go forward");
        debug_assert!(rows.columns.len() <= series.len(), "every column has its series");
        let mut directory = Directory { rows: rows.len(), ..Directory::default() };
        let mut columns;
        let mut summaries = Vec::new();
        (directory.times, columns) = self.encode_times(&rows.at_ns);
        for (series, column) in series.iter().zip(&rows.columns).filter(|(_, column)| !column.is_unused()) {
            self.plain.clear();
            let written = cells::encode_column(column, rows.len(), series.decimals, &mut self.scratch, &mut self.plain);
            let span = self.pack_plain(&mut columns);
            if written.encoding != Encoding::Words && written.summary.count > 0 {
                summaries.push((series.id, written.summary));
            }
            let cells::SeriesWritten { encoding, summary, any_missing } = written;
            directory.entries.push(SeriesEntry { series: series.id, encoding, any_missing, summary, span });
        }
        debug_assert!(directory.has_adjacent_spans(), "offsets that are not written follow from the lengths");
        debug_assert!(columns.len() == directory.end_offset(), "the spans follow each other up to the end");
        directory.note_words(&codes_in(rows), reasons);
        let key = BlockKey {
            segment,
            first_row,
            rows: rows.len() as i64,
            start_ns: rows.at_ns.first().copied().unwrap_or_default(),
            end_ns: rows.at_ns.last().copied().unwrap_or_default(),
        };
        let mut directory = directory.to_bytes();
        key.append_checksums(&mut directory, &columns);
        Block { key, directory, columns, summaries }
    }

    /// The first stream of a block: the times of its rows.
    pub(crate) fn encode_times(&mut self, at_ns: &[TimeNs]) -> (ByteSpan, Vec<u8>) {
        self.plain.clear();
        self.integers.clear();
        self.integers.extend_from_slice(at_ns);
        integers::encode_integers(&self.integers, &mut self.plain);
        let mut columns = Vec::new();
        (self.pack_plain(&mut columns), columns)
    }

    /// Appends `plain` to `columns`, compressed when that is shorter.
    fn pack_plain(&mut self, columns: &mut Vec<u8>) -> ByteSpan {
        let (offset, unpacked) = (columns.len(), self.plain.len());
        let packed = (unpacked >= PACK_FROM).then(|| self.zstd.compress(&self.plain).ok()).flatten();
        match packed.filter(|packed| packed.len() < unpacked) {
            Some(packed) => columns.extend_from_slice(&packed),
            None => columns.extend_from_slice(&self.plain),
        }
        let span = ByteSpan { offset, stored: columns.len() - offset, unpacked };
        debug_assert!(span.stored <= span.unpacked, "a stream that does not get shorter is stored as it is");
        debug_assert!(span.unpacked <= UNPACKED_MAX, "what is written can be read back");
        span
    }
}

fn codes_in(rows: &SeriesRows) -> [bool; 256] {
    let mut codes = [false; 256];
    for column in &rows.columns {
        match column {
            Column::Numbers { missing, .. } => missing.iter().for_each(|code| codes[usize::from(*code)] = true),
            Column::Words(changes) => changes.iter().for_each(|(_, word)| match word {
                Word::Missing(code) => codes[usize::from(*code)] = true,
                Word::Is(_) => codes[usize::from(PRESENT)] = true,
            }),
        }
    }
    codes
}

/// Turns blocks back into cells, series by series.
pub(crate) struct Decoder {
    zstd: zstd::bulk::Decompressor<'static>,
}

impl Decoder {
    pub(crate) fn new() -> Result<Self, std::io::Error> {
        Ok(Self { zstd: zstd::bulk::Decompressor::new()? })
    }

    /// The times of the rows; `None` when the block is damaged.
    pub(crate) fn decode_times(&mut self, directory: &Directory, columns: &[u8]) -> Option<Vec<TimeNs>> {
        let plain = self.unpack_span(directory.times, columns)?;
        integers::decode_integers(&mut Bytes(&plain), directory.rows)
    }

    /// The cells of one series; `None` when the block is damaged.
    pub(crate) fn decode_cells(&mut self, directory: &Directory, entry: &SeriesEntry, columns: &[u8]) -> Option<Cells> {
        let plain = self.unpack_span(entry.span, columns)?;
        let present = usize::try_from(entry.summary.count).ok().filter(|count| *count <= directory.rows)?;
        cells::decode_cells(&plain, directory.rows, entry.encoding, entry.any_missing, present)
    }

    fn unpack_span<'a>(&mut self, span: ByteSpan, columns: &'a [u8]) -> Option<std::borrow::Cow<'a, [u8]>> {
        let stored = columns.get(span.offset..span.offset.checked_add(span.stored)?)?;
        if span.stored == span.unpacked {
            return Some(stored.into());
        }
        let plain = self.zstd.decompress(stored, span.unpacked.min(UNPACKED_MAX)).ok()?;
        (plain.len() == span.unpacked).then(|| plain.into())
    }
}
