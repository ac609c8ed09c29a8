//! Load loss per gear stage: `Pi = Pu(n) + (1 + a0) Pc + a1(n) Pc^2`, by least squares on steady cuts and idle stretches.
//!
//! Every speed has a no-load power of its own, fitted along with a0 and a1, so that its error is in their intervals. Over several
//! speeds a1 has one of two [`forms`](super::forms); from one speed alone, nothing tells which, and the result says so.

use super::accuracy::{Accuracy, evaluate_accuracy};
use super::cuts::{SteadyPoint, collect_points};
use super::forms::{FittedLoss, FormResiduals, by_speed, fit_best_form, is_same_speed};
use super::reference::{PowerReference, ReferenceChoice, select_reference};
use super::rows::classify_rows;
use super::stretches::find_stretches;
use crate::regression::{CONFIDENCE, FTest, Refusal, RefusalKind, Regression, UnequalScatter, t_quantile};
use crate::{LoadLossDoubt, LoadLossLaw, STAGES};
use numerics::statistics::count_to_f64;
use recording::Recording;
use serde::Serialize;

/// The heaviest cut must take this many times the power of the lightest, or a0 and a1 cannot be told apart.
const SPAN_MIN: f64 = 2.0;
/// Different cutting powers that are needed.
const LEVELS_MIN: usize = 3;
/// Longer idling is looked at in pieces of this length, s: of a warm-up only the end tells the power under the cut that follows. At a drift
/// of 4 % in ten minutes, which is usual (`no_load_drift`), a piece is at most 0.4 % off; shorter ones would be noisier than that.
const IDLE_S: f64 = 60.0;
/// Cutting power over power above no-load power that is credible.
const CREDIBLE: (f64, f64) = (0.4, 1.5);
/// Half of a 95 % interval of a normal distribution, in standard deviations.
const NORMAL_95: f64 = 1.96;
/// Greatest value that `load_loss_sd_at_w` takes, W.
const AT_MOST_W: f64 = 100_000.0;
/// Values that the gateway takes.
const LINEAR_RANGE: (f64, f64) = (-0.5, 2.0);
const QUADRATIC_RANGE: (f64, f64) = (-0.001, 0.01);

/// A number with its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct IntervalEstimate {
    /// The estimate, in the unit that its field tells.
    pub value: f64,
    /// Standard error of the estimate, in the same unit.
    pub standard_error: f64,
    /// Ends of the 95 % interval.
    pub interval: (f64, f64),
}

/// Load loss of one gear stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageLearned {
    /// Gear stage; 0 where the recording has none.
    pub stage: usize,
    /// a0, load loss per watt of cutting power.
    pub linear: IntervalEstimate,
    /// a1, load loss per square watt of cutting power, 1/W.
    pub quadratic_per_w: IntervalEstimate,
    /// Spindle speed at which a1 is as stated, where it goes with 1/n^2; `None` where it is the same at every speed, or where the cuts
    /// were made at one speed, so that nothing tells.
    pub speed_rpm: Option<f64>,
    /// What both forms of a1 over the speed leave; `None` for cuts at one speed.
    pub form_residuals: Option<FormResiduals>,
    /// Load loss over cutting power at the mean cut (at `speed_rpm` where a1 goes with the speed), and its standard error.
    pub share_at_mean: IntervalEstimate,
    /// How well both are known together, for the running machine.
    pub doubt: LoadLossDoubt,
    /// Cutting powers from, to and mean, W.
    pub cutting_power_w: (f64, f64, f64),
    /// Speeds with cuts, rpm.
    pub speeds_rpm: Vec<f64>,
    /// Cuts and idle stretches that it rests on.
    pub cuts: usize,
    /// How many of these are idle stretches.
    pub idle: usize,
    /// Residual standard deviation, W.
    pub residual_sd_w: f64,
    /// Variance inflation of a0 by a1.
    pub variance_inflation: f64,
    /// Does each speed want coefficients of its own?
    pub by_speed: Option<FTest>,
    /// Accuracy of the separation in cuts that were left out; `None` for too few cuts.
    pub accuracy: Option<Accuracy>,
}

impl StageLearned {
    /// The coefficients, to separate cutting power with.
    #[must_use]
    pub fn load_loss(&self) -> LoadLossLaw {
        LoadLossLaw {
            linear: self.linear.value,
            quadratic_per_w: self.quadratic_per_w.value,
            speed_rpm: self.speed_rpm,
        }
    }
}

/// What a recording tells about load loss.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoadLossLearned {
    /// What told the cutting power.
    pub reference: PowerReference,
    /// The gear stages whose load loss could be told.
    pub stages: Vec<StageLearned>,
    /// The cuts and idle stretches.
    pub points: Vec<SteadyPoint>,
    /// Stages that cannot be told, and why.
    pub refused: Vec<Refusal>,
    /// What the reader should know.
    pub notes: Vec<String>,
}

