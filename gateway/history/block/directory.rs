//! The directory of a block: which series it holds, where, how, and the summary of each. It is a column of its own, so
//! that deciding whether a block is wanted does not read the samples.

use super::super::reason::Reasons;
use super::super::rounding::{TEN, round_to_integer};
use super::cells::{Encoding, ValueSummary};
use super::varint::{Bytes, append_varint, put_text, unzigzag, zigzag};

/// Version of the block format, the first byte. From 2 on checksums follow the directory: see [`checksum`](super::checksum).
const VERSION: u8 = 2;
const VERSION_UNSEALED: u8 = 1;
/// No block has more rows: refuses a damaged count before memory is claimed.
const ROWS_MAX: usize = 1 << 20;
const PLANES: u8 = 0x40;
const WORDS: u8 = 0x41;
const MISSING: u8 = 0x80;

/// Where the bytes of a series lie and how they are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct ByteSpan {
    pub(crate) offset: usize,
    pub(crate) stored: usize,
    /// Length after decompression; equal to `stored` when the bytes are not compressed.
    pub(crate) unpacked: usize,
}

impl ByteSpan {
    pub(crate) fn end(self) -> usize {
        self.offset + self.stored
    }
}

/// One series of a block.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SeriesEntry {
    pub(crate) series: i64,
    pub(crate) encoding: Encoding,
    pub(crate) any_missing: bool,
    pub(crate) summary: ValueSummary,
    pub(crate) span: ByteSpan,
}

/// What a block holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Directory {
    pub(crate) rows: usize,
    pub(crate) times: ByteSpan,
    pub(crate) entries: Vec<SeriesEntry>,
    /// Estimators' own reasons used in this block: code and word.
    pub(crate) words: Vec<(u8, String)>,
}

impl Directory {
    pub(crate) fn find_entry(&self, series: i64) -> Option<&SeriesEntry> {
        self.entries.iter().find(|entry| entry.series == series)
    }

    /// Does every span begin where the one before ends?
    pub(crate) fn has_adjacent_spans(&self) -> bool {
        let spans: Vec<ByteSpan> = std::iter::once(self.times).chain(self.entries.iter().map(|it| it.span)).collect();
        spans.windows(2).all(|pair| pair[0].end() == pair[1].offset)
    }

    /// Where the last span ends: offsets follow from the lengths.
    pub(crate) fn end_offset(&self) -> usize {
        self.entries.last().map_or(self.times, |entry| entry.span).end()
    }

    /// The directory as bytes. Offsets follow from the lengths and are not written.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        debug_assert!(self.rows <= ROWS_MAX, "no reader takes more rows");
        debug_assert!(self.times.offset == 0, "the times are the first stream");
        let mut out = vec![VERSION];
        append_varint(&mut out, self.rows as u64);
        put_span(&mut out, self.times);
        append_varint(&mut out, self.entries.len() as u64);
        self.entries.iter().for_each(|entry| put_entry(&mut out, entry));
        append_varint(&mut out, self.words.len() as u64);
        for (code, word) in &self.words {
            out.push(*code);
            put_text(&mut out, word);
        }
        out
    }

    /// The directory in `bytes`, without its checksums; `None` when it is of another version or damaged.
    pub(crate) fn parse(bytes: &[u8]) -> Option<Self> {
        let mut bytes = Bytes(bytes);
        if ![VERSION, VERSION_UNSEALED].contains(&bytes.read_byte()?) {
            return None;
        }
        let rows = bytes.read_count().filter(|rows| *rows <= ROWS_MAX)?;
        let mut offset = 0;
        let times = take_span(&mut bytes, &mut offset)?;
        let mut entries = Vec::new();
        for _ in 0..bytes.read_count()? {
            entries.push(take_entry(&mut bytes, &mut offset)?);
        }
        let mut words = Vec::new();
        for _ in 0..bytes.read_count()? {
            words.push((bytes.read_byte()?, bytes.read_text()?.to_owned()));
        }
        Some(Self { rows, times, entries, words })
    }

    /// Notes which own reasons may occur, with their words.
    pub(crate) fn note_words(&mut self, codes: &[bool; 256], reasons: &Reasons) {
        let used = (0..=u8::MAX).filter(|code| codes[usize::from(*code)] && Reasons::is_own(*code));
        self.words = used.filter_map(|code| Some((code, reasons.find_word(code)?.to_owned()))).collect();
    }
}

