//! TDMS files of LabVIEW: segments of metadata and raw values, as "TDMS File Format Internal Structure" (NI) describes them.
//!
//! A channel with the properties of a waveform brings its own clock; channels of equal clocks share it.

use super::super::error::RecordingError;
use super::super::input::Input;
use super::super::table::{ColumnCells, ColumnTable, OwnedCell};
use super::bytes::{Bytes, NumberKind};
use crate::bilingual::Bilingual;
use crate::clock::{SECOND_NS, TimeNs};
use std::collections::HashMap;

/// Seconds from 1904-01-01 to 1970-01-01.
const EPOCH_1904_S: i64 = 2_082_844_800;
const HAS_METADATA: u32 = 1 << 1;
const NEW_OBJECTS: u32 = 1 << 2;
const HAS_RAW_DATA: u32 = 1 << 3;
const IS_INTERLEAVED: u32 = 1 << 5;
const IS_BIG_ENDIAN: u32 = 1 << 6;
const IS_DAQMX: u32 = 1 << 7;
const LEAD_IN: usize = 28;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ValueKind {
    Number(NumberKind),
    Text,
    Flag,
    Moment,
    Nothing,
}

impl ValueKind {
    fn of(code: u32) -> Option<Self> {
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

    fn size(self) -> usize {
        match self {
            Self::Number(kind) => kind.size(),
            Self::Flag => 1,
            Self::Moment => 16,
            Self::Text | Self::Nothing => 0,
        }
    }
}

/// How many values of which kind a channel has in each chunk of a segment.
#[derive(Debug, Clone, Copy)]
struct RawIndex {
    kind: ValueKind,
    count: usize,
    /// Of text: bytes altogether.
    bytes: usize,
}

#[derive(Debug, Default)]
struct Channel {
    path: Vec<String>,
    index: Option<RawIndex>,
    values: Values,
    unit: Option<String>,
    increment_s: Option<f64>,
    offset_s: f64,
    start_ns: Option<TimeNs>,
}

#[derive(Debug, Default)]
enum Values {
    #[default]
    None,
    Numbers(Vec<f64>),
    Moments(Vec<TimeNs>),
    Texts(Vec<OwnedCell>),
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Self::None => 0,
            Self::Numbers(values) => values.len(),
            Self::Moments(values) => values.len(),
            Self::Texts(values) => values.len(),
        }
    }
}

#[derive(Debug, Default)]
struct TdmsFile {
    channels: Vec<Channel>,
    known: HashMap<String, usize>,
    /// Channels of the running segment, in the order of their raw data.
    active: Vec<usize>,
}

pub(super) fn open(input: &Input, group: Option<&str>) -> Result<ColumnTable, RecordingError> {
    let bytes = super::whole(input)?;
    let mut file = TdmsFile::default();
    let mut at = 0;
    while at + LEAD_IN <= bytes.len() {
        let damaged = || {
            RecordingError::format(
                &input.file,
                format!("the TDMS file is damaged in the segment at byte {at}: copy it again"),
                format!("TDMS文件在第{at}字节的段损坏：请重新复制"),
            )
        };
        at = file.segment(&bytes, at).map_err(|problem| match problem {
            Problem::Damaged => damaged(),
            Problem::Daqmx => RecordingError::format(
                &input.file,
                "raw data of DAQmx, which is not read: save it as waveforms, or convert it in LabVIEW",
                "DAQmx原始数据，无法读取：请在LabVIEW中另存为波形",
            ),
        })?;
    }
    file.table(input, group)
}

enum Problem {
    Damaged,
    Daqmx,
}

impl TdmsFile {
    /// Reads the segment here; where the next one begins.
    fn segment(&mut self, bytes: &[u8], at: usize) -> Result<usize, Problem> {
        let mut lead = Bytes::new(&bytes[at..], false);
        if lead.take(4) != Some(b"TDSm") {
            return Err(Problem::Damaged);
        }
        let mask = lead.u32().ok_or(Problem::Damaged)?;
        lead.is_big = mask & IS_BIG_ENDIAN != 0;
        let _version = lead.u32();
        let (next, raw) = lead.u64().zip(lead.u64()).ok_or(Problem::Damaged)?;
        let start = at + LEAD_IN;
        // A segment that was not finished has no length: it goes to the end of the file.
        let end = usize::try_from(next)
            .ok()
            .and_then(|next| start.checked_add(next))
            .map_or(bytes.len(), |end| end.min(bytes.len()));
        let raw_at = usize::try_from(raw).ok().and_then(|raw| start.checked_add(raw)).ok_or(Problem::Damaged)?;
        if mask & HAS_METADATA != 0 {
            if mask & NEW_OBJECTS != 0 {
                self.active.clear();
            }
            let metadata = bytes.get(start..raw_at.min(end)).ok_or(Problem::Damaged)?;
            self.metadata(Bytes::new(metadata, lead.is_big))?;
        }
        if mask & HAS_RAW_DATA != 0 {
            if mask & IS_DAQMX != 0 {
                return Err(Problem::Daqmx);
            }
            let data = bytes.get(raw_at..end).ok_or(Problem::Damaged)?;
            self.raw(Bytes::new(data, lead.is_big), mask & IS_INTERLEAVED != 0);
        }
        Ok(end)
    }

