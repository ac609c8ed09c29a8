//! A machine of other settings that is known by a recording alone: 5 rows a second, lighter cuts, a slow and noisy meter, no word of the
//! process plan. The recording is a file that the reader reads; its faults stand in it for a while, whether they are told or not.

use super::kinds::{FAULTS, Fault};
use super::{AFTER_S, Counted, Course, Now, Setup, Told, as_delivered, settings};
use adapters::address::SimulatedMachine;
use adapters::clock::SECOND_NS;
use adapters::merge::{Delay, Lockstep};
use adapters::recording::read_path;
use adapters::replay::Replay;
use adapters::simulated::{CutLevel, MeterSettings, Simulated, SimulatedSettings};
use adapters::{Pull, Sample, Value};
use gateway::gate::Gate;
use gateway::history::{ExtraValue, Record};
use gateway::pipeline::{Pipeline, Store};
use rules::estimators;
use rules::script::{AlarmLevel, Host, Stop};
use std::fmt::Write;
use std::time::Duration;

pub(super) const MACHINES: [(&str, SimulatedMachine); 2] =
    [("another lathe, by recording", SimulatedMachine::Lathe), ("another mill, by recording", SimulatedMachine::Mill)];

const ROW_NS: i64 = SECOND_NS / 5;
/// A fault stands for so long, s: two parts.
const STANDS_S: f64 = 600.0;

/// From when to when a fault stands in the recording.
struct Window {
    fault: Fault,
    from_s: f64,
    to_s: f64,
}

struct Nothing;

impl Store for Nothing {
    fn store_sample(&mut self, _: &Sample, _: &[ExtraValue<'_>]) {}

    fn store_record(&mut self, _: Record) {}
}

fn other_settings(setup: &Setup, seed: u64) -> SimulatedSettings {
    let usual = settings(setup, seed);
    let mut meter = MeterSettings { noise_share: 0.02, noise_floor_w: 4.0, zero_drift_w: 10.0, ..usual.meter };
    (meter.device.refresh, meter.device.period) = (Duration::from_millis(200), Duration::from_millis(200));
    SimulatedSettings { cut: CutLevel::Planned(0.7), tau_s: 1.1, annotations: false, meter, ..usual }
}

/// The recording as a table of text, and what stands in it.
fn record(setup: &Setup, seed: u64) -> (String, Vec<Window>) {
    let machine = Simulated::new("simulated://foreign", other_settings(setup, seed), 0);
    let sources: Vec<Box<dyn Pull>> = vec![Box::new(machine.controller()), Box::new(machine.meter())];
    let mut lockstep = Lockstep::new(sources, Delay::SlowestPeriod);
    let (mut course, mut sample, mut line_fault) = (Course::new(setup, seed), Sample::new_empty(0), None);
    let (mut table, mut windows, mut now_ns) = (String::new(), Vec::<Window>::new(), 0);
    while course.current().is_some() && now_ns < 12 * 3600 * SECOND_NS {
        now_ns += ROW_NS;
        lockstep.sample_into(&mut sample, now_ns);
        let now_s = now_ns as f64 / SECOND_NS as f64;
        match course.now {
            Now::Works { .. } => {
                if let Some(fault) = course.begins(&machine.moment(now_ns), now_s, ROW_NS as f64 / SECOND_NS as f64) {
                    line_fault = fault.begin_on(&machine, course.tool);
                    windows.push(Window { fault, from_s: now_s, to_s: now_s + STANDS_S });
                }
            }
            Now::Faulty { since_s } if now_s - since_s >= STANDS_S => {
                course.current().expect("it is on").end_on(&machine, course.tool);
                line_fault = None;
                course.end(now_s);
            }
            Now::Faulty { .. } => {}
        }
        if let Some(fault) = line_fault {
            fault.apply(&mut sample);
        }
        write_row(&mut table, &sample, now_s);
    }
    (table, windows)
}

fn write_row(table: &mut String, sample: &Sample, now_s: f64) {
    if table.is_empty() {
        table.push_str("time_s");
        sample.provided_slots().for_each(|(id, _)| write!(table, ",{}", id.name()).expect("memory"));
        table.push('\n');
    }
    write!(table, "{now_s:.1}").expect("memory");
    for (_, slot) in sample.provided_slots() {
        match &slot.value {
            Ok(Value::Number(number)) => write!(table, ",{number:.3}"),
            Ok(Value::Text(text)) => write!(table, ",{text}"),
            Err(_) => write!(table, ","),
        }
        .expect("memory");
    }
    table.push('\n');
}

pub(super) fn run(machine: SimulatedMachine, seed: u64) -> Counted {
    let setup = Setup { name: "foreign", machine, armed: false, lots: true, parts: 25, faults: &FAULTS };
    let (table, windows) = record(&setup, seed);
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("foreign.csv");
    std::fs::write(&file, table).expect("room");
    let recording = read_path(&file).expect("a recording").recording;
    let mut lockstep = Lockstep::new(
        vec![Box::new(Replay::new("foreign", &recording, 0)) as Box<dyn Pull>],
        Delay::Fixed(Duration::ZERO),
    );
    let mut host = Host::new();
    host.load_scripts(&super::list_scripts()).expect("the scripts are accepted");
    let mut pipeline = Pipeline::new(
        estimators::Inference::new(estimators::Settings::default()),
        host,
        Gate::new(as_delivered(false)),
    );
    let mut counted = Counted::default();
    counted.told.extend(windows.iter().map(|it| Told { fault: it.fault.name, after_s: None, by: String::new() }));
    let (mut sample, mut begin_ns) = (Sample::new_empty(0), None);
    while let Some(now_ns) = lockstep.next_ns() {
        lockstep.sample_into(&mut sample, now_ns);
        pipeline.run_tick(&sample, &mut Nothing);
        // The first row is that of one period.
        let now_s = (now_ns - *begin_ns.get_or_insert(now_ns) + ROW_NS) as f64 / SECOND_NS as f64;
        counted.judge(&pipeline, &windows, now_s);
    }
    counted
}

impl Counted {
    fn judge(&mut self, pipeline: &Pipeline, windows: &[Window], now_s: f64) {
        let here = windows.iter().position(|it| (it.from_s..it.to_s + AFTER_S).contains(&now_s));
        self.healthy_s += if here.is_none() { ROW_NS as f64 / SECOND_NS as f64 } else { 0.0 };
        let decision = pipeline.scripts().decision();
        for alarm in decision.alarms.iter().filter(|alarm| alarm.raised) {
            if let Some(at) = here {
                let (window, told) = (&windows[at], &mut self.told[at]);
                if told.after_s.is_none() && now_s < window.to_s && window.fault.is_told_by(&alarm.name) {
                    (told.after_s, told.by) = (Some(now_s - window.from_s), alarm.name.to_string());
                }
            } else if alarm.level != AlarmLevel::Info && !alarm.name.starts_with("tool_worn") {
                self.false_alarms.push(format!("{now_s:.0} s: {}", alarm.name));
            }
        }
        self.holds += u32::from(here.is_none() && decision.stops.iter().any(|ask| ask.stop == Stop::FeedHold));
    }
}
