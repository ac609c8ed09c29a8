//! Heads that are written by rules of their own: TwinCAT Scope, oscilloscopes of Rigol, two lines of names one above the other.

use super::cell::written_number;
use super::names::ForeignName;
use super::table::OwnedCell;
use adapter_core::channel::unit::{Dimension, Unit};

/// A column that counts samples: time is `start_s + step_s x`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HeadTime {
    pub(super) index: usize,
    pub(super) start_s: f64,
    pub(super) step_s: f64,
}

/// The line of a row in the file, and its cells.
pub(super) type HeadRow = (u64, Vec<OwnedCell>);

/// What such a head says.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct HeadForm {
    pub(super) names: Vec<String>,
    pub(super) units: Vec<Option<String>>,
    /// Line of the names.
    pub(super) line: u64,
    /// Lines that were used.
    pub(super) lines: usize,
    pub(super) time: Option<HeadTime>,
    /// The columns end at different rows, and the rows with them.
    pub(super) short: bool,
}

/// The texts of the cells of a row; nothing where a cell holds neither text nor number.
pub(super) fn extract_texts(cells: &[OwnedCell]) -> Vec<String> {
    let text = |cell: &OwnedCell| match cell {
        OwnedCell::Text(text) => text.split_whitespace().collect::<Vec<_>>().join(" "),
        OwnedCell::Number(number) => number.to_string(),
        _ => String::new(),
    };
    cells.iter().map(text).collect()
}

/// The head of a program that is known, in the lines before the data.
pub(super) fn find_head_form(rows: &[HeadRow]) -> Option<HeadForm> {
    find_scope_head(rows).or_else(|| find_oscilloscope_head(rows))
}

/// TwinCAT Scope. `Name X Name Y`: every second column is the time of the one behind it. `Name X Y`: the first column is the time of all.
/// The unit of the time stands in the line `SampleTime[ms]`, those of the values in the line `Unit`.
fn find_scope_head(rows: &[HeadRow]) -> Option<HeadForm> {
    let texts: Vec<Vec<String>> = rows.iter().map(|(_, cells)| extract_texts(cells)).collect();
    let step = texts.iter().position(|cells| cells.first().is_some_and(|text| text.starts_with("SampleTime")))?;
    let width = texts[step].len();
    let is_names = |cells: &Vec<String>| cells.first().is_some_and(|text| text == "Name") && cells.len() == width;
    let names = texts[..step].iter().rposition(is_names).filter(|_| width >= 2)?;
    let unit = texts[step][0].trim_start_matches("SampleTime").trim_matches(['[', ']', '(', ')']).to_owned();
    let is_paired = width >= 4 && width.is_multiple_of(2) && texts[names].chunks(2).all(|pair| pair[0] == "Name");
    let is_time = |index: usize| if is_paired { index.is_multiple_of(2) } else { index == 0 };
    let units = texts.iter().find(|cells| cells.first().is_some_and(|text| text == "Unit") && cells.len() == width);
    // `W (Power)`: the quantity stands behind the unit.
    let bare = |text: &String| text.split(" (").next().unwrap_or(text).trim().to_owned();
    let unit_of = |index: usize| {
        units.map(|cells| bare(&cells[index])).filter(|unit| !is_time(index) && Unit::from_symbol(unit).is_some())
    };
    let name_of = |index: usize| if is_time(index) { format!("Time [{unit}]") } else { texts[names][index].clone() };
    Some(HeadForm {
        names: (0..width).map(name_of).collect(),
        units: (0..width).map(unit_of).collect(),
        line: rows[names].0,
        lines: 2 + usize::from(units.is_some()),
        time: None,
        short: is_paired,
    })
}

