//! From text to the table, with everything that is wrong at once.

use super::quantity::{QUANTITIES, suggest_key};
use super::recipe::{Operation, Recipe};
use adapter_core::channel::find_nearest_name;
use script::ScriptProblem;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Bytes of one file.
pub const TEXT_MAX: usize = 512 * 1024;
/// Operations of one file.
pub const OPERATIONS_MAX: usize = 2000;
/// Characters of one name.
const NAME_MAX: usize = 100;
/// Greatest sequence number of a block.
const BLOCK_MAX: u32 = 99_999_999;

const SCHEMA: &str = "operations/1";
const TEXTS: [&str; 4] = ["program", "name", "tool", "work_material"];
const OTHER_NAMES: [(&str, &str); 8] = [
    ("material", "work_material"),
    ("workpiece_material", "work_material"),
    ("operation", "name"),
    ("prog", "program"),
    ("block", "blocks"),
    ("block_range", "blocks"),
    ("range", "blocks"),
    ("tool_number", "tool"),
];

/// Reads the table; `file` is its name in messages.
///
/// # Errors
/// Everything that is wrong, in the order of the file.
pub fn parse(file: &str, text: &str) -> Result<Recipe, Vec<ScriptProblem>> {
    let mut reader = RecipeReader { file, text, problems: Vec::new(), version: compute_version(text) };
    let operations = reader.read_operations();
    reader.check_overlaps(&operations);
    reader.problems.sort_by_key(|problem| (problem.line.is_none(), problem.line, problem.column));
    match reader.problems.is_empty() {
        true => Ok(Recipe::new(operations, reader.version)),
        false => Err(reader.problems),
    }
}

/// FNV-1a over the text, eight digits: tells one version from another, keeps no secret.
fn compute_version(text: &str) -> Arc<str> {
    let hash = text
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    Arc::from(&format!("{hash:016x}")[..8])
}

type Value<'a> = Spanned<DeValue<'a>>;

struct RecipeReader<'t> {
    file: &'t str,
    text: &'t str,
    problems: Vec<ScriptProblem>,
    version: Arc<str>,
}

