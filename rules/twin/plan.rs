//! The experiment that a diagnosis asks for, as a recording plan: `recording/1` with the commanded inputs row by row.
//!
//! A plan stays within the speeds, feeds and depths that the recording shows the machine in, and begins and ends with
//! the drives on at standstill, which is the zero of the meter. Two repetitions are two runs.

use super::diagnosis::{Diagnosis, Verdict};
use super::experiments::moves;
use adapter_core::channel::quantity::is_of_spindle;
use numerics::statistics::median;
use physics::explain::Language;
use physics::{Role, Scene, find_effect};
use recording::Recording;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use thiserror::Error;

/// A plan holds the experiments of several explanations when they take no longer than this together, minutes.
const TOGETHER_MINUTES_MAX: f64 = 40.0;
/// Rows of a plan, at most; a longer one gets fewer rows per minute.
const ROWS_MAX: f64 = 7200.0;

/// The operation of moves in which the way to the commanded speed counts; of all others only what comes after it does.
pub const TRANSITION: &str = "transition";

/// The range in which the recording shows the machine.
#[derive(Debug, Clone, PartialEq)]
pub struct Envelope {
    /// Lowest and highest spindle speed while it turns, rpm.
    pub speed_rpm: (f64, f64),
    /// Usual speed in the cut, rpm.
    pub cutting_speed_rpm: f64,
    /// Lowest and highest feed per revolution in the cut, mm.
    pub feed_mm: (f64, f64),
    /// Least and greatest depth of cut, mm.
    pub depth_mm: (f64, f64),
    /// Usual diameter of the work or the tool, mm.
    pub diameter_mm: f64,
    /// Fastest motion of the axis, in the unit of its column.
    pub axis_speed: f64,
    /// Column of the axis velocity.
    pub axis_column: String,
    /// Is it a drive on its own, with neither a spindle nor a cut?
    pub drive_alone: bool,
    /// Is it the spindle that is compared? Then friction is that of its bearings and belt.
    pub spindle: bool,
}

/// What is commanded over a stretch of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Move {
    /// How long it is held, s.
    pub seconds: f64,
    /// Repetition, from 1: the run.
    pub run: u32,
    /// `standstill`, `idle`, `cut`, `axis`, or [`TRANSITION`].
    pub operation: &'static str,
    /// Commanded quantities by channel.
    pub commands: BTreeMap<String, f64>,
    /// Edge or lot, where it matters: column and text.
    pub words: BTreeMap<&'static str, &'static str>,
    /// What the operator does, English and Chinese; empty where the commands say it all.
    pub instruction: (&'static str, &'static str),
}

/// An experiment ready to be run.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The kind whose experiment it is.
    pub kinds: Vec<String>,
    /// In the order of time.
    pub moves: Vec<Move>,
}

/// No plan: a diagnosis that leaves no explanations to choose between, or none whose kind has an experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the verdict is {}: there is nothing left to tell apart, so no plan was written", .verdict.as_word())]
pub struct NothingToTellApart {
    /// That of the diagnosis.
    pub verdict: Verdict,
}

/// The plan that tells the explanations of a diagnosis apart, within what the recording shows.
///
/// # Errors
/// [`NothingToTellApart`].
pub fn plan_experiments(diagnosis: &Diagnosis, recording: &Recording) -> Result<Plan, NothingToTellApart> {
    plan_within(diagnosis, &Envelope::from_recording(recording, &diagnosis.output, &diagnosis.model.roles))
}

/// The same within what the machine has shown that it can do.
pub(crate) fn plan_within(diagnosis: &Diagnosis, envelope: &Envelope) -> Result<Plan, NothingToTellApart> {
    let kinds = list_experiment_kinds(diagnosis);
    if kinds.is_empty() {
        return Err(NothingToTellApart { verdict: diagnosis.verdict });
    }
    Ok(build_plan(&kinds, envelope))
}

/// The plan of these kinds, one experiment after the other.
#[must_use]
pub fn build_plan(kinds: &[&str], envelope: &Envelope) -> Plan {
    let standstill = moves::build_rest(envelope, 20.0);
    let mut all = vec![standstill.clone()];
    let mut run = 1;
    for kind in kinds {
        let one = moves::list_moves(kind, envelope);
        let last = one.iter().map(|a| a.run).max().unwrap_or(1);
        all.extend(one.into_iter().map(|a| Move { run: a.run + run - 1, ..a }));
        run += last;
    }
    let last = all.last().map_or(1, |a| a.run);
    all.push(Move { run: last, ..standstill });
    Plan { kinds: kinds.iter().map(|kind| (*kind).to_owned()).collect(), moves: all }
}

