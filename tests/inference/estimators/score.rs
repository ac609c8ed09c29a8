//! Scored on the bench, side by side with the plain reading of the source:
//! `cargo test --release --test inference -- --nocapture estimators::score`.

use adapters::clock::SECOND_NS;
use adapters::merge::{Delay, Lockstep};
use adapters::{Absence, ChannelId, Sample, Slot};
use rules::estimators::{Inference, Settings};
use std::sync::Arc;
use testkit::bench::{Course, Disturbance, Scenario, sources};
use testkit::plain_reading::PlainReading;
use testkit::scoring::{Judged, Score};

/// Courses per scenario.
const SEEDS: u64 = 20;

const SCENARIOS: [Scenario; 8] = [
    scenario("fast start, heavy cuts", 0.3, 0.8, false, false),
    scenario("slow start, heavy cuts", 2.0, 0.8, false, false),
    scenario("fast start, cuts of 5 %", 0.3, 0.05, false, false),
    scenario("slow start, cuts of 5 %", 2.0, 0.05, false, false),
    scenario("speed changes, fast", 0.3, 0.4, true, false),
    scenario("speed changes, slow", 2.0, 0.4, true, false),
    scenario("dropouts, heavy cuts", 0.3, 0.8, false, true),
    scenario("dropouts, slow, 5 %", 2.0, 0.05, true, true),
];

const fn scenario(name: &'static str, tau_s: f64, cut_share: f64, speed_changes: bool, dropouts: bool) -> Scenario {
    Scenario { name, tau_s, cut_share, speed_changes, dropouts, supply_exponent: None }
}

/// Traces of the product and of the plain reading.
fn run(scenario: &Scenario, seed: u64) -> (Vec<Judged>, Vec<Judged>) {
    run_seeing(scenario, seed, true)
}

/// The same; `voltage`: does the product see the voltage, where the meter shows it?
fn run_seeing(scenario: &Scenario, seed: u64, voltage: bool) -> (Vec<Judged>, Vec<Judged>) {
    let course = Arc::new(Course::run(scenario, seed));
    let sources = sources(&course, Disturbance::default(), scenario.dropouts, seed);
    let mut merge = Lockstep::new(sources, Delay::default());
    let (mut product, mut plain) = (Inference::new(Settings::default()), PlainReading::new());
    let mut sample = Sample::new_empty(0);
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    let inputs = ["spindle_speed_rpm", "spindle_power_w"].map(|name| ChannelId::from_name(name).expect("in the table"));
    let supply = ChannelId::from_name("supply_voltage_v").expect("in the table");
    let mut now_ns = SECOND_NS;
    while merge.sample_into(&mut sample, now_ns) {
        now_ns += SECOND_NS / 10;
        if !voltage {
            sample.set_slot(supply, Slot { value: Err(Absence::NotProvided), age_ns: 0 });
        }
        let time_s = sample.at_ns as f64 / SECOND_NS as f64;
        let Some(moment) = course.at(time_s) else { break };
        let missing = inputs.iter().any(|channel| sample.number(*channel).is_err());
        let estimates = *product.update_with_sample(&sample);
        plain.step(&sample);
        let judged = |said, said_no_load_w| Judged {
            time_s,
            truth: moment.state,
            said,
            missing,
            true_no_load_w: moment.no_load_power_w,
            said_no_load_w,
        };
        ours.push(judged(estimates.state, estimates.no_load_power_w.ok().map(|estimate| estimate.value)));
        theirs.push(judged(plain.state, plain.no_load_w));
    }
    (ours, theirs)
}

