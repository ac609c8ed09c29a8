//! From the survey of a table to a plan: names, units, decimal signs, kinds. What cannot be told is refused with the line and the cure;
//! what is assumed is said.

use super::cell::{Decimal, flag_words};
use super::clock::Columns;
use super::error::RecordingError;
use super::head::Head;
use super::mapping::{ColumnMapping, Mapping};
use super::names::{ForeignName, conversion};
use super::plan::{BlockPlan, Note, NoteKind, PlannedColumn, PlannedKind, ReadPlan, TimePlan};
use super::survey::{ColumnSurvey, Survey};
use crate::bilingual::Bilingual;
use crate::channel::unit::Unit;
use crate::channel::{ChannelId, Kind, quantity};
use crate::recording::TEXT_COLUMNS;
use std::collections::BTreeMap;

/// Makes the plan.
pub(super) fn understand(
    head: &Head,
    survey: &Survey,
    mapping: &Mapping,
    file: &str,
) -> Result<ReadPlan, RecordingError> {
    let names: Vec<ForeignName> =
        head.names.iter().zip(&head.units).map(|(name, unit)| ForeignName::of(name, unit.as_deref())).collect();
    let mut columns = Columns {
        file,
        head,
        names: &names,
        surveys: &survey.columns,
        mapping,
        decimal: mapping.decimal.and_then(decimal_named),
    };
    columns.decimal = columns.decimal.or_else(|| decimal_of_file(&survey.columns));
    let is_contract = head.names.iter().any(|name| ["time_s", "time_utc"].contains(&name.as_str()));
    let mut notes = Vec::new();
    form_notes(head, &columns, survey, &mut notes);
    let clocks = columns.clocks(&mut notes)?;
    let targets = targets(&columns, &clocks, is_contract, &mut notes)?;
    let mut blocks: Vec<BlockPlan> = clocks.into_iter().map(|time| BlockPlan { time, columns: Vec::new() }).collect();
    for (index, target) in targets {
        let planned = planned(&columns, index, target, is_contract, &mut notes)?;
        // Each column goes with the last clock before it.
        let block = blocks.iter().rposition(|block| block.time.index < index).unwrap_or(0);
        blocks[block].columns.push(planned);
    }
    blocks.retain(|block| !block.columns.is_empty());
    if blocks.is_empty() {
        return Err(columns.wrong("there is no column besides the time".to_owned(), "除时间外没有其他列".to_owned()));
    }
    Ok(ReadPlan { blocks, is_contract, notes })
}

fn decimal_named(sign: char) -> Option<Decimal> {
    match sign {
        '.' => Some(Decimal::Point),
        ',' => Some(Decimal::Comma),
        _ => None,
    }
}

/// The sign that more columns use beyond doubt.
fn decimal_of_file(columns: &[ColumnSurvey]) -> Option<Decimal> {
    let points = columns.iter().filter(|column| column.point > column.comma).count();
    let commas = columns.iter().filter(|column| column.comma > column.point).count();
    match points.cmp(&commas) {
        std::cmp::Ordering::Greater => Some(Decimal::Point),
        std::cmp::Ordering::Less => Some(Decimal::Comma),
        std::cmp::Ordering::Equal => None,
    }
}

/// The decimal sign of a column; `None` where it holds no written number.
pub(super) fn decimal_of(columns: &Columns<'_>, index: usize) -> Result<Option<Decimal>, RecordingError> {
    let survey = &columns.surveys[index];
    let name = &columns.names[index].text;
    if columns.mapping.decimal.is_some() {
        return Ok(columns.decimal);
    }
    match (&survey.point_example, &survey.comma_example) {
        (Some(point), Some(comma)) => Err(RecordingError::Header {
            file: columns.file.to_owned(),
            line: point.line.max(comma.line),
            reason: Bilingual::new(
                format!(
                    "column {name} has numbers of both decimal signs, {:?} on line {} and {:?} on line {}: correct the cells, or say which sign it is in a \
                     map (decimal = \",\")",
                    point.text, point.line, comma.text, comma.line
                ),
                format!(
                    "列{name}中两种小数符号混用：第{}行为{:?}，第{}行为{:?}：请改正单元格，或在映射文件中指定（decimal = \",\"）",
                    point.line, point.text, comma.line, comma.text
                ),
            ),
        }),
        (Some(_), None) => Ok(Some(Decimal::Point)),
        (None, Some(_)) => Ok(Some(Decimal::Comma)),
        (None, None) if survey.point_or_thousands + survey.comma_or_thousands == 0 => Ok(Some(Decimal::Point)),
        (None, None) => match (columns.decimal, survey.point_or_thousands > 0, survey.comma_or_thousands > 0) {
            (Some(decimal), ..) => Ok(Some(decimal)),
            // 1.250 and nothing that speaks against a point: as the contract writes it.
            (None, true, false) => Ok(Some(Decimal::Point)),
            _ => Err(columns.wrong(
                format!("column {name}: 1,250 may be one and a quarter or twelve hundred and fifty: say which sign is the decimal one in a map (decimal = \",\" or \".\")"),
                format!("列{name}：1,250可能是一又四分之一，也可能是一千二百五十：请在映射文件中指定小数符号（decimal = \",\"或\".\"）"),
            )),
        },
    }
}