/// The kinds whose experiments separate what is left: that of the next experiment first, then those of every explanation
/// that is still open, then those that the best explanation is usually confused with: a recording in which little was
/// varied cannot even tell that they compete.
pub(crate) fn list_experiment_kinds(diagnosis: &Diagnosis) -> Vec<&str> {
    let asked = diagnosis.next_experiment.iter().map(|experiment| experiment.effect.as_str());
    if diagnosis.alternatives.is_empty() && diagnosis.missing.is_empty() && diagnosis.next_experiment.is_none() {
        return Vec::new();
    }
    let open = diagnosis.alternatives.iter().flat_map(|other| [other.effect.as_str(), &other.instead_of]);
    let found = diagnosis.missing.iter().map(|missing| missing.effect.as_str());
    let first = diagnosis.alternatives.first().map(|other| other.instead_of.as_str());
    let rivals = first.and_then(find_effect).map_or(&[][..], |effect| effect.doc().rivals);
    let usual = if diagnosis.alternatives.is_empty() { found.take(1).collect() } else { rivals.to_vec() };
    select_kinds(asked.chain(open).chain(usual))
}

/// As many as can be carried out in the time, each experiment once.
fn select_kinds<'a>(wanted: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut kinds: Vec<&str> = Vec::new();
    let mut minutes = 0.0;
    for doc in wanted.filter_map(|kind| find_effect(kind).map(physics::Effect::doc)) {
        let fits = kinds.is_empty() || minutes + doc.experiment_minutes <= TOGETHER_MINUTES_MAX;
        if fits && !kinds.iter().any(|kind| moves::has_same_experiment(kind, doc.kind)) {
            kinds.push(doc.kind);
            minutes += doc.experiment_minutes;
        }
    }
    kinds
}

impl Envelope {
    /// The range of a recording; usual values of a small lathe stand in for what it does not hold.
    #[must_use]
    pub fn from_recording(recording: &Recording, output: &str, roles: &BTreeMap<Role, String>) -> Self {
        let scene = Scene::new(recording, output, roles).ok();
        let column = |name: &str| scene.as_ref().and_then(|scene| scene.column(name)).map(<[f64]>::to_vec);
        let role = |role: Role| scene.as_ref().and_then(|scene| scene.role_values(role)).map(<[f64]>::to_vec);
        let engaged = role(Role::Engaged);
        let in_cut = |values: Option<Vec<f64>>| match (&engaged, values) {
            (Some(engaged), Some(values)) => {
                Some(values.into_iter().zip(engaged).filter(|(_, engaged)| **engaged > 0.5).map(|(x, _)| x).collect())
            }
            (_, values) => values,
        };
        let speed = role(Role::Speed);
        let drive_alone = engaged.is_none() && speed.is_none() && role(Role::Velocity).is_some();
        let axis_column = scene.as_ref().and_then(|scene| scene.role_name(Role::Velocity)).map(str::to_owned);
        let axis_speed = role(Role::Velocity).map_or(0.0, |v| v.iter().fold(0.0_f64, |top, x| top.max(x.abs())));
        Self {
            speed_rpm: compute_quantile_range(speed.clone(), (300.0, 1500.0)),
            cutting_speed_rpm: compute_median_size(in_cut(speed), 800.0),
            feed_mm: compute_quantile_range(in_cut(column("feed_per_rev_mm")), (0.05, 0.2)),
            depth_mm: compute_quantile_range(in_cut(column("depth_of_cut_mm")), (0.5, 1.5)),
            diameter_mm: compute_median_size(in_cut(column("diameter_mm")), 60.0),
            axis_speed: if axis_speed > 0.0 { axis_speed } else { 3000.0 },
            axis_column: axis_column.unwrap_or_else(|| "axis_velocity_mm_min".to_owned()),
            drive_alone,
            spindle: is_of_spindle(output),
        }
    }
}

/// 2 % and 98 % points of the sizes above a hundredth of the greatest.
fn compute_quantile_range(values: Option<Vec<f64>>, usual: (f64, f64)) -> (f64, f64) {
    let mut sizes: Vec<f64> = values.unwrap_or_default().into_iter().map(f64::abs).collect();
    let top = sizes.iter().copied().fold(0.0, f64::max);
    sizes.retain(|x| *x > 0.01 * top);
    sizes.sort_by(f64::total_cmp);
    let last = sizes.len().saturating_sub(1);
    match (sizes.get(last / 50), sizes.get(last - last / 50)) {
        (Some(low), Some(high)) => (*low, *high),
        _ => usual,
    }
}

