//! What a method is called with, and what it answers.

use super::Method;
use crate::collect::ScriptResult;
use crate::problem::describe_type;
use estimators::regression::{Refusal, RefusalKind};
use rhai::{Array, Dynamic, Map};

/// Entries of an array that are read; a script cannot make a longer one.
const ENTRIES_MAX: usize = 128;

#[derive(Debug, Clone, PartialEq)]
enum Argument {
    Absent,
    Number(f64),
    Text(String),
    Numbers(Vec<f64>),
    Rows(Vec<Vec<f64>>),
}

/// The arguments of one call, in the order of the parameters.
pub struct Arguments<'a> {
    method: &'a Method,
    values: Vec<Argument>,
}

impl<'a> Arguments<'a> {
    /// Reads what the script handed over. Something that is neither number, text, array of numbers nor array of rows is a
    /// mistake in the script.
    pub(super) fn read(method: &'a Method, values: &[&mut Dynamic]) -> ScriptResult<Self> {
        let read = values.iter().zip(method.parameters).map(|(value, parameter)| {
            let said = || {
                format!("{}: {} needs {}, not {}", method.name, parameter.name, parameter.unit, describe_type(value))
            };
            let argument = to_argument(value).ok_or_else(said)?;
            if argument.matches_unit(parameter.unit) { Ok(argument) } else { Err(said()) }
        });
        let values = read.collect::<Result<Vec<Argument>, String>>()?;
        Ok(Self { method, values })
    }

    /// The first argument that has no value.
    pub(super) fn find_missing(&self) -> Option<Refusal> {
        let at = self.values.iter().position(|value| *value == Argument::Absent)?;
        let name = self.method.parameters[at].name;
        Some(Refusal::new(RefusalKind::Missing, format!("{name} has no value"), ""))
    }

    /// The number at this place; 0 only where the table of parameters says that there is none.
    #[must_use]
    pub fn number(&self, at: usize) -> f64 {
        match self.values.get(at) {
            Some(Argument::Number(number)) => *number,
            _ => 0.0,
        }
    }

    /// The text at this place.
    #[must_use]
    pub fn text(&self, at: usize) -> &str {
        match self.values.get(at) {
            Some(Argument::Text(text)) => text,
            _ => "",
        }
    }

    /// The array of numbers at this place.
    #[must_use]
    pub fn numbers(&self, at: usize) -> &[f64] {
        match self.values.get(at) {
            Some(Argument::Numbers(numbers)) => numbers,
            _ => &[],
        }
    }

    /// The array of rows of numbers at this place.
    #[must_use]
    pub fn rows(&self, at: usize) -> &[Vec<f64>] {
        match self.values.get(at) {
            Some(Argument::Rows(rows)) => rows,
            _ => &[],
        }
    }

    /// The same, every row of the same length.
    ///
    /// # Errors
    /// A row of another length.
    pub fn rows_of<const N: usize>(&self, at: usize) -> Result<Vec<[f64; N]>, Refusal> {
        let name = self.method.parameters.get(at).map_or("", |parameter| parameter.name);
        let wrong = |length: usize| {
            Refusal::new(RefusalKind::Mismatch, format!("a row of {name} has {length} numbers"), format!("give {N}"))
        };
        self.rows(at).iter().map(|row| row.as_slice().try_into().map_err(|_| wrong(row.len()))).collect()
    }
}

impl Argument {
    fn matches_unit(&self, unit: &str) -> bool {
        match self {
            Self::Absent => true,
            Self::Number(_) => !unit.starts_with('[') && unit != "text",
            Self::Text(_) => unit == "text",
            Self::Numbers(_) => unit.starts_with('[') && !unit.starts_with("[["),
            Self::Rows(_) => unit.starts_with("[["),
        }
    }
}

fn to_argument(value: &Dynamic) -> Option<Argument> {
    if value.is_unit() {
        return Some(Argument::Absent);
    }
    if let Some(number) = read_number(value) {
        return Some(Argument::Number(number));
    }
    if let Ok(text) = value.as_immutable_string_ref() {
        return Some(Argument::Text(text.to_string()));
    }
    let array = value.read_lock::<Array>()?;
    if array.len() > ENTRIES_MAX {
        return None;
    }
    match array.first() {
        Some(first) if first.is_array() => array.iter().map(read_row).collect::<Option<_>>().map(Argument::Rows),
        _ => array.iter().map(read_number).collect::<Option<_>>().map(Argument::Numbers),
    }
}

fn read_number(value: &Dynamic) -> Option<f64> {
    value.as_float().ok().or_else(|| value.as_int().ok().map(|whole| whole as f64))
}

fn read_row(value: &Dynamic) -> Option<Vec<f64>> {
    value.read_lock::<Array>()?.iter().map(read_number).collect()
}

/// What a method answers.
#[derive(Debug, Clone, PartialEq)]
pub enum MethodResult {
    /// A number in the unit of the method's name.
    Number(f64),
    /// Yes or no, a boolean in the script.
    Flag(bool),
    /// Several numbers by name; each name ends in its unit.
    Map(Vec<(&'static str, f64)>),
}

impl MethodResult {
    /// The answer, where every number in it is one.
    pub(super) fn check_finite(self) -> Result<Self, Refusal> {
        let finite = match &self {
            Self::Number(number) => number.is_finite(),
            Self::Flag(_) => true,
            Self::Map(entries) => entries.iter().all(|(_, number)| number.is_finite()),
        };
        let refusal =
            || Refusal::new(RefusalKind::OutOfRange, "the result is no finite number", "look at the arguments");
        if finite { Ok(self) } else { Err(refusal()) }
    }

    pub(super) fn into_dynamic(self) -> Dynamic {
        match self {
            Self::Number(number) => Dynamic::from_float(number),
            Self::Flag(flag) => Dynamic::from_bool(flag),
            Self::Map(entries) => {
                let entry = |(name, number): (&str, f64)| (name.into(), Dynamic::from_float(number));
                Dynamic::from_map(entries.into_iter().map(entry).collect::<Map>())
            }
        }
    }
}
