//! A feed override that a script follows: an estimate whose value is asked for at every tick, also between two runs of the script.

use crate::decision::OverrideRequest;
use crate::script_set::Script;
use crate::vocabulary::{View, Word, WordValue};
use rhai::ImmutableString;
use std::sync::Arc;

#[derive(Default)]
pub(super) struct Follows {
    word: Option<(&'static Word, Arc<str>)>,
    request: Option<OverrideRequest>,
}

impl Follows {
    /// What the newest run of the script follows, and why.
    pub(super) fn set_followed_word(&mut self, wanted: Option<(&'static Word, ImmutableString)>) {
        match (&mut self.word, wanted) {
            (Some((word, reason)), Some((wanted, why))) if word.name == wanted.name && **reason == *why => {}
            (word, wanted) => {
                self.request = None;
                *word = wanted.map(|(word, reason)| (word, Arc::from(reason.as_str())));
            }
        }
    }

    /// Nothing is followed any more.
    pub(super) fn stop_following(&mut self) {
        (self.word, self.request) = (None, None);
    }

    /// What is asked for at this tick.
    pub(super) fn update_request(&mut self, view: &View<'_>, script: &Script) {
        let Some((word, reason)) = &self.word else { return };
        match (word.read_value(view), &mut self.request) {
            (WordValue::Number(pct), Some(request)) => request.pct = pct,
            (WordValue::Number(pct), request) => {
                let (reason, file) = (reason.clone(), script.file.clone());
                *request = Some(OverrideRequest { pct, reason, script: file, version: script.version });
            }
            (_, request) => *request = None,
        }
    }

    pub(super) fn request(&self) -> Option<&OverrideRequest> {
        self.request.as_ref()
    }
}
