//! Experiments: stretches of turning.

use adapters::simulated::{ExperimentCut, ExperimentStep};

pub(crate) const SPEED_RPM: f64 = 900.0;
pub(crate) const DIAMETER_MM: f64 = 60.0;

/// Turning in the air.
pub(crate) fn air(seconds: f64) -> ExperimentStep {
    ExperimentStep {
        seconds,
        spindle_rpm: SPEED_RPM,
        gear_stage: Some(1),
        cut: None,
        axis_mm_min: 0.0,
        coolant_on: false,
        hydraulics_on: false,
        override_pct: 100,
        new_edge: false,
    }
}

/// The tool feeds and meets nothing.
pub(crate) fn air_cut(seconds: f64, feed_mm_min: f64) -> ExperimentStep {
    ExperimentStep { axis_mm_min: -feed_mm_min, ..air(seconds) }
}

/// Turning at this depth for so many seconds of the programmed feed.
pub(crate) fn cut(seconds: f64, feed_mm_min: f64, depth_mm: f64) -> ExperimentStep {
    let cut = ExperimentCut { feed_mm_min, depth_mm, diameter_mm: DIAMETER_MM, onward: false };
    ExperimentStep { cut: Some(cut), ..air(seconds) }
}

/// The same without a retract: the depth changes under the tool.
pub(crate) fn onward(seconds: f64, feed_mm_min: f64, depth_mm: f64) -> ExperimentStep {
    let step = cut(seconds, feed_mm_min, depth_mm);
    ExperimentStep { cut: step.cut.map(|cut| ExperimentCut { onward: true, ..cut }), ..step }
}
