//! The simulated machine carries out an experiment: a recording plan in, a recording out.

use adapter_core::channel::{ChannelId, Kind};
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::driver::Pull;
use adapter_core::merge::{Delay, Lockstep};
use adapter_core::{Sample, Value};
use recording::Recording;
use recording::{Cells, Numbers, Words};
use rules::twin::plan::TRANSITION;
use simulated::address::SimulatedMachine;
use simulated::{EXPERIMENT_PROGRAM, ExperimentCut, ExperimentStep, Simulated, SimulatedSettings, Truth};
use std::fmt::Write as _;

/// When the machine is switched on: 2026-01-01, so that the same plan gives the same recording.
const ORIGIN_NS: TimeNs = 1_767_225_600 * SECOND_NS;
/// An experiment takes no longer than this, s.
const SECONDS_MAX: f64 = 48.0 * 3600.0;
/// Steps of a plan, at most.
const STEPS_MAX: usize = 2000;

/// The spindle has its commanded speed within this share,
const AT_SPEED: f64 = 0.02;
/// and has had it for so long, ns: the drive and the meter have settled.
const SETTLED_NS: i64 = 4 * SECOND_NS;

/// The steps of a plan, and the run that each belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct Steps {
    steps: Vec<ExperimentStep>,
    runs: Vec<String>,
    /// Is only what comes after the way to the commanded speed part of the step? Plans that name their operations say.
    settled: Vec<bool>,
}

/// Why a plan cannot be carried out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ExperimentPlanError {
    /// Nothing says how fast the spindle is to turn.
    #[error("the plan has no column spindle_programmed_rpm; `diagnose --experiment` writes plans")]
    NoSpeed,
    /// It takes more time or more steps than the simulated machine carries out.
    #[error(
        "the plan takes {hours:.1} h in {steps} steps; the simulated machine carries out at most {:.0} h in {STEPS_MAX} steps",
        SECONDS_MAX / 3600.0
    )]
    TooLong {
        /// How long it takes, h.
        hours: f64,
        /// In how many steps.
        steps: usize,
    },
}

impl Steps {
    /// Consecutive rows that command the same are one step.
    ///
    /// # Errors
    /// What the plan lacks, or why it is too long.
    pub fn from_plan(plan: &Recording) -> Result<Self, ExperimentPlanError> {
        if plan.find_numbers("spindle_programmed_rpm").is_none() {
            return Err(ExperimentPlanError::NoSpeed);
        }
        let mut found = Self { steps: Vec::new(), runs: Vec::new(), settled: Vec::new() };
        let mut last_tool: Option<String> = None;
        for run in plan.list_runs() {
            for row in run.rows {
                let mut step = read_step(plan, row);
                let tool = plan.find_words("tool").and_then(|words| words.get(row)).map(str::to_owned);
                step.new_edge = tool.is_some() && last_tool.is_some() && tool != last_tool;
                last_tool = tool.or(last_tool);
                let operation = plan.find_words("operation").and_then(|words| words.get(row));
                found.add(step, &run.name, operation.is_some_and(|operation| operation != TRANSITION));
            }
        }
        let seconds: f64 = found.steps.iter().map(|step| step.seconds).sum();
        if seconds > SECONDS_MAX || found.steps.len() > STEPS_MAX {
            return Err(ExperimentPlanError::TooLong { hours: seconds / 3600.0, steps: found.steps.len() });
        }
        Ok(found)
    }

    fn add(&mut self, step: ExperimentStep, run: &str, settled: bool) {
        match self.steps.last_mut() {
            Some(last)
                if self.runs.last().is_some_and(|name| name == run)
                    && self.settled.last() == Some(&settled)
                    && (ExperimentStep { seconds: last.seconds, ..step })
                        == (ExperimentStep { new_edge: false, ..*last }) =>
            {
                last.seconds += step.seconds;
            }
            _ => {
                self.steps.push(step);
                self.runs.push(run.to_owned());
                self.settled.push(settled);
            }
        }
    }
}

