//! One message of a sample channel: a column of values per item, and when they were true on the device's clock.

use super::begin_time::{BeginTime, ForeignClock, parse_begin};
use super::item_conversion::{ItemConversion, UnitProblem, split_unit};
use super::lenient_json::{find_field, find_list, find_text, parse_number};
use super::model::Model;
use serde_json::Value;
use thiserror::Error;

/// At most so many values are taken from one message.
pub const VALUES_MAX: usize = 1_000_000;

/// The values of one item.
#[derive(Debug, Clone, PartialEq)]
pub struct ItemColumn {
    /// Path of the item, or its name as the device writes it when the model does not know it.
    pub path: String,
    /// The unit of its numbers: as the model tells it, else as the values themselves do. [`ItemConversion`] makes of it what a
    /// channel wants.
    pub unit: Option<String>,
    /// In the order of time; `None` where the device had no number. Words are not numbers.
    pub values: Vec<Option<f64>>,
    /// Time between two values, ms; 0 with fewer than two.
    pub step_ms: f64,
    /// The last word, where the column holds words.
    pub word: Option<String>,
}

/// What one message holds. Value `k` of a column was true at `begin_ms + k * step_ms` of the column.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleBlock {
    /// Name of the sample channel.
    pub channel: String,
    /// Time of the first value on the device's clock, ms since 1970.
    pub begin_ms: i64,
    /// Between two instants, ms. An instant may hold several values.
    pub interval_ms: f64,
    /// Instants of the longest column.
    pub instants: usize,
    /// In the order of the message.
    pub columns: Vec<ItemColumn>,
    /// How the device told `begin_ms`, where that is not as the standard has it.
    pub clock: Option<ForeignClock>,
}

/// Why a message of a sample channel makes no sense.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SampleError {
    /// It does not say when its first instant was.
    #[error("there is no \"beginTime\" in it")]
    NoBegin,
    /// The time of its first instant cannot be understood; the value as JSON.
    #[error("\"beginTime\" is {0}, which is no time in milliseconds since 1970")]
    BadBegin(String),
    /// Neither the message nor the model says how far apart the instants are.
    #[error("there is no interval in it, nor in the model")]
    NoInterval,
    /// It holds so many values, more than are taken from one message.
    #[error("{0} values; at most {VALUES_MAX} are taken from one message")]
    TooMany(usize),
    /// Its columns are not as many as their names.
    #[error("it has {columns} columns and names for {names}")]
    Names {
        /// Columns of values in the message.
        columns: usize,
        /// Names from the message, or from the model where the message has none.
        names: usize,
    },
}

impl SampleBlock {
    /// Reads a message of the channel named in its topic; what it leaves out is taken from the model.
    ///
    /// # Errors
    /// What makes no sense in it.
    pub fn parse(message: &Value, tail: &str, model: &Model) -> Result<Self, SampleError> {
        let channel = find_text(message, &["id"]).unwrap_or_else(|| tail.to_owned());
        let known = model.samples.iter().find(|known| known.id == channel || known.id == tail);
        let data = find_list(message, &["data"]);
        let begin = find_field(message, &["beginTime", "begintime"]).ok_or(SampleError::NoBegin)?;
        let BeginTime { ms: begin_ms, clock } =
            parse_begin(begin).ok_or_else(|| SampleError::BadBegin(begin.to_string().chars().take(60).collect()))?;
        let interval = find_field(message, &["interval", "sampleInterval"]).and_then(parse_number);
        let interval_ms = interval.or(known.map(|known| known.interval_ms)).filter(|ms| *ms > 0.0);
        let interval_ms = interval_ms.ok_or(SampleError::NoInterval)?;
        let names = resolve_names(message, known.map(|known| known.items.as_slice()), data.len())?;
        let sizes = data.iter().map(|column| find_list(column, &["data"]));
        let total: usize = sizes.clone().flatten().map(|value| value.as_array().map_or(1, Vec::len)).sum();
        if total > VALUES_MAX {
            return Err(SampleError::TooMany(total));
        }
        let instants = sizes.map(<[Value]>::len).max().unwrap_or(0);
        let column = |(data, name): (&Value, &String)| {
            let item = model.find_item(name);
            let path = item.map_or_else(|| name.clone(), |item| item.path.clone());
            build_column(find_list(data, &["data"]), path, item.and_then(|item| item.unit.clone()), interval_ms)
        };
        let columns = data.iter().zip(&names).map(column).collect();
        Ok(Self { channel, begin_ms, interval_ms, instants, columns, clock })
    }

    /// When the next message of the channel must begin if nothing is lost, ms.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "a message holds at most a million instants")]
    pub fn duration_ms(&self) -> f64 {
        self.instants as f64 * self.interval_ms
    }
}

/// The names of the columns: from the message, else the order of the model.
fn resolve_names(message: &Value, model: Option<&[String]>, columns: usize) -> Result<Vec<String>, SampleError> {
    let said: Vec<String> = find_list(message, &["paths", "ids"]).iter().filter_map(parse_name).collect();
    let names = if said.is_empty() { model.unwrap_or_default().to_vec() } else { said };
    if names.len() == columns {
        return Ok(names);
    }
    Err(SampleError::Names { columns, names: names.len() })
}

