//! One value against one row of the table of keys.

use super::keys::{ConfigKey, NAME_MAX, ValueKind};
use adapters::Address;
use adapters::address::AddressError;
use adapters::channel::find_nearest_name;
use gateway_base::machine_path::{MachinePath, MachinePathError};
use gateway_sinks::SinkAddress;
use toml::de::DeValue;

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Scalar {
    /// Text, a word, a path or an address.
    Text(String),
    /// A finite number within its range.
    Number(f64),
    Flag(bool),
}

/// What is wrong, and what to do.
pub(super) type ValueRefusal = (String, String);

/// A value as it stands in the file.
pub(super) fn check_written(key: &ConfigKey, value: &DeValue<'_>) -> Result<Scalar, ValueRefusal> {
    match (key.kind, value) {
        (ValueKind::Number(..), DeValue::Integer(number)) => check_scalar(key, &to_decimal(number)),
        (ValueKind::Number(..), DeValue::Float(number)) => check_scalar(key, number.as_str()),
        (ValueKind::Flag, DeValue::Boolean(flag)) => Ok(Scalar::Flag(*flag)),
        (ValueKind::Number(..) | ValueKind::Flag, other) => Err(wrong_type(key, other)),
        (_, DeValue::String(text)) => check_scalar(key, text),
        (_, other) => Err(wrong_type(key, other)),
    }
}

fn to_decimal(number: &toml::de::DeInteger<'_>) -> String {
    i128::from_str_radix(number.as_str(), number.radix()).map_or_else(|_| number.to_string(), |value| value.to_string())
}

fn wrong_type(key: &ConfigKey, value: &DeValue<'_>) -> ValueRefusal {
    let found = match value {
        DeValue::String(_) => "text",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a section",
    };
    (format!("`{}` is {found}; {} is needed", key.name, describe_kind(key.kind)), format_example(key))
}

fn describe_kind(kind: ValueKind) -> &'static str {
    match kind {
        ValueKind::Text | ValueKind::Name => "text",
        ValueKind::OneOf(_) => "a word",
        ValueKind::Number(..) => "a number",
        ValueKind::Flag => "true or false",
        ValueKind::Path => "a path in quotes",
        ValueKind::Listen => "HOST:PORT in quotes",
        ValueKind::Address | ValueKind::SinkAddress => "an address in quotes",
        ValueKind::PlantPath => "a path in quotes",
        ValueKind::PathWord => "a word in quotes",
    }
}

fn format_example(key: &ConfigKey) -> String {
    let value = match key.kind {
        ValueKind::Text | ValueKind::Name | ValueKind::Path => "\"...\"".to_owned(),
        ValueKind::OneOf(words) => format!("\"{}\"", words.first().copied().unwrap_or_default()),
        ValueKind::Number(min, max) => format!("{:?}", 1.0_f64.clamp(min, max)),
        ValueKind::Flag => "true".to_owned(),
        ValueKind::Listen => "\"127.0.0.1:8080\"".to_owned(),
        ValueKind::Address => "\"simulated://lathe\"".to_owned(),
        ValueKind::SinkAddress => "\"mqtts://broker:8883/plant\"".to_owned(),
        ValueKind::PlantPath => "\"shanghai/line-2\"".to_owned(),
        ValueKind::PathWord => "\"lathe-7\"".to_owned(),
    };
    format!("for example {} = {value}", key.name)
}

