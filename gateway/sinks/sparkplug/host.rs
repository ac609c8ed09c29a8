//! The primary host: what it says of itself on `spBv1.0/STATE/ID`. Pure.
//!
//! Source: Eclipse Sparkplug Specification 3.0.0, 5.4 and 6.4.27 (`tck-id-message-flow-edge-node-birth-publish-phid-*`).

use serde::Deserialize;

/// `{"online":true,"timestamp":...}`, retained by the broker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
struct HostState {
    online: bool,
    #[serde(default)]
    timestamp: i64,
}

/// What is known of the primary host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct PrimaryHost {
    /// Of the last message that counted.
    timestamp: Option<i64>,
    pub(super) online: bool,
}

impl PrimaryHost {
    /// At a new connection: whether it is there has to be heard again.
    pub(super) fn asked_again(self) -> Self {
        Self { online: false, ..self }
    }

    /// Takes a message of the host; one that is older than the last, such as the will of a connection before, does not count.
    pub(super) fn accept_message(&mut self, payload: &[u8]) {
        let Ok(state) = serde_json::from_slice::<HostState>(payload) else { return };
        if self.timestamp.is_none_or(|last| state.timestamp >= last) {
            *self = Self { timestamp: Some(state.timestamp), online: state.online };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_older_message_changes_nothing() {
        let mut host = PrimaryHost::default();
        host.accept_message(b"{\"online\":true,\"timestamp\":50}");
        assert!(host.online);
        host.accept_message(b"{\"online\":false,\"timestamp\":49}");
        assert!(host.online, "the will of an older connection");
        host.accept_message(b"nonsense");
        assert!(host.online);
        host.accept_message(b"{\"online\":false,\"timestamp\":50}");
        assert!(!host.online);
    }
}
