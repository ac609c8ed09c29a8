//! One value against one row of the table of keys.

use super::keys::{Key, Kind};
use adapters::Address;
use adapters::channel::nearest;
use toml::de::DeValue;

/// A checked value.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Scalar {
    /// Text, a word, a path or an address.
    Text(String),
    /// A finite number within its range.
    Number(f64),
    /// Yes or no.
    Flag(bool),
}

/// What is wrong, and what to do.
pub(super) type Refusal = (String, String);

/// A value as it stands in the file.
pub(super) fn check_written(key: &Key, value: &DeValue<'_>) -> Result<Scalar, Refusal> {
    match (key.kind, value) {
        (Kind::Number(..), DeValue::Integer(number)) => check_scalar(key, &decimal(number)),
        (Kind::Number(..), DeValue::Float(number)) => check_scalar(key, number.as_str()),
        (Kind::Flag, DeValue::Boolean(flag)) => Ok(Scalar::Flag(*flag)),
        (Kind::Number(..) | Kind::Flag, other) => Err(wrong_type(key, other)),
        (_, DeValue::String(text)) => check_scalar(key, text),
        (_, other) => Err(wrong_type(key, other)),
    }
}

fn decimal(number: &toml::de::DeInteger<'_>) -> String {
    i128::from_str_radix(number.as_str(), number.radix()).map_or_else(|_| number.to_string(), |value| value.to_string())
}

fn wrong_type(key: &Key, value: &DeValue<'_>) -> Refusal {
    let found = match value {
        DeValue::String(_) => "text",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a section",
    };
    (format!("`{}` is {found}; {} is needed", key.name, needed(key.kind)), example(key))
}

fn needed(kind: Kind) -> &'static str {
    match kind {
        Kind::Text => "text",
        Kind::OneOf(_) => "a word",
        Kind::Number(..) => "a number",
        Kind::Flag => "true or false",
        Kind::Path => "a path in quotes",
        Kind::Listen => "HOST:PORT in quotes",
        Kind::Address => "an address in quotes",
    }
}

fn example(key: &Key) -> String {
    let value = match key.kind {
        Kind::Text | Kind::Path => "\"...\"".to_owned(),
        Kind::OneOf(words) => format!("\"{}\"", words.first().copied().unwrap_or_default()),
        Kind::Number(min, max) => format!("{:?}", 1.0_f64.clamp(min, max)),
        Kind::Flag => "true".to_owned(),
        Kind::Listen => "\"127.0.0.1:8080\"".to_owned(),
        Kind::Address => "\"simulated://lathe\"".to_owned(),
    };
    format!("for example {} = {value}", key.name)
}

/// A value as text without quotes, as in an environment variable.
pub(super) fn check_scalar(key: &Key, text: &str) -> Result<Scalar, Refusal> {
    match key.kind {
        Kind::Number(min, max) => number(key, text, min, max),
        Kind::Flag => match text {
            "true" => Ok(Scalar::Flag(true)),
            "false" => Ok(Scalar::Flag(false)),
            _ => Err((format!("`{}` is {text:?}; true or false is needed", key.name), String::new())),
        },
        _ if text.trim().is_empty() => Err((format!("`{}` is empty", key.name), example(key))),
        Kind::OneOf(words) => word(key, text, words),
        Kind::Listen => listen(key, text),
        Kind::Address => address(text),
        Kind::Text | Kind::Path => Ok(Scalar::Text(text.to_owned())),
    }
}

fn number(key: &Key, text: &str, min: f64, max: f64) -> Result<Scalar, Refusal> {
    let Ok(number) = text.replace('_', "").parse::<f64>() else {
        return Err((format!("`{}` is {text:?}; a number is needed", key.name), example(key)));
    };
    if number >= min && number <= max {
        return Ok(Scalar::Number(number));
    }
    Err((format!("`{} = {text}` is outside {min} to {max}", key.name), format!("{}: {}", key.name, key.en)))
}

fn word(key: &Key, text: &str, words: &[&str]) -> Result<Scalar, Refusal> {
    if words.contains(&text) {
        return Ok(Scalar::Text(text.to_owned()));
    }
    let near = nearest(text, words.iter().copied()).filter(|near| near.len() > 2);
    let meant = near.map(|near| format!("; did you mean \"{near}\"?")).unwrap_or_default();
    let next = format!("write one of {}{meant}", words.join(", "));
    Err((format!("`{}` cannot be {text:?}", key.name), next))
}

fn listen(key: &Key, text: &str) -> Result<Scalar, Refusal> {
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

fn address(text: &str) -> Result<Scalar, Refusal> {
    match text.parse::<Address>() {
        Ok(_) => Ok(Scalar::Text(text.to_owned())),
        Err(error) => {
            let next = "`cnc-gateway doctor ADDRESS` tries an address and says what is wrong".to_owned();
            Err((format!("`address` cannot be used: {}", error.problems.join("; ")), next))
        }
    }
}