/// A value as text without quotes, as in an environment variable.
pub(super) fn check_scalar(key: &ConfigKey, text: &str) -> Result<Scalar, ValueRefusal> {
    match key.kind {
        ValueKind::Number(min, max) => check_number(key, text, min, max),
        ValueKind::Flag => match text {
            "true" => Ok(Scalar::Flag(true)),
            "false" => Ok(Scalar::Flag(false)),
            _ => Err((format!("`{}` is {text:?}; true or false is needed", key.name), String::new())),
        },
        _ if text.contains(char::is_control) => Err(with_control(key, text)),
        _ if text.trim().is_empty() => Err((format!("`{}` is empty", key.name), format_example(key))),
        ValueKind::OneOf(words) => check_word(key, text, words),
        ValueKind::Listen => check_listen(key, text),
        ValueKind::Address => check_address(text, text.parse::<Address>().map(drop)),
        ValueKind::SinkAddress => check_address(text, text.parse::<SinkAddress>().map(drop)),
        ValueKind::Name if text.chars().count() > NAME_MAX => {
            let what = format!("`{}` has {} letters", key.name, text.chars().count());
            Err((what, format!("give a name of at most {NAME_MAX}")))
        }
        ValueKind::PlantPath => check_path(key, text, MachinePath::new(text, "machine").err()),
        ValueKind::PathWord => check_path(key, text, MachinePath::new("site", text).err()),
        ValueKind::Text | ValueKind::Name | ValueKind::Path => Ok(Scalar::Text(text.to_owned())),
    }
}

/// Every output carries the words of a path as they are.
fn check_path(key: &ConfigKey, text: &str, wrong: Option<MachinePathError>) -> Result<Scalar, ValueRefusal> {
    match wrong {
        None => Ok(Scalar::Text(text.to_owned())),
        Some(error) => Err((format!("`{} = {text:?}` cannot be used: {error}", key.name), format_example(key))),
    }
}

/// Neither databases nor the lines of a protocol take ends of lines or NUL within a text.
fn with_control(key: &ConfigKey, text: &str) -> ValueRefusal {
    let first = text.chars().find(|letter| letter.is_control()).unwrap_or_default();
    let what = format!("`{}` holds the control character U+{:04X}", key.name, u32::from(first));
    (what, "write it on one line, with letters, digits and signs only".to_owned())
}

fn check_number(key: &ConfigKey, text: &str, min: f64, max: f64) -> Result<Scalar, ValueRefusal> {
    let Ok(number) = text.replace('_', "").parse::<f64>() else {
        return Err((format!("`{}` is {text:?}; a number is needed", key.name), format_example(key)));
    };
    if number >= min && number <= max {
        return Ok(Scalar::Number(number));
    }
    Err((format!("`{} = {text}` is outside {min} to {max}", key.name), format!("{}: {}", key.name, key.en)))
}

fn check_word(key: &ConfigKey, text: &str, words: &[&str]) -> Result<Scalar, ValueRefusal> {
    if words.contains(&text) {
        return Ok(Scalar::Text(text.to_owned()));
    }
    let near = find_nearest_name(text, words.iter().copied()).filter(|near| near.len() > 2);
    let meant = near.map(|near| format!("; did you mean \"{near}\"?")).unwrap_or_default();
    let next = format!("write one of {}{meant}", words.join(", "));
    Err((format!("`{}` cannot be {text:?}", key.name), next))
}

fn check_listen(key: &ConfigKey, text: &str) -> Result<Scalar, ValueRefusal> {
    let host = text.rsplit_once(':').filter(|(_, port)| port.parse::<u16>().is_ok()).map(|(host, _)| host);
    let named = |host: &str| !host.is_empty() && host.chars().all(|c| c.is_ascii_alphanumeric() || "-.".contains(c));
    if text.parse::<std::net::SocketAddr>().is_ok() || host.is_some_and(named) {
        return Ok(Scalar::Text(text.to_owned()));
    }
    Err((
        format!("`{}` is {text:?}; HOST:PORT is needed", key.name),
        "\"127.0.0.1:8080\" is reachable from this box only, \"0.0.0.0:8080\" from the whole network (with tls and tokens)"
            .to_owned(),
    ))
}

fn check_address(text: &str, parsed: Result<(), AddressError>) -> Result<Scalar, ValueRefusal> {
    match parsed {
        Ok(_) => Ok(Scalar::Text(text.to_owned())),
        Err(error) => {
            let next = "`cnc-gateway doctor ADDRESS` tries an address and says what is wrong".to_owned();
            Err((format!("`address` cannot be used: {}", error.problems.join("; ")), next))
        }
    }
}