    fn metadata(&mut self, mut bytes: Bytes<'_>) -> Result<(), Problem> {
        let count = bytes.u32().ok_or(Problem::Damaged)?;
        for _ in 0..count {
            let path = bytes.text().ok_or(Problem::Damaged)?;
            let index = *self.known.entry(path.clone()).or_insert_with(|| {
                self.channels.push(Channel { path: parts(&path), ..Channel::default() });
                self.channels.len() - 1
            });
            let length = bytes.u32().ok_or(Problem::Damaged)?;
            match length {
                u32::MAX => {}
                0 => self.activate(index),
                0x1269 | 0x1369 => return Err(Problem::Daqmx),
                _ => {
                    let kind = bytes.u32().and_then(ValueKind::of).ok_or(Problem::Damaged)?;
                    let _dimension = bytes.u32();
                    let count = bytes.u64().and_then(|count| usize::try_from(count).ok()).ok_or(Problem::Damaged)?;
                    let size = if kind == ValueKind::Text {
                        bytes.u64().and_then(|size| usize::try_from(size).ok())
                    } else {
                        Some(0)
                    };
                    self.channels[index].index = Some(RawIndex { kind, count, bytes: size.ok_or(Problem::Damaged)? });
                    self.activate(index);
                }
            }
            self.properties(&mut bytes, index).ok_or(Problem::Damaged)?;
        }
        Ok(())
    }

    fn activate(&mut self, index: usize) {
        if !self.active.contains(&index) {
            self.active.push(index);
        }
    }

    fn properties(&mut self, bytes: &mut Bytes<'_>, index: usize) -> Option<()> {
        for _ in 0..bytes.u32()? {
            let name = bytes.text()?;
            let kind = ValueKind::of(bytes.u32()?)?;
            let channel = &mut self.channels[index];
            match kind {
                ValueKind::Text => {
                    let text = bytes.text()?;
                    if name == "unit_string" {
                        channel.unit = Some(text).filter(|unit| !unit.is_empty());
                    }
                }
                ValueKind::Moment => {
                    let at_ns = moment(bytes)?;
                    if name == "wf_start_time" {
                        channel.start_ns = Some(at_ns);
                    }
                }
                ValueKind::Number(kind) => {
                    let value = kind.all(bytes.take(kind.size())?, bytes.is_big).first().copied()?;
                    match name.as_str() {
                        "wf_increment" => channel.increment_s = Some(value).filter(|step_s| *step_s > 0.0),
                        "wf_start_offset" => channel.offset_s = value,
                        _ => {}
                    }
                }
                ValueKind::Flag => {
                    bytes.take(1)?;
                }
                ValueKind::Nothing => {}
            }
        }
        Some(())
    }

    /// Chunks of equal layout follow one another; a last one that is not whole is left out.
    fn raw(&mut self, mut bytes: Bytes<'_>, is_interleaved: bool) {
        let layout: Vec<(usize, RawIndex)> = self
            .active
            .iter()
            .filter_map(|index| Some((*index, self.channels[*index].index?)))
            .filter(|(_, index)| index.count > 0)
            .collect();
        let size = |index: &RawIndex| {
            if index.kind == ValueKind::Text { index.bytes } else { index.kind.size().saturating_mul(index.count) }
        };
        let chunk: usize = layout.iter().map(|(_, index)| size(index)).fold(0, usize::saturating_add);
        if chunk == 0 {
            return;
        }
        while bytes.left.len() >= chunk {
            if is_interleaved {
                let Some(block) = bytes.take(chunk) else { return };
                self.interleaved(block, &layout, bytes.is_big);
                continue;
            }
            for (channel, index) in &layout {
                let Some(part) = bytes.take(size(index)) else { return };
                self.channels[*channel].push(part, *index, bytes.is_big);
            }
        }
    }

    fn interleaved(&mut self, block: &[u8], layout: &[(usize, RawIndex)], is_big: bool) {
        let width: usize = layout.iter().map(|(_, index)| index.kind.size()).sum();
        for row in block.chunks_exact(width.max(1)) {
            let mut bytes = Bytes::new(row, is_big);
            for (channel, index) in layout {
                let Some(part) = bytes.take(index.kind.size()) else { return };
                self.channels[*channel].push(part, RawIndex { count: 1, ..*index }, is_big);
            }
        }
    }

