//! Query and set: requests as JSON, answers as values or reasons. Wire forms: T/CMTBA 1008.5 and the recorded messages of
//! open implementations.

use super::lenient_json::{find_field, find_list, find_text, parse_number};
use serde_json::{Value, json};
use thiserror::Error;

/// What is asked of one data item.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Params {
    /// Elements of a list, `"7"` or `"3-5"`.
    pub indexes: Vec<String>,
    /// The value to write; `None` reads.
    pub value: Option<Value>,
    /// To this element of a list.
    pub index: Option<u32>,
    /// To this bit of it.
    pub bit: Option<u8>,
}

/// One data item of a request, under the name by which the device knows it.
#[derive(Debug, Clone, PartialEq)]
pub struct RequestedItem {
    /// Node number or path.
    pub id: String,
    /// Which elements are meant, and what is written.
    pub params: Params,
}

impl RequestedItem {
    /// The value of an item.
    #[must_use]
    pub fn from_id(id: &str) -> Self {
        Self { id: id.to_owned(), params: Params::default() }
    }

    /// Elements of a list item.
    #[must_use]
    pub fn with_elements(id: &str, indexes: &[u32]) -> Self {
        let indexes = indexes.iter().map(ToString::to_string).collect();
        Self { id: id.to_owned(), params: Params { indexes, ..Params::default() } }
    }

    /// Write an element of a list item.
    #[must_use]
    pub fn write(id: &str, index: u32, value: i64) -> Self {
        let params = Params { value: Some(json!(value)), index: Some(index), ..Params::default() };
        Self { id: id.to_owned(), params }
    }

    fn to_json(&self) -> Value {
        let params = &self.params;
        let mut said = json!({});
        if let Some(index) = params.index {
            said["index"] = json!(index);
        }
        if let Some(bit) = params.bit {
            said["offset"] = json!(bit);
        }
        match &params.value {
            Some(value) => {
                said["operation"] = json!("set_value");
                said["value"] = value.clone();
            }
            None => said["operation"] = json!("get_value"),
        }
        if !params.indexes.is_empty() {
            said["indexes"] = json!(params.indexes);
        }
        json!({"id": self.id, "params": said})
    }
}

/// What a device said about one item.
pub type NcLinkAnswer = Result<Vec<Value>, String>;

/// Why a message holds no answers.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub(super) enum AnswersError {
    /// The device refuses the request as a whole, with this reason.
    #[error("{0}")]
    Refused(String),
    /// There is no list of answers, and no refusal.
    #[error("there is neither \"values\" nor \"results\" in it")]
    NoAnswers,
}

/// The request for values, or to write them.
pub(super) fn encode_request(id: &str, asks: &[RequestedItem]) -> Vec<u8> {
    let items: Vec<Value> = asks.iter().map(RequestedItem::to_json).collect();
    let key = if asks.iter().any(|ask| ask.params.value.is_some()) { "values" } else { "ids" };
    json!({"@id": id, key: items}).to_string().into_bytes()
}

/// Does a message that is not addressed to a device name this one anywhere in it? Makers write the serial number under many names.
pub(super) fn names_device(message: &Value, serial: &str) -> bool {
    match message {
        Value::String(text) => text == serial,
        Value::Array(list) => list.iter().any(|one| names_device(one, serial)),
        Value::Object(fields) => fields.values().any(|one| names_device(one, serial)),
        Value::Number(number) => number.to_string() == serial,
        _ => false,
    }
}

/// The identifier by which an answer belongs to its request.
pub fn find_identifier(message: &Value) -> Option<String> {
    find_text(message, &["@id", "@ID", "id@"])
}

/// The answers in the order of the asks. An item that the device left out, or answered for another one, is `None`.
///
/// # Errors
/// The message as a whole is a refusal, or has no list of answers.
pub(super) fn parse_answers(
    message: &Value,
    asks: &[RequestedItem],
) -> Result<Vec<Option<NcLinkAnswer>>, AnswersError> {
    let items = find_list(message, &["values", "results"]);
    if items.is_empty() {
        return match find_refusal(message) {
            Some(reason) => Err(AnswersError::Refused(reason)),
            None => Err(AnswersError::NoAnswers),
        };
    }
    let id = |item: &Value| find_text(item, &["id"]);
    // In order, as the standard has it; a device that answers in its own order is understood by the names.
    let in_order = items.len() == asks.len()
        && items.iter().zip(asks).all(|(item, ask)| id(item).is_none_or(|id| same_name(&id, &ask.id)));
    if in_order {
        return Ok(items.iter().map(|item| Some(parse_answer(item))).collect());
    }
    let mut used = vec![false; items.len()];
    let mut find = |ask: &RequestedItem| {
        let named = |(at, item): &(usize, &Value)| !used[*at] && id(item).is_some_and(|id| same_name(&id, &ask.id));
        let (at, item) = items.iter().enumerate().find(named)?;
        used[at] = true;
        Some(parse_answer(item))
    };
    Ok(asks.iter().map(&mut find).collect())
}

