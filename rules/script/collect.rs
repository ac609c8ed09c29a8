//! What a script leaves behind in one run.

use super::decision::{Axis, Stop};
use super::timers::{AlarmText, NAMES_MAX, Timers, too_many};
use super::vocabulary::Word;
use adapter_core::clock::TimeNs;
use rhai::{Dynamic, EvalAltResult, ImmutableString};
use std::sync::Arc;

/// At most this many notes in one run.
const NOTES_MAX: usize = 8;

/// At most so many calls of `forget` in one run.
const FORGET_MAX: usize = 16;

pub(super) type ScriptResult<T> = Result<T, Box<EvalAltResult>>;

/// A number asked for, and why.
pub(super) type Asked = (f64, ImmutableString);

/// What one run of one script leaves behind.
#[derive(Debug, Default)]
pub(super) struct RunOutput {
    pub(super) now_ns: TimeNs,
    pub(super) timers: Timers,
    pub(super) request: Option<Asked>,
    /// The word whose value is asked for at every tick, and why.
    pub(super) follows: Option<(&'static Word, ImmutableString)>,
    /// Programs whose load is to be learned anew.
    pub(super) learn_anew: Vec<ImmutableString>,
    pub(super) stops: Vec<(Stop, ImmutableString)>,
    pub(super) offsets: Vec<(Axis, Asked)>,
    pub(super) alarms: Vec<(ImmutableString, AlarmText)>,
    pub(super) notes: Vec<ImmutableString>,
    pub(super) published: Vec<(ImmutableString, Option<f64>)>,
    /// Settings whose value depends on tool and operation.
    pub(super) live: Option<Arc<[Dynamic]>>,
    refusals: Vec<(&'static str, String)>,
    forgotten: usize,
}

impl RunOutput {
    /// Ready for the next run; keeps the buffers.
    pub(super) fn begin_run(&mut self, now_ns: TimeNs) {
        self.now_ns = now_ns;
        self.request = None;
        self.follows = None;
        self.learn_anew.clear();
        self.stops.clear();
        self.offsets.clear();
        self.alarms.clear();
        self.notes.clear();
        self.published.clear();
        self.refusals.clear();
        self.forgotten = 0;
    }

    /// Looks through everything that was put away, which a loop could make long.
    pub(super) fn forget_numbers(&mut self, beginning: &str) -> ScriptResult<()> {
        self.forgotten += 1;
        if self.forgotten > FORGET_MAX {
            return Err(format!("forget was called more than {FORGET_MAX} times in one run").into());
        }
        self.timers.forget_numbers(beginning);
        Ok(())
    }

    /// A method had no answer in this run; the last reason of each counts.
    pub(super) fn record_refusal(&mut self, method: &'static str, reason: &str) {
        self.refusals.retain(|(known, _)| *known != method);
        self.refusals.push((method, reason.to_owned()));
    }

    /// Why the method of this name last had no answer in this run; `()` where it had one.
    pub(super) fn explain_refusal(&self, method: &str) -> Dynamic {
        let found = self.refusals.iter().find(|(known, _)| *known == method);
        found.map_or(Dynamic::UNIT, |(_, reason)| reason.into())
    }

    /// What methods refused in this run, for the operator.
    pub(super) fn list_refusals(&self) -> impl Iterator<Item = String> {
        self.refusals.iter().map(|(method, reason)| format!("{method} has no value ({reason})"))
    }

    pub(super) fn add_alarm(&mut self, name: ImmutableString, text: AlarmText) -> ScriptResult<()> {
        if let Some(known) = self.alarms.iter_mut().find(|(known, _)| *known == name) {
            known.1 = text;
        } else if self.alarms.len() < NAMES_MAX {
            self.alarms.push((name, text));
        } else {
            return Err(too_many("alarms", NAMES_MAX));
        }
        Ok(())
    }

    pub(super) fn add_note(&mut self, text: ImmutableString) {
        if self.notes.len() < NOTES_MAX {
            self.notes.push(text);
        }
    }

    /// Raises or clears by what the condition has been for `hold_s`; `None` leaves the alarm as it is.
    pub(super) fn alarm_turning(
        &mut self,
        name: ImmutableString,
        wanted: Option<bool>,
        hold_s: f64,
        text: AlarmText,
    ) -> ScriptResult<()> {
        let stands = self.timers.alarm_turning(&name, wanted, hold_s, self.now_ns)?;
        if stands { self.add_alarm(name, text) } else { Ok(()) }
    }

    /// What was learned of the load of this program is learned anew.
    pub(super) fn learn_anew(&mut self, program: ImmutableString) -> ScriptResult<()> {
        if self.learn_anew.len() >= FORGET_MAX {
            return Err(format!("learn_anew was called more than {FORGET_MAX} times in one run").into());
        }
        self.learn_anew.push(program);
        Ok(())
    }

    /// Of requests that are the same, the last reason counts.
    pub(super) fn request_stop(&mut self, stop: Stop, reason: ImmutableString) -> ScriptResult<()> {
        self.stops.retain(|(known, before)| *known != stop || !stop.is_same_request(before, &reason));
        if self.stops.len() >= NAMES_MAX {
            return Err(too_many("requests", NAMES_MAX));
        }
        self.stops.push((stop, reason));
        Ok(())
    }

    /// The last offset proposed for each axis counts.
    pub(super) fn propose_offset(&mut self, axis: Axis, asked: Asked) {
        self.offsets.retain(|(known, _)| *known != axis);
        self.offsets.push((axis, asked));
    }

    /// The last value of each channel counts.
    pub(super) fn publish_value(&mut self, name: ImmutableString, value: Option<f64>) {
        self.published.retain(|(known, _)| *known != name);
        self.published.push((name, value));
    }
}
