//! The cuts and idle runs to make, as a list for a person and as a plan that the simulated machine carries out
//! (`simulate --machine lathe --plan`).

use clap::ValueEnum;
use rules::estimators::wear::{Array, ConditionFactor, FactorLevels, plan_experiment};
use std::f64::consts::PI;
use std::fmt::Write as _;

/// Which list of cuts or idle runs is to be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Which {
    /// Idle runs.
    NoLoad,
    /// Cuts with a torque sensor.
    LoadLoss,
    /// The 9 cuts of the L27 list with a new edge.
    #[value(name = "wear-1")]
    Wear1,
    /// ... with a half worn edge.
    #[value(name = "wear-2")]
    Wear2,
    /// ... with a worn edge.
    #[value(name = "wear-3")]
    Wear3,
}

/// What the machine and the work allow.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// Spindle speeds to idle at, rpm.
    pub speeds_rpm: Vec<f64>,
    /// Three cutting speeds, m/min: of the L27 and, as spindle speeds, of the cuts with the torque sensor.
    pub cutting_speeds_m_min: Vec<f64>,
    /// Three feeds, mm per revolution, for the L27 and the cuts with the torque sensor.
    pub feeds_mm: Vec<f64>,
    /// Three depths of cut, mm, for the L27 and the cuts with the torque sensor.
    pub depths_mm: Vec<f64>,
    /// Diameter of the work, mm.
    pub diameter_mm: f64,
    /// Order of the L27.
    pub seed: u64,
}

/// A stretch at one spindle speed, idling or in cut.
#[derive(Debug, Clone, PartialEq)]
pub struct CommissionStep {
    /// How long the step lasts, s.
    pub seconds: f64,
    /// Spindle speed of the step, rpm.
    pub rpm: f64,
    /// Feed, mm/min, and depth, mm; none while idling.
    pub cut: Option<(f64, f64)>,
}

const IDLE_S: f64 = 30.0;
const WARM_UP_S: f64 = 600.0;
const BETWEEN_S: f64 = 12.0;
/// Idling after the last cut of a visit of a speed, s.
const AFTER_S: f64 = 7.0;

/// Visits of a speed in the list with the torque sensor: 0 the lowest, 1 the middle, 2 the highest; then its two cuts:
/// where the depth lies among the depths, and how long, s. Lengths all differ, so that the sensor's file fits in one place only.
const SENSED: [(usize, [(f64, f64); 2]); 6] = [
    (1, [(0.0, 11.0), (0.7, 15.0)]),
    (0, [(1.0, 12.0), (0.3, 19.0)]),
    (2, [(0.65, 14.0), (0.0, 20.0)]),
    (2, [(0.3, 16.0), (1.0, 10.0)]),
    (0, [(0.65, 18.0), (0.0, 13.0)]),
    (1, [(0.35, 17.0), (1.0, 21.0)]),
];

fn idle_step(seconds: f64, rpm: f64) -> CommissionStep {
    CommissionStep { seconds, rpm, cut: None }
}

/// Spindle speed of a cutting speed in m/min, rpm.
fn spindle_rpm(cutting_speed_m_min: f64, diameter_mm: f64) -> f64 {
    (1000.0 * cutting_speed_m_min / (PI * diameter_mm)).round()
}

/// Why there is no list of steps.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StepPlanError {
    /// The conditions of cutting have no such factor.
    #[error("there is no factor {symbol}")]
    NoFactor {
        /// Symbol of the factor, as the experiment's table writes it.
        symbol: String,
    },
    /// The levels make no design; every problem of them.
    #[error("{0}")]
    Design(String),
}

/// The steps of a list.
///
/// # Errors
/// Levels that make no design.
pub fn plan_steps(which: Which, limits: &Limits) -> Result<Vec<CommissionStep>, StepPlanError> {
    Ok(match which {
        Which::NoLoad => {
            let warm_rpm = limits.speeds_rpm.get(limits.speeds_rpm.len() / 2).copied();
            let warm_up = warm_rpm.map(|rpm| idle_step(WARM_UP_S, rpm));
            let each = limits.speeds_rpm.iter().map(|rpm| idle_step(IDLE_S, *rpm));
            // There and back: what drifts with warmth shows as a difference of the two visits.
            let back = limits.speeds_rpm.iter().rev().map(|rpm| idle_step(IDLE_S, *rpm));
            warm_up.into_iter().chain(each).chain(back).collect()
        }
        Which::LoadLoss => load_loss(limits),
        Which::Wear1 => plan_l27(limits, 1)?,
        Which::Wear2 => plan_l27(limits, 2)?,
        Which::Wear3 => plan_l27(limits, 3)?,
    })
}

