//! The last rows, as a recording that a model can be simulated over: every second of the last moments and, for laws
//! with a memory of hours, one row per half minute of the shift before them.

use super::second_row::Row;
use adapter_core::channel::{ChannelId, Kind};
use adapter_core::clock::{SECOND_NS, TimeNs};
use recording::{Cells, Numbers, Recording, Words};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Seconds kept one by one.
const FINE_ROWS: usize = 12;
/// The same for laws that look back to the beginning of a pass.
const PASS_ROWS: usize = 180;
/// Seconds per row further back.
const COARSE_S: i64 = 30;
/// Rows further back: eight hours.
const COARSE_ROWS: usize = 960;
/// Tools whose cutting time is counted; the one used longest ago is forgotten first.
const TOOLS_MAX: usize = 64;
/// A longer step from one second to the next is a pause in which nothing is cut.
const STEP_MAX_S: f64 = 3.0;

/// How far back a model looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LookBack {
    /// No further than the present moment.
    Moment,
    /// As long as a pass takes.
    Pass,
    /// A whole shift: what warms up slowly.
    Shift,
}

impl LookBack {
    /// How far back the law of this kind looks.
    #[must_use]
    pub fn from_kind(kind: &str) -> Self {
        match kind {
            "bearing_warm_up"
            | "preload_growth"
            | "spindle_growth"
            | "screw_growth"
            | "coolant_temperature"
            | "ambient_drift" => Self::Shift,
            "depth_taper" | "entry_exit" | "engagement_timing" | "meter_window" | "clock_lag" | "override_delay"
            | "built_up_edge" | "regeneration" => Self::Pass,
            _ => Self::Moment,
        }
    }
}

/// Engaged minutes of each tool.
pub type CuttingTimes = BTreeMap<String, (f64, TimeNs)>;

/// The seconds behind the present one that a model looks back at.
#[derive(Debug, Clone)]
pub struct Window {
    look_back: LookBack,
    fine: VecDeque<(Row, Option<f64>)>,
    coarse: VecDeque<(Row, Option<f64>)>,
    cutting_times: CuttingTimes,
}

impl Window {
    /// An empty window; `minutes` is what the tools have cut before.
    #[must_use]
    pub fn new(memory: LookBack, minutes: CuttingTimes) -> Self {
        Self { look_back: memory, fine: VecDeque::new(), coarse: VecDeque::new(), cutting_times: minutes }
    }

    /// Engaged minutes of each tool so far.
    #[must_use]
    pub fn cutting_times(&self) -> &CuttingTimes {
        &self.cutting_times
    }

    /// Seconds between the first row and the last.
    #[must_use]
    pub fn span_s(&self) -> f64 {
        let first = self.coarse.front().or(self.fine.front());
        first.zip(self.fine.back()).map_or(0.0, |(first, last)| ns_to_seconds(last.0.at_ns - first.0.at_ns))
    }

    /// Appends a second. The oldest are dropped; of a shift one of every half minute is kept.
    pub fn push(&mut self, row: Row) {
        let minutes = self.add_cutting_time(&row);
        self.fine.push_back((row, minutes));
        let kept = if self.look_back == LookBack::Moment { FINE_ROWS } else { PASS_ROWS };
        while self.fine.len() > kept {
            let Some(old) = self.fine.pop_front() else { break };
            if self.look_back == LookBack::Shift {
                self.keep_coarse_row(old);
            }
        }
    }

    /// One row of every half minute is kept.
    fn keep_coarse_row(&mut self, old: (Row, Option<f64>)) {
        let due = self.coarse.back().is_none_or(|(last, _)| old.0.at_ns - last.at_ns >= COARSE_S * SECOND_NS);
        if due {
            self.coarse.push_back(old);
            self.coarse.drain(..self.coarse.len().saturating_sub(COARSE_ROWS));
        }
    }

    /// Adds the second to the cutting time of its tool.
    fn add_cutting_time(&mut self, row: &Row) -> Option<f64> {
        let engaged = row.read_engagement()?;
        let step_s = self.fine.back().map_or(0.0, |(last, _)| ns_to_seconds(row.at_ns - last.at_ns));
        let tool = row.read_word("tool").unwrap_or("");
        if !self.cutting_times.contains_key(tool) && self.cutting_times.len() >= TOOLS_MAX {
            let oldest =
                self.cutting_times.iter().min_by_key(|(_, (_, used_ns))| *used_ns).map(|(tool, _)| tool.clone());
            oldest.map(|tool| self.cutting_times.remove(&tool));
        }
        let entry = self.cutting_times.entry(tool.to_owned()).or_insert((0.0, row.at_ns));
        if (0.0..=STEP_MAX_S).contains(&step_s) {
            *entry = (entry.0 + engaged * step_s / 60.0, row.at_ns);
        }
        Some(entry.0)
    }

    /// The rows as a recording with every channel that had a value in any of them.
    #[must_use]
    pub fn to_recording(&self) -> Recording {
        let rows: Vec<&(Row, Option<f64>)> = self.coarse.iter().chain(&self.fine).collect();
        let start_ns = rows.first().map_or(0, |(row, _)| row.at_ns);
        let time_s = rows.iter().map(|(row, _)| ns_to_seconds(row.at_ns - start_ns)).collect();
        let mut recording = Recording::new("live", time_s, Some(start_ns));
        let number = |row: &Row, index: usize| row.numbers.get(index).copied().flatten();
        for id in ChannelId::list_all() {
            let index = id.index();
            if id.channel().kind == Kind::Text {
                if rows.iter().any(|(row, _)| row.words.contains_key(&index)) {
                    let word = |row: &Row| row.words.get(&index).map_or(Arc::from(""), Arc::clone);
                    let words: Vec<Arc<str>> = rows.iter().map(|(row, _)| word(row)).collect();
                    recording.set_column(id.name(), Cells::Words(words.iter().map(|word| &**word).collect::<Words>()));
                }
            } else if rows.iter().any(|(row, _)| number(row, index).is_some()) {
                let numbers = rows.iter().map(|(row, _)| number(row, index)).collect::<Numbers>();
                recording.set_column(id.name(), Cells::Numbers(numbers));
            }
        }
        let engaged = rows.iter().map(|(row, _)| row.read_engagement()).collect();
        recording.set_column("engaged", Cells::Numbers(engaged));
        let minutes = rows.iter().map(|(_, minutes)| *minutes).collect();
        recording.set_column("cutting_time_min", Cells::Numbers(minutes));
        recording
    }
}

fn ns_to_seconds(ns: i64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "microseconds suffice beyond a hundred days")]
    let seconds = ns as f64 / SECOND_NS as f64;
    seconds
}
