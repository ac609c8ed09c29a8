//! A channel of a TDMS file: how its values are stored, the values, and the clock of a waveform.

use super::super::table::{ColumnCells, OwnedCell};
use super::bytes::{ByteReader, NumberKind};
use super::tdms_scaling::TdmsScaling;
use adapter_core::clock::{SECOND_NS, TimeNs};

/// Seconds from 1904-01-01 to 1970-01-01.
const EPOCH_1904_S: i64 = 2_082_844_800;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ValueKind {
    Number(NumberKind),
    Text,
    Flag,
    Moment,
    Nothing,
}

impl ValueKind {
    pub(super) fn from_code(code: u32) -> Option<Self> {
        use NumberKind::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
        Some(match code {
            0 => Self::Nothing,
            1 => Self::Number(I8),
            2 => Self::Number(I16),
            3 => Self::Number(I32),
            4 => Self::Number(I64),
            5 => Self::Number(U8),
            6 => Self::Number(U16),
            7 => Self::Number(U32),
            8 => Self::Number(U64),
            9 | 0x19 => Self::Number(F32),
            10 | 0x1a => Self::Number(F64),
            0x20 => Self::Text,
            0x21 => Self::Flag,
            0x44 => Self::Moment,
            _ => return None,
        })
    }

    pub(super) fn byte_size(self) -> usize {
        match self {
            Self::Number(kind) => kind.byte_size(),
            Self::Flag => 1,
            Self::Moment => 16,
            Self::Text | Self::Nothing => 0,
        }
    }
}

/// How many values of which kind a channel has in each chunk of a segment.
#[derive(Debug, Clone, Copy)]
pub(super) struct RawIndex {
    pub(super) kind: ValueKind,
    pub(super) count: usize,
    /// Of text: bytes altogether.
    pub(super) bytes: usize,
}

#[derive(Debug, Default)]
pub(super) struct TdmsChannel {
    pub(super) path: Vec<String>,
    pub(super) index: Option<RawIndex>,
    pub(super) values: TdmsValues,
    pub(super) unit: Option<String>,
    pub(super) scaling: TdmsScaling,
    pub(super) increment_s: Option<f64>,
    pub(super) offset_s: f64,
    pub(super) start_ns: Option<TimeNs>,
}

#[derive(Debug, Default)]
pub(super) enum TdmsValues {
    #[default]
    None,
    Numbers(Vec<f64>),
    Moments(Vec<TimeNs>),
    Texts(Vec<OwnedCell>),
}

impl TdmsValues {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::None => 0,
            Self::Numbers(values) => values.len(),
            Self::Moments(values) => values.len(),
            Self::Texts(values) => values.len(),
        }
    }
}

/// The clock of a waveform.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WaveformClock {
    pub(super) start_ns: Option<TimeNs>,
    pub(super) offset_s: f64,
    pub(super) step_s: f64,
    pub(super) rows: usize,
}

impl WaveformClock {
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "numbers of rows are far below 2^53; saturates"
    )]
    pub(super) fn into_column(self) -> (String, ColumnCells) {
        let at_s = |row: usize| self.offset_s + row as f64 * self.step_s;
        match self.start_ns {
            Some(start_ns) => {
                let at_ns = |row: usize| start_ns.saturating_add((at_s(row) * SECOND_NS as f64).round() as i64);
                ("Time".to_owned(), ColumnCells::Instants((0..self.rows).map(at_ns).collect()))
            }
            None => ("Time [s]".to_owned(), ColumnCells::Numbers((0..self.rows).map(at_s).collect())),
        }
    }
}

impl TdmsChannel {
    pub(super) fn build_clock(&self) -> Option<WaveformClock> {
        // A waveform that was never started has the beginning of 1904.
        let start_ns = self.start_ns.filter(|at_ns| *at_ns > 0);
        Some(WaveformClock { start_ns, offset_s: self.offset_s, step_s: self.increment_s?, rows: self.values.len() })
    }

    pub(super) fn push(&mut self, part: &[u8], index: RawIndex, is_big: bool) {
        match index.kind {
            ValueKind::Number(kind) => self.append_numbers(kind.decode_numbers(part, is_big)),
            ValueKind::Flag => self.append_numbers(part.iter().map(|flag| f64::from(u8::from(*flag != 0))).collect()),
            ValueKind::Moment => {
                let mut bytes = ByteReader::new(part, is_big);
                let read: Vec<TimeNs> = std::iter::from_fn(|| read_moment(&mut bytes)).collect();
                match &mut self.values {
                    TdmsValues::Moments(values) => values.extend(read),
                    values => *values = TdmsValues::Moments(read),
                }
            }
            ValueKind::Text => {
                let read = read_texts(part, index.count, is_big);
                match &mut self.values {
                    TdmsValues::Texts(values) => values.extend(read),
                    values => *values = TdmsValues::Texts(read),
                }
            }
            ValueKind::Nothing => {}
        }
    }

    fn append_numbers(&mut self, read: Vec<f64>) {
        match &mut self.values {
            TdmsValues::Numbers(values) => values.extend(read),
            values => *values = TdmsValues::Numbers(read),
        }
    }
}

/// `/'group'/'channel'`; a quote within a name is doubled.
pub(super) fn split_path(path: &str) -> Vec<String> {
    let inner = path.trim_start_matches('/');
    if inner.is_empty() {
        return Vec::new();
    }
    inner.split("'/'").map(|part| part.trim_matches('\'').replace("''", "'")).collect()
}

/// Sixteen bytes: fractions of 2^-64 s, then seconds since 1904; in the other order where the bytes are big endian.
pub(super) fn read_moment(bytes: &mut ByteReader<'_>) -> Option<TimeNs> {
    let (fraction, seconds) = if bytes.is_big {
        let seconds = bytes.i64()?;
        (bytes.u64()?, seconds)
    } else {
        (bytes.u64()?, bytes.i64()?)
    };
    let ns = i64::try_from((u128::from(fraction) * u128::from(SECOND_NS.unsigned_abs())) >> 64).ok()?;
    seconds.checked_sub(EPOCH_1904_S)?.checked_mul(SECOND_NS)?.checked_add(ns)
}

pub(super) fn read_texts(part: &[u8], count: usize, is_big: bool) -> Vec<OwnedCell> {
    let mut bytes = ByteReader::new(part, is_big);
    let ends: Vec<usize> = (0..count).map_while(|_| usize::try_from(bytes.u32()?).ok()).collect();
    let mut start = 0;
    let text = |end: usize| {
        let text =
            bytes.left.get(start..end).map_or_else(String::new, |text| String::from_utf8_lossy(text).into_owned());
        start = end;
        OwnedCell::from_text(&text)
    };
    ends.into_iter().map(text).collect()
}
