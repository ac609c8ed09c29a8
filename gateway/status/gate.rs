//! What the gate says of itself: arming, override and offset.

use super::DecisionStatus;
use serde::Serialize;

/// The way of a feed override to the machine.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GateStatus {
    /// `off`, `shadow` (decide and record, write nothing) or `armed`.
    pub mode: &'static str,
    /// What the scripts ask for, %.
    pub wanted_pct: Option<f64>,
    /// Why they ask, in their words.
    pub reason: Option<String>,
    /// What the gate lets through (or would, in shadow), %.
    pub permitted_pct: Option<f64>,
    /// Why the gate holds back, where it does.
    pub held: Option<String>,
    /// What was really written, %; `null` in shadow.
    pub written_pct: Option<f64>,
    /// Who armed the gate, while it is armed.
    pub armed_by: Option<String>,
    /// When the arming ends by itself, milliseconds since 1970.
    pub armed_until_ms: Option<i64>,
    /// Why it is not armed.
    pub disarmed: Option<String>,
    /// Thermal offsets, where they are decided about.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<OffsetStatus>,
    /// The latest changes, newest first.
    pub recent: Vec<DecisionStatus>,
}

/// Thermal offsets on their way to the control.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OffsetStatus {
    /// `shadow` (decide and record, write nothing) or `armed`.
    pub mode: &'static str,
    /// The axes that may be shifted.
    pub axes: Vec<AxisShift>,
}

/// One axis that may be shifted, and how far it is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisShift {
    /// `x`, `y` or `z`.
    pub axis: &'static str,
    /// What the scripts propose, um.
    pub wanted_um: Option<f64>,
    /// What is shifted in the control, um.
    pub shift_um: f64,
}