impl RecipeReader<'_> {
    fn report_problem(&mut self, offset: usize, what: impl Into<String>, next: impl Into<String>) {
        let (line, column) = self.locate_offset(offset);
        self.problems.push(ScriptProblem {
            file: self.file.to_owned(),
            line: Some(line),
            column: Some(column),
            what: what.into(),
            next: next.into(),
        });
    }

    /// Line and column of a byte offset, both from 1.
    fn locate_offset(&self, offset: usize) -> (usize, usize) {
        let before = self.text.get(..offset).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }

    fn read_operations(&mut self) -> Vec<Operation> {
        if self.text.len() > TEXT_MAX {
            self.report_problem(
                0,
                format!("the file is longer than {TEXT_MAX} bytes"),
                "one machine needs no more; split it",
            );
            return Vec::new();
        }
        let (table, errors) = DeTable::parse_recoverable(self.text);
        for error in &errors {
            let next = "write one `key = value` per line; text stands in \"quotes\"";
            self.report_problem(
                error.span().map_or(0, |span| span.start),
                format!("not TOML: {}", error.message()),
                next,
            );
        }
        if !errors.is_empty() {
            return Vec::new();
        }
        self.check_top_level(table.get_ref());
        let Some(entries) = table.get_ref().get("operation") else {
            self.report_problem(
                0,
                "there is no [[operation]]",
                "write one section [[operation]] for each stretch of a program",
            );
            return Vec::new();
        };
        self.read_entries(entries)
    }

    fn check_top_level(&mut self, table: &DeTable<'_>) {
        for (key, _) in table.iter().filter(|(key, _)| !["schema", "operation"].contains(&key.get_ref().as_ref())) {
            let next = "this file holds schema = \"operations/1\" and sections [[operation]]";
            self.report_problem(key.span().start, format!("there is no `{}` here", key.get_ref()), next);
        }
        match table.get("schema") {
            Some(schema) if schema.get_ref().as_str() == Some(SCHEMA) => {}
            Some(schema) => {
                self.report_problem(schema.span().start, "this schema is not known", "write schema = \"operations/1\"")
            }
            None => self.report_problem(0, "the schema is missing", "begin the file with schema = \"operations/1\""),
        }
    }

    fn read_entries(&mut self, entries: &Value<'_>) -> Vec<Operation> {
        let Some(list) = entries.get_ref().as_array() else {
            self.report_problem(entries.span().start, "`operation` is not a list of sections", "write [[operation]]");
            return Vec::new();
        };
        if list.len() > OPERATIONS_MAX {
            let what = format!("{} operations; at most {OPERATIONS_MAX} are read", list.len());
            self.report_problem(entries.span().start, what, "drop the programs that this machine no longer runs");
            return Vec::new();
        }
        let mut operations = Vec::new();
        for entry in list.iter() {
            match entry.get_ref().as_table() {
                Some(table) => operations.extend(self.read_operation(table, entry.span().start)),
                None => self.report_problem(entry.span().start, "an operation is a section", "write [[operation]]"),
            }
        }
        operations
    }

    fn read_operation(&mut self, table: &DeTable<'_>, offset: usize) -> Option<Operation> {
        let before = self.problems.len();
        let mut numbers = BTreeMap::new();
        let mut texts = BTreeMap::new();
        let mut blocks = None;
        for (key, value) in table.iter() {
            let name = key.get_ref().as_ref();
            if let Some(quantity) = QUANTITIES.iter().find(|quantity| quantity.key == name) {
                numbers.extend(self.read_number(quantity, value).map(|number| (quantity.key, number)));
            } else if let Some(known) = TEXTS.iter().find(|known| **known == name) {
                texts.extend(self.read_text(known, value).map(|text| (*known, text)));
            } else if name == "blocks" {
                blocks = self.read_blocks(value);
            } else {
                self.report_unknown_key(name, key.span().start, value);
            }
        }
        self.check_required(&texts, table, offset);
        self.check_plausibility(&numbers, offset);
        (self.problems.len() == before).then(|| self.build_operation(&numbers, &texts, blocks, offset))?
    }

    fn build_operation(
        &self,
        numbers: &BTreeMap<&str, f64>,
        texts: &BTreeMap<&str, Arc<str>>,
        blocks: Option<RangeInclusive<u32>>,
        offset: usize,
    ) -> Option<Operation> {
        let number = |key: &str| numbers.get(key).copied();
        let name = texts.get("name")?.clone();
        Some(Operation {
            mark: Arc::from(format!("{name} ({})", self.version)),
            name,
            program: texts.get("program")?.clone(),
            blocks,
            depth_of_cut_mm: number("depth_of_cut_mm"),
            width_of_cut_mm: number("width_of_cut_mm"),
            diameter_mm: number("diameter_mm"),
            teeth: number("teeth"),
            tool: texts.get("tool").cloned(),
            work_material: texts.get("work_material").cloned(),
            line: self.locate_offset(offset).0,
        })
    }

    fn report_unknown_key(&mut self, name: &str, offset: usize, value: &Value<'_>) {
        let other = OTHER_NAMES.iter().find(|(other, _)| name.eq_ignore_ascii_case(other));
        let known = || TEXTS.into_iter().chain(QUANTITIES.iter().map(|quantity| quantity.key)).chain(["blocks"]);
        let next = suggest_key(name, plain_number(value.get_ref()))
            .or_else(|| other.map(|(_, key)| format!("write {key} = ...")))
            .or_else(|| find_nearest_name(name, known()).map(|near| format!("did you mean `{near}`?")))
            .unwrap_or_else(|| format!("the keys are {}", known().collect::<Vec<_>>().join(", ")));
        self.report_problem(offset, format!("an operation has no `{name}`"), next);
    }

    fn read_number(&mut self, quantity: &super::OperationQuantity, value: &Value<'_>) -> Option<f64> {
        let Some(number) = plain_number(value.get_ref()) else {
            let what = format!("`{}` is no number", quantity.key);
            self.report_problem(
                value.span().start,
                what,
                format!("{}, without quotes: {} = 1.0", quantity.en, quantity.key),
            );
            return None;
        };
        if quantity.is_credible(number) {
            return Some(number);
        }
        let what = format!("{} = {number} cannot be", quantity.key);
        self.report_problem(value.span().start, what, quantity.describe_correction(number));
        None
    }

    fn read_text(&mut self, key: &str, value: &Value<'_>) -> Option<Arc<str>> {
        let text = match value.get_ref() {
            DeValue::String(text) => text.trim(),
            _ => {
                self.report_problem(
                    value.span().start,
                    format!("`{key}` is no text"),
                    format!("write {key} = \"...\""),
                );
                return None;
            }
        };
        if text.is_empty() || text.chars().count() > NAME_MAX || text.chars().any(char::is_control) {
            let what = format!("`{key}` must have 1 to {NAME_MAX} printable characters");
            self.report_problem(value.span().start, what, "shorten it, or leave it out where it may be absent");
            return None;
        }
        Some(Arc::from(text))
    }

    fn read_blocks(&mut self, value: &Value<'_>) -> Option<RangeInclusive<u32>> {
        let form = "write blocks = [10, 120]: the first and the last sequence number (N10 to N120)";
        let numbers: Option<Vec<u32>> = value.get_ref().as_array().and_then(|list| {
            list.iter().map(|one| plain_block(one.get_ref()).filter(|block| *block <= BLOCK_MAX)).collect()
        });
        match numbers.as_deref() {
            Some([first, last]) if first <= last => Some(*first..=*last),
            Some([first, last]) => {
                let next = format!("write blocks = [{last}, {first}]");
                self.report_problem(value.span().start, format!("the blocks run backwards: {first} to {last}"), next);
                None
            }
            _ => {
                self.report_problem(value.span().start, "`blocks` is no pair of sequence numbers", form);
                None
            }
        }
    }

    fn check_required(&mut self, texts: &BTreeMap<&str, Arc<str>>, table: &DeTable<'_>, offset: usize) {
        let missing = |key: &str| !texts.contains_key(key) && !table.iter().any(|(name, _)| name.get_ref() == key);
        if missing("program") {
            self.report_problem(
                offset,
                "the operation names no program",
                "write program = \"O1234\", as the controller shows it",
            );
        }
        if missing("name") {
            self.report_problem(offset, "the operation has no name", "write name = \"rough turning\"");
        }
        if !table.iter().any(|(name, _)| says_of_cut(name.get_ref()))
            && table.iter().all(|(name, _)| suggest_key(name.get_ref(), None).is_none())
        {
            self.report_problem(
                offset,
                "the operation says nothing of the cut",
                "write depth_of_cut_mm = ..., diameter_mm = ..., or at least work_material = \"...\"",
            );
        }
    }

    /// Numbers that are possible one by one and not together.
    fn check_plausibility(&mut self, numbers: &BTreeMap<&str, f64>, offset: usize) {
        let number = |key: &str| numbers.get(key).copied();
        let (depth, width, diameter) = (number("depth_of_cut_mm"), number("width_of_cut_mm"), number("diameter_mm"));
        if let (Some(width), Some(diameter)) = (width, diameter)
            && width > diameter
        {
            let what = format!("a cut {width} mm wide is wider than the tool of {diameter} mm");
            self.report_problem(
                offset,
                what,
                "the diameter is that of the tool in milling; in turning leave the width out",
            );
        }
        if let (Some(depth), None, Some(diameter)) = (depth, width, diameter)
            && 2.0 * depth > diameter
        {
            let what = format!("a cut {depth} mm deep goes beyond the centre of a work of {diameter} mm");
            self.report_problem(
                offset,
                what,
                "the diameter is that of the work before the cut in turning; milling needs a width",
            );
        }
    }

    /// No block may belong to two operations.
    fn check_overlaps(&mut self, operations: &[Operation]) {
        for (index, later) in operations.iter().enumerate() {
            let same = |earlier: &&Operation| {
                earlier.program.eq_ignore_ascii_case(&later.program) && blocks_overlap(&earlier.blocks, &later.blocks)
            };
            if let Some(earlier) = operations[..index].iter().find(same) {
                let what = match &later.blocks {
                    Some(_) => {
                        format!("{:?} and {:?} both claim blocks of {}", earlier.name, later.name, later.program)
                    }
                    None => format!("{:?} and {:?} both claim the rest of {}", earlier.name, later.name, later.program),
                };
                self.problems.push(ScriptProblem {
                    file: self.file.to_owned(),
                    line: Some(later.line),
                    column: None,
                    what,
                    next: format!("give each block to one operation; the other stands at line {}", earlier.line),
                });
            }
        }
    }
}

/// An operation of the whole program is what is left over and overlaps only with another one of its kind.
fn blocks_overlap(a: &Option<RangeInclusive<u32>>, b: &Option<RangeInclusive<u32>>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a.start() <= b.end() && b.start() <= a.end(),
        (None, None) => true,
        _ => false,
    }
}

/// Does this key say anything of the cut?
fn says_of_cut(name: &str) -> bool {
    name == "work_material" || QUANTITIES.iter().any(|quantity| quantity.key == name)
}

fn plain_number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok().map(|it| it as f64),
        DeValue::Float(number) => {
            number.as_str().replace('_', "").parse::<f64>().ok().filter(|number| number.is_finite())
        }
        _ => None,
    }
}

/// A sequence number, also in quotes with its N.
fn plain_block(value: &DeValue<'_>) -> Option<u32> {
    match value {
        DeValue::Integer(number) => u32::from_str_radix(number.as_str(), number.radix()).ok(),
        DeValue::String(text) => super::block_number(text),
        _ => None,
    }
}

#[cfg(test)]
#[path = "read_tests.rs"]
mod tests;
