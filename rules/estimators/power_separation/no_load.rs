//! No-load power per gear stage and speed, several visits put together.

use super::rows::rows;
use super::stretches::{SAME_SPEED, Stretch, stretches};
use crate::estimators::SPEEDS_PER_STAGE;
use crate::estimators::regression::{CONFIDENCE, Refusal, RefusalKind, t_quantile};
use adapters::Recording;
use serde::Serialize;

/// No-load power at one speed of one gear stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpeedLearned {
    /// Gear stage; 0 where the recording has none.
    pub stage: usize,
    /// Speed.
    pub speed_rpm: f64,
    /// No-load power.
    pub power_w: f64,
    /// Standard error.
    pub standard_error_w: f64,
    /// Ends of the 95 % interval.
    pub interval_w: (f64, f64),
    /// Visits of this speed.
    pub visits: usize,
    /// Standard deviation from visit to visit beyond the noise; `None` with one visit.
    pub between_visits_w: Option<f64>,
    /// Settled seconds in all visits together.
    pub settled_s: f64,
    /// Greatest drift within a visit that noise does not explain.
    pub drift_w: Option<f64>,
}

/// What a recording tells about no-load power.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoLoadLearned {
    /// By gear stage and speed.
    pub speeds: Vec<SpeedLearned>,
    /// The stretches that it rests on.
    pub stretches: Vec<Stretch>,
    /// What the reader should know.
    pub notes: Vec<String>,
}

/// Finds the idle stretches of a recording and the no-load power at each of their speeds.
///
/// # Errors
/// A [`Refusal`] where the recording has no settled idling, or a column or unit is wrong.
pub fn identify_no_load(recording: &Recording) -> Result<NoLoadLearned, Refusal> {
    let stretches = stretches(&rows(recording)?);
    if stretches.is_empty() {
        return Err(Refusal::new(
            RefusalKind::TooFew,
            "no stretch in which the spindle turns at a steady speed, without feed, for 7 s or longer",
            "let the spindle turn for a minute at each speed of interest, axes at rest",
        ));
    }
    let mut speeds: Vec<SpeedLearned> = Vec::new();
    for visits in grouped(&stretches) {
        speeds.push(pooled(&visits)?);
    }
    let notes = notes(&speeds);
    Ok(NoLoadLearned { speeds, stretches, notes })
}

/// Visits of the same stage and speed.
fn grouped(stretches: &[Stretch]) -> Vec<Vec<&Stretch>> {
    let mut sorted: Vec<&Stretch> = stretches.iter().collect();
    sorted.sort_by(|a, b| a.stage.cmp(&b.stage).then(a.speed_rpm.total_cmp(&b.speed_rpm)));
    let mut groups: Vec<Vec<&Stretch>> = Vec::new();
    for stretch in sorted {
        match groups.last_mut() {
            Some(group)
                if group[0].stage == stretch.stage && stretch.speed_rpm <= group[0].speed_rpm * (1.0 + SAME_SPEED) =>
            {
                group.push(stretch);
            }
            _ => groups.push(vec![stretch]),
        }
    }
    groups
}

fn pooled(visits: &[&Stretch]) -> Result<SpeedLearned, Refusal> {
    let count = crate::estimators::filter::count(visits.len());
    let mean = |of: &dyn Fn(&Stretch) -> f64| visits.iter().map(|visit| of(visit)).sum::<f64>() / count;
    let power_w = mean(&|visit| visit.level.mean);
    let speed_rpm = mean(&|visit| visit.speed_rpm);
    let within = mean(&|visit| visit.level.standard_error.powi(2));
    let place = format!("gear stage {}, {speed_rpm:.0} rpm", visits[0].stage);
    if power_w <= 0.0 {
        let what = format!("the spindle idles at {power_w:.1} W");
        let next = "no-load power is positive: look at the sign and the wiring of the meter";
        return Err(Refusal::new(RefusalKind::Contradiction, what, next).at(place));
    }
    let spread = visits.iter().map(|visit| (visit.level.mean - power_w).powi(2)).sum::<f64>() / (count - 1.0);
    let (variance, freedom) = if visits.len() > 1 {
        ((spread / count).max(within / count), count - 1.0)
    } else {
        (within, visits[0].level.independent - 1.0)
    };
    let half = t_quantile(0.5 + 0.5 * CONFIDENCE, freedom.max(1.0)) * variance.sqrt();
    let drifts = visits.iter().filter(|visit| visit.drifts()).map(|visit| visit.drift_w());
    Ok(SpeedLearned {
        stage: visits[0].stage,
        speed_rpm,
        power_w,
        standard_error_w: variance.sqrt(),
        interval_w: (power_w - half, power_w + half),
        visits: visits.len(),
        between_visits_w: (visits.len() > 1).then(|| (spread - within).max(0.0).sqrt()),
        settled_s: visits.iter().map(|visit| visit.to_s - visit.from_s).sum(),
        drift_w: drifts.max_by(|a, b| a.abs().total_cmp(&b.abs())),
    })
}

fn notes(speeds: &[SpeedLearned]) -> Vec<String> {
    let mut notes = Vec::new();
    for stage in 0..crate::estimators::STAGES {
        let count = speeds.iter().filter(|speed| speed.stage == stage).count();
        if count > SPEEDS_PER_STAGE {
            notes.push(format!("gear stage {stage}: {count} speeds; the gateway keeps {SPEEDS_PER_STAGE}"));
        }
        if count == 1 || count == 2 {
            notes.push(format!("gear stage {stage}: {count} speeds; three or more make a curve"));
        }
    }
    notes
}
