//! Answers of an MTConnect agent (`sample`, `current`): every data item is a column with a clock of its own.
//!
//! Units are those that the standard gives to a type (MTConnect Part 2): an agent converts into them, and the document does not repeat them.

use super::super::error::RecordingError;
use super::super::input::Input;
use super::super::limits::{CELLS_IN_MEMORY_MAX, COLUMNS_MAX};
use super::super::table::{ColumnCells, ColumnTable, OwnedCell};
use adapter_core::bilingual::Bilingual;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::collections::HashMap;
use std::io::BufReader;

/// Element, the words of our dictionary for it, the unit of the standard.
const TYPES: &[(&str, &str, &str)] = &[
    ("RotaryVelocity", "Spindle speed", "rpm"),
    ("SpindleSpeed", "Spindle speed", "rpm"),
    ("PathFeedrate", "Path feedrate", "mm/s"),
    ("AxisFeedrate", "Axis velocity", "mm/s"),
    ("PathFeedratePerRevolution", "Feed per revolution", "mm/rev"),
    ("Wattage", "Power", "W"),
    ("Amperage", "Current", "A"),
    ("AmperageAC", "Current", "A"),
    ("Voltage", "Voltage", "V"),
    ("VoltageAC", "Voltage", "V"),
    ("Load", "Load", "%"),
    ("Torque", "Torque", "N m"),
    ("Temperature", "Temperature", "°C"),
    ("Position", "Position", "mm"),
    ("Displacement", "Displacement", "mm"),
    ("LinearForce", "Force", "N"),
    ("RotaryVelocityOverride", "Spindle override", "%"),
    ("PathFeedrateOverride", "Feed override", "%"),
    ("Program", "program", ""),
    ("Block", "block", ""),
    ("ControllerMode", "mode", ""),
    ("Execution", "execution", ""),
    ("ToolNumber", "tool", ""),
    ("ToolId", "tool", ""),
];
/// Components that turn the spindle.
const SPINDLES: [&str; 2] = ["Spindle", "Rotary"];

/// The series of one data item.
struct Item {
    name: String,
    times: Vec<OwnedCell>,
    values: Vec<OwnedCell>,
}

#[derive(Default)]
struct Stream {
    items: Vec<Item>,
    known: HashMap<String, usize>,
    component: (String, String),
    /// The observation whose text comes next: its item and time.
    open: Option<(usize, String)>,
    cells: usize,
    is_streams: bool,
}

pub(super) fn open(input: &Input) -> Result<ColumnTable, RecordingError> {
    let mut reader = Reader::from_reader(BufReader::new(input.open()?));
    reader.config_mut().trim_text(true);
    let mut stream = Stream::default();
    let mut buffer = Vec::new();
    loop {
        let event = reader.read_event_into(&mut buffer).map_err(|error| {
            RecordingError::with_format_reason(
                &input.file,
                format!("the XML is broken at byte {}: {error}", reader.error_position()),
                format!("XML在第{}字节处损坏：{error}", reader.error_position()),
            )
        })?;
        match event {
            Event::Start(element) => stream.begin_element(&element),
            Event::Text(text) => stream.record_value(&text),
            Event::End(_) => stream.open = None,
            Event::Eof => break,
            _ => {}
        }
        if stream.cells > CELLS_IN_MEMORY_MAX || stream.items.len() > COLUMNS_MAX {
            return Err(RecordingError::with_format_reason(
                &input.file,
                "more observations than are read at once: ask the agent for less",
                "观测值过多：请减少一次请求的数量",
            ));
        }
        buffer.clear();
    }
    if !stream.is_streams {
        return Err(RecordingError::with_format_reason(
            &input.file,
            "this is XML, but no answer of an MTConnect agent (MTConnectStreams): export the data as CSV",
            "该文件是XML，但不是MTConnect应答（MTConnectStreams）：请导出为CSV",
        ));
    }
    let has_value = |item: &Item| item.values.iter().any(|value| *value != OwnedCell::Empty);
    if !stream.items.iter().any(has_value) {
        return Err(RecordingError::with_format_reason(
            &input.file,
            "an MTConnect document in which every observation is UNAVAILABLE: the machine or its adapter was off",
            "MTConnect文档中所有观测值均为UNAVAILABLE：机床或适配器未连接",
        ));
    }
    let columns = stream.items.into_iter().filter(has_value).flat_map(|item| {
        [("Time".to_owned(), ColumnCells::Cells(item.times)), (item.name, ColumnCells::Cells(item.values))]
    });
    let form = vec![Bilingual::new("MTConnect document", "MTConnect文档")];
    Ok(ColumnTable { columns: columns.collect(), form, ..ColumnTable::default() })
}

impl Stream {
    fn begin_element(&mut self, element: &BytesStart<'_>) {
        self.open = None;
        let tag = element.local_name().as_ref().to_owned();
        let attribute = |name: &str| {
            let found = element.attributes().flatten().find(|attribute| attribute.key.as_ref() == name);
            found.map(|attribute| attribute.value.into_owned())
        };
        match tag.as_str() {
            "MTConnectStreams" => self.is_streams = true,
            "ComponentStream" => {
                self.component = (attribute("component").unwrap_or_default(), attribute("name").unwrap_or_default())
            }
            _ => {
                let (Some(item), Some(time)) = (attribute("dataItemId"), attribute("timestamp")) else { return };
                let name = self.choose_name(&tag, &item, attribute("subType").as_deref());
                let index = *self.known.entry(item).or_insert_with(|| {
                    self.items.push(Item { name, times: Vec::new(), values: Vec::new() });
                    self.items.len() - 1
                });
                self.open = Some((index, time));
            }
        }
    }

    fn record_value(&mut self, text: &str) {
        let Some((index, time)) = self.open.take() else { return };
        let item = &mut self.items[index];
        item.times.push(OwnedCell::from_text(&time));
        item.values.push(if text == "UNAVAILABLE" { OwnedCell::Empty } else { OwnedCell::from_text(text) });
        self.cells += 2;
    }

    /// A name of our dictionary where type and component tell the column, else the item's own.
    fn choose_name(&self, tag: &str, item: &str, sub_type: Option<&str>) -> String {
        let is_actual = sub_type.is_none_or(|sub_type| sub_type.eq_ignore_ascii_case("ACTUAL"));
        let is_spindle = SPINDLES.contains(&self.component.0.as_str());
        let taken = |name: &String| self.items.iter().any(|known| known.name == *name);
        let known = TYPES.iter().find(|(known, ..)| *known == tag).filter(|_| is_actual);
        let unit = TYPES.iter().find(|(known, ..)| *known == tag).map_or("", |(.., unit)| unit);
        let wanted = known.map(|(_, words, unit)| {
            let of_spindle = is_spindle && ["Power", "Current", "Load", "Torque"].contains(words);
            let words = if of_spindle { format!("Spindle {}", words.to_lowercase()) } else { (*words).to_owned() };
            if unit.is_empty() { words } else { format!("{words} [{unit}]") }
        });
        match wanted.filter(|name| !taken(name)) {
            Some(name) => name,
            None if unit.is_empty() => item.to_owned(),
            None => format!("{item} [{unit}]"),
        }
    }
}
