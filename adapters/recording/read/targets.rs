//! Which column of a file becomes which of ours: by a map, by our own names, by a foreign name that leaves no doubt.

use super::clock::ForeignColumns;
use super::error::RecordingError;
use super::mapping::ColumnMapping;
use super::names::{ForeignName, find_unit_conversion};
use super::note::{Note, NoteKind};
use super::plan::TimePlan;
use super::survey::ColumnSurvey;
use crate::TEXT_COLUMNS;
use adapter_core::channel::unit::Unit;
use adapter_core::channel::{ChannelId, quantity};
use std::collections::BTreeMap;

/// Which column of the table becomes which of ours, in the order of the table.
pub(super) fn find_targets(
    columns: &ForeignColumns<'_>,
    clocks: &[TimePlan],
    is_contract: bool,
    notes: &mut Vec<Note>,
) -> Result<Vec<(usize, ColumnTarget)>, RecordingError> {
    let of_time = |index: &usize| {
        clocks.iter().any(|clock| clock.uses_column(*index))
            || is_contract && ["time_s", "time_utc"].contains(&columns.names[*index].text.as_str())
    };
    unknown_mappings(columns)?;
    let mut all: Vec<(usize, ColumnTarget)> = Vec::new();
    for index in (0..columns.names.len()).filter(|index| !of_time(index)) {
        if let Some(target) = find_target(columns, index, is_contract, notes)? {
            all.push((index, target));
        }
    }
    resolve_duplicates(columns, &mut all, notes)?;
    Ok(all)
}

/// A column's place in the recording.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ColumnTarget {
    pub(super) name: String,
    pub(super) factor: f64,
    pub(super) offset: f64,
    /// The unit that factor and offset begin from, where one is known.
    pub(super) unit: Option<String>,
    /// Found by its foreign name, not by a map and not by ours.
    pub(super) is_guess: bool,
}

/// ForeignColumns that a map names and the file does not have.
fn unknown_mappings(columns: &ForeignColumns<'_>) -> Result<(), RecordingError> {
    let has = |mapped: &&ColumnMapping| {
        columns.names.iter().enumerate().any(|(index, name)| {
            columns.mapping.find_column(&name.text, index).is_some_and(|found| found.from == mapped.from)
        })
    };
    let Some(lost) = columns.mapping.column.iter().find(|mapped| !has(mapped)) else { return Ok(()) };
    let known: Vec<&str> = columns.names.iter().map(|name| name.text.as_str()).collect();
    let near = adapter_core::channel::find_nearest_name(&lost.from, known);
    let hint = near.map_or_else(String::new, |near| format!("; did you mean {near}?"));
    Err(columns.build_header_error(
        format!("the map names a column {:?}, which the file does not have{hint}", lost.from),
        format!("映射文件中的列{:?}在文件中不存在", lost.from),
    ))
}

fn find_target(
    columns: &ForeignColumns<'_>,
    index: usize,
    is_contract: bool,
    notes: &mut Vec<Note>,
) -> Result<Option<ColumnTarget>, RecordingError> {
    let name = &columns.names[index];
    let survey = &columns.surveys[index];
    if let Some(mapped) = columns.mapping.find_column(&name.text, index) {
        return mapped_target(columns, index, mapped);
    }
    if name.text.is_empty() {
        if survey.count_filled() > 0 && !survey.counts_rows() {
            notes.push(Note::new(
                NoteKind::Loss,
                format!("column {} has no name and is left out", index + 1),
                format!("第{}列没有列名，未读取", index + 1),
            ));
        }
        return Ok(None);
    }
    let own = own_target(name);
    let is_ours = ChannelId::from_name(&name.text).is_some() || TEXT_COLUMNS.contains(&name.text.as_str());
    if is_ours || is_contract {
        if ChannelId::from_name(&name.text).is_some() {
            unit_agrees(columns, index)?;
        }
        return Ok(Some(own));
    }
    match name.find_meaning() {
        Some(ours) => {
            let (factor, offset) = name.find_conversion(ours).unwrap_or((1.0, 0.0));
            Ok(Some(ColumnTarget { name: ours.to_owned(), factor, offset, unit: name.unit.clone(), is_guess: true }))
        }
        None => {
            note_doubt(name, survey, notes);
            Ok(Some(own))
        }
    }
}

/// A column under its own name, as it stands there.
fn own_target(name: &ForeignName) -> ColumnTarget {
    ColumnTarget { name: name.text.clone(), factor: 1.0, offset: 0.0, unit: name.unit.clone(), is_guess: false }
}

/// One of ours whose line of units says another unit.
fn unit_agrees(columns: &ForeignColumns<'_>, index: usize) -> Result<(), RecordingError> {
    let (name, said) = (&columns.names[index].text, &columns.head.units[index]);
    let (Some(own), Some(said)) = (quantity::unit_of(name).and_then(Unit::from_symbol), said.as_deref()) else {
        return Ok(());
    };
    let bare = said.trim_matches(['(', ')', '[', ']']);
    match Unit::from_symbol(bare).and_then(|said| said.compute_conversion(own)) {
        Some((factor, offset)) if (factor - 1.0).abs() < 1e-9 && offset.abs() < 1e-9 => Ok(()),
        // A feed per revolution is often written as a length.
        None if quantity::unit_of(name) == Some("mm/rev") && bare == "mm" || bare == "-" || bare == "1" => Ok(()),
        _ => {
            let own = quantity::unit_of(name).unwrap_or_default();
            Err(columns.build_header_error(
                format!("column {name}: its name says {own}, the line of units says {bare}: rename the column, or say the unit in a map"),
                format!("列{name}：列名表示单位{own}，单位行为{bare}：请改列名，或在映射文件中指定单位"),
            ))
        }
    }
}

