//! TDMS files of LabVIEW: segments of metadata and raw values, as "TDMS File Format Internal Structure" (NI) describes them.
//!
//! A channel with the properties of a waveform brings its own clock; channels of equal clocks share it.

use super::super::error::RecordingError;
use super::super::input::Input;
use super::super::table::{ColumnCells, ColumnTable};
use super::bytes::ByteReader;
use super::tdms_channel::{RawIndex, TdmsChannel, TdmsValues, ValueKind, WaveformClock, read_moment, split_path};
use super::tdms_scaling::TdmsScaling;
use adapter_core::bilingual::Bilingual;
use std::collections::HashMap;

const HAS_METADATA: u32 = 1 << 1;
const NEW_OBJECTS: u32 = 1 << 2;
const HAS_RAW_DATA: u32 = 1 << 3;
const IS_INTERLEAVED: u32 = 1 << 5;
const IS_BIG_ENDIAN: u32 = 1 << 6;
const IS_DAQMX: u32 = 1 << 7;
const LEAD_IN: usize = 28;

#[derive(Debug, Default)]
struct TdmsFile {
    channels: Vec<TdmsChannel>,
    known: HashMap<String, usize>,
    /// Channels of the running segment, in the order of their raw data.
    active: Vec<usize>,
}

pub(super) fn open(input: &Input, group: Option<&str>) -> Result<ColumnTable, RecordingError> {
    let bytes = super::read_whole(input)?;
    let mut file = TdmsFile::default();
    let mut at = 0;
    while at + LEAD_IN <= bytes.len() {
        let damaged = || {
            RecordingError::with_format_reason(
                &input.file,
                format!("the TDMS file is damaged in the segment at byte {at}: copy it again"),
                format!("TDMS文件在第{at}字节的段损坏：请重新复制"),
            )
        };
        at = file.read_segment(&bytes, at).map_err(|problem| match problem {
            Problem::Damaged => damaged(),
            Problem::Daqmx => RecordingError::with_format_reason(
                &input.file,
                "raw data of DAQmx, which is not read: save it as waveforms, or convert it in LabVIEW",
                "DAQmx原始数据，无法读取：请在LabVIEW中另存为波形",
            ),
        })?;
    }
    file.into_table(input, group)
}

enum Problem {
    Damaged,
    Daqmx,
}

impl TdmsFile {
    /// Reads the segment here; where the next one begins.
    fn read_segment(&mut self, bytes: &[u8], at: usize) -> Result<usize, Problem> {
        let mut lead = ByteReader::new(&bytes[at..], false);
        if lead.take_bytes(4) != Some(b"TDSm") {
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
            self.read_metadata(ByteReader::new(metadata, lead.is_big))?;
        }
        if mask & HAS_RAW_DATA != 0 {
            if mask & IS_DAQMX != 0 {
                return Err(Problem::Daqmx);
            }
            let data = bytes.get(raw_at..end).ok_or(Problem::Damaged)?;
            self.read_raw(ByteReader::new(data, lead.is_big), mask & IS_INTERLEAVED != 0);
        }
        Ok(end)
    }

    fn read_metadata(&mut self, mut bytes: ByteReader<'_>) -> Result<(), Problem> {
        let count = bytes.u32().ok_or(Problem::Damaged)?;
        for _ in 0..count {
            let path = bytes.read_text().ok_or(Problem::Damaged)?;
            let index = *self.known.entry(path.clone()).or_insert_with(|| {
                self.channels.push(TdmsChannel { path: split_path(&path), ..TdmsChannel::default() });
                self.channels.len() - 1
            });
            let length = bytes.u32().ok_or(Problem::Damaged)?;
            match length {
                u32::MAX => {}
                0 => self.activate_channel(index),
                0x1269 | 0x1369 => return Err(Problem::Daqmx),
                _ => {
                    let kind = bytes.u32().and_then(ValueKind::from_code).ok_or(Problem::Damaged)?;
                    let _dimension = bytes.u32();
                    let count = bytes.u64().and_then(|count| usize::try_from(count).ok()).ok_or(Problem::Damaged)?;
                    let size = if kind == ValueKind::Text {
                        bytes.u64().and_then(|size| usize::try_from(size).ok())
                    } else {
                        Some(0)
                    };
                    self.channels[index].index = Some(RawIndex { kind, count, bytes: size.ok_or(Problem::Damaged)? });
                    self.activate_channel(index);
                }
            }
            self.read_properties(&mut bytes, index).ok_or(Problem::Damaged)?;
        }
        Ok(())
    }