fn read_step(plan: &Recording, row: usize) -> ExperimentStep {
    let number = |name: &str| plan.find_numbers(name).and_then(|numbers| numbers.get(row));
    let next_s = plan.time_s.get(row + 1).filter(|next_s| **next_s > plan.time_s[row]);
    let before_s = (row > 0).then(|| plan.time_s[row] - plan.time_s[row - 1]).filter(|step_s| *step_s > 0.0);
    let cut = (number("engaged").unwrap_or(0.0) > 0.5).then(|| ExperimentCut {
        feed_mm_min: number("feed_programmed_mm_min").unwrap_or(0.0),
        depth_mm: number("depth_of_cut_mm").unwrap_or(1.0),
        diameter_mm: number("diameter_mm").unwrap_or(60.0),
        onward: false,
    });
    let axis = number("axis_velocity_mm_min").or_else(|| number("z_axis_velocity_mm_min"));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to what the register holds")]
    let percent = number("feed_override_pct").unwrap_or(100.0).clamp(0.0, 254.0) as u8;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to what a machine has")]
    let stage = number("gear_stage").map(|stage| stage.clamp(1.0, 9.0) as u8);
    ExperimentStep {
        seconds: next_s.map(|next_s| next_s - plan.time_s[row]).or(before_s).unwrap_or(1.0),
        spindle_rpm: number("spindle_programmed_rpm").unwrap_or(0.0),
        gear_stage: stage,
        cut: cut.filter(|cut| cut.feed_mm_min > 0.0),
        axis_mm_min: axis.unwrap_or(0.0),
        coolant_on: number("coolant_on").unwrap_or(0.0) > 0.5,
        hydraulics_on: number("hydraulics_on").unwrap_or(0.0) > 0.5,
        override_pct: percent,
        new_edge: false,
    }
}

/// The simulated machine runs the plan from a cold start; what a gateway at `rate_hz` records of it, and what instruments beside
/// the gateway show.
///
/// # Errors
/// See [`Steps::from_plan`].
pub fn execute_plan(
    settings: SimulatedSettings,
    plan: &Recording,
    rate_hz: f64,
) -> Result<(Recording, Instruments), ExperimentPlanError> {
    let steps = Steps::from_plan(plan)?;
    let name = match settings.machine {
        SimulatedMachine::Lathe => "simulated://lathe",
        SimulatedMachine::Mill => "simulated://mill",
    };
    let machine = Simulated::experiment(name, settings, ORIGIN_NS, &steps.steps);
    let sources: Vec<Box<dyn Pull>> = vec![Box::new(machine.controller()), Box::new(machine.meter())];
    let mut table = RecordingBuilder::new(name, &steps);
    let mut instruments = Instruments::new(settings.seed);
    table.record_samples(Lockstep::new(sources, Delay::SlowestPeriod), rate_hz, |at_ns| {
        instruments.read(&machine.truth(at_ns), at_ns)
    });
    Ok((table.into_recording(), instruments))
}

/// What instruments that are no part of the gateway show of the simulated machine during an experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Instruments {
    /// A torque sensor at the spindle: times on its own clock, s, and torques, N·m, with zero error and noise.
    pub torque: Vec<(f64, f64)>,
    /// Flank wear of the edge in use before and after, as a microscope shows it, mm.
    pub flank_wear_mm: Option<(f64, f64)>,
    noise: Noise,
    first_ns: Option<TimeNs>,
}

/// The sensor's clock began at another time and runs fast,
const SENSOR_CLOCK: (f64, f64) = (4321.7, 40e-6);
/// its zero error and its noise, N·m.
const SENSOR_ERRORS_NM: (f64, f64) = (0.4, 0.1);

impl Instruments {
    fn new(seed: u64) -> Self {
        Self { torque: Vec::new(), flank_wear_mm: None, noise: Noise(seed | 1), first_ns: None }
    }

