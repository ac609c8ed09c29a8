//! Machines with faults under every delivered script, as delivered but for `tell_insert = 1`: beside the healthy ones. Twelve faults come and go on a machine at
//! work, one after the other; counted is after how long each is told, by which alarm, and what is told where nothing is wrong.
//!
//! The machines are the lathe and the mill that are built in, live, in shadow and armed; and a mill of another maker, with other laws, that
//! is known by a recording alone, which the reader reads and the pipeline replays.

mod foreign;
mod foreign_mill;
mod kinds;
mod thermal_sensors;

use super::bench::Bench;
use super::healthy::as_delivered;
use adapters::address::SimulatedMachine;
use adapters::simulated::{DaySettings, Moment, SimulatedSettings};
use kinds::{FAULTS, Fault};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rules::script::{AlarmLevel, ScriptFile, list_shipped_scripts};
use std::collections::BTreeMap;

/// A fault that is not told after so long in all is not told, s.
const PATIENCE_S: f64 = 900.0;
/// Between two faults the machine works for so long, s: some parts.
const RECOVERS_S: f64 = 500.0;
/// Parts of a lathe, and of a mill, before the first fault: every program has shown what is usual, and a tool with inserts in 8 parts how
/// little one differs from the next on the same work.
const LATHE_PARTS: u32 = 26;
const MILL_PARTS: u32 = 50;
/// What a fault leaves behind for so long counts with it, s.
const AFTER_S: f64 = 60.0;

/// The delivered scripts, of which `teach` tells a missing insert.
fn list_scripts() -> Vec<ScriptFile> {
    let told = |file: ScriptFile| ScriptFile {
        text: file.text.replace("setting(\"tell_insert\", 0,", "setting(\"tell_insert\", 1,"),
        ..file
    };
    list_shipped_scripts().into_iter().map(told).collect()
}

/// A machine, and how it is run.
#[derive(Clone, Copy)]
struct Setup {
    name: &'static str,
    machine: SimulatedMachine,
    armed: bool,
    /// Lots of other material and programs; otherwise one program.
    lots: bool,
    /// Parts before the first fault.
    parts: u32,
    faults: &'static [Fault],
}

/// When a fault began, and what told it.
#[derive(Debug, Clone)]
struct Told {
    fault: &'static str,
    after_s: Option<f64>,
    by: String,
}

#[derive(Debug, Default)]
struct Counted {
    told: Vec<Told>,
    /// Alarms without a fault.
    false_alarms: Vec<String>,
    holds: u32,
    healthy_s: f64,
}

/// The fault that is on, or when the next one may come.
#[derive(Debug, Clone, Copy)]
enum Now {
    Works { since_s: f64, cut_s: f64, wanted_cut_s: f64 },
    Faulty { since_s: f64 },
}

/// What a machine is about when a fault may come.
struct AtWork {
    /// The tool is wholly in the work.
    engaged: bool,
    tool: u8,
    parts: u32,
}

impl AtWork {
    fn of(moment: &Moment) -> Self {
        Self { engaged: moment.truth.engaged > 0.99, tool: moment.panel.tool, parts: moment.panel.part_count }
    }
}

/// Faults of one machine, one after the other.
struct Course {
    faults: Vec<Fault>,
    at: usize,
    now: Now,
    tool: u8,
    rng: Pcg64Mcg,
    parts: u32,
}

impl Course {
    /// These faults, from so many parts on.
    fn new(faults: &[Fault], parts: u32, seed: u64) -> Self {
        let mut faults = faults.to_vec();
        let turns = seed as usize % faults.len();
        faults.rotate_left(turns);
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let tool = 1 + u8::try_from(seed / 2 % 2).expect("a bit");
        let now = Now::Works { since_s: 0.0, cut_s: 0.0, wanted_cut_s: rng.random_range(0.0..30.0) };
        Self { faults, at: 0, now, tool, rng, parts }
    }

    fn current(&self) -> Option<&Fault> {
        self.faults.get(self.at)
    }

    /// The fault that begins at this moment: in a cut, after a random time of cutting, that of the insert in one of its tool.
    fn begins(&mut self, at: &AtWork, now_s: f64, step_s: f64) -> Option<Fault> {
        let fault = *self.current()?;
        let Now::Works { since_s, cut_s, wanted_cut_s } = &mut self.now else { return None };
        if at.parts < self.parts || now_s - *since_s < RECOVERS_S {
            return None;
        }
        let right = at.engaged && (!fault.of_tool || at.tool == self.tool);
        *cut_s += if right { step_s } else { 0.0 };
        if !right || *cut_s < *wanted_cut_s {
            return None;
        }
        self.now = Now::Faulty { since_s: now_s };
        Some(fault)
    }