fn compute_median_size(values: Option<Vec<f64>>, usual: f64) -> f64 {
    let sizes: Vec<f64> = values.unwrap_or_default().into_iter().map(f64::abs).filter(|x| *x > 0.0).collect();
    median(sizes).unwrap_or(usual)
}

impl Plan {
    /// How long it takes, minutes.
    #[must_use]
    pub fn duration_min(&self) -> f64 {
        self.moves.iter().map(|a| a.seconds).sum::<f64>() / 60.0
    }

    /// As `recording/1`: one row per second (of long plans fewer), an empty cell where nothing is commanded.
    #[must_use]
    pub fn to_csv(&self, language: Language) -> String {
        let mut numbers: Vec<&str> = self.moves.iter().flat_map(|a| a.commands.keys()).map(String::as_str).collect();
        let mut words: Vec<&str> = self.moves.iter().flat_map(|a| a.words.keys()).copied().collect();
        for names in [&mut numbers, &mut words] {
            names.sort_unstable();
            names.dedup();
        }
        let columns = [&["time_s", "run", "operation"][..], &words, &numbers, &["instruction"]].concat();
        let mut text = format!("{}\n", columns.join(","));
        let step_s = (self.duration_min() * 60.0 / ROWS_MAX).ceil().max(1.0);
        let mut time_s = 0.0;
        for a in &self.moves {
            let end_s = time_s + a.seconds;
            let cells = a.format_cells(&words, &numbers, language);
            let mut at_s = time_s;
            while at_s < end_s - 1e-9 {
                let _ = writeln!(text, "{at_s},{},{},{cells}", a.run, a.operation);
                at_s += step_s;
            }
            time_s = end_s;
        }
        text
    }
}

impl Move {
    fn format_cells(&self, words: &[&str], numbers: &[&str], language: Language) -> String {
        let words = words.iter().map(|name| self.words.get(name).copied().unwrap_or("").to_owned());
        let numbers = numbers.iter().map(|name| self.commands.get(*name).map(f64::to_string).unwrap_or_default());
        let (en, zh) = self.instruction;
        let instruction = language.select_text(en, zh);
        words.chain(numbers).chain([format!("\"{instruction}\"")]).collect::<Vec<_>>().join(",")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::CATALOGUE;
    use recording::read_csv;

    fn envelope() -> Envelope {
        Envelope {
            speed_rpm: (300.0, 1500.0),
            cutting_speed_rpm: 800.0,
            feed_mm: (0.1, 0.2),
            depth_mm: (0.5, 1.5),
            diameter_mm: 60.0,
            axis_speed: 3000.0,
            axis_column: "axis_velocity_mm_min".to_owned(),
            drive_alone: false,
            spindle: false,
        }
    }

    #[test]
    fn every_effect_has_a_plan_that_reads_as_a_recording_and_stays_in_range() {
        for doc in CATALOGUE.iter().map(|effect| effect.doc()) {
            let plan = build_plan(&[doc.kind], &envelope());
            let csv = plan.to_csv(Language::En);
            let read = read_csv(csv.as_bytes(), doc.kind).unwrap_or_else(|error| panic!("{}: {error}", doc.kind));
            assert_eq!(read.refused, 0, "{}: {:?}", doc.kind, read.problems.first());
            if let Some(speed) = read.recording.find_numbers("spindle_programmed_rpm") {
                assert!(speed.present_values().all(|n| (0.0..=1500.0).contains(&n)), "{}", doc.kind);
            }
            let asked = doc.experiment_minutes;
            assert!(
                plan.duration_min() > 0.5 && plan.duration_min() < 2.0 * asked + 6.0,
                "{}: {}",
                doc.kind,
                plan.duration_min()
            );
        }
    }

    #[test]
    fn a_drive_on_its_own_is_never_asked_to_turn_a_spindle_or_to_cut() {
        let alone =
            Envelope { drive_alone: true, axis_column: "velocity_m_s".to_owned(), axis_speed: 0.5, ..envelope() };
        for doc in CATALOGUE.iter().map(|effect| effect.doc()) {
            let plan = build_plan(&[doc.kind], &alone);
            assert!(plan.moves.iter().all(|a| a.commands.keys().eq(["velocity_m_s"])), "{}", doc.kind);
            let (en, zh) = crate::next_step::describe_drive_experiment(doc.kind);
            assert!(!en.contains("spindle") && !en.contains("cut") && !zh.contains("切"), "{}", doc.kind);
        }
    }

    #[test]
    fn two_experiments_are_runs_of_their_own() {
        let plan = build_plan(&["edge_force", "no_load_power"], &envelope());
        let runs: Vec<u32> = plan.moves.iter().map(|a| a.run).collect();
        assert!(runs.is_sorted() && runs.last() >= Some(&4), "{runs:?}");
    }
}
