//! A machine of another maker that is known by a recording alone: `foreign_mill` makes the rows, the reader reads the file, the pipeline
//! replays it. Its faults stand in the file for a while, whether they are told or not.

use super::foreign_mill::{ForeignMill, ROW_S};
use super::kinds::{FAULTS, Fault};
use super::{AFTER_S, AtWork, Counted, Course, MILL_PARTS, Now, PATIENCE_S, Told, as_delivered};
use adapters::clock::SECOND_NS;
use adapters::merge::{Delay, Lockstep};
use adapters::recording::read_path;
use adapters::replay::Replay;
use adapters::{Pull, Sample, Value};
use gateway::gate::Gate;
use gateway::history::{ExtraValue, Record};
use gateway::pipeline::{Pipeline, Store};
use rules::estimators;
use rules::script::{AlarmLevel, Host, Stop};
use std::fmt::Write;
use std::time::Duration;

pub(super) const NAME: &str = "mill of another maker, by recording";

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

/// The recording as a table of text, what stands in it, and the time of its first row.
fn record(seed: u64) -> (String, Vec<Window>, f64) {
    let mut machine = ForeignMill::new(seed);
    let (mut course, mut sample, mut line_fault) = (Course::new(&FAULTS, MILL_PARTS, seed), Sample::new_empty(0), None);
    let (mut table, mut windows, mut first_s) = (String::new(), Vec::<Window>::new(), None);
    while course.current().is_some() && machine.now_s < 12.0 * 3600.0 {
        machine.advance();
        let now_s = machine.now_s;
        first_s.get_or_insert(now_s);
        match course.now {
            Now::Works { .. } => {
                let at = AtWork { engaged: machine.engaged() > 0.99, tool: machine.tool(), parts: machine.parts };
                if let Some(fault) = course.begins(&at, now_s, ROW_S) {
                    line_fault = fault.begin_on(&mut machine, course.tool);
                    windows.push(Window { fault, from_s: now_s, to_s: now_s + PATIENCE_S });
                }
            }
            Now::Faulty { since_s } if now_s - since_s >= PATIENCE_S => {
                course.current().expect("it is on").end_on(&mut machine, course.tool);
                line_fault = None;
                course.end(now_s);
            }
            Now::Faulty { .. } => {}
        }
        machine.fill(&mut sample);
        if let Some(fault) = line_fault {
            fault.apply(&mut sample);
        }
        write_row(&mut table, &sample, now_s);
    }
    assert!(course.current().is_none(), "every fault came within twelve hours");
    (table, windows, first_s.expect("a row"))
}

fn write_row(table: &mut String, sample: &Sample, now_s: f64) {
    if table.is_empty() {
        table.push_str("time_s");
        sample.provided_slots().for_each(|(id, _)| write!(table, ",{}", id.name()).expect("memory"));
        table.push('\n');
    }
    write!(table, "{now_s:.3}").expect("memory");
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

pub(super) fn run(seed: u64) -> Counted {
    let (table, windows, first_s) = record(seed);
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
        let now_s = first_s + (now_ns - *begin_ns.get_or_insert(now_ns)) as f64 / SECOND_NS as f64;
        counted.judge(&pipeline, &windows, now_s);
    }
    counted
}

impl Counted {
    fn judge(&mut self, pipeline: &Pipeline, windows: &[Window], now_s: f64) {
        let here = windows.iter().position(|it| (it.from_s..it.to_s + AFTER_S).contains(&now_s));
        self.healthy_s += if here.is_none() { ROW_S } else { 0.0 };
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
