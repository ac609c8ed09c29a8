//! A request of the network as a JSON document. Pure.

use gateway_control::{RequestRefusal, RequestedChange};
use serde::Deserialize;

/// A request is shorter than this.
const REQUEST_BYTES_MAX: usize = 2048;
/// Letters of the asker's own mark that are given back.
const ID_MAX: usize = 64;

/// A request as it comes, for example `{"request":"feed_override","pct":80,"reason":"...","id":"..."}`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RequestDocument {
    request: String,
    pct: Option<f64>,
    reason: Option<String>,
    code: Option<String>,
    pub(super) id: Option<String>,
}

pub(super) fn document_of(payload: &[u8]) -> Result<RequestDocument, RequestRefusal> {
    if payload.len() > REQUEST_BYTES_MAX {
        return Err(RequestRefusal::TooLong { bytes: payload.len(), most: REQUEST_BYTES_MAX });
    }
    let mut document: RequestDocument = serde_json::from_slice(payload)
        .map_err(|error| RequestRefusal::Unreadable { error: error.to_string(), forms: FORMS })?;
    document.id = document.id.map(|id| id.chars().take(ID_MAX).collect());
    Ok(document)
}

const FORMS: &str = "write {\"request\":\"feed_override\",\"pct\":80}, {\"request\":\"withdraw\"} or \
                     {\"request\":\"acknowledge_alarm\",\"code\":\"...\"}";

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