/// Learns a0 and a1 of every gear stage from cuts whose power at the edge is known besides the spindle power.
///
/// # Errors
/// A [`Refusal`] where nothing tells the cutting power, or no stage has cuts that differ enough.
pub fn identify_load_loss(recording: &Recording, choice: &ReferenceChoice) -> Result<LoadLossLearned, Refusal> {
    let rows = classify_rows(recording)?;
    let reference = select_reference(recording, &rows, choice)?;
    let points = collect_points(recording, &rows, &find_stretches(&rows, IDLE_S), &reference);
    let mut learned = LoadLossLearned {
        reference: reference.reference,
        stages: Vec::new(),
        points: Vec::new(),
        refused: Vec::new(),
        notes: Vec::new(),
    };
    for stage in 0..STAGES {
        let own = beside_cuts(&points.iter().filter(|point| point.stage == stage).collect::<Vec<_>>());
        if own.iter().any(|point| point.cut) {
            match of_stage(&own, reference.reference) {
                Ok(found) => learned.stages.push(found),
                Err(refusal) => learned.refused.push(refusal.with_place(format!("gear stage {stage}"))),
            }
        }
    }
    if learned.stages.is_empty() {
        return Err(learned.refused.into_iter().next().unwrap_or_else(refuse_without_cuts));
    }
    learned.notes = learned.stages.iter().flat_map(list_notes).collect();
    learned.points = points;
    Ok(learned)
}

/// The cuts, and of the idle stretches those nearest to a cut of the same speed, before and after it. No-load power drifts with warmth: a
/// history also holds warm-ups and idling at this speed hours away, which would stand for the power under these cuts.
fn beside_cuts<'a>(points: &[&'a SteadyPoint]) -> Vec<&'a SteadyPoint> {
    let mut used = vec![false; points.len()];
    for (at, cut) in points.iter().enumerate().filter(|(_, point)| point.cut) {
        let idle = |other: &usize| !points[*other].cut && is_same_speed(points[*other].speed_rpm, cut.speed_rpm);
        let (before, after) = ((0..at).rev().find(idle), (at + 1..points.len()).find(idle));
        [Some(at), before, after].into_iter().flatten().for_each(|kept| used[kept] = true);
    }
    points.iter().zip(used).filter_map(|(point, used)| used.then_some(*point)).collect()
}

fn refuse_without_cuts() -> Refusal {
    let what = "no steady cut of 5 s or longer in which both power and reference are known";
    Refusal::new(
        RefusalKind::TooFew,
        what,
        "cut at one speed with at least three depths or feeds, 10 s each, idling between",
    )
}

pub(super) fn of_stage(points: &[&SteadyPoint], reference: PowerReference) -> Result<StageLearned, Refusal> {
    let cuts: Vec<f64> = points.iter().filter(|point| point.cut).map(|point| point.cutting_power_w).collect();
    let speeds = list_cut_speeds(points);
    check_span(&cuts)?;
    check_idle(points, &speeds)?;
    let fitted = fit_best_form(points, &speeds)?;
    let regression = &fitted.regression;
    check_share(points, regression, &speeds)?;
    let mean = cuts.iter().sum::<f64>() / count_to_f64(cuts.len());
    let own = Widening::from_fit(&fitted, speeds.len(), reference);
    let stage = StageLearned {
        stage: points[0].stage,
        linear: own.combine_coefficients(-1.0, 1.0, 0.0),
        quadratic_per_w: own.combine_coefficients(0.0, 0.0, 1.0),
        speed_rpm: fitted.speed_rpm,
        form_residuals: fitted.residuals,
        share_at_mean: own.combine_coefficients(-1.0, 1.0, mean),
        doubt: own.summarise_doubt((mean, find_greatest_like_stated(points, &fitted)), &speeds),
        cutting_power_w: (find_least(&cuts), find_greatest(&cuts), mean),
        speeds_rpm: speeds.clone(),
        cuts: cuts.len(),
        idle: points.len() - cuts.len(),
        residual_sd_w: regression.residual_sd,
        variance_inflation: regression.coefficients[speeds.len()].variance_inflation.unwrap_or(1.0),
        by_speed: by_speed(points, &speeds, &fitted),
        accuracy: evaluate_accuracy(points, &speeds),
    };
    check_credibility(&stage)?;
    Ok(stage)
}

fn find_least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

fn find_greatest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// The cut on which a1 rests most: its power times a1 at its speed over a1 as stated, W.
fn find_greatest_like_stated(points: &[&SteadyPoint], fitted: &FittedLoss) -> f64 {
    let law = fitted.load_loss();
    let cuts = points.iter().filter(|point| point.cut);
    cuts.map(|point| point.cutting_power_w * law.speed_factor(point.speed_rpm)).fold(0.0, f64::max)
}