fn form_notes(head: &Head, columns: &Columns<'_>, survey: &Survey, notes: &mut Vec<Note>) {
    let mut say = |en: String, zh: String| notes.push(Note::new(NoteKind::Assumption, en, zh));
    let uses_comma = survey.columns.iter().any(|column| column.comma > 0) || columns.mapping.decimal == Some(',');
    if uses_comma {
        say("decimal comma".to_owned(), "小数点为逗号".to_owned());
    }
    if head.other_lines > 0 {
        let count = head.other_lines;
        let lines = if count == 1 { "line" } else { "lines" };
        say(format!("{count} {lines} before the names left out"), format!("列名前有{count}行说明，未读取"));
    }
    if head.line > 1 {
        say(format!("names on line {}", head.line), format!("列名在第{}行", head.line));
    }
    if head.has_units {
        say("a line of units".to_owned(), "有一行单位".to_owned());
    }
    for index in 0..columns.names.len() {
        let survey = &columns.surveys[index];
        let groups = survey.point_or_thousands + survey.comma_or_thousands;
        let name = &columns.names[index].text;
        if groups > 0
            && columns.decimal.is_some()
            && survey.point + survey.comma == 0
            && survey.whole > 0
            && columns.decimal != Some(Decimal::Point)
        {
            say(format!("{name}: a point sets thousands apart"), format!("{name}：点号为千位分隔符"));
        }
    }
}

/// Which column of the table becomes which of ours, in the order of the table.
fn targets(
    columns: &Columns<'_>,
    clocks: &[TimePlan],
    is_contract: bool,
    notes: &mut Vec<Note>,
) -> Result<Vec<(usize, Target)>, RecordingError> {
    let of_time = |index: &usize| {
        clocks
            .iter()
            .any(|clock| clock.index == *index || clock.date == Some(*index) || clock.milliseconds == Some(*index))
            || is_contract && ["time_s", "time_utc"].contains(&columns.names[*index].text.as_str())
    };
    unknown_mappings(columns)?;
    let mut all: Vec<(usize, Target)> = Vec::new();
    for index in (0..columns.names.len()).filter(|index| !of_time(index)) {
        if let Some(target) = target(columns, index, is_contract, notes)? {
            all.push((index, target));
        }
    }
    duplicates(columns, &mut all, notes)?;
    Ok(all)
}

/// A column's place in the recording.
#[derive(Debug, Clone, PartialEq)]
struct Target {
    name: String,
    factor: f64,
    offset: f64,
    /// Found by its foreign name, not by a map and not by ours.
    is_guess: bool,
}

/// Columns that a map names and the file does not have.
fn unknown_mappings(columns: &Columns<'_>) -> Result<(), RecordingError> {
    let has = |mapped: &&ColumnMapping| {
        columns.names.iter().enumerate().any(|(index, name)| {
            columns.mapping.column(&name.text, index).is_some_and(|found| found.from == mapped.from)
        })
    };
    let Some(lost) = columns.mapping.column.iter().find(|mapped| !has(mapped)) else { return Ok(()) };
    let known: Vec<&str> = columns.names.iter().map(|name| name.text.as_str()).collect();
    let near = crate::channel::nearest(&lost.from, known);
    let hint = near.map_or_else(String::new, |near| format!("; did you mean {near}?"));
    Err(columns.wrong(
        format!("the map names a column {:?}, which the file does not have{hint}", lost.from),
        format!("映射文件中的列{:?}在文件中不存在", lost.from),
    ))
}