fn parse_name(value: &Value) -> Option<String> {
    value.as_str().map(str::to_owned).or_else(|| find_text(value, &["id", "path"]))
}

/// A value may itself be a list: several values within one interval. `[]` is none.
#[expect(clippy::cast_precision_loss, reason = "a message holds at most a million values")]
fn build_column(data: &[Value], path: String, unit: Option<String>, interval_ms: f64) -> ItemColumn {
    let mut column = ItemColumn { path, unit, values: Vec::with_capacity(data.len()), step_ms: 0.0, word: None };
    for value in data {
        match value {
            Value::Array(several) if several.is_empty() => column.values.push(None),
            Value::Array(several) => several.iter().for_each(|value| column.push_value(value)),
            other => column.push_value(other),
        }
    }
    let per_instant = if data.is_empty() { 1.0 } else { column.values.len() as f64 / data.len() as f64 };
    column.step_ms = interval_ms / per_instant.max(1.0);
    column
}

impl ItemColumn {
    /// Its numbers in the unit that a channel wants, `None` where there is none.
    ///
    /// # Errors
    /// Their unit does not fit.
    pub fn convert_values(&self, wanted: &str) -> Result<Vec<Option<f64>>, UnitProblem> {
        let conversion = ItemConversion::new(self.unit.as_deref(), wanted);
        match conversion.problem() {
            Some(problem) => Err(problem),
            None => Ok(self.values.iter().map(|value| conversion.convert_number((*value)?).ok()).collect()),
        }
    }

    /// A number in the column's unit. The first text with a unit of its own tells that of a column without one.
    fn push_value(&mut self, value: &Value) {
        if let Value::String(text) = value
            && parse_number(value).is_none()
        {
            match split_unit(text) {
                Some((_, unit)) if self.unit.is_none() && self.values.iter().all(Option::is_none) => {
                    self.unit = Some(unit.to_owned());
                }
                Some(_) => {}
                None => self.word = Some(text.clone()),
            }
        }
        // Only a text brings a unit of its own.
        let in_own_unit = || {
            let unit = self.unit.as_deref()?;
            ItemConversion::new(Some(unit), unit).convert_value(value).ok()
        };
        let number = parse_number(value).or_else(in_own_unit);
        self.values.push(number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn model() -> Model {
        Model::parse(&json!({"devices": [{"type": "MACHINE",
            "configs": [{"id": "s1", "type": "SAMPLE_CHANNEL", "sampleInterval": 1, "uploadInterval": 4,
                         "ids": [{"id": "01"}, {"id": "02"}]}],
            "dataItems": [{"id": "01", "type": "STATUS"}, {"id": "02", "type": "FEED_SPEED"}]}]}))
        .expect("a model")
    }

    #[test]
    fn the_recorded_message_is_read() {
        let message = json!({"@id": "m1", "paths": ["/STATUS"], "id": "s9", "beginTime": "1700000000000",
            "data": [{"data": [1, 2]}], "interval": 1000, "uploadInterval": 2000});
        let block = SampleBlock::parse(&message, "s9", &model()).expect("sense");
        assert_eq!((block.begin_ms, block.interval_ms, block.instants), (1_700_000_000_000, 1000.0, 2));
        assert_eq!(block.columns[0].path, "STATUS");
        assert_eq!(block.columns[0].values, [Some(1.0), Some(2.0)]);
        assert!((block.duration_ms() - 2000.0).abs() < 1e-9);
    }

    #[test]
    fn what_is_left_out_comes_from_the_model() {
        let message = json!({"beginTime": 5, "data": [{"data": [1, 2, 3, 4]}, {"data": [[], [], [], []]}]});
        let block = SampleBlock::parse(&message, "s1", &model()).expect("sense");
        assert_eq!((block.channel.as_str(), block.interval_ms), ("s1", 1.0));
        assert_eq!(
            block.columns[1],
            ItemColumn { path: "FEED_SPEED".to_owned(), unit: None, values: vec![None; 4], step_ms: 1.0, word: None }
        );
    }

    #[test]
    fn several_values_in_one_instant_lie_closer() {
        let message = json!({"beginTime": "5", "data": [{"data": [[1, 2], [3, 4]]}, {"data": ["O10.nc", "O10.nc"]}]});
        let block = SampleBlock::parse(&message, "s1", &model()).expect("sense");
        assert_eq!((block.instants, block.columns[0].step_ms), (2, 0.5));
        assert_eq!(block.columns[0].values.len(), 4);
        assert_eq!(block.columns[1].word.as_deref(), Some("O10.nc"));
    }

    #[test]
    fn nonsense_is_refused_in_words() {
        let said = |message: Value| SampleBlock::parse(&message, "s1", &model()).expect_err("refused").to_string();
        assert!(said(json!({"data": []})).contains("beginTime"));
        assert!(said(json!({"beginTime": "noon", "data": []})).contains("noon"));
        assert!(said(json!({"beginTime": 1, "data": [{"data": [1]}]})).contains("1 columns and names for 2"));
        let other = json!({"id": "sx", "beginTime": 1, "data": []});
        assert!(SampleBlock::parse(&other, "sx", &model()).expect_err("refused").to_string().contains("interval"));
    }
}
