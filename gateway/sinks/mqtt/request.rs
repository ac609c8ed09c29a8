//! A request of the network as a JSON document. Pure.

use gateway_base::moment;
use gateway_control::{RequestOrigin, RequestRefusal, RequestedChange};
use serde::Deserialize;
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
    #[serde(rename = "id")]
    _id: Option<String>,
    #[serde(rename = "from")]
    _from: Option<String>,
    #[serde(rename = "issued_at")]
    _issued_at: Option<String>,
}

/// What a message says of who asks, also where it is no request.
pub(super) fn origin_of(payload: &[u8]) -> RequestOrigin {
    if payload.len() > REQUEST_BYTES_MAX {
        return RequestOrigin::default();
    }
    let fields: Json = serde_json::from_slice(payload).unwrap_or_default();
    let word = |name: &str| fields.get(name).and_then(Json::as_str);
    // A time that is relative to now is none that somebody has noted.
    let issued_ns = word("issued_at")
        .filter(|text| text.starts_with(|first: char| first.is_ascii_digit()))
        .and_then(|text| moment::parse(text, 0).ok());
    RequestOrigin::from_words(word("id"), word("from"), issued_ns)
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
        assert_eq!(origin_of(b"hello"), RequestOrigin::default());
        assert_eq!(origin_of(br#"{"id":7,"issued_at":"yesterday"}"#), RequestOrigin::default());
    }
}