    fn end(&mut self, now_s: f64) {
        self.at += 1;
        self.now = Now::Works { since_s: now_s, cut_s: 0.0, wanted_cut_s: self.rng.random_range(0.0..30.0) };
    }
}

fn settings(setup: &Setup, seed: u64) -> SimulatedSettings {
    let parts_per_lot = if setup.lots { DaySettings::default().parts_per_lot } else { u32::MAX };
    let day = DaySettings { shift_s: 12.0 * 3600.0, parts_per_lot, ..DaySettings::default() };
    SimulatedSettings { machine: setup.machine, seed, day, ..SimulatedSettings::default() }
}

/// Every fault once, on one machine.
fn run(setup: &Setup, seed: u64) -> Counted {
    let mut bench = Bench::at_work(settings(setup, seed), &list_scripts(), &as_delivered(setup.armed));
    let (mut course, mut counted) = (Course::new(setup.faults, setup.parts, seed), Counted::default());
    let mut held = false;
    while course.current().is_some() && bench.now_s() < 12.0 * 3600.0 {
        bench.tick();
        let now_s = bench.now_s();
        if setup.armed && now_s > 30.0 && bench.pipeline.gate().current_arming().is_err() {
            bench.arm();
        }
        let decision = bench.pipeline.scripts().decision().clone();
        let raised: Vec<_> = decision.alarms.iter().filter(|alarm| alarm.raised).cloned().collect();
        let holds = !decision.stops.is_empty();
        match course.now {
            Now::Works { since_s, .. } => {
                counted.healthy_s += f64::from(u8::from(now_s - since_s > AFTER_S)) * bench.period_ns as f64 / 1e9;
                let wrong = |name: &str, level| level != AlarmLevel::Info && !name.starts_with("tool_worn");
                let wrong = raised.iter().filter(|it| now_s - since_s > AFTER_S && wrong(&it.name, it.level));
                counted.false_alarms.extend(wrong.map(|it| format!("{now_s:.0} s: {}", it.name)));
                let asks = decision.stops.iter().any(|ask| ask.stop == rules::script::Stop::FeedHold);
                counted.holds += u32::from(asks && !held && now_s - since_s > AFTER_S);
                held = holds && asks;
                let moment = bench.machine.moment((now_s * 1e9) as i64);
                if let Some(fault) = course.begins(&AtWork::of(&moment), now_s, bench.period_ns as f64 / 1e9) {
                    fault.begin(&mut bench, course.tool);
                }
            }
            Now::Faulty { since_s } => {
                let fault = *course.current().expect("it is on");
                let telling = raised.iter().find(|it| fault.is_told_by(&it.name));
                if telling.is_none() && now_s - since_s < PATIENCE_S {
                    continue;
                }
                let after_s = telling.map(|_| now_s - since_s);
                let by = telling.map_or_else(String::new, |it| it.name.to_string());
                counted.told.push(Told { fault: fault.name, after_s, by });
                fault.end(&mut bench, course.tool);
                course.end(now_s);
            }
        }
    }
    let untold = course.faults[course.at.min(course.faults.len())..].iter();
    counted.told.extend(untold.map(|fault| Told { fault: fault.name, after_s: None, by: "never came".to_owned() }));
    counted
}

/// Runs these seeds on both processors.
fn runs<T: Send>(seeds: std::ops::Range<u64>, of: impl Fn(u64) -> T + Sync) -> Vec<T> {
    std::thread::scope(|scope| {
        let of = &of;
        let lane = |odd: u64| {
            let seeds = seeds.clone();
            move || seeds.filter(|seed| seed % 2 == odd).map(of).collect::<Vec<_>>()
        };
        let lanes = [scope.spawn(lane(0)), scope.spawn(lane(1))];
        lanes.into_iter().flat_map(|lane| lane.join().expect("a machine")).collect()
    })
}

fn heading() {
    println!("| machine | fault | told | median s | worst s | by |\n|---|---|---|---|---|---|");
}

