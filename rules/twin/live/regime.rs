//! What the machine is doing as far as the comparison is concerned: told from the inputs alone, never from the output
//! that is compared.

use super::second_row::Row;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fmt;

/// Seconds of the same work before a second counts: run-ups, entries into the cut and lags are over.
const SETTLED_BEFORE: usize = 4;
/// Seconds of the same work after it.
const SETTLED_AFTER: usize = 2;
/// Relative change of the speed from one second to the next that is no steady speed.
const STEADY_SHARE: f64 = 0.02;

/// A kind of state with a noise of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Regime {
    /// Powered, spindle and axes at rest.
    Standby,
    /// The spindle turns, nothing is cut.
    Idle,
    /// The tool is in the work.
    Cutting,
    /// An axis moves; the spindle is not concerned.
    Moving,
}

impl Regime {
    /// Every regime, for tables of words.
    pub const ALL: [Self; 4] = [Self::Standby, Self::Idle, Self::Cutting, Self::Moving];

    /// The word in JSON.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Standby => "standby",
            Self::Idle => "idle",
            Self::Cutting => "cutting",
            Self::Moving => "moving",
        }
    }

    /// As part of a sentence, English and Chinese.
    #[must_use]
    pub fn as_phrases(self) -> (&'static str, &'static str) {
        match self {
            Self::Standby => ("at standstill", "静止时"),
            Self::Idle => ("while idling", "空转时"),
            Self::Cutting => ("while cutting", "切削时"),
            Self::Moving => ("while the axis moves", "轴运动时"),
        }
    }
}

impl fmt::Display for Regime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_word())
    }
}

/// Regime and kind of work of a second; `None` while the machine is off or what it does is not known.
#[must_use]
pub fn classify_row(row: &Row) -> Option<(Regime, String)> {
    let number = |name: &str| row.read_number(name);
    let rapid = number("rapid").is_some_and(|rapid| rapid > 0.0);
    if row.off || rapid {
        return None;
    }
    let speed = number("spindle_speed_rpm").or_else(|| number("spindle_programmed_rpm")).map(f64::abs);
    let feed = number("axis_velocity_mm_min").or_else(|| number("velocity_m_s")).map(f64::abs);
    let engaged = row.read_engagement();
    let regime = match (speed, engaged, feed) {
        (Some(speed), Some(engaged), _) if speed > 1.0 && engaged >= 1.0 => Regime::Cutting,
        (_, Some(engaged), _) if engaged > 0.0 => return None,
        (Some(speed), ..) if speed > 1.0 => Regime::Idle,
        (_, _, Some(feed)) if feed > 0.0 => Regime::Moving,
        (None, _, None) => return None,
        _ => Regime::Standby,
    };
    Some((regime, format_work_key(regime, row)))
}

/// Program, operation, tool without the number of its edge, and gear stage: what a model fits differently.
fn format_work_key(regime: Regime, row: &Row) -> String {
    let word = |name: &str| row.read_word(name).unwrap_or("");
    let tool = word("tool").split('-').next().unwrap_or("");
    let stage = row.read_number("gear_stage").map_or(String::new(), |stage| format!("{stage:.0}"));
    match regime {
        Regime::Cutting => format!("{}/{}/{tool}/{stage}", word("program"), word("operation")),
        Regime::Idle => format!("{:.0}/{stage}", row.read_number("spindle_speed_rpm").unwrap_or(0.0) / 50.0),
        Regime::Standby | Regime::Moving => String::new(),
    }
}

/// Lets a second through when the same has been going on before and goes on after it.
#[derive(Debug, Clone, Default)]
pub struct Settling<T> {
    held: VecDeque<Held<T>>,
}

/// A second that waits: what is done, the speed, and what goes with it.
type Held<T> = (Option<(Regime, String)>, f64, T);

impl<T: Copy> Settling<T> {
    /// No second is held yet.
    #[must_use]
    pub fn new() -> Self {
        Self { held: VecDeque::new() }
    }

    /// Takes a second with its speed; gives an earlier one that was settled. A gap breaks the stretch.
    pub fn add_second(&mut self, what: Option<(Regime, String)>, speed: f64, second: T) -> Option<(Regime, String, T)> {
        self.held.push_back((what, speed, second));
        let length = SETTLED_BEFORE + 1 + SETTLED_AFTER;
        while self.held.len() > length {
            self.held.pop_front();
        }
        if self.held.len() < length {
            return None;
        }
        let (what, speed, second) = &self.held[SETTLED_BEFORE];
        let (regime, work) = what.as_ref()?;
        let steady = |other: f64| (other - speed).abs() <= STEADY_SHARE * speed.abs().max(1.0);
        let same = self.held.iter().all(|(other, its_speed, _)| other == what && steady(*its_speed));
        same.then(|| (*regime, work.clone(), *second))
    }

    /// Something is missing in between.
    pub fn reset_stretch(&mut self) {
        self.held.clear();
    }
}