/// The first seed: `CNC_GATEWAY_SEED`, or the usual one. The settings were chosen on the usual ones.
pub(crate) fn first_seed(usual: u64) -> u64 {
    std::env::var("CNC_GATEWAY_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(usual)
}

fn percent(share: f64) -> f64 {
    100.0 * share
}

pub(crate) fn header(title: &str) {
    println!("{title}; times in s, shares in %");
    println!(
        "| {:<24} | {:<7} | {:>6} | {:>6} | {:>6} | {:>6} | {:>6} | {:>6} | {:>6} | {:>6} | {:>6} | {:>6} |",
        "scenario", "", "right", "cut", "false", "d50", "d95", "missed", "bias50", "bias95", "no ref", "absent"
    );
}

pub(crate) fn line(name: &str, who: &str, score: &Score) {
    println!(
        "| {name:<24} | {who:<7} | {:6.2} | {:6.1} | {:6.2} | {:6.2} | {:6.2} | {:6.1} | {:6.2} | {:6.2} | {:6.1} | {:6.1} |",
        percent(score.right()),
        percent(score.cut_seen()),
        percent(score.false_cut()),
        score.delay_s(0.5),
        score.delay_s(0.95),
        percent(score.missed()),
        percent(score.bias(0.5)),
        percent(score.bias(0.95)),
        percent(score.no_reference()),
        percent(score.right_missing()),
    );
}

#[test]
fn score_beats_the_plain_reading_of_the_source_everywhere() {
    header(&format!("bench, {SEEDS} courses each"));
    for scenario in &SCENARIOS {
        let (mut product, mut plain) = (Score::default(), Score::default());
        for seed in first_seed(0)..first_seed(0) + SEEDS {
            let (ours, theirs) = run(scenario, seed);
            product.add(&ours);
            plain.add(&theirs);
        }
        line(scenario.name, "product", &product);
        line("", "plain", &plain);
        assert_better(scenario.name, &product, &plain);
    }
}

/// Better in every figure, or as good where nothing is left to gain.
pub(crate) fn assert_better(name: &str, product: &Score, plain: &Score) {
    let higher = [
        ("right", product.right(), plain.right()),
        ("cut", product.cut_seen(), plain.cut_seen()),
        ("cut minus false", product.judgement(), plain.judgement()),
        // A tick or two at power-up is no difference.
        ("absent", product.right_missing() + 0.01, plain.right_missing()),
    ];
    let lower = [
        ("d50", product.delay_s(0.5), plain.delay_s(0.5)),
        ("d95", product.delay_s(0.95), plain.delay_s(0.95)),
        ("missed", product.missed(), plain.missed()),
        ("bias50", product.bias(0.5), plain.bias(0.5)),
        ("bias95", product.bias(0.95), plain.bias(0.95)),
        ("no ref", product.no_reference(), plain.no_reference()),
    ];
    for (figure, ours, theirs) in higher {
        assert!(ours >= theirs, "{name}: {figure} {ours} against {theirs}");
    }
    for (figure, ours, theirs) in lower {
        assert!(ours <= theirs, "{name}: {figure} {ours} against {theirs}");
    }
}

/// Mains that wander by 4 %, for drives whose no-load power follows them with these exponents.
const EXPONENTS: [f64; 3] = [0.0, 1.0, 2.0];

/// With the voltage at most this share of what is called cutting is false.
const FALSE_CUT_MAX: f64 = 0.04;

#[test]
fn wandering_mains_are_not_taken_for_cuts() {
    header(&format!("mains wander by 4 %, {SEEDS} courses each"));
    for exponent in EXPONENTS {
        for scenario in SCENARIOS.map(|scenario| Scenario { supply_exponent: Some(exponent), ..scenario }) {
            let (mut seeing, mut blind) = (Score::default(), Score::default());
            for seed in first_seed(0)..first_seed(0) + SEEDS {
                seeing.add(&run_seeing(&scenario, seed, true).0);
                blind.add(&run_seeing(&scenario, seed, false).0);
            }
            line(&format!("{}, U^{exponent}", scenario.name), "voltage", &seeing);
            line("", "without", &blind);
            assert!(seeing.false_cut() <= FALSE_CUT_MAX, "{} U^{exponent}: {}", scenario.name, seeing.false_cut());
        }
    }
}