    fn activate_channel(&mut self, index: usize) {
        if !self.active.contains(&index) {
            self.active.push(index);
        }
    }

    fn read_properties(&mut self, bytes: &mut ByteReader<'_>, index: usize) -> Option<()> {
        for _ in 0..bytes.u32()? {
            let name = bytes.read_text()?;
            let kind = ValueKind::from_code(bytes.u32()?)?;
            let channel = &mut self.channels[index];
            match kind {
                ValueKind::Text => {
                    let text = bytes.read_text()?;
                    if name == "unit_string" {
                        channel.unit = Some(text).filter(|unit| !unit.is_empty());
                    } else {
                        channel.scaling.accept_text(&name, text);
                    }
                }
                ValueKind::Moment => {
                    let at_ns = read_moment(bytes)?;
                    if name == "wf_start_time" {
                        channel.start_ns = Some(at_ns);
                    }
                }
                ValueKind::Number(kind) => {
                    let value =
                        kind.decode_numbers(bytes.take_bytes(kind.byte_size())?, bytes.is_big).first().copied()?;
                    match name.as_str() {
                        "wf_increment" => channel.increment_s = Some(value).filter(|step_s| *step_s > 0.0),
                        "wf_start_offset" => channel.offset_s = value,
                        name => channel.scaling.accept_number(name, value),
                    }
                }
                ValueKind::Flag => {
                    bytes.take_bytes(1)?;
                }
                ValueKind::Nothing => {}
            }
        }
        Some(())
    }

    /// Chunks of equal layout follow one another; a last one that is not whole is left out.
    fn read_raw(&mut self, mut bytes: ByteReader<'_>, is_interleaved: bool) {
        let layout: Vec<(usize, RawIndex)> = self
            .active
            .iter()
            .filter_map(|index| Some((*index, self.channels[*index].index?)))
            .filter(|(_, index)| index.count > 0)
            .collect();
        let size = |index: &RawIndex| {
            if index.kind == ValueKind::Text { index.bytes } else { index.kind.byte_size().saturating_mul(index.count) }
        };
        let chunk: usize = layout.iter().map(|(_, index)| size(index)).fold(0, usize::saturating_add);
        if chunk == 0 {
            return;
        }
        while bytes.left.len() >= chunk {
            if is_interleaved {
                let Some(block) = bytes.take_bytes(chunk) else { return };
                self.read_interleaved(block, &layout, bytes.is_big);
                continue;
            }
            for (channel, index) in &layout {
                let Some(part) = bytes.take_bytes(size(index)) else { return };
                self.channels[*channel].push(part, *index, bytes.is_big);
            }
        }
    }

    fn read_interleaved(&mut self, block: &[u8], layout: &[(usize, RawIndex)], is_big: bool) {
        let width: usize = layout.iter().map(|(_, index)| index.kind.byte_size()).sum();
        for row in block.chunks_exact(width.max(1)) {
            let mut bytes = ByteReader::new(row, is_big);
            for (channel, index) in layout {
                let Some(part) = bytes.take_bytes(index.kind.byte_size()) else { return };
                self.channels[*channel].push(part, RawIndex { count: 1, ..*index }, is_big);
            }
        }
    }

    /// Groups that have a channel with values, in the order of the file.
    fn list_groups(&self) -> Vec<String> {
        let mut groups: Vec<String> = Vec::new();
        for channel in self.channels.iter().filter(|channel| channel.values.len() > 0 && channel.path.len() == 2) {
            if !groups.contains(&channel.path[0]) {
                groups.push(channel.path[0].clone());
            }
        }
        groups
    }