    fn table(self, input: &Input, group: Option<&str>) -> Result<ColumnTable, RecordingError> {
        let groups: Vec<String> = {
            let mut all: Vec<String> = Vec::new();
            for channel in self.channels.iter().filter(|channel| channel.values.len() > 0 && channel.path.len() == 2) {
                if !all.contains(&channel.path[0]) {
                    all.push(channel.path[0].clone());
                }
            }
            all
        };
        let Some(first) = groups.first() else {
            return Err(RecordingError::format(
                &input.file,
                "the TDMS file has no channel with values",
                "TDMS文件没有带数值的通道",
            ));
        };
        let chosen = group.map_or_else(
            || Ok(first.clone()),
            |asked| {
                groups.iter().find(|name| *name == asked).cloned().ok_or_else(|| {
                    let list = groups.join(", ");
                    RecordingError::format(
                        &input.file,
                        format!("there is no group {asked}; there are {list}"),
                        format!("没有组{asked}；现有：{list}"),
                    )
                })
            },
        )?;
        let mut form = vec![Bilingual::new("TDMS", "TDMS")];
        if groups.len() > 1 {
            form.push(Bilingual::new(
                format!("group {chosen} of {}", groups.join(", ")),
                format!("组{chosen}（共有{}）", groups.join("、")),
            ));
        }
        let mut columns: Vec<(String, ColumnCells)> = Vec::new();
        let mut clock: Option<Clock> = None;
        for channel in self
            .channels
            .into_iter()
            .filter(|channel| channel.path.first() == Some(&chosen) && channel.values.len() > 0)
        {
            let own = channel.clock();
            if let Some(own) = own.filter(|own| Some(*own) != clock) {
                columns.push(own.column());
                clock = Some(own);
            }
            let name = channel.path.last().cloned().unwrap_or_default();
            let name = channel.unit.as_ref().map_or_else(|| name.clone(), |unit| format!("{name} [{unit}]"));
            let cells = match channel.values {
                Values::Numbers(values) => ColumnCells::Numbers(values),
                Values::Moments(values) => ColumnCells::Instants(values),
                Values::Texts(values) => ColumnCells::Cells(values),
                Values::None => continue,
            };
            columns.push((name, cells));
        }
        Ok(ColumnTable { columns, form })
    }
}

/// The clock of a waveform.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Clock {
    start_ns: Option<TimeNs>,
    offset_s: f64,
    step_s: f64,
    rows: usize,
}

impl Clock {
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "numbers of rows are far below 2^53; saturates"
    )]
    fn column(self) -> (String, ColumnCells) {
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

impl Channel {
    fn clock(&self) -> Option<Clock> {
        // A waveform that was never started has the beginning of 1904.
        let start_ns = self.start_ns.filter(|at_ns| *at_ns > 0);
        Some(Clock { start_ns, offset_s: self.offset_s, step_s: self.increment_s?, rows: self.values.len() })
    }

    fn push(&mut self, part: &[u8], index: RawIndex, is_big: bool) {
        match index.kind {
            ValueKind::Number(kind) => self.numbers(kind.all(part, is_big)),
            ValueKind::Flag => self.numbers(part.iter().map(|flag| f64::from(u8::from(*flag != 0))).collect()),
            ValueKind::Moment => {
                let mut bytes = Bytes::new(part, is_big);
                let read: Vec<TimeNs> = std::iter::from_fn(|| moment(&mut bytes)).collect();
                match &mut self.values {
                    Values::Moments(values) => values.extend(read),
                    values => *values = Values::Moments(read),
                }
            }
            ValueKind::Text => {
                let read = texts(part, index.count, is_big);
                match &mut self.values {
                    Values::Texts(values) => values.extend(read),
                    values => *values = Values::Texts(read),
                }
            }
            ValueKind::Nothing => {}
        }
    }

    fn numbers(&mut self, read: Vec<f64>) {
        match &mut self.values {
            Values::Numbers(values) => values.extend(read),
            values => *values = Values::Numbers(read),
        }
    }
}

/// `/'group'/'channel'`; a quote within a name is doubled.
fn parts(path: &str) -> Vec<String> {
    let inner = path.trim_start_matches('/');
    if inner.is_empty() {
        return Vec::new();
    }
    inner.split("'/'").map(|part| part.trim_matches('\'').replace("''", "'")).collect()
}

/// Sixteen bytes: fractions of 2^-64 s, then seconds since 1904; in the other order where the bytes are big endian.
fn moment(bytes: &mut Bytes<'_>) -> Option<TimeNs> {
    let (fraction, seconds) = if bytes.is_big {
        let seconds = bytes.i64()?;
        (bytes.u64()?, seconds)
    } else {
        (bytes.u64()?, bytes.i64()?)
    };
    let ns = i64::try_from((u128::from(fraction) * u128::from(SECOND_NS.unsigned_abs())) >> 64).ok()?;
    seconds.checked_sub(EPOCH_1904_S)?.checked_mul(SECOND_NS)?.checked_add(ns)
}

fn texts(part: &[u8], count: usize, is_big: bool) -> Vec<OwnedCell> {
    let mut bytes = Bytes::new(part, is_big);
    let ends: Vec<usize> = (0..count).map_while(|_| usize::try_from(bytes.u32()?).ok()).collect();
    let mut start = 0;
    let text = |end: usize| {
        let text =
            bytes.left.get(start..end).map_or_else(String::new, |text| String::from_utf8_lossy(text).into_owned());
        start = end;
        OwnedCell::text(&text)
    };
    ends.into_iter().map(text).collect()
}
