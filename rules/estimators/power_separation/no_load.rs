//! No-load power per gear stage and speed, several visits put together.

use super::rows::classify_rows;
use super::stretches::{SAME_SPEED, Stretch, find_stretches};
use crate::regression::{CONFIDENCE, Coefficient, Column, Intercept, Refusal, RefusalKind, fit_unweighted, t_quantile};
use crate::{SPEEDS_PER_STAGE, STAGES};
use numerics::statistics::count_to_f64;
use recording::Recording;
use serde::Serialize;

/// With so many visits of its own a speed needs no others to tell how much it differs from visit to visit.
const OWN_VISITS: usize = 5;

/// A visit in which the power drifts by more than this share is one of a spindle that warms up.
const WARM_UP: f64 = 0.02;

/// Visits of one speed that fall into two levels this far apart, as a share of their mean, are not of one condition. Friction
/// differs by 10 to 30 % between a cold and a warm spindle, step by step; two gear stages differ more and in one jump.
const TWO_LEVELS_SHARE: f64 = 0.1;
/// ... and the jump is so many times what either level scatters.
const TWO_LEVELS_SCATTER: f64 = 3.0;

/// No-load power at one speed of one gear stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpeedLearned {
    /// Gear stage; 0 where the recording has none.
    pub stage: usize,
    /// Magnitude of the spindle speed, rpm.
    pub speed_rpm: f64,
    /// Power of the spindle at this speed when nothing is cut, W.
    pub power_w: f64,
    /// Standard error of that power, W.
    pub standard_error_w: f64,
    /// Ends of the 95 % interval.
    pub interval_w: (f64, f64),
    /// Visits of this speed.
    pub visits: usize,
    /// Standard deviation from visit to visit beyond the noise; `None` where no speed was visited again.
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
    /// Standard deviation from visit to visit, relative; `None` where no speed was visited again.
    pub drift: Option<f64>,
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
    let stretches = find_stretches(&classify_rows(recording)?, f64::INFINITY);
    if stretches.is_empty() {
        return Err(Refusal::new(
            RefusalKind::TooFew,
            "no stretch in which the spindle turns at a steady speed, without feed, for 7 s or longer",
            "let the spindle turn for a minute at each speed of interest, axes at rest",
        ));
    }
    let mut speeds: Vec<SpeedLearned> = Vec::new();
    let (groups, left_out) = without_warm_up(group_by_speed(&stretches));
    let (groups, refused) = of_one_level(groups)?;
    let between = Between::from_groups(&groups);
    for visits in &groups {
        speeds.push(pool_visits(visits, between.as_ref())?);
    }
    let mut notes = list_notes(&speeds, &groups);
    notes.extend(refused.iter().map(|refusal| format!("left out: {refusal}")));
    if left_out > 0 {
        notes.push(format!("{left_out} visits in which the power drifted by more than 2 % are left out: warming up"));
    }
    let drift = between.map(|between| between.relative.sqrt());
    Ok(NoLoadLearned { speeds, drift, stretches, notes })
}