    /// Scales of the groups and of the file.
    fn list_inherited_scaling(&self) -> Vec<ObjectScaling> {
        let above = self.channels.iter().filter(|object| object.path.len() < 2);
        above.map(|object| ObjectScaling { path: object.path.clone(), scaling: object.scaling.clone() }).collect()
    }

    fn into_table(self, input: &Input, group: Option<&str>) -> Result<ColumnTable, RecordingError> {
        let groups = self.list_groups();
        let chosen = choose_group(&groups, group, input)?;
        let mut form = vec![Bilingual::new("TDMS", "TDMS")];
        if groups.len() > 1 {
            form.push(Bilingual::new(
                format!("group {chosen} of {}", groups.join(", ")),
                format!("组{chosen}（共有{}）", groups.join("、")),
            ));
        }
        let inherited = self.list_inherited_scaling();
        let mut columns: Vec<(String, ColumnCells)> = Vec::new();
        let mut clock: Option<WaveformClock> = None;
        for channel in self
            .channels
            .into_iter()
            .filter(|channel| channel.path.first() == Some(&chosen) && channel.values.len() > 0)
        {
            let own = channel.build_clock();
            if let Some(own) = own.filter(|own| Some(*own) != clock) {
                columns.push(own.into_column());
                clock = Some(own);
            }
            let name = channel.path.last().cloned().unwrap_or_default();
            let name = channel.unit.as_ref().map_or_else(|| name.clone(), |unit| format!("{name} [{unit}]"));
            let cells = match channel.values {
                TdmsValues::Numbers(values) => {
                    let scaled = match find_scaling(&channel.path, &channel.scaling, &inherited) {
                        Some(scaling) => scaling.scale_values(values),
                        None => Ok(values),
                    };
                    ColumnCells::Numbers(scaled.map_err(|kind| {
                        RecordingError::with_format_reason(
                            &input.file,
                            format!("channel {name} holds raw values with a scale of the kind {kind}, which is not computed: save it as scaled waveforms"),
                            format!("通道{name}为原始值，其换算类型{kind}不支持：请保存为已换算的波形"),
                        )
                    })?)
                }
                TdmsValues::Moments(values) => ColumnCells::Instants(values),
                TdmsValues::Texts(values) => ColumnCells::Cells(values),
                TdmsValues::None => continue,
            };
            columns.push((name, cells));
        }
        Ok(ColumnTable { columns, form, ..ColumnTable::default() })
    }
}

/// The scale of a group or of the file.
struct ObjectScaling {
    path: Vec<String>,
    scaling: TdmsScaling,
}

/// The scale of a channel: what it does not say, its group says, and what that does not, the file.
fn find_scaling<'a>(path: &[String], own: &'a TdmsScaling, inherited: &'a [ObjectScaling]) -> Option<&'a TdmsScaling> {
    let of_length = |length: usize| inherited.iter().find(|object| object.path[..] == path[..length]);
    let above = (0..2).rev().filter_map(of_length).map(|object| &object.scaling);
    std::iter::once(own).chain(above).find(|scaling| scaling.says_something())
}

fn choose_group(groups: &[String], asked: Option<&str>, input: &Input) -> Result<String, RecordingError> {
    let Some(first) = groups.first() else {
        return Err(RecordingError::with_format_reason(
            &input.file,
            "the TDMS file has no channel with values",
            "TDMS文件没有带数值的通道",
        ));
    };
    let Some(asked) = asked else { return Ok(first.clone()) };
    groups.iter().find(|name| *name == asked).cloned().ok_or_else(|| {
        let list = groups.join(", ");
        RecordingError::with_format_reason(
            &input.file,
            format!("there is no group {asked}; there are {list}"),
            format!("没有组{asked}；现有：{list}"),
        )
    })
}
