//! The source's state machine, read plainly: what the product has to beat.
//!
//! Five states; one window of N filtered powers; no-load power is the mean of that window and is kept until the spindle
//! stands still; no slope test, no hysteresis, no dwell, no table, no learning in idle. Where the text gives no return
//! transition the condition of the forward one is negated. A missing value is the last one. Tolerances are those of the
//! range in the text that serve it best: c1 = 0.15, c2 = 0.05.

use adapters::{ChannelId, Sample};
use rules::estimators::{AntiPulse, Settings, State, is_stationary};
use std::collections::VecDeque;

const WINDOW: usize = 20;
const FILTER: usize = 10;
const C1: f64 = 0.15;
const C2: f64 = 0.05;
/// The text says "0"; a meter never reads exactly that.
const OFF_POWER_W: f64 = 20.0;

/// The state machine with its window.
pub struct PlainReading {
    /// What it says.
    pub state: State,
    /// The no-load power that it believes.
    pub no_load_w: Option<f64>,
    filter: AntiPulse,
    window: VecDeque<f64>,
    settings: Settings,
    channels: [ChannelId; 4],
    last: [f64; 4],
}

impl Default for PlainReading {
    fn default() -> Self {
        Self::new()
    }
}

impl PlainReading {
    /// Before the first sample: off.
    pub fn new() -> Self {
        let mut settings = Settings::default();
        settings.set_value("c1", C1).expect("in range");
        let names = ["total_power_w", "spindle_speed_rpm", "feed_mm_min", "spindle_power_w"];
        Self {
            state: State::Off,
            no_load_w: None,
            filter: AntiPulse::new(FILTER),
            window: VecDeque::new(),
            settings,
            channels: names.map(|name| ChannelId::from_name(name).expect("in the table")),
            last: [0.0; 4],
        }
    }

    /// One sample.
    pub fn step(&mut self, sample: &Sample) {
        for (last, channel) in self.last.iter_mut().zip(self.channels) {
            *last = sample.number(channel).unwrap_or(*last);
        }
        let [total_w, speed_rpm, feed_mm_min, power_w] = self.last;
        let Some(power_w) = self.filter.push(power_w) else { return };
        if self.window.len() == WINDOW {
            self.window.pop_front();
        }
        self.window.push_back(power_w);
        self.state = self.next(total_w, speed_rpm.abs(), feed_mm_min, power_w);
    }

    fn next(&mut self, total_w: f64, speed_rpm: f64, feed_mm_min: f64, power_w: f64) -> State {
        if total_w < OFF_POWER_W {
            return State::Off;
        }
        if speed_rpm < 10.0 {
            return State::Standby;
        }
        match self.state {
            State::Off | State::Standby => {
                self.window.clear();
                self.no_load_w = None;
                State::SpindleStart
            }
            State::SpindleStart => self.settle(),
            _ => {
                let no_load_w = self.no_load_w.unwrap_or(power_w);
                let loaded = feed_mm_min > 0.0 && (power_w - no_load_w) / no_load_w >= C2;
                if loaded { State::Cutting } else { State::Idle }
            }
        }
    }

    fn settle(&mut self) -> State {
        let mean_w = self.window.iter().sum::<f64>() / self.window.len() as f64;
        if self.window.len() < WINDOW || !is_stationary(self.window.iter().copied(), mean_w, &self.settings) {
            return State::SpindleStart;
        }
        self.no_load_w = Some(mean_w);
        State::Idle
    }
}
