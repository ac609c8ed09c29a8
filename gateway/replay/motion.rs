//! How the states agree with what the machine itself says: its speed, and its motion words where a recording has them.

use adapters::{ChannelId, Sample};
use rules::estimators::{Estimates, State};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Words counted one by one; further ones are counted together.
const WORDS_MAX: usize = 64;

/// A spindle slower than this stands still, rpm.
const STANDS_BELOW_RPM: f64 = 10.0;

/// Rows by motion word and state, and edges of the spindle.
#[derive(Debug, Clone, Default)]
pub struct Motion {
    rows: BTreeMap<Arc<str>, [u64; State::ALL.len()]>,
    channels: Option<(ChannelId, ChannelId)>,
    /// Did the spindle turn in the row before, and did the state say so?
    before: Option<(bool, bool)>,
    /// Times the speed went from standing still to turning or back.
    pub edges: u64,
    /// Of these, times the state was right in the row before and in the row itself.
    pub right: u64,
}

impl Motion {
    /// Compares one row with the estimated state; counts nothing where the channels are absent.
    pub fn add(&mut self, sample: &Sample, estimates: &Estimates) {
        let found = || Some((ChannelId::from_name("motion")?, ChannelId::from_name("spindle_speed_rpm")?));
        let Some((motion, speed)) = self.channels.or_else(found) else { return };
        self.channels = Some((motion, speed));
        self.add_edge(sample.number(speed).ok(), estimates);
        self.add_word(sample.text(motion), estimates);
    }

    fn add_edge(&mut self, speed_rpm: Option<f64>, estimates: &Estimates) {
        let now = speed_rpm.map(|rpm| {
            let turns = rpm.abs() >= STANDS_BELOW_RPM;
            (turns, estimates.state.spindle_on().or(estimates.spindle_turns) == Some(turns))
        });
        if let (Some((turned, was_right)), Some((turns, is_right))) = (self.before, now)
            && turned != turns
        {
            self.edges += 1;
            self.right += u64::from(was_right && is_right);
        }
        self.before = now;
    }

    fn add_word(&mut self, word: Option<&str>, estimates: &Estimates) {
        let Some(word) = word else { return };
        let word = if self.rows.len() < WORDS_MAX || self.rows.contains_key(word) { word } else { "(others)" };
        if !self.rows.contains_key(word) {
            self.rows.insert(Arc::from(word), [0; State::ALL.len()]);
        }
        if let Some(counts) = self.rows.get_mut(word) {
            counts[usize::from(estimates.state.to_code())] += 1;
        }
    }

    /// One line per word: how many rows, and in which states they were, most frequent first.
    pub(super) fn format_lines(&self) -> Vec<String> {
        let wide = self.rows.keys().map(|word| word.chars().count()).max().unwrap_or(0);
        self.rows.iter().map(|(word, counts)| format_line(word, wide, counts)).collect()
    }

    /// Rows per word and state, where the recording has such words; states that never occur are left out.
    #[must_use]
    pub fn to_json(&self) -> Option<Value> {
        let row = |counts: &[u64; State::ALL.len()]| -> Map<String, Value> {
            let each = State::ALL.into_iter().zip(counts).filter(|(_, count)| **count > 0);
            each.map(|(state, count)| (state.as_word().to_owned(), json!(count))).collect()
        };
        let words = self.rows.iter().map(|(word, counts)| (word.to_string(), Value::Object(row(counts))));
        (!self.rows.is_empty()).then(|| Value::Object(words.collect()))
    }
}

fn format_line(word: &str, wide: usize, counts: &[u64; State::ALL.len()]) -> String {
    let all: u64 = counts.iter().sum();
    let mut states: Vec<(State, u64)> = State::ALL.into_iter().zip(*counts).filter(|(_, count)| *count > 0).collect();
    states.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    #[expect(clippy::cast_precision_loss, reason = "a share")]
    let share =
        |(state, count): &(State, u64)| format!("{} {:.0} %", state.as_word(), 100.0 * *count as f64 / all as f64);
    let shares: Vec<String> = states.iter().map(share).collect();
    format!("{word:<wide$} {all:>8} rows: {}", shares.join(", "))
}