fn target(
    columns: &Columns<'_>,
    index: usize,
    is_contract: bool,
    notes: &mut Vec<Note>,
) -> Result<Option<Target>, RecordingError> {
    let name = &columns.names[index];
    let survey = &columns.surveys[index];
    if let Some(mapped) = columns.mapping.column(&name.text, index) {
        return mapped_target(columns, index, mapped);
    }
    if name.text.is_empty() {
        if survey.filled() > 0 && !survey.counts_rows {
            notes.push(Note::new(
                NoteKind::Loss,
                format!("column {} has no name and is left out", index + 1),
                format!("第{}列没有列名，未读取", index + 1),
            ));
        }
        return Ok(None);
    }
    let own = Target { name: name.text.clone(), factor: 1.0, offset: 0.0, is_guess: false };
    let is_ours = ChannelId::of(&name.text).is_some() || TEXT_COLUMNS.contains(&name.text.as_str());
    if is_ours || is_contract {
        if ChannelId::of(&name.text).is_some() {
            unit_agrees(columns, index)?;
        }
        return Ok(Some(own));
    }
    match name.meaning() {
        Some(ours) => {
            let (factor, offset) = name.conversion(ours).unwrap_or((1.0, 0.0));
            Ok(Some(Target { name: ours.to_owned(), factor, offset, is_guess: true }))
        }
        None => {
            doubt(name, survey, notes);
            Ok(Some(own))
        }
    }
}

/// One of ours whose line of units says another unit.
fn unit_agrees(columns: &Columns<'_>, index: usize) -> Result<(), RecordingError> {
    let (name, said) = (&columns.names[index].text, &columns.head.units[index]);
    let (Some(own), Some(said)) = (quantity::unit_of(name).and_then(Unit::of), said.as_deref()) else { return Ok(()) };
    let bare = said.trim_matches(['(', ')', '[', ']']);
    match Unit::of(bare).and_then(|said| said.to(own)) {
        Some((factor, offset)) if (factor - 1.0).abs() < 1e-9 && offset.abs() < 1e-9 => Ok(()),
        // A feed per revolution is often written as a length.
        None if quantity::unit_of(name) == Some("mm/rev") && bare == "mm" || bare == "-" || bare == "1" => Ok(()),
        _ => {
            let own = quantity::unit_of(name).unwrap_or_default();
            Err(columns.wrong(
                format!("column {name}: its name says {own}, the line of units says {bare}: rename the column, or say the unit in a map"),
                format!("列{name}：列名表示单位{own}，单位行为{bare}：请改列名，或在映射文件中指定单位"),
            ))
        }
    }
}

fn mapped_target(
    columns: &Columns<'_>,
    index: usize,
    mapped: &ColumnMapping,
) -> Result<Option<Target>, RecordingError> {
    if mapped.to.is_empty() {
        return Ok(None);
    }
    let name = &columns.names[index];
    let unit = mapped.unit.as_deref().or(name.unit.as_deref());
    let own = quantity::unit_of(&mapped.to);
    let (factor, offset) = match (conversion(unit, &mapped.to), unit, own) {
        (Some(found), ..) => found,
        (None, None, _) | (None, Some(_), None) => (1.0, 0.0),
        (None, Some(unit), Some(own)) => {
            return Err(columns.wrong(
                format!("column {}: {unit} cannot become {} in {own}: these are different quantities, or a unit that is not known", name.text, mapped.to),
                format!("列{}：单位{unit}无法换算为{}（{own}）：物理量不同或单位未知", name.text, mapped.to),
            ));
        }
    };
    let scale = mapped.scale.unwrap_or(1.0);
    let target = Target {
        name: mapped.to.clone(),
        factor: factor * scale,
        offset: offset * scale + mapped.offset.unwrap_or(0.0),
        is_guess: false,
    };
    Ok(Some(target))
}