fn mapped_target(
    columns: &ForeignColumns<'_>,
    index: usize,
    mapped: &ColumnMapping,
) -> Result<Option<ColumnTarget>, RecordingError> {
    if mapped.to.is_empty() {
        return Ok(None);
    }
    let name = &columns.names[index];
    let unit = mapped.unit.as_deref().or(name.unit.as_deref());
    let own = quantity::unit_of(&mapped.to);
    let (factor, offset) = match (find_unit_conversion(unit, &mapped.to), unit, own) {
        (Some(found), ..) => found,
        (None, None, _) | (None, Some(_), None) => (1.0, 0.0),
        (None, Some(unit), Some(own)) => {
            return Err(columns.build_header_error(
                format!("column {}: {unit} cannot become {} in {own}: these are different quantities, or a unit that is not known", name.text, mapped.to),
                format!("列{}：单位{unit}无法换算为{}（{own}）：物理量不同或单位未知", name.text, mapped.to),
            ));
        }
    };
    let scale = mapped.scale.unwrap_or(1.0);
    let target = ColumnTarget {
        name: mapped.to.clone(),
        factor: factor * scale,
        offset: offset * scale + mapped.offset.unwrap_or(0.0),
        unit: unit.map(str::to_owned),
        is_guess: false,
    };
    Ok(Some(target))
}

/// A name that may mean one of ours: a person has to say.
fn note_doubt(name: &ForeignName, survey: &ColumnSurvey, notes: &mut Vec<Note>) {
    let candidates = name.list_candidates();
    let Some(first) = candidates.first().filter(|_| survey.count_filled() > 0) else { return };
    let list = candidates.iter().take(3).copied().collect::<Vec<_>>();
    let why = if name.unit.is_none() && candidates.len() == 1 { "it has no unit" } else { "that is not sure" };
    notes.push(Note::new(
        NoteKind::Doubt,
        format!(
            "{}: may be {} ({why}); kept under its own name. A map says it: cnc-gateway recording map",
            name.text,
            list.join(" or ")
        ),
        format!(
            "{}：可能是{}，不能确定，保留原名。可用映射文件指定：cnc-gateway recording map",
            name.text,
            list.join("或")
        ),
    ));
    let _ = first;
}

/// Two columns that would get the same name: guesses give way to their own names, and names that stand twice in the file get their place.
/// A map that names one twice is refused.
fn resolve_duplicates(
    columns: &ForeignColumns<'_>,
    all: &mut [(usize, ColumnTarget)],
    notes: &mut Vec<Note>,
) -> Result<(), RecordingError> {
    let is_mapped = |index: usize| columns.mapping.find_column(&columns.names[index].text, index).is_some();
    for (name, places) in list_duplicates(all) {
        let mapped: Vec<usize> = places.iter().map(|place| all[*place].0).filter(|index| is_mapped(*index)).collect();
        if let [_, second, ..] = mapped[..] {
            return Err(columns.build_header_error(
                format!(
                    "column {name} appears twice: say in the map which one is meant by its place (from = \"#{}\")",
                    second + 1
                ),
                format!("列{name}出现两次：请在映射文件中用列号指定（from = \"#{}\"）", second + 1),
            ));
        }
        let guesses: Vec<usize> = places.iter().copied().filter(|place| all[*place].1.is_guess).collect();
        if guesses.is_empty() {
            continue;
        }
        let texts: Vec<&str> = places.iter().map(|place| columns.names[all[*place].0].text.as_str()).collect();
        notes.push(Note::new(
            NoteKind::Doubt,
            format!(
                "{} could all be {name}: each keeps its own name. A map says which: cnc-gateway recording map",
                texts.join(" and ")
            ),
            format!("{}都可能是{name}：均保留原名。请用映射文件指定：cnc-gateway recording map", texts.join("和")),
        ));
        for place in guesses {
            all[place].1 = own_target(&columns.names[all[place].0]);
        }
    }
    for (name, places) in list_duplicates(all) {
        let unmapped: Vec<usize> = places.into_iter().filter(|place| !is_mapped(all[*place].0)).collect();
        let mut kept = Vec::new();
        for place in unmapped {
            let (index, target) = &mut all[place];
            target.name = format!("{name} #{}", *index + 1);
            kept.push(target.name.clone());
        }
        notes.push(Note::new(
            NoteKind::Doubt,
            format!("{name} stands more than once in the file: kept as {}. A map says what each is: cnc-gateway recording map", kept.join(" and ")),
            format!("{name}在文件中出现多次：保留为{}。请用映射文件指定：cnc-gateway recording map", kept.join("和")),
        ));
    }
    match list_duplicates(all).pop_first() {
        Some((name, _)) => {
            Err(columns.build_header_error(format!("column {name} appears twice"), format!("列{name}出现两次")))
        }
        None => Ok(()),
    }
}

/// Names that more than one column would get, with the places of these.
fn list_duplicates(all: &[(usize, ColumnTarget)]) -> BTreeMap<String, Vec<usize>> {
    let mut by_name: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (place, (_, target)) in all.iter().enumerate() {
        by_name.entry(target.name.clone()).or_default().push(place);
    }
    by_name.retain(|_, places| places.len() > 1);
    by_name
}