/// Speeds that have cuts.
fn list_cut_speeds(points: &[&SteadyPoint]) -> Vec<f64> {
    let mut speeds: Vec<f64> = Vec::new();
    for point in points.iter().filter(|point| point.cut) {
        if !speeds.iter().any(|known| is_same_speed(*known, point.speed_rpm)) {
            speeds.push(point.speed_rpm);
        }
    }
    speeds
}

fn check_span(cuts: &[f64]) -> Result<(), Refusal> {
    let (low, high) = (find_least(cuts), find_greatest(cuts));
    let mut sorted = cuts.to_vec();
    sorted.sort_by(f64::total_cmp);
    let levels = 1 + sorted.windows(2).filter(|pair| pair[1] > pair[0] + 0.05 * high.abs()).count();
    if low <= 0.0 {
        let what = format!("the reference shows {low:.1} W in a cut");
        return Err(Refusal::new(RefusalKind::Contradiction, what, "look at the sign and the zero of the reference"));
    }
    if levels < LEVELS_MIN || high < SPAN_MIN * low {
        let what = format!(
            "the cuts take {low:.0} to {high:.0} W at the edge in {levels} steps: over so narrow a range a0 and a1 are \
             collinear, and only their sum a0 + a1 Pc can be told"
        );
        let next = "record cuts of at least three powers, the heaviest at least twice the lightest, better four times";
        return Err(Refusal::new(RefusalKind::Collinear, what, next));
    }
    Ok(())
}

fn check_idle(points: &[&SteadyPoint], speeds: &[f64]) -> Result<(), Refusal> {
    let idles = |speed: &&f64| points.iter().any(|point| !point.cut && is_same_speed(**speed, point.speed_rpm));
    match speeds.iter().find(|speed| !idles(speed)) {
        None => Ok(()),
        Some(speed) => {
            let what = format!("the spindle never idles at {speed:.0} rpm, where it cuts");
            let next = "let it turn without feed for 10 s at this speed, between the cuts";
            Err(Refusal::new(RefusalKind::NotIdentifiable, what, next))
        }
    }
}

/// Cutting power and spindle power must be of one size.
fn check_share(points: &[&SteadyPoint], regression: &Regression, speeds: &[f64]) -> Result<(), Refusal> {
    let no_load = |point: &SteadyPoint| {
        let at = speeds.iter().position(|speed| is_same_speed(*speed, point.speed_rpm)).unwrap_or(0);
        regression.coefficients[at].value
    };
    let cuts = || points.iter().filter(|point| point.cut);
    let (cutting, above): (f64, f64) =
        (cuts().map(|point| point.cutting_power_w).sum(), cuts().map(|point| point.power.mean - no_load(point)).sum());
    let share = cutting / above;
    if share > CREDIBLE.0 && share < CREDIBLE.1 {
        return Ok(());
    }
    let what = format!("the reference says {share:.4} of the power above no-load power; 0.7 to 1 is usual");
    let next = "look at units (torque in N·m, force in N, diameter in mm) and at what the meter measures";
    Err(Refusal::new(RefusalKind::Unit, what, next))
}

/// a0 and a1, with what is not known of the reference's scale: with `Pc` known to a factor, `1 + a0` goes with its inverse and `a1`
/// with the inverse of its square.
struct Widening<'a> {
    scatter: &'a UnequalScatter,
    gain: f64,
    quadratic: f64,
    /// Variance of the logarithm of the factor.
    scale: f64,
}

impl<'a> Widening<'a> {
    fn from_fit(fitted: &'a FittedLoss, at: usize, reference: PowerReference) -> Self {
        let value = |at: usize| fitted.regression.coefficients[at].value;
        let scale = match reference {
            PowerReference::Removal { relative_sd } => relative_sd * relative_sd,
            PowerReference::Torque | PowerReference::Force => 0.0,
        };
        Self { scatter: &fitted.scatter, gain: value(at), quadratic: value(at + 1), scale }
    }

    /// `offset + a (1 + a0) + b a1`.
    fn combine_coefficients(&self, offset: f64, a: f64, b: f64) -> IntervalEstimate {
        let value = offset + a * self.gain + b * self.quadratic;
        let (scatter, degrees_of_freedom) = self.scatter.compute_variance(&[a, b]);
        let by_scale = self.scale * (a * self.gain + 2.0 * b * self.quadratic).powi(2);
        let standard_error = (scatter + by_scale).sqrt();
        let half = t_quantile(0.5 + 0.5 * CONFIDENCE, degrees_of_freedom) * standard_error;
        IntervalEstimate { value, standard_error, interval: (value - half, value + half) }
    }
}

