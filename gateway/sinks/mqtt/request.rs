//! A request of the network as a JSON document. Pure.

use gateway_control::RequestedChange;
use serde::Deserialize;

/// What the broker has kept would come again at every connection, long after whoever asked has gone.
pub(super) const RETAINED: &str =
    "a retained message is no request: publish it without the retain flag, and remove the retained one";
/// A request is shorter than this.
const REQUEST_BYTES_MAX: usize = 2048;
/// Letters of the asker's own mark that are given back.
const ID_MAX: usize = 64;

/// `{"request":"feed_override","pct":80,"reason":"...","id":"..."}`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RequestDocument {
    request: String,
    pct: Option<f64>,
    reason: Option<String>,
    code: Option<String>,
    pub(super) id: Option<String>,
}

pub(super) fn document_of(payload: &[u8]) -> Result<RequestDocument, String> {
    if payload.len() > REQUEST_BYTES_MAX {
        return Err(format!("a message of {} bytes is no request: at most {REQUEST_BYTES_MAX}", payload.len()));
    }
    let mut document: RequestDocument =
        serde_json::from_slice(payload).map_err(|error| format!("this is no request: {error}; {FORMS}"))?;
    document.id = document.id.map(|id| id.chars().take(ID_MAX).collect());
    Ok(document)
}

const FORMS: &str = "write {\"request\":\"feed_override\",\"pct\":80}, {\"request\":\"withdraw\"} or \
                     {\"request\":\"acknowledge_alarm\",\"code\":\"...\"}";

impl RequestDocument {
    pub(super) fn into_change(self) -> Result<RequestedChange, String> {
        match (self.request.as_str(), self.pct, self.code) {
            ("feed_override", Some(pct), None) => RequestedChange::feed_override(pct, &self.reason.unwrap_or_default()),
            ("withdraw", None, None) => Ok(RequestedChange::Withdraw),
            ("acknowledge_alarm", None, Some(code)) => Ok(RequestedChange::acknowledge_alarm(&code)),
            _ => Err(format!("this is no request; {FORMS}")),
        }
    }
}
