//! The limits that no script can widen, as the configuration gives them.

use adapter_core::Axis;
use std::time::Duration;

/// How far the gate goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GateMode {
    /// Nothing is decided; 100 % is held.
    Off,
    /// Decided and recorded, never written.
    Shadow,
    /// May be armed on the box; until then as in shadow.
    Armed,
}

impl GateMode {
    /// The word in the configuration, in the history and on the page.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Shadow => "shadow",
            Self::Armed => "armed",
        }
    }
}

/// `[gate]`: the limits that no script can widen.
#[derive(Debug, Clone, PartialEq)]
pub struct GateConfig {
    /// How far it goes.
    pub mode: GateMode,
    /// Name of the source that is written to.
    pub source: Option<String>,
    /// Least override, whole percent, 10 to 100.
    pub min_pct: f64,
    /// Greatest override, whole percent, 100 to 200.
    pub max_pct: f64,
    /// Greatest rise, percent per second.
    pub slew_up_pct_per_s: f64,
    /// Greatest fall, percent per second.
    pub slew_down_pct_per_s: f64,
    /// May the override exceed the operator's dial? Then the ladder multiplies the two.
    pub above_dial: bool,
    /// A request within this of the one in force changes nothing, percent.
    pub dead_band_pct: f64,
    /// Least time between two changes.
    pub min_interval: Duration,
    /// Time between two signs of life.
    pub heartbeat: Duration,
    /// Data older than this holds 100 %.
    pub stale: Duration,
    /// Arming ends by itself after this.
    pub armed_for: Duration,
    /// The limits of thermal offsets, `[gate.offset]`.
    pub offset: OffsetConfig,
}

impl GateConfig {
    /// The furthest that overrides or offsets may go: what arming needs.
    #[must_use]
    pub fn greatest_mode(&self) -> GateMode {
        if self.offset.mode == GateMode::Armed { GateMode::Armed } else { self.mode }
    }
}

/// `[gate.offset]`: the limits of thermal offsets.
#[derive(Debug, Clone, PartialEq)]
pub struct OffsetConfig {
    /// How far it goes.
    pub mode: GateMode,
    /// Name of the source that is written to.
    pub source: Option<String>,
    /// Axes that may be shifted.
    pub axes: Vec<Axis>,
    /// Greatest change at a time, um.
    pub step_um: f64,
    /// Greatest shift from what the operator has set, um.
    pub total_um: f64,
    /// Least time between two writes.
    pub min_interval: Duration,
    /// Give back what the operator had set when nobody writes any more.
    pub restore: bool,
}