impl Widening<'_> {
    /// The doubt of the share and that of a1, at the cutting power where they are independent of each other: there
    /// `cov(a0 + a1 x, a1) = 0`. Few degrees of freedom make an interval wider than a normal one. Heavy cuts have the fewest, and what
    /// is told beyond them rests on them: the mean of the own widening and theirs holds the truth in 91 to 99 % of 2,000 repetitions from 300 to
    /// 5,000 W with cuts up to 2,300 W, the own alone in 87 to 95 %.
    fn summarise_doubt(&self, (mean_w, greatest_w): (f64, f64), speeds_rpm: &[f64]) -> LoadLossDoubt {
        let told = |a: f64, b: f64| self.combine_coefficients(0.0, a, b);
        let variance = |a: f64, b: f64| told(a, b).standard_error.powi(2);
        let (of_linear, of_quadratic) = (variance(1.0, 0.0), variance(0.0, 1.0));
        let covariance = (variance(1.0, mean_w) - of_linear - mean_w * mean_w * of_quadratic) / (2.0 * mean_w);
        let at_w = if of_quadratic > 0.0 { (-covariance / of_quadratic).clamp(0.0, AT_MOST_W) } else { 0.0 };
        let widening = |a: f64, b: f64| {
            let it = told(a, b);
            let half = 0.5 * (it.interval.1 - it.interval.0);
            if it.standard_error > 0.0 { half / (NORMAL_95 * it.standard_error) } else { 1.0 }
        };
        let sd = |a: f64, b: f64| 0.5 * (widening(a, b) + widening(1.0, greatest_w)) * variance(a, b).sqrt();
        let only_speed_rpm = if let [only] = speeds_rpm { Some(*only) } else { None };
        LoadLossDoubt { share_sd: sd(1.0, at_w), at_w, quadratic_sd_per_w: sd(0.0, 1.0), only_speed_rpm }
    }
}

fn check_credibility(stage: &StageLearned) -> Result<(), Refusal> {
    let inside = |value: f64, range: (f64, f64)| (range.0..=range.1).contains(&value);
    if inside(stage.linear.value, LINEAR_RANGE) && inside(stage.quadratic_per_w.value, QUADRATIC_RANGE) {
        return Ok(());
    }
    let (a0, a1) = (stage.linear.value, stage.quadratic_per_w.value);
    let what = format!("a0 = {a0:.3} and a1 = {a1:.2e} 1/W are those of no drive");
    Err(Refusal::new(RefusalKind::Contradiction, what, "look at reference and meter, and record heavier cuts"))
}

fn list_notes(stage: &StageLearned) -> impl Iterator<Item = String> {
    by_speed_told(stage).into_iter().chain(one_speed(stage)).chain(note_negative_loss(stage))
}

/// a1 from one speed holds at this speed; what it is elsewhere depends on what loses the power.
fn one_speed(stage: &StageLearned) -> Option<String> {
    let [speed_rpm] = stage.speeds_rpm[..] else { return None };
    let own = stage.load_loss();
    let mean_w = stage.cutting_power_w.2;
    let with_torque = LoadLossLaw { speed_rpm: Some(speed_rpm), ..own };
    let slower_rpm = 0.7 * speed_rpm;
    let share = |loss: &LoadLossLaw| 100.0 * (loss.linear + loss.quadratic_at(slower_rpm) * mean_w);
    Some(format!(
        "gear stage {}: a1 is known at {speed_rpm:.0} rpm only and is taken as the same at every speed. Where it comes from the windings it \
         goes with 1/n^2: at {slower_rpm:.0} rpm the mean cut of {mean_w:.0} W would lose {:.1} % instead of {:.1} %. Cut at two more \
         speeds, a slow and a fast one (commission --plan load-loss writes the list)",
        stage.stage,
        share(&with_torque),
        share(&own)
    ))
}

/// A load takes power; a loss below 0 means that the cutting power of the reference is too great. Its doubt is not in the interval,
/// where it is the same for all cuts.
fn note_negative_loss(stage: &StageLearned) -> Option<String> {
    let share = stage.share_at_mean.value;
    (share < 0.0).then(|| {
        format!(
            "gear stage {}: the load loss is negative ({:.1} % of the cutting power at the mean cut), which no machine has: the cutting \
             power of the reference is too great. Lower the specific energy of the material by at least as much, or take a torque \
             (torque_nm); do not set these coefficients",
            stage.stage,
            100.0 * share
        )
    })
}

fn by_speed_told(stage: &StageLearned) -> Option<String> {
    let test = stage.by_speed.filter(|test| test.p < 0.05)?;
    Some(format!(
        "gear stage {}: the speeds want coefficients of their own (F = {:.1}, p = {:.3}); the common ones are a mean over {} speeds",
        stage.stage,
        test.f,
        test.p,
        stage.speeds_rpm.len()
    ))
}
