//! Keeps a script from flooding the history with notes.

use adapter_core::clock::{SECOND_NS, TimeNs};
use std::sync::Arc;

/// Notes of one script in one minute.
const PER_MINUTE: u32 = 20;
const MINUTE_NS: i64 = 60 * SECOND_NS;

/// What one script has noted in the current minute.
#[derive(Debug, Default)]
pub(super) struct NoteLimit {
    began_ns: Option<TimeNs>,
    written: Vec<Arc<str>>,
    full: bool,
}

impl NoteLimit {
    /// The text when it may be written: not twice in a minute, not more than twenty; the last of them says so.
    pub(super) fn admit_note(&mut self, text: &str, now_ns: TimeNs) -> Option<Arc<str>> {
        let began_ns = *self.began_ns.get_or_insert(now_ns);
        if now_ns < began_ns || now_ns - began_ns >= MINUTE_NS {
            *self = Self { began_ns: Some(now_ns), ..Self::default() };
        }
        if self.full || self.written.iter().any(|known| **known == *text) {
            return None;
        }
        self.full = self.written.len() as u32 + 1 >= PER_MINUTE;
        let suffix = if self.full { " (further notes of this minute are left out)" } else { "" };
        let text: Arc<str> = format!("{text}{suffix}").into();
        self.written.push(text.clone());
        Some(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_different_notes_a_minute() {
        let mut limit = NoteLimit::default();
        let admitted = (0..100).filter_map(|i| limit.admit_note(&format!("note {i}"), i)).count();
        assert_eq!(admitted, 20);
        assert!(limit.admit_note("later", MINUTE_NS).is_some());
        assert!(limit.admit_note("later", MINUTE_NS + 1).is_none());
    }
}
