//! Reading JSON that several makers write differently: the same thing under several names, numbers in quotes.

use serde_json::Value;

/// The first of these fields that is there.
pub(super) fn find_field<'a>(object: &'a Value, names: &[&str]) -> Option<&'a Value> {
    names.iter().find_map(|name| object.get(name)).filter(|value| !value.is_null())
}

/// A field as text; a number becomes its digits.
pub fn find_text(object: &Value, names: &[&str]) -> Option<String> {
    match find_field(object, names)? {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    }
}

/// A field as a list; one thing alone is a list of one.
pub fn find_list<'a>(object: &'a Value, names: &[&str]) -> &'a [Value] {
    match find_field(object, names) {
        Some(Value::Array(list)) => list,
        Some(other) => std::slice::from_ref(other),
        None => &[],
    }
}

/// A flag, also as 0/1 or a word.
pub(super) fn find_flag(object: &Value, names: &[&str]) -> bool {
    match find_field(object, names) {
        Some(Value::Bool(flag)) => *flag,
        Some(Value::Number(number)) => number.as_f64().is_some_and(|number| number != 0.0),
        Some(Value::String(word)) => word.eq_ignore_ascii_case("true") || word == "1",
        _ => false,
    }
}

/// A finite number, also in quotes, as a flag, or as the only element of a list.
pub(super) fn parse_number(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64().filter(|number| number.is_finite()),
        Value::String(text) => text.trim().parse().ok().filter(|number: &f64| number.is_finite()),
        Value::Bool(flag) => Some(f64::from(u8::from(*flag))),
        Value::Array(list) if list.len() == 1 => parse_number(&list[0]),
        _ => None,
    }
}

/// A whole number that fits.
pub fn parse_integer(value: &Value) -> Option<i64> {
    let number = parse_number(value).filter(|number| number.fract() == 0.0 && number.abs() < 9e15)?;
    #[expect(clippy::cast_possible_truncation, reason = "whole and below 2^53")]
    let integer = number as i64;
    Some(integer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_are_found_in_many_dresses_and_nan_in_none() {
        for value in [json!(7), json!("7"), json!(" 7.0 "), json!([7]), json!(["7"])] {
            assert_eq!(parse_number(&value), Some(7.0), "{value}");
            assert_eq!(parse_integer(&value), Some(7), "{value}");
        }
        for value in [json!("NaN"), json!("inf"), json!([]), json!([1, 2]), json!(null), json!({}), json!("")] {
            assert_eq!(parse_number(&value), None, "{value}");
        }
        assert_eq!(parse_integer(&json!(7.5)), None);
    }

    #[test]
    fn a_field_is_found_under_any_of_its_names() {
        let object = json!({"setable": "true", "dataType": "LIST", "ids": {"id": 5}, "number": null});
        assert!(find_flag(&object, &["settable", "setable"]));
        assert_eq!(find_text(&object, &["datatype", "dataType"]).as_deref(), Some("LIST"));
        assert_eq!(find_list(&object, &["ids"]).len(), 1);
        assert_eq!(find_text(&object, &["number"]), None);
    }
}