/// `X,CH1,CH2,Start,Increment` above `Sequence,Volt,Volt,-6.0e+00,1.0e-01`: time is Start + X Increment.
fn find_oscilloscope_head(rows: &[HeadRow]) -> Option<HeadForm> {
    let texts: Vec<Vec<String>> = rows.iter().map(|(_, cells)| extract_texts(cells)).collect();
    let names = texts.iter().position(|cells| {
        cells.first().is_some_and(|text| text == "X") && cells.iter().any(|text| text == "Increment")
    })?;
    let start = texts[names].iter().position(|text| text == "Start")?;
    let increment = texts[names].iter().position(|text| text == "Increment")?;
    let below = texts.get(names + 1)?;
    let number = |index: usize| written_number(below.get(index)?)?.parse_value(super::cell::Decimal::Point);
    let (start_s, step_s) = (number(start)?, number(increment).filter(|step_s| *step_s > 0.0)?);
    let width = start.min(increment);
    let is_sequence = below.first().is_some_and(|text| text.eq_ignore_ascii_case("sequence"));
    let unit = |index: usize| below.get(index).filter(|unit| index > 0 && Unit::from_symbol(unit).is_some()).cloned();
    let time = HeadTime { index: 0, start_s, step_s };
    Some(HeadForm {
        names: texts[names][..width].to_vec(),
        units: (0..width).map(unit).collect(),
        line: rows[names].0,
        lines: 2,
        time: Some(if is_sequence { time } else { HeadTime { start_s: 0.0, step_s: 1.0, ..time } }),
        short: false,
    })
}

/// Two lines of names: groups (`Spindle`, over several columns) above what differs within them. They are one where the lower line
/// holds the unit of a name that stands above it, or where names stand twice in it that the upper one tells apart.
pub(super) fn merge_group_line(upper: &[String], lower: &[String]) -> Option<Vec<String>> {
    let is_word = |text: &&String| !text.is_empty() && written_number(text).is_none();
    if upper.iter().filter(|text| !text.is_empty()).count() < 2
        || !upper.iter().filter(|t| !t.is_empty()).all(|t| is_word(&t))
    {
        return None;
    }
    let above = |index: usize| upper.get(index).filter(|text| !text.is_empty());
    let is_unit_of = |index: usize| {
        let (Some(name), Some(unit)) = (above(index), Unit::from_symbol(&lower[index])) else { return false };
        let found = ForeignName::from_text(name, Some(&lower[index]));
        found.find_meaning().is_some() || found.is_time() && unit.dimension == Dimension::Time
    };
    // A group reaches to the next one.
    let group = |index: usize| (0..=index).rev().find_map(above);
    let merged: Vec<String> = (0..lower.len())
        .map(|index| match group(index) {
            Some(name) if is_unit_of(index) => format!("{name} [{}]", lower[index]),
            Some(name) if lower[index].is_empty() => above(index).map_or_else(String::new, |_| name.clone()),
            Some(name) => format!("{name} {}", lower[index]),
            None => lower[index].clone(),
        })
        .collect();
    let repeats = |names: &[String]| {
        (1..names.len()).any(|index| !names[index].is_empty() && names[..index].contains(&names[index]))
    };
    let tells_apart = repeats(lower) && !repeats(&merged);
    (tells_apart || (0..lower.len()).any(is_unit_of)).then_some(merged)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split_line(line: &str) -> Vec<String> {
        line.split(',').map(str::to_owned).collect()
    }

    #[test]
    fn two_lines_are_one_where_they_need_one_another() {
        let merged = merge_group_line(
            &split_line("Zeit,Spindel,,Achse X"),
            &split_line("s,Drehzahl [1/min],Leistung [kW],Strom [A]"),
        );
        let right = "Zeit [s],Spindel Drehzahl [1/min],Spindel Leistung [kW],Achse X Strom [A]";
        assert_eq!(merged, Some(split_line(right)));
        let merged = merge_group_line(&split_line("Time,X,,Y,"), &split_line(",pos,load,pos,load"));
        assert_eq!(merged, Some(split_line("Time,X pos,X load,Y pos,Y load")));
        // A title is no line of names.
        assert_eq!(merge_group_line(&split_line("Operator,Smith,"), &split_line("Zeit,Drehzahl,Leistung")), None);
        assert_eq!(merge_group_line(&split_line("Report,7,"), &split_line("Zeit,n,n")), None);
    }
}