    /// Reads the instruments at one moment of the experiment.
    fn read(&mut self, truth: &Truth, at_ns: TimeNs) {
        let first_ns = *self.first_ns.get_or_insert(at_ns);
        let before_mm = self.flank_wear_mm.map_or(truth.flank_wear_mm, |(before_mm, _)| before_mm);
        self.flank_wear_mm = Some((before_mm, truth.flank_wear_mm));
        let rad_s = truth.spindle_speed_rpm.abs() * std::f64::consts::TAU / 60.0;
        let cutting = if rad_s > 1.0 { truth.cutting_power_w / rad_s } else { 0.0 };
        let own_s = (at_ns - first_ns) as f64 / SECOND_NS as f64 * (1.0 + SENSOR_CLOCK.1) + SENSOR_CLOCK.0;
        self.torque.push((own_s, cutting + SENSOR_ERRORS_NM.0 + SENSOR_ERRORS_NM.1 * self.noise.next_normal()));
    }

    /// The file of the torque sensor.
    #[must_use]
    pub fn torque_csv(&self) -> String {
        let mut text = String::from("time_s,torque_nm\n");
        for (time_s, torque) in &self.torque {
            let _ = writeln!(text, "{time_s:.3},{torque:.4}");
        }
        text
    }
}

/// Normal noise from a seed: a sum of twelve even numbers (Irwin-Hall), from a linear congruential generator.
#[derive(Debug, Clone, PartialEq)]
struct Noise(u64);

impl Noise {
    fn next_normal(&mut self) -> f64 {
        let mut even = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| even()).sum::<f64>() - 6.0
    }
}

/// The recording under construction.
struct RecordingBuilder<'a> {
    name: &'static str,
    steps: &'a Steps,
    on_the_way_ns: Option<TimeNs>,
    samples: Vec<(f64, usize, Sample)>,
    first_ns: Option<TimeNs>,
}

impl<'a> RecordingBuilder<'a> {
    fn new(name: &'static str, steps: &'a Steps) -> Self {
        Self { name, steps, on_the_way_ns: None, samples: Vec::new(), first_ns: None }
    }

    /// Samples from the first step to the end of the last one; `at` hears of each.
    fn record_samples(&mut self, mut lockstep: Lockstep, rate_hz: f64, mut at: impl FnMut(TimeNs)) {
        #[expect(clippy::cast_possible_truncation, reason = "between a millisecond and a thousand seconds")]
        let period_ns = (SECOND_NS as f64 / rate_hz.clamp(0.001, 1000.0)) as i64;
        let mut sample = Sample::new_empty(0);
        let mut now_ns = ORIGIN_NS;
        let mut begun = false;
        let limit_ns = ORIGIN_NS + (SECOND_NS as f64 * 2.0 * SECONDS_MAX) as i64;
        while now_ns < limit_ns {
            lockstep.sample_into(&mut sample, now_ns);
            match step_of(&sample) {
                Some(step) => {
                    begun = true;
                    at(sample.at_ns);
                    self.add(&sample, step);
                }
                None if begun && has_ended(&sample) => break,
                None => {}
            }
            now_ns += period_ns;
        }
    }

    fn add(&mut self, sample: &Sample, step: usize) {
        if self.is_on_the_way(sample, step) {
            return;
        }
        let first_ns = *self.first_ns.get_or_insert(sample.at_ns);
        let time_s = (sample.at_ns - first_ns) as f64 / SECOND_NS as f64;
        self.samples.push((time_s, step, sample.clone()));
    }

