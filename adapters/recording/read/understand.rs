//! From the survey of a table to a plan: names, units, decimal signs, kinds. What cannot be told is refused with the line and the cure;
//! what is assumed is said.

use super::cell::{Decimal, flag_words};
use super::cell_unit::{find_unit_of_cells, plan_cell_units};
use super::clock::ForeignColumns;
use super::error::RecordingError;
use super::head::Head;
use super::mapping::Mapping;
use super::names::ForeignName;
use super::note::{Note, NoteKind};
use super::plan::{BlockPlan, PlannedColumn, PlannedKind, ReadPlan};
use super::survey::{ColumnSurvey, Survey};
use super::targets::{ColumnTarget, find_targets};
use crate::TEXT_COLUMNS;
use adapter_core::bilingual::Bilingual;
use adapter_core::channel::{ChannelId, Kind};

pub(super) fn build_plan(
    head: &Head,
    survey: &Survey,
    mapping: &Mapping,
    file: &str,
) -> Result<ReadPlan, RecordingError> {
    let mut names: Vec<ForeignName> =
        head.names.iter().zip(&head.units).map(|(name, unit)| ForeignName::from_text(name, unit.as_deref())).collect();
    for (name, survey) in names.iter_mut().zip(&survey.columns).filter(|(name, _)| name.unit.is_none()) {
        name.unit = find_unit_of_cells(survey);
    }
    let mut columns = ForeignColumns {
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
    let own = columns.find_own_clocks(&mut notes)?;
    let mut clocks = match columns.find_clocks(&mut notes) {
        Ok(clocks) => clocks,
        Err(error) if own.is_empty() => return Err(error),
        Err(_) => Vec::new(),
    };
    let shared = clocks.len();
    clocks.extend(own.iter().map(|own| own.time.clone()));
    let targets = find_targets(&columns, &clocks, is_contract, &mut notes)?;
    let mut blocks: Vec<BlockPlan> = clocks.into_iter().map(|time| BlockPlan { time, columns: Vec::new() }).collect();
    for (index, target) in targets {
        let planned = plan_column(&columns, index, target, is_contract, &mut notes)?;
        let of_own = own.iter().position(|own| own.columns.contains(&index)).map(|place| shared + place);
        // Each other column goes with the last clock before it.
        let before =
            || blocks[..shared].iter().rposition(|block| block.time.index < Some(index)).or((shared > 0).then_some(0));
        let Some(block) = of_own.or_else(before) else {
            let source = &planned.source;
            notes.push(Note::new(
                NoteKind::Loss,
                format!("{source} belongs to no clock of the map and is left out"),
                format!("{source}不属于映射文件中的任何时钟，未读取"),
            ));
            continue;
        };
        blocks[block].columns.push(planned);
    }
    blocks.retain(|block| !block.columns.is_empty());
    if blocks.is_empty() {
        return Err(columns
            .build_header_error("there is no column besides the time".to_owned(), "除时间外没有其他列".to_owned()));
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
pub(super) fn decimal_of(columns: &ForeignColumns<'_>, index: usize) -> Result<Option<Decimal>, RecordingError> {
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
            _ => Err(columns.build_header_error(
                format!("column {name}: 1,250 may be one and a quarter or twelve hundred and fifty: say which sign is the decimal one in a map (decimal = \",\" or \".\")"),
                format!("列{name}：1,250可能是一又四分之一，也可能是一千二百五十：请在映射文件中指定小数符号（decimal = \",\"或\".\"）"),
            )),
        },
    }
}

fn form_notes(head: &Head, columns: &ForeignColumns<'_>, survey: &Survey, notes: &mut Vec<Note>) {
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

/// Numbers, flags or words, by most of the cells.
fn plan_column(
    columns: &ForeignColumns<'_>,
    index: usize,
    target: ColumnTarget,
    is_contract: bool,
    notes: &mut Vec<Note>,
) -> Result<PlannedColumn, RecordingError> {
    let survey = &columns.surveys[index];
    let source = columns.names[index].text.clone();
    let mapped = columns.mapping.find_column(&source, index);
    // A person who says the unit means the numbers as they stand there.
    let unit = target.unit.as_deref();
    let cell_units = plan_cell_units(survey, unit).filter(|_| mapped.is_none_or(|mapped| mapped.unit.is_none()));
    let is_text = TEXT_COLUMNS.contains(&target.name.as_str())
        || target.name.ends_with("_missing")
        || ChannelId::from_name(&target.name).is_some_and(|id| id.channel().kind == Kind::Text);
    let known = ChannelId::from_name(&target.name).is_some() && !is_text;
    let numbers = survey.count_numbers();
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
    if let Some(units) =
        cell_units.as_ref().filter(|units| units.has_several() && matches!(kind, PlannedKind::Numbers { .. }))
    {
        let unit = unit.unwrap_or_default();
        notes.push(Note::new(
            NoteKind::Assumption,
            format!("{source}: its cells are in {}, taken together in {unit}", units.list_units()),
            format!("{source}：单元格单位有{}，统一为{unit}", units.list_units()),
        ));
    }
    if target.is_guess || mapped.is_some() && source != target.name {
        notes.push(note_change(&columns.names[index], &target));
    }
    let strict = is_contract && known;
    Ok(PlannedColumn { index, name: target.name, source, kind, strict, cell_units })
}

fn flag_note(survey: &ColumnSurvey, target: &ColumnTarget, notes: &mut Vec<Note>) {
    let Some((no, yes)) = survey.pair.map(flag_words) else { return };
    let name = &target.name;
    notes.push(Note::new(
        NoteKind::Assumption,
        format!("{name}: {} for 1, {} for 0", yes.to_uppercase(), no.to_uppercase()),
        format!("{name}：{}为1，{}为0", yes.to_uppercase(), no.to_uppercase()),
    ));
}

fn note_change(name: &ForeignName, target: &ColumnTarget) -> Note {
    let change = match (target.factor, target.offset) {
        (factor, offset) if (factor - 1.0).abs() < 1e-12 && offset == 0.0 => String::new(),
        (factor, 0.0) => format!(" ({}x)", short_number(factor)),
        (factor, offset) => {
            format!(
                " ({}x {} {})",
                short_number(factor),
                if offset < 0.0 { "-" } else { "+" },
                short_number(offset.abs())
            )
        }
    };
    let text = format!("{} -> {}{change}", name.text, target.name);
    Note::new(NoteKind::Column, text.clone(), text)
}

fn short_number(x: f64) -> String {
    let text = format!("{x:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
