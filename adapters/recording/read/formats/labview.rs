//! LabVIEW measurement files (`.lvm`): a head of keys, a second one for the channels, then tables of tabs or commas.
//!
//! Keys and their meaning: "Specification for the LabVIEW Measurement File (.lvm)", NI. Where the file has no column of time, the rows
//! follow one another by `Delta_X`.

use super::super::cell::Cell;
use super::super::error::RecordingError;
use super::super::input::Input;
use super::super::limits::CELLS_IN_MEMORY_MAX;
use super::super::moment::{DateOrder, written_moment};
use super::super::separator::Separator;
use super::super::table::{MemoryTable, OwnedCell, Table, VisitStep};
use super::super::text::TextTable;
use adapter_core::bilingual::Bilingual;
use adapter_core::clock::{SECOND_NS, TimeNs};

const END: &str = "***End_of_Header***";

/// What the heads say.
#[derive(Debug, Default)]
struct LvmHead {
    ends: u64,
    units: Vec<String>,
    delta_s: Option<f64>,
    x0_s: f64,
    no_x: bool,
    /// Times are counted from the date and time of the head.
    is_relative: bool,
    date: String,
    time: String,
}

pub(super) fn open(input: Input) -> Result<MemoryTable, RecordingError> {
    let separator = if input.read_head(400)?.windows(9).any(|part| part == b"Separator") && has_comma_key(&input)? {
        b','
    } else {
        b'\t'
    };
    let file = input.file.clone();
    let mut text = TextTable::new(input, None, Some(Separator::Sign(separator)))?;
    text.short = true;
    let mut head = LvmHead::default();
    let mut table = MemoryTable::default();
    let mut cells = 0;
    let mut named = false;
    let mut row_number = 0_u32;
    let mut of_time: Vec<usize> = Vec::new();
    text.visit_rows(&mut |row| {
        let words: Vec<&str> =
            row.cells.iter().map(|cell| if let Cell::Text(text) = cell { *text } else { "" }).collect();
        let first = words.first().copied().unwrap_or("");
        if first == END {
            head.ends += 1;
            return Ok(VisitStep::Next);
        }
        let is_key = row.cells.len() > 1 && !first.is_empty() && first.chars().all(|c| c.is_alphanumeric() || c == '_');
        if !named && first != "X_Value" {
            if is_key {
                head.accept_key(first, &words[1..]);
            }
            return Ok(VisitStep::Next);
        }
        if first == "X_Value" {
            if named {
                return Ok(VisitStep::Enough);
            }
            named = true;
            of_time = (0..words.len()).filter(|place| words[*place] == "X_Value").collect();
            table.rows.extend(head.header_rows(row.line, &words));
            return Ok(VisitStep::Next);
        }
        let mut owned: Vec<OwnedCell> = words.iter().map(|word| OwnedCell::from_text(word)).collect();
        if head.no_x {
            owned[0] = head
                .delta_s
                .map_or(OwnedCell::Empty, |delta_s| OwnedCell::Number(head.x0_s + f64::from(row_number) * delta_s));
        }
        row_number += 1;
        for place in &of_time {
            if let Some(cell) = owned.get_mut(*place) {
                *cell = head.convert_time_cell(std::mem::replace(cell, OwnedCell::Empty));
            }
        }
        cells += owned.len();
        table.rows.push((row.line, owned));
        if cells > CELLS_IN_MEMORY_MAX {
            return Err(RecordingError::with_format_reason(
                &file,
                "more values than are read at once: export it in parts",
                "数据过多：请分成几个文件导出",
            ));
        }
        Ok(VisitStep::Next)
    })?;
    if !named {
        return Err(no_names(&file));
    }
    table.form = text.describe_form().into_iter().filter(|form| form.en != "tab").collect();
    table.form.insert(0, Bilingual::new("LabVIEW measurement file", "LabVIEW测量文件"));
    Ok(table)
}

fn no_names(file: &str) -> RecordingError {
    RecordingError::with_format_reason(
        file,
        "a LabVIEW measurement file without a line X_Value: export it with a header (one, or one per packet)",
        "LabVIEW测量文件缺少X_Value行：请带表头导出",
    )
}

fn has_comma_key(input: &Input) -> Result<bool, RecordingError> {
    let head = String::from_utf8_lossy(&input.read_head(400)?).into_owned();
    Ok(head.lines().any(|line| line.starts_with("Separator") && line.to_lowercase().contains("comma")))
}

impl LvmHead {
    fn accept_key(&mut self, key: &str, values: &[&str]) {
        let number = |text: &&str| text.replace(',', ".").parse::<f64>().ok();
        match key {
            "X_Columns" => self.no_x = values.first().is_some_and(|value| value.eq_ignore_ascii_case("no")),
            "Y_Unit_Label" => self.units = values.iter().map(|value| (*value).to_owned()).collect(),
            "Delta_X" => self.delta_s = values.first().and_then(number),
            "Time_Pref" => {
                self.is_relative = values.first().is_some_and(|value| value.eq_ignore_ascii_case("relative"))
            }
            "Date" => self.date = values.first().map_or_else(String::new, |value| (*value).to_owned()),
            "Time" => self.time = values.first().map_or_else(String::new, |value| (*value).to_owned()),
            "X0" => self.x0_s = values.first().and_then(number).unwrap_or(0.0),
            _ => {}
        }
    }

    /// When the times begin, on the clock of the place.
    fn start_ns(&self) -> Option<TimeNs> {
        let moment = written_moment(&format!("{} {}", self.date, self.time)).filter(|_| self.is_relative)?;
        moment.local_ns(DateOrder::DayFirst)
    }

    /// A cell of time as a moment, where the beginning is known.
    fn convert_time_cell(&self, cell: OwnedCell) -> OwnedCell {
        let Some(start_ns) = self.start_ns() else { return cell };
        let seconds = match &cell {
            OwnedCell::Number(seconds) => Some(*seconds),
            OwnedCell::Text(text) => text.replace(',', ".").parse::<f64>().ok(),
            _ => None,
        };
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        seconds.map_or(cell, |seconds| {
            OwnedCell::Local(start_ns.saturating_add((seconds * SECOND_NS as f64).round() as i64))
        })
    }

    /// The names, their time columns with a unit, and the units of the channels behind them.
    fn header_rows(&self, line: u64, names: &[&str]) -> Vec<(u64, Vec<OwnedCell>)> {
        let mut channel = 0;
        let cell = |name: &&str| {
            let text = match *name {
                "X_Value" if self.start_ns().is_some() => "X_Value".to_owned(),
                "X_Value" => "X_Value [s]".to_owned(),
                "Comment" | "" => (*name).to_owned(),
                name => {
                    let unit = self.units.get(channel).filter(|unit| !unit.is_empty());
                    channel += 1;
                    unit.map_or_else(|| name.to_owned(), |unit| format!("{name} [{unit}]"))
                }
            };
            OwnedCell::from_text(&text)
        };
        vec![(line, names.iter().map(cell).collect())]
    }
}
