//! Scored on the built-in simulated machine, side by side with the plain reading of the source:
//! `cargo test --release --test inference -- --ignored --nocapture estimators::simulated` (20 seeds; two run by default).
//! `CNC_GATEWAY_SEED` gives the first seed.
//!
//! It is hard on a detector: most speeds are never run without feed, bearings warm up all the time, meter pulses of either
//! sign last longer than a tick, and slow spindles cut before their power has settled.

use crate::estimators::score::{assert_better, first_seed, header, line};
use adapters::clock::SECOND_NS;
use adapters::merge::{Delay, Lockstep};
use adapters::simulated::{CutLevel, Simulated, SimulatedSettings};
use adapters::{ChannelId, Sample};
use rules::estimators::{Inference, Settings, State};
use testkit::plain_reading::PlainReading;
use testkit::scoring::{Judged, Score};

const SCENARIOS: [(&str, f64, f64, bool, f64); 8] = [
    ("fast start, heavy cuts", 0.3, 0.8, false, 0.0),
    ("slow start, heavy cuts", 2.0, 0.8, false, 0.0),
    ("fast start, cuts of 5 %", 0.3, 0.05, false, 0.0),
    ("slow start, cuts of 5 %", 2.0, 0.05, false, 0.0),
    ("speed changes, fast", 0.3, 0.4, true, 0.0),
    ("speed changes, slow", 2.0, 0.4, true, 0.0),
    ("dropouts, heavy cuts", 0.3, 0.8, false, 60.0),
    ("dropouts, slow, 5 %", 2.0, 0.05, true, 60.0),
];

fn settings(
    (_, tau_s, share, speed_changes, dropouts_per_h): (&str, f64, f64, bool, f64),
    seed: u64,
) -> SimulatedSettings {
    let mut settings = SimulatedSettings { seed, tau_s, speed_changes, ..SimulatedSettings::default() };
    settings.cut = CutLevel::OfNoLoad(share);
    settings.meter.dropouts_per_h = dropouts_per_h;
    settings
}

fn run(settings: SimulatedSettings, course_s: i64) -> (Vec<Judged>, Vec<Judged>) {
    let machine = Simulated::new("simulated://lathe", settings, 0);
    let sources: Vec<Box<dyn adapters::Pull>> = vec![Box::new(machine.controller()), Box::new(machine.meter())];
    course(&machine, sources, course_s)
}

/// Traces of the product and of the plain reading, from what these sources of the machine say.
fn course(machine: &Simulated, sources: Vec<Box<dyn adapters::Pull>>, course_s: i64) -> (Vec<Judged>, Vec<Judged>) {
    let mut merge = Lockstep::new(sources, Delay::default());
    let (mut product, mut plain) = (Inference::new(Settings::default()), PlainReading::new());
    let mut sample = Sample::new_empty(0);
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    let inputs = ["spindle_speed_rpm", "spindle_power_w"].map(|name| ChannelId::from_name(name).expect("in the table"));
    for tick in 10..course_s * 10 {
        merge.sample_into(&mut sample, tick * SECOND_NS / 10);
        let truth = machine.truth(sample.at_ns);
        let state = State::from_word(truth.state.as_word()).expect("the same words");
        let absent = inputs.iter().any(|channel| sample.number(*channel).is_err());
        let estimates = *product.update_with_sample(&sample);
        plain.step(&sample);
        let judged = |said, said_no_load_w| Judged {
            time_s: sample.at_ns as f64 / SECOND_NS as f64,
            truth: state,
            said,
            missing: absent && state != State::Off,
            true_no_load_w: truth.no_load_power_w,
            said_no_load_w,
        };
        ours.push(judged(estimates.state, estimates.no_load_power_w.ok().map(|estimate| estimate.value)));
        theirs.push(judged(plain.state, plain.no_load_w));
    }
    (ours, theirs)
}

/// Courses of `course_s` seconds: power-up, warm-up and several parts.
fn score(seeds: u64, course_s: i64) {
    header(&format!("simulated lathe, {seeds} courses of {} min each", course_s / 60));
    for scenario in SCENARIOS {
        let (mut product, mut plain) = (Score::default(), Score::default());
        for seed in first_seed(1)..first_seed(1) + seeds {
            let (ours, theirs) = run(settings(scenario, seed), course_s);
            product.add(&ours);
            plain.add(&theirs);
        }
        line(scenario.0, "product", &product);
        line("", "plain", &plain);
        assert_better(scenario.0, &product, &plain);
    }
}

#[test]
fn simulated_machine_scored_on_two_seeds() {
    score(2, 1200);
}

/// Cuts in percent of the planned ones. Without any power meter: the controller's speed, feed and load meter, which shows whole
/// percent of the rating.
const LOADS: [(&str, f64, f64, CutLevel); 4] = [
    ("load meter, planned cuts", 0.6, 0.0, CutLevel::Planned(1.0)),
    ("load meter, half of them", 0.6, 0.0, CutLevel::Planned(0.5)),
    ("load meter, slow start", 2.0, 0.0, CutLevel::Planned(1.0)),
    ("load meter, dropouts", 0.6, 60.0, CutLevel::Planned(1.0)),
];

/// `cargo test --release --test inference -- --ignored --nocapture without_a_power` prints 20 seeds. Per scenario: share of time right, of cutting seen, of other time called cutting; and the same with the meter.
fn score_load_meter(seeds: u64, course_s: i64) -> Vec<(Score, Score)> {
    header(&format!("simulated lathe without a power meter, {seeds} courses of {} min each", course_s / 60));
    let mut scores = Vec::new();
    for (name, tau_s, dropouts_per_h, cut) in LOADS {
        let (mut without, mut with) = (Score::default(), Score::default());
        for seed in first_seed(1)..first_seed(1) + seeds {
            let mut settings = SimulatedSettings { seed, tau_s, cut, ..SimulatedSettings::default() };
            settings.meter.dropouts_per_h = dropouts_per_h;
            let machine = Simulated::new("simulated://lathe", settings, 0);
            let sources: Vec<Box<dyn adapters::Pull>> = vec![Box::new(machine.controller())];
            without.add(&load_only(course(&machine, sources, course_s).0));
            with.add(&run(settings, course_s).0);
        }
        line(name, "load", &without);
        line("", "power", &with);
        scores.push((without, with));
    }
    scores
}

/// Power is never there in such a trace, which is no excuse.
fn load_only(mut trace: Vec<Judged>) -> Vec<Judged> {
    trace.iter_mut().for_each(|tick| tick.missing = false);
    trace
}

#[test]
fn without_a_power_meter_the_load_meter_tells_the_state() {
    for (load, power) in score_load_meter(1, 1500) {
        assert!(load.right() > 0.75 * power.right(), "{} against {}", load.right(), power.right());
        assert!(load.cut_seen() > 0.7 && load.false_cut() < 0.1, "{} {}", load.cut_seen(), load.false_cut());
    }
}

#[test]
#[ignore = "1 minute: states without a power meter on 20 seeds of every scenario, in release"]
fn without_a_power_meter_on_twenty_seeds() {
    score_load_meter(20, 2400);
}

#[test]
#[ignore = "1 minute: machine states of 20 seeds of every scenario, in release"]
fn simulated_machine_scored_on_twenty_seeds() {
    score(20, 2400);
}