    /// Has the step not begun yet, because the spindle is still on its way to the commanded speed?
    fn is_on_the_way(&mut self, sample: &Sample, step: usize) -> bool {
        let (Some(wanted), Some(settled)) = (self.steps.steps.get(step - 1), self.steps.settled.get(step - 1)) else {
            return false;
        };
        let off = read_number(sample, "spindle_speed_rpm")
            .is_some_and(|rpm| (rpm - wanted.spindle_rpm).abs() > AT_SPEED * wanted.spindle_rpm.abs() + 1.0);
        if off {
            self.on_the_way_ns = Some(sample.at_ns);
        }
        *settled && self.on_the_way_ns.is_some_and(|then_ns| sample.at_ns - then_ns < SETTLED_NS)
    }

    fn into_recording(self) -> Recording {
        let time_s = self.samples.iter().map(|(time_s, ..)| *time_s).collect();
        let mut recording = Recording::new(self.name, time_s, None);
        let run = |step: usize| self.steps.runs.get(step - 1).map_or("", String::as_str);
        recording.set_column("run", Cells::Words(self.samples.iter().map(|(_, step, _)| run(*step)).collect()));
        for id in ChannelId::list_all() {
            if let Some(cells) = self.collect_cells(id) {
                recording.set_column(id.name(), cells);
            }
        }
        recording.set_column(
            "engaged",
            Cells::Numbers(self.samples.iter().map(|(.., sample)| compute_engagement(sample)).collect()),
        );
        recording
    }

    fn collect_cells(&self, id: ChannelId) -> Option<Cells> {
        let values = || self.samples.iter().map(|(.., sample)| sample.slot(id).value.as_ref().ok());
        values().flatten().next()?;
        if id.channel().kind == Kind::Text {
            return Some(Cells::Words(
                values().map(|value| value.and_then(Value::as_text).unwrap_or("")).collect::<Words>(),
            ));
        }
        Some(Cells::Numbers(values().map(|value| value.and_then(Value::as_number)).collect::<Numbers>()))
    }
}

fn read_text<'a>(sample: &'a Sample, name: &str) -> Option<&'a str> {
    sample.text(ChannelId::from_name(name)?)
}

fn read_number(sample: &Sample, name: &str) -> Option<f64> {
    sample.number(ChannelId::from_name(name)?).ok()
}

/// The step in progress, from 1.
fn step_of(sample: &Sample) -> Option<usize> {
    let program = read_text(sample, "program")?;
    let block = read_text(sample, "block")?.strip_prefix('N')?.parse().ok()?;
    (program == format!("O{EXPERIMENT_PROGRAM}") && block > 0).then_some(block)
}

fn has_ended(sample: &Sample) -> bool {
    read_text(sample, "program").is_some_and(|program| program != format!("O{EXPERIMENT_PROGRAM}"))
}

/// In the cut, as the program says it: a depth is planned and the axis feeds.
fn compute_engagement(sample: &Sample) -> Option<f64> {
    let (depth, feed) = (read_number(sample, "depth_of_cut_mm")?, read_number(sample, "feed_mm_min")?);
    let rapid = read_number(sample, "rapid").unwrap_or(0.0) > 0.5;
    Some(f64::from(u8::from(depth > 0.0 && feed > 0.0 && !rapid)))
}

/// A recording as CSV.
#[must_use]
pub fn format_csv(recording: &Recording) -> String {
    let mut text = String::from("time_s");
    recording.columns().iter().for_each(|column| text.push_str(&format!(",{}", column.name)));
    text.push('\n');
    for row in 0..recording.count_rows() {
        let _ = write!(text, "{}", recording.time_s[row]);
        for column in recording.columns() {
            let _ = match &column.cells {
                Cells::Numbers(numbers) => {
                    write!(text, ",{}", numbers.get(row).map(|x| round_to_six(x).to_string()).unwrap_or_default())
                }
                Cells::Words(words) => write!(text, ",{}", super::simulation::quote_cell(words.get(row).unwrap_or(""))),
            };
        }
        text.push('\n');
    }
    text
}

/// Six decimals are finer than any of the simulated instruments.
fn round_to_six(x: f64) -> f64 {
    (x * 1e6).round() / 1e6
}