/// Cuts with the torque sensor: how the loss goes with the power is told by the depths, how it goes with the speed by the speeds. Each
/// speed comes twice, the second time in reverse order, so that a drive that warms up over the list does not pass for one that
/// loses less at the later speeds; each visit has a light and a heavy cut.
fn load_loss(limits: &Limits) -> Vec<CommissionStep> {
    let feed_mm = limits.feeds_mm.get(1).copied().unwrap_or(0.2);
    let (least, greatest) = find_extremes(&limits.depths_mm);
    let mut speeds = limits.cutting_speeds_m_min.clone();
    speeds.sort_by(f64::total_cmp);
    let Some(last) = speeds.len().checked_sub(1) else { return Vec::new() };
    let three = [0, last / 2, last].map(|at| spindle_rpm(speeds[at], limits.diameter_mm));
    let visit = |(speed, cuts): (usize, [(f64, f64); 2])| {
        let rpm = three[speed];
        let pass = move |(depth, seconds): (f64, f64)| {
            let depth = least + depth * (greatest - least);
            [idle_step(BETWEEN_S, rpm), CommissionStep { seconds, rpm, cut: Some((feed_mm * rpm, depth)) }]
        };
        // The sensor's zero and the power without the cut are those before and after it.
        cuts.into_iter().flat_map(pass).chain([idle_step(AFTER_S, rpm)])
    };
    SENSED.into_iter().flat_map(visit).collect()
}

fn find_extremes(values: &[f64]) -> (f64, f64) {
    let of = |pick: fn(f64, f64) -> f64, from: f64| values.iter().copied().fold(from, pick);
    (of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY))
}

/// The nine cuts of one wear, in the order of the design.
fn plan_l27(limits: &Limits, wear: usize) -> Result<Vec<CommissionStep>, StepPlanError> {
    let factor = |symbol: &str, values: &[f64]| {
        let factor = ConditionFactor::find_by_name(symbol)
            .ok_or_else(|| StepPlanError::NoFactor { symbol: symbol.to_owned() })?;
        Ok::<_, StepPlanError>(FactorLevels { factor, values: values.to_vec() })
    };
    // The wears stand for the edges that come: what they are the microscope says.
    let factors = [
        factor("VB", &[0.05, 0.15, 0.25])?,
        factor("vc", &limits.cutting_speeds_m_min)?,
        factor("f", &limits.feeds_mm)?,
        factor("ap", &limits.depths_mm)?,
    ];
    let design = plan_experiment(Array::L27, &factors, limits.seed)
        .map_err(|problems| StepPlanError::Design(problems.join("; ")))?;
    let own = design.cuts.iter().filter(|cut| cut.levels.first() == Some(&wear));
    let pass = |values: &[f64]| {
        let rpm = spindle_rpm(values[1], limits.diameter_mm);
        let cut = Some((values[2] * rpm, values[3]));
        [idle_step(BETWEEN_S, rpm), CommissionStep { seconds: BETWEEN_S, rpm, cut }]
    };
    Ok(own.flat_map(|cut| pass(&cut.values)).collect())
}

/// Minutes that the steps take.
#[must_use]
pub fn total_minutes(steps: &[CommissionStep]) -> f64 {
    steps.iter().map(|step| step.seconds).sum::<f64>() / 60.0
}

/// The list for a person.
#[must_use]
pub fn format_text(steps: &[CommissionStep], diameter_mm: f64) -> String {
    let mut text = format!(
        "{} steps, {:.0} min, work of {diameter_mm} mm\n step   s    rpm  feed mm/min  depth mm\n",
        steps.len(),
        total_minutes(steps)
    );
    for (index, step) in steps.iter().enumerate() {
        let cut =
            step.cut.map_or_else(|| "idle, no feed".to_owned(), |(feed, depth)| format!("{feed:>11.1} {depth:>9.2}"));
        let _ = writeln!(text, "{:>5} {:>3.0} {:>6.0}  {cut}", index + 1, step.seconds, step.rpm);
    }
    text
}

/// The plan as a recording of commanded inputs.
#[must_use]
pub fn format_csv(steps: &[CommissionStep], diameter_mm: f64) -> String {
    let mut csv =
        String::from("time_s,run,spindle_programmed_rpm,feed_programmed_mm_min,depth_of_cut_mm,diameter_mm,engaged\n");
    let mut time_s = 0.0;
    let mut row = |time_s: f64, step: &CommissionStep| {
        let (feed, depth, engaged) = step.cut.map_or((0.0, 0.0, 0), |(feed, depth)| (feed, depth, 1));
        let _ = writeln!(csv, "{time_s},1,{},{feed:.3},{depth:.4},{diameter_mm},{engaged}", step.rpm);
    };
    for step in steps {
        row(time_s, step);
        time_s += step.seconds;
    }
    // The last row ends the last step; as long as the one before is what the plan's reader takes it for.
    if let Some(last) = steps.last() {
        row(time_s - 0.5, last);
    }
    csv
}