/// Visits of the same stage and speed.
fn group_by_speed(stretches: &[Stretch]) -> Vec<Vec<&Stretch>> {
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

/// Leaves out the visits in which the power drifts far, where a speed has others; how many those are.
fn without_warm_up(mut groups: Vec<Vec<&Stretch>>) -> (Vec<Vec<&Stretch>>, usize) {
    let far = |visit: &&Stretch| visit.is_drifting() && visit.drift_w().abs() > WARM_UP * visit.level.mean.abs();
    let mut left_out = 0;
    for visits in &mut groups {
        let drifting = visits.iter().filter(|visit| far(visit)).count();
        if drifting < visits.len() {
            visits.retain(|visit| !far(visit));
            left_out += drifting;
        }
    }
    (groups, left_out)
}

/// Where the visits of a speed fall into two levels: the greatest power of the lower and the least of the upper one, W.
fn two_levels(visits: &[&Stretch]) -> Option<(f64, f64)> {
    let mut levels: Vec<f64> = visits.iter().map(|visit| visit.level.mean).collect();
    levels.sort_by(f64::total_cmp);
    let jump = |at: &usize| levels[*at] - levels[*at - 1];
    let at = (1..levels.len()).max_by(|a, b| jump(a).total_cmp(&jump(b)))?;
    let (lower, upper) = levels.split_at(at);
    // One visit of its own is a cold start or a disturbance, no level.
    if lower.len() < 2 || upper.len() < 2 {
        return None;
    }
    let range = (lower[at - 1] - lower[0]).max(upper[upper.len() - 1] - upper[0]);
    let apart = jump(&at) > (TWO_LEVELS_SHARE * average_power_w(visits).abs()).max(TWO_LEVELS_SCATTER * range);
    apart.then(|| (lower[at - 1], upper[0]))
}

/// The speeds whose visits are of one level, and why the others are left out: a mean between two levels holds for neither.
///
/// # Errors
/// A [`Refusal`] where no speed is of one level.
fn of_one_level(groups: Vec<Vec<&Stretch>>) -> Result<(Vec<Vec<&Stretch>>, Vec<Refusal>), Refusal> {
    let (mut kept, mut refused) = (Vec::new(), Vec::new());
    for visits in groups {
        let Some((lower_w, upper_w)) = two_levels(&visits) else {
            kept.push(visits);
            continue;
        };
        let what = format!("two levels at one speed, {lower_w:.0} W and {upper_w:.0} W");
        let next = "two gear stages or two directions lie in one column: record gear_stage, or identify each by itself";
        let place = format!("gear stage {}, {:.0} rpm", visits[0].stage, visits[0].speed_rpm);
        refused.push(Refusal::new(RefusalKind::Ambiguous, what, next).with_place(place));
    }
    match refused.first() {
        Some(first) if kept.is_empty() => Err(first.clone()),
        _ => Ok((kept, refused)),
    }
}

/// How much no-load power differs from visit to visit, over all speeds that were visited again. Warmth acts in proportion
/// to the power, the supply and the meter's zero do not; the greater of the two counts.
struct Between {
    relative: f64,
    absolute_w2: f64,
    freedom: f64,
}

impl Between {
    fn from_groups(groups: &[Vec<&Stretch>]) -> Option<Self> {
        let freedom = groups.iter().map(|visits| count_to_f64(visits.len()) - 1.0).sum::<f64>();
        let absolute: f64 = groups.iter().map(|visits| sum_squared_deviations(visits)).sum();
        let relative: f64 =
            groups.iter().map(|visits| sum_squared_deviations(visits) / average_power_w(visits).powi(2)).sum();
        let of = |sum: f64| sum / freedom;
        (freedom >= 1.0).then(|| Self { relative: of(relative), absolute_w2: of(absolute), freedom })
    }

    /// Variance of one visit at this power, W2.
    fn visit_variance_w2(&self, power_w: f64) -> f64 {
        self.absolute_w2.max(self.relative * power_w * power_w)
    }
}

fn average_power_w(visits: &[&Stretch]) -> f64 {
    visits.iter().map(|visit| visit.level.mean).sum::<f64>() / count_to_f64(visits.len())
}

/// Sum of squares of the levels about their mean.
fn sum_squared_deviations(visits: &[&Stretch]) -> f64 {
    let middle = average_power_w(visits);
    visits.iter().map(|visit| (visit.level.mean - middle).powi(2)).sum()
}

/// The mean of the visits. Its variance is that from visit to visit, over the number of visits: by this speed's own
/// visits where there are enough, by those of all speeds together where there are not, and by the noise within the only
/// visit where no speed was visited again.
fn pool_visits(visits: &[&Stretch], between: Option<&Between>) -> Result<SpeedLearned, Refusal> {
    let visited = count_to_f64(visits.len());
    let power_w = average_power_w(visits);
    let speed_rpm = visits.iter().map(|visit| visit.speed_rpm).sum::<f64>() / visited;
    if power_w <= 0.0 {
        let what = format!("the spindle idles at {power_w:.1} W");
        let next = "no-load power is positive: look at the sign and the wiring of the meter";
        let place = format!("gear stage {}, {speed_rpm:.0} rpm", visits[0].stage);
        return Err(Refusal::new(RefusalKind::Contradiction, what, next).with_place(place));
    }
    let within = visits.iter().map(|visit| visit.level.standard_error.powi(2)).sum::<f64>() / visited;
    let (one, freedom) = match between {
        _ if visits.len() >= OWN_VISITS => (sum_squared_deviations(visits) / (visited - 1.0), visited - 1.0),
        Some(between) => (between.visit_variance_w2(power_w), between.freedom),
        None => (within, (visits[0].level.independent - 1.0).max(1.0)),
    };
    let standard_error_w = (one.max(within) / visited).sqrt();
    let half = t_quantile(0.5 + 0.5 * CONFIDENCE, freedom) * standard_error_w;
    let drifts = visits.iter().filter(|visit| visit.is_drifting()).map(|visit| visit.drift_w());
    Ok(SpeedLearned {
        stage: visits[0].stage,
        speed_rpm,
        power_w,
        standard_error_w,
        interval_w: (power_w - half, power_w + half),
        visits: visits.len(),
        between_visits_w: between.map(|_| (one - within).max(0.0).sqrt()),
        settled_s: visits.iter().map(|visit| visit.to_s - visit.from_s).sum(),
        drift_w: drifts.max_by(|a, b| a.abs().total_cmp(&b.abs())),
    })
}

/// Slope of the relative deviation from each speed's mean over the hours of the recording, where it stands out.
fn warm_up(groups: &[Vec<&Stretch>]) -> Option<Coefficient> {
    let again = groups.iter().filter(|visits| visits.len() > 1);
    let deviations = again.flat_map(|visits| {
        let middle = average_power_w(visits);
        visits.iter().map(move |visit| (0.5 * (visit.from_s + visit.to_s) / 3600.0, visit.level.mean / middle - 1.0))
    });
    let (hours, deviations): (Vec<f64>, Vec<f64>) = deviations.unzip();
    let time = Column::new("hours", hours);
    let fitted = fit_unweighted(&Column::new("deviation", deviations), &[time], Intercept::Fitted).ok()?;
    fitted.find_coefficient("hours").filter(|slope| slope.p < 0.01).cloned()
}

fn list_notes(speeds: &[SpeedLearned], groups: &[Vec<&Stretch>]) -> Vec<String> {
    let mut notes = Vec::new();
    for stage in 0..STAGES {
        let known = speeds.iter().filter(|speed| speed.stage == stage).count();
        if known > SPEEDS_PER_STAGE {
            notes.push(format!(
                "gear stage {stage}: {known} speeds; the gateway keeps {SPEEDS_PER_STAGE}, spread over the range"
            ));
        }
        if known == 1 || known == 2 {
            notes.push(format!("gear stage {stage}: {known} speeds; three or more make a curve"));
        }
    }
    if groups.iter().all(|visits| visits.len() == 1) {
        notes.push(
            "every speed was visited once: the intervals hold for the warmth of that visit; visit the speeds again in another order"
                .to_owned(),
        );
    }
    if let Some(slope) = warm_up(groups) {
        notes.push(format!(
            "no-load power changes by {:+.1} % per hour over the recording: the spindle was warming up or cooling down",
            100.0 * slope.value
        ));
    }
    notes
}
