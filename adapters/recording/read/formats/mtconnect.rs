//! Answers of an MTConnect agent (`sample`, `current`): every data item is a column with a clock of its own.
//!
//! Units are those that the standard gives to a type (MTConnect Part 2): an agent converts into them, and the document does not repeat them.

use super::super::error::RecordingError;
use super::super::input::Input;
use super::super::limits::{CELLS_IN_MEMORY_MAX, COLUMNS_MAX};
use super::super::table::{ColumnCells, ColumnTable, OwnedCell};
use adapter_core::bilingual::Bilingual;
use mtconnect::standard::find_type;
use mtconnect::streams::{Observation, StreamsEvent, StreamsReader, UNAVAILABLE};
use std::collections::HashMap;
use std::io::BufReader;

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
    cells: usize,
}

pub(super) fn open(input: &Input) -> Result<ColumnTable, RecordingError> {
    let mut reader = StreamsReader::new(BufReader::new(input.open()?));
    let mut stream = Stream::default();
    loop {
        let event = reader.read_event().map_err(|error| {
            RecordingError::with_format_reason(
                &input.file,
                error.to_string(),
                format!("XML在第{}字节处损坏：{}", error.at, error.what),
            )
        })?;
        match event {
            Some(StreamsEvent::Observation(observation)) => stream.record_observation(&observation),
            Some(StreamsEvent::Header(_) | StreamsEvent::Error { .. }) => {}
            None => break,
        }
        if stream.cells > CELLS_IN_MEMORY_MAX || stream.items.len() > COLUMNS_MAX {
            return Err(RecordingError::with_format_reason(
                &input.file,
                "more observations than are read at once: ask the agent for less",
                "观测值过多：请减少一次请求的数量",
            ));
        }
    }
    if reader.root() != Some("MTConnectStreams") {
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
    fn record_observation(&mut self, observation: &Observation) {
        let index = match self.known.get(&observation.item) {
            Some(index) => *index,
            None => {
                let name = self.choose_name(observation);
                self.known.insert(observation.item.clone(), self.items.len());
                self.items.push(Item { name, times: Vec::new(), values: Vec::new() });
                self.items.len() - 1
            }
        };
        if observation.text.is_empty() {
            return;
        }
        let (item, text) = (&mut self.items[index], observation.text.as_str());
        item.times.push(OwnedCell::from_text(&observation.timestamp));
        item.values.push(if text == UNAVAILABLE { OwnedCell::Empty } else { OwnedCell::from_text(text) });
        self.cells += 2;
    }

    /// A name of our dictionary where type and component tell the column, else the item's own.
    fn choose_name(&self, observation: &Observation) -> String {
        let item = observation.item.as_str();
        let is_actual = observation.sub_type.as_ref().is_none_or(|sub_type| sub_type.eq_ignore_ascii_case("ACTUAL"));
        let is_spindle = SPINDLES.contains(&observation.component.as_str());
        let taken = |name: &String| self.items.iter().any(|known| known.name == *name);
        let known = find_type(&observation.element);
        let unit = known.map_or("", |known| known.unit);
        let wanted = known.filter(|_| is_actual).map(|known| {
            let of_spindle = is_spindle && ["Power", "Current", "Load", "Torque"].contains(&known.words);
            let words =
                if of_spindle { format!("Spindle {}", known.words.to_lowercase()) } else { known.words.to_owned() };
            if unit.is_empty() { words } else { format!("{words} [{unit}]") }
        });
        match wanted.filter(|name| !taken(name)) {
            Some(name) => name,
            None if unit.is_empty() => item.to_owned(),
            None => format!("{item} [{unit}]"),
        }
    }
}