/// A name that may mean one of ours: a person has to say.
fn doubt(name: &ForeignName, survey: &ColumnSurvey, notes: &mut Vec<Note>) {
    let candidates = name.candidates();
    let Some(first) = candidates.first().filter(|_| survey.filled() > 0) else { return };
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

/// Two columns that would get the same name: guesses give way, anything else is refused.
fn duplicates(columns: &Columns<'_>, all: &mut [(usize, Target)], notes: &mut Vec<Note>) -> Result<(), RecordingError> {
    let mut by_name: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (place, (_, target)) in all.iter().enumerate() {
        by_name.entry(target.name.clone()).or_default().push(place);
    }
    for (name, places) in by_name.into_iter().filter(|(_, places)| places.len() > 1) {
        let sure: Vec<usize> = places.iter().copied().filter(|place| !all[*place].1.is_guess).collect();
        if sure.len() > 1 {
            return Err(columns.wrong(
                format!("column {name} appears twice: rename one of them, or leave one out in a map (from = \"#{}\", to = \"\")", all[sure[1]].0 + 1),
                format!("列{name}出现两次：请改名，或在映射文件中去掉一个（from = \"#{}\", to = \"\"）", all[sure[1]].0 + 1),
            ));
        }
        let texts: Vec<String> = places.iter().map(|place| columns.names[all[*place].0].text.clone()).collect();
        for place in places {
            let (index, target) = &mut all[place];
            if !target.is_guess {
                continue;
            }
            let foreign = &columns.names[*index].text;
            *target = Target { name: foreign.clone(), factor: 1.0, offset: 0.0, is_guess: false };
        }
        notes.push(Note::new(
            NoteKind::Doubt,
            format!(
                "{} could all be {name}: each keeps its own name. A map says which: cnc-gateway recording map",
                texts.join(" and ")
            ),
            format!("{}都可能是{name}：均保留原名。请用映射文件指定：cnc-gateway recording map", texts.join("和")),
        ));
    }
    let mut seen: Vec<&str> = Vec::new();
    for (_, target) in all.iter() {
        if seen.contains(&target.name.as_str()) {
            return Err(
                columns.wrong(format!("column {} appears twice", target.name), format!("列{}出现两次", target.name))
            );
        }
        seen.push(&target.name);
    }
    Ok(())
}

/// Numbers, flags or words, by most of the cells.
fn planned(
    columns: &Columns<'_>,
    index: usize,
    target: Target,
    is_contract: bool,
    notes: &mut Vec<Note>,
) -> Result<PlannedColumn, RecordingError> {
    let survey = &columns.surveys[index];
    let source = columns.names[index].text.clone();
    let is_text = TEXT_COLUMNS.contains(&target.name.as_str())
        || target.name.ends_with("_missing")
        || ChannelId::of(&target.name).is_some_and(|id| id.channel().kind == Kind::Text);
    let known = ChannelId::of(&target.name).is_some() && !is_text;
    let numbers = survey.numbers();
    let others = survey.words + survey.moments + survey.times_of_day + survey.instants + survey.locals;
    let kind = if is_text {
        PlannedKind::Words
    } else if survey.flags > 0 && survey.pair.is_some() && survey.flags > others && survey.flags >= numbers {
        flag_note(survey, &target, notes);
        PlannedKind::Flags
    } else if known || numbers >= others + survey.flags {
        let decimal = decimal_of(columns, index)?.unwrap_or(Decimal::Point);
        PlannedKind::Numbers { decimal, factor: target.factor, offset: target.offset }
    } else {
        PlannedKind::Words
    };
    if matches!(kind, PlannedKind::Words) && !is_text && numbers > 0 {
        notes.push(Note::new(
            NoteKind::Doubt,
            format!(
                "{source} is read as words: {} of its cells are words, {numbers} are numbers",
                others + survey.flags
            ),
            format!("{source}按文字读取：{}个单元格为文字，{numbers}个为数字", others + survey.flags),
        ));
    }
    if known && others > numbers {
        let example = survey.word_examples.first();
        let line = example.map_or(columns.head.data_line, |example| example.line);
        let text = example.map_or_else(String::new, |example| format!(" (such as {:?})", example.text));
        return Err(RecordingError::Header {
            file: columns.file.to_owned(),
            line,
            reason: Bilingual::new(
                format!(
                    "column {source} becomes {}, which holds numbers, and most of its cells are words{text}: correct it, or leave it out in a map",
                    target.name
                ),
                format!(
                    "列{source}对应{}，应为数字，但多数单元格是文字{text}：请改正，或在映射文件中去掉",
                    target.name
                ),
            ),
        });
    }
    if target.is_guess || columns.mapping.column(&source, index).is_some() && source != target.name {
        notes.push(became(&columns.names[index], &target));
    }
    let strict = is_contract && known;
    Ok(PlannedColumn { index, name: target.name, source, kind, strict })
}

fn flag_note(survey: &ColumnSurvey, target: &Target, notes: &mut Vec<Note>) {
    let Some((no, yes)) = survey.pair.map(flag_words) else { return };
    let name = &target.name;
    notes.push(Note::new(
        NoteKind::Assumption,
        format!("{name}: {} for 1, {} for 0", yes.to_uppercase(), no.to_uppercase()),
        format!("{name}：{}为1，{}为0", yes.to_uppercase(), no.to_uppercase()),
    ));
}

fn became(name: &ForeignName, target: &Target) -> Note {
    let change = match (target.factor, target.offset) {
        (factor, offset) if (factor - 1.0).abs() < 1e-12 && offset == 0.0 => String::new(),
        (factor, 0.0) => format!(" ({}x)", short(factor)),
        (factor, offset) => {
            format!(" ({}x {} {})", short(factor), if offset < 0.0 { "-" } else { "+" }, short(offset.abs()))
        }
    };
    let text = format!("{} -> {}{change}", name.text, target.name);
    Note::new(NoteKind::Column, text.clone(), text)
}

fn short(x: f64) -> String {
    let text = format!("{x:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