fn same_name(a: &str, b: &str) -> bool {
    a.trim_start_matches('/').eq_ignore_ascii_case(b.trim_start_matches('/'))
}

fn parse_answer(item: &Value) -> NcLinkAnswer {
    match find_refusal(item) {
        Some(reason) => Err(reason),
        None => match find_field(item, &["values", "value"]) {
            Some(Value::Array(values)) => Ok(values.clone()),
            Some(value) => Ok(vec![value.clone()]),
            None => Ok(Vec::new()),
        },
    }
}

/// Why not, if the code says no. A missing code is consent when there is no reason either.
pub(super) fn find_refusal(item: &Value) -> Option<String> {
    let reason = find_text(item, &["reason", "message", "msg"]);
    match find_text(item, &["code"]) {
        Some(code) if code.eq_ignore_ascii_case("OK") || code == "0" => None,
        Some(code) => Some(reason.unwrap_or(code)),
        None => reason,
    }
}

/// The first value as a number.
pub(super) fn first_number(values: &[Value]) -> Option<f64> {
    values.first().and_then(parse_number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Value {
        serde_json::from_str(text).expect("JSON")
    }

    #[test]
    fn requests_are_written_as_recorded() {
        let query = RequestedItem {
            id: "/STATUS".to_owned(),
            params: Params { indexes: vec!["1".into(), "3-5".into()], ..Params::default() },
        };
        let expected =
            r#"{"@id":"m1","ids":[{"id":"/STATUS","params":{"operation":"get_value","indexes":["1","3-5"]}}]}"#;
        assert_eq!(String::from_utf8_lossy(&encode_request("m1", &[query])), expected);
        let set =
            RequestedItem { id: "/STATUS".to_owned(), params: Params { value: Some(json!(7)), ..Params::default() } };
        let expected = r#"{"@id":"m1","values":[{"id":"/STATUS","params":{"operation":"set_value","value":7}}]}"#;
        assert_eq!(String::from_utf8_lossy(&encode_request("m1", &[set])), expected);
        let register = String::from_utf8_lossy(&encode_request("m1", &[RequestedItem::write("R", 5, -1)])).into_owned();
        assert!(register.contains(r#""index":5"#) && register.contains(r#""value":-1"#), "{register}");
    }

    #[test]
    fn recorded_answers_are_understood() {
        let asks = [RequestedItem::from_id("/STATUS")];
        let ok = parsed(r#"{"@id":"m1","values":[{"id":"/STATUS","code":"OK","values":[42]}]}"#);
        assert_eq!(find_identifier(&ok).as_deref(), Some("m1"));
        assert_eq!(parse_answers(&ok, &asks), Ok(vec![Some(Ok(vec![json!(42)]))]));
        let no = parsed(r#"{"@id":"m1","values":[{"id":"/STATUS","code":"NG","reason":"NOT_FOUND"}]}"#);
        assert_eq!(parse_answers(&no, &asks), Ok(vec![Some(Err("NOT_FOUND".to_owned()))]));
        let set = parsed(r#"{"@id":"m1","results":[{"id":"/STATUS","code":"OK"}]}"#);
        assert_eq!(parse_answers(&set, &asks), Ok(vec![Some(Ok(Vec::new()))]));
    }

    #[test]
    fn answers_out_of_order_or_left_out_find_their_question() {
        let asks = [
            RequestedItem::from_id("STATUS"),
            RequestedItem::from_id("FEED_SPEED"),
            RequestedItem::from_id("PART_COUNT"),
        ];
        let message = parsed(r#"{"values":[{"id":"/PART_COUNT","value":3},{"id":"/STATUS","code":"NG"}]}"#);
        let expected = vec![Some(Err("NG".to_owned())), None, Some(Ok(vec![json!(3)]))];
        assert_eq!(parse_answers(&message, &asks), Ok(expected));
    }

    #[test]
    fn the_same_item_asked_twice_gets_both_answers() {
        let asks = [RequestedItem::with_elements("REG", &[1]), RequestedItem::with_elements("REG", &[2])];
        let message = parsed(r#"{"values":[{"id":"REG","values":[10]},{"id":"REG","values":[20]}]}"#);
        assert_eq!(parse_answers(&message, &asks), Ok(vec![Some(Ok(vec![json!(10)])), Some(Ok(vec![json!(20)]))]));
    }

    #[test]
    fn a_refusal_of_everything_and_nonsense_are_told() {
        let asks = [RequestedItem::from_id("STATUS")];
        assert_eq!(
            parse_answers(&parsed(r#"{"code":"NG","reason":"busy"}"#), &asks),
            Err(AnswersError::Refused("busy".to_owned()))
        );
        assert!(parse_answers(&parsed("[1]"), &asks).is_err_and(|why| why.to_string().contains("values")));
    }
}
