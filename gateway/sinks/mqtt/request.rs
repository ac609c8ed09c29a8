//! A request of the network as a JSON document. Pure.

use gateway_base::moment;
use gateway_control::{RequestOrigin, RequestRefusal, RequestedChange};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value as Json;

/// A request is shorter than this.
const REQUEST_BYTES_MAX: usize = 2048;

/// A request as it comes, for example
/// `{"request":"feed_override","pct":80,"reason":"...","id":"...","from":"mes","issued_at":"2026-01-31T08:15:00Z"}`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RequestDocument {
    request: String,
    pct: Option<f64>,
    reason: Option<String>,
    code: Option<String>,
    /// Who asks is read by [`origin_of`].
    #[serde(rename = "id")]
    _id: Option<IgnoredAny>,
    #[serde(rename = "from")]
    _from: Option<IgnoredAny>,
    #[serde(rename = "issued_at")]
    _issued_at: Option<IgnoredAny>,
}

/// What a message says of who asks, also where it is no request or no JSON: whatever can be read goes into the answer.
pub(super) fn origin_of(payload: &[u8]) -> RequestOrigin {
    let text = String::from_utf8_lossy(payload.get(..REQUEST_BYTES_MAX).unwrap_or(payload));
    let document: Option<Json> = serde_json::from_str(&text).ok();
    let word = |name: &str| match &document {
        Some(document) => document.get(name).and_then(to_word),
        None => find_word(&text, name),
    };
    // A time that is relative to now is none that somebody has noted.
    let issued_ns = word("issued_at")
        .filter(|text| text.starts_with(|first: char| first.is_ascii_digit()))
        .and_then(|text| moment::parse(&text, 0).ok());
    RequestOrigin::from_words(word("id").as_deref(), word("from").as_deref(), issued_ns)
}

fn to_word(value: &Json) -> Option<String> {
    match value {
        Json::String(text) => Some(text.clone()),
        Json::Number(number) => Some(number.to_string()),
        _ => None,
    }
}

/// The value behind the first `"NAME":` of a text that is no JSON as a whole. Such a text is never obeyed.
fn find_word(text: &str, name: &str) -> Option<String> {
    let (_, behind) = text.split_once(&format!("\"{name}\""))?;
    let value = behind.trim_start().strip_prefix(':')?;
    let first = serde_json::Deserializer::from_str(value).into_iter::<Json>().next()?.ok()?;
    to_word(&first)
}

pub(super) fn document_of(payload: &[u8]) -> Result<RequestDocument, RequestRefusal> {
    if payload.len() > REQUEST_BYTES_MAX {
        return Err(RequestRefusal::TooLong { bytes: payload.len(), most: REQUEST_BYTES_MAX });
    }
    serde_json::from_slice(payload)
        .map_err(|error| RequestRefusal::Unreadable { error: error.to_string(), forms: FORMS })
}

const FORMS: &str = "write {\"request\":\"feed_override\",\"pct\":80}, {\"request\":\"withdraw\"} or \
                     {\"request\":\"acknowledge_alarm\",\"code\":\"...\"}, each with \
                     \"id\":\"...\" and \"issued_at\":\"2026-01-31T08:15:00Z\"";

impl RequestDocument {
    pub(super) fn into_change(self) -> Result<RequestedChange, RequestRefusal> {
        match (self.request.as_str(), self.pct, self.code) {
            ("feed_override", Some(pct), None) => RequestedChange::feed_override(pct, &self.reason.unwrap_or_default()),
            ("withdraw", None, None) => Ok(RequestedChange::Withdraw),
            ("acknowledge_alarm", None, Some(code)) => Ok(RequestedChange::acknowledge_alarm(&code)),
            _ => Err(RequestRefusal::Unknown { forms: FORMS }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_asks_is_known_of_a_message_that_is_no_request_too() {
        let said = br#"{"request":"arm","id":"r7","from":"mes\n","issued_at":"2026-01-31T08:15:00Z","more":1}"#;
        assert!(document_of(said).is_err());
        let expected = RequestOrigin::from_words(Some("r7"), Some("mes"), Some(1_769_847_300_000_000_000));
        assert_eq!(origin_of(said), expected);
        let id = |said: &[u8]| origin_of(said).id.unwrap_or_default();
        for said in [
            &br#"{"request":"feed_override","pct":1e999,"id":"r7"}"#[..],
            br#"{"request":"feed_override","pct":,"id" : "r7"}"#,
            br#"{"id":"r7","request":"feed_"#,
            br#"{"id":"r7"} and more"#,
            b"{\"pct\":\"\xff\",\"id\":\"r7\"}",
        ] {
            assert!(document_of(said).is_err());
            assert_eq!(id(said), "r7", "{}", String::from_utf8_lossy(said));
        }
        let long = format!(r#"{{"id":"r7","reason":"{}"}}"#, "x".repeat(5000));
        assert_eq!(id(long.as_bytes()), "r7");
        assert_eq!(id(br#"{"request":"withdraw","id":7}"#), "7", "a number is a mark too");
        assert_eq!(id(br#"{"reason":"\"id\":\"r8\"","id":"r7"}"#), "r7", "what a value says is no mark");
        for nobody in [&b"hello"[..], br#"{"id":{"a":1},"issued_at":"yesterday"}"#, br#"{"id" "r7""#, b"", b"\"id\":"] {
            assert_eq!(origin_of(nobody), RequestOrigin::default(), "{}", String::from_utf8_lossy(nobody));
        }
    }
}