/// Do checksums follow this directory? Any first byte but that of the older version counts as sealed: a version that was
/// damaged must not switch the check off.
pub(crate) fn is_sealed(bytes: &[u8]) -> bool {
    bytes.first().is_some_and(|version| *version != VERSION_UNSEALED)
}

fn put_span(out: &mut Vec<u8>, span: ByteSpan) {
    append_varint(out, span.stored as u64);
    append_varint(out, span.unpacked as u64);
}

fn take_span(bytes: &mut Bytes<'_>, offset: &mut usize) -> Option<ByteSpan> {
    let span = ByteSpan { offset: *offset, stored: bytes.read_count()?, unpacked: bytes.read_count()? };
    *offset = offset.checked_add(span.stored)?;
    Some(span)
}

fn put_entry(out: &mut Vec<u8>, entry: &SeriesEntry) {
    append_varint(out, zigzag(entry.series));
    let encoding = match entry.encoding {
        Encoding::Scaled(places) => places,
        Encoding::Planes => PLANES,
        Encoding::Words => WORDS,
    };
    out.push(encoding | if entry.any_missing { MISSING } else { 0 });
    append_varint(out, entry.summary.count);
    if entry.summary.count > 0 {
        put_summary(out, entry);
    }
    put_span(out, entry.span);
}

fn put_summary(out: &mut Vec<u8>, entry: &SeriesEntry) {
    let ValueSummary { min, max, mean, .. } = entry.summary;
    match entry.encoding {
        Encoding::Words => {}
        Encoding::Scaled(places) => {
            let scale = TEN[usize::from(places)];
            [min, max].iter().for_each(|value| append_varint(out, zigzag(round_to_integer(value * scale) as i64)));
            out.extend_from_slice(&mean.to_le_bytes());
        }
        Encoding::Planes => [min, max, mean].iter().for_each(|value| out.extend_from_slice(&value.to_le_bytes())),
    }
}

fn take_entry(bytes: &mut Bytes<'_>, offset: &mut usize) -> Option<SeriesEntry> {
    let series = unzigzag(bytes.read_varint()?);
    let byte = bytes.read_byte()?;
    let encoding = match byte & !MISSING {
        PLANES => Encoding::Planes,
        WORDS => Encoding::Words,
        places if usize::from(places) < TEN.len() => Encoding::Scaled(places),
        _ => return None,
    };
    let mut summary = ValueSummary { count: bytes.read_varint()?, ..ValueSummary::default() };
    if summary.count > 0 {
        take_summary(bytes, encoding, &mut summary)?;
    }
    let span = take_span(bytes, offset)?;
    Some(SeriesEntry { series, encoding, any_missing: byte & MISSING != 0, summary, span })
}

fn take_summary(bytes: &mut Bytes<'_>, encoding: Encoding, summary: &mut ValueSummary) -> Option<()> {
    match encoding {
        Encoding::Words => return Some(()),
        Encoding::Scaled(places) => {
            let scale = TEN[usize::from(places)];
            summary.min = unzigzag(bytes.read_varint()?) as f64 / scale;
            summary.max = unzigzag(bytes.read_varint()?) as f64 / scale;
        }
        Encoding::Planes => {
            summary.min = bytes.read_f64()?;
            summary.max = bytes.read_f64()?;
        }
    }
    summary.mean = bytes.read_f64()?;
    Some(())
}