/// Prints a row for each fault, and what was told without one; gives faults, told ones and false alarms.
fn score(name: &str, counted: &[Counted]) -> [usize; 3] {
    let mut faults = BTreeMap::<&str, Vec<&Told>>::new();
    for told in counted.iter().flat_map(|it| &it.told) {
        faults.entry(told.fault).or_default().push(told);
    }
    let [mut all, mut seen] = [0, 0];
    for (fault, cases) in faults {
        let mut seconds: Vec<f64> = cases.iter().filter_map(|it| it.after_s).collect();
        seconds.sort_by(f64::total_cmp);
        let mut by: Vec<&str> = cases.iter().map(|it| it.by.as_str()).filter(|it| !it.is_empty()).collect();
        by.sort_unstable();
        by.dedup();
        let at = |index: usize| seconds.get(index).map_or_else(|| "-".to_owned(), |it| format!("{it:.1}"));
        println!(
            "| {name} | {fault} | {} of {} | {} | {} | {} |",
            seconds.len(),
            cases.len(),
            at(seconds.len() / 2),
            at(seconds.len().saturating_sub(1)),
            by.join(", ")
        );
        (all, seen) = (all + cases.len(), seen + seconds.len());
    }
    let wrong: Vec<&String> = counted.iter().flat_map(|it| &it.false_alarms).collect();
    let shifts = counted.iter().map(|it| it.healthy_s).sum::<f64>() / 28_800.0;
    let holds: u32 = counted.iter().map(|it| it.holds).sum();
    println!(
        "| {name} | none | {} false alarms and {holds} holds in {shifts:.1} shifts | | | {} |",
        wrong.len(),
        wrong.iter().take(8).map(|it| it.as_str()).collect::<Vec<_>>().join("; ")
    );
    [all, seen, wrong.len() + holds as usize]
}

fn setups() -> Vec<Setup> {
    let of = |name, machine, armed| {
        let parts = if machine == SimulatedMachine::Mill { MILL_PARTS } else { LATHE_PARTS };
        Setup { name, machine, armed, lots: true, parts, faults: &FAULTS }
    };
    vec![
        of("lathe, shadow", SimulatedMachine::Lathe, false),
        of("lathe, armed", SimulatedMachine::Lathe, true),
        of("mill, shadow", SimulatedMachine::Mill, false),
        of("mill, armed", SimulatedMachine::Mill, true),
    ]
}

#[test]
fn faults_of_a_mill_are_told_in_shadow() {
    let faults = &FAULTS[..4];
    assert!(faults.iter().any(|it| it.of_tool), "the insert is among them");
    let setup = Setup {
        name: "mill, shadow, one program",
        machine: SimulatedMachine::Mill,
        armed: false,
        lots: false,
        parts: 14,
        faults,
    };
    heading();
    let [all, seen, wrong] = score(setup.name, &[run(&setup, 4)]);
    assert_eq!((all, seen, wrong), (4, 4, 0));
}

/// A shift in which a reading of the meter is ten times the power in a short cut: it lies in two samples, and is no fault.
#[test]
fn a_disturbed_reading_of_the_meter_is_no_multiple() {
    let mill = setups().into_iter().find(|it| it.name == "mill, shadow").expect("it is listed");
    let counted = run(&mill, 6);
    assert_eq!(counted.false_alarms, [""; 0]);
}

/// `cargo test --test box another_maker -- --nocapture`
#[test]
fn faults_of_a_mill_of_another_maker_are_told_by_its_recording() {
    heading();
    let [all, seen, wrong] = score(foreign::NAME, &[foreign::run(3)]);
    assert_eq!((all, wrong), (9, 0));
    // A missing insert may take more parts than the recording has.
    assert!(seen >= 8, "{seen} of {all}");
}

/// `FAULT_RUNS` chooses by name, `FAULT_SEEDS=1..21` the seeds (20 from 1 on unless given).
#[test]
#[ignore = "30 minutes: twelve faults on 20 seeds of lathe, mill and a machine by recording, when and by what each is told"]
fn twelve_faults_are_told() {
    let chosen = std::env::var("FAULT_RUNS").unwrap_or_default();
    let seeds = std::env::var("FAULT_SEEDS").unwrap_or_else(|_| "1..21".to_owned());
    let (from, to) = seeds.split_once("..").expect("FROM..TO");
    let seeds = from.parse().expect("a number")..to.parse().expect("a number");
    heading();
    let mut sums = [0, 0, 0];
    let mut add = |of: [usize; 3]| sums.iter_mut().zip(of).for_each(|(sum, of)| *sum += of);
    for setup in setups().iter().filter(|it| it.name.contains(&chosen)) {
        add(score(setup.name, &runs(seeds.clone(), |seed| run(setup, seed))));
    }
    if foreign::NAME.contains(&chosen) {
        add(score(foreign::NAME, &runs(seeds.clone(), foreign::run)));
    }
    for (name, run) in thermal_sensors::MACHINES.iter().filter(|(name, _)| name.contains(&chosen)) {
        add(score(name, &runs(seeds.clone(), *run)));
    }
    let [all, seen, wrong] = sums;
    println!("told {seen} of {all}; {wrong} false");
    assert!(seen * 100 >= 95 * all, "{seen} of {all}");
}
