//! Constant load against plain feed on the same part: feature, depth, curve, feed, write, acknowledgement.
//!
//! The curves of the spindle power over feed are identified from sweeps at five depths, as `identify feed-curve` does; the
//! script infers the equivalent depth from feed and power, and asks for the feed that gives the wanted power. Guards: entry
//! and exit (nothing for half a second after the tool has met the work), air (power below every curve: the programmed feed),
//! overload (power above every curve: the least feed), nothing without a fresh power.

use super::bench::{Bench, limits, script};
use super::steps::{SPEED_RPM, air, air_cut, cut};
use adapters::channel::Kind;
use adapters::recording::{Cells, Numbers, Words};
use adapters::simulated::{ExperimentStep, SimulatedSettings};
use adapters::{ChannelId, Recording, Sample, Value};
use rules::estimators::spindle_current::{FeedCurves, identify_feed_curve};
use rules::script::ScriptFile;
use std::fmt::Write as _;

/// The programmed feed, chosen for the deepest cut of the part.
const FEED_MM_MIN: f64 = 180.0;
const DEPTHS_MM: [f64; 5] = [0.6, 1.0, 1.5, 2.1, 2.8];
const MAX_PCT: f64 = 150.0;
const MIN_PCT: f64 = 50.0;

fn settings(seed: u64) -> SimulatedSettings {
    let mut settings = SimulatedSettings { seed, wear_mm: 0.05, ..SimulatedSettings::default() };
    settings.meter.dropouts_per_h = 0.0;
    settings
}

/// A part with varying depth, two air cuts, and a rest before and after.
fn part() -> Vec<ExperimentStep> {
    let depths = [1.0, 2.4, 0.8, 1.6, 2.6, 1.2, 2.0, 0.7, 2.2, 1.4];
    let mut steps = vec![air(15.0)];
    for (index, depth) in depths.into_iter().enumerate() {
        steps.push(cut(14.0, FEED_MM_MIN, depth));
        if index % 4 == 2 {
            steps.push(air_cut(3.0, FEED_MM_MIN));
        }
    }
    steps.push(air(3.0));
    steps
}

/// Sweeps at every depth, recorded through the same line as the control will be.
fn curves() -> FeedCurves {
    let mut steps = vec![air(15.0)];
    for depth in DEPTHS_MM {
        for feed in [70.0, 100.0, 140.0, 180.0, 220.0, 260.0, 300.0] {
            steps.push(cut(7.0, feed, depth));
        }
    }
    let quiet = [script("nothing.rhai", "const EVERY_S = 10.0;")];
    let mut bench = Bench::new(settings(99), &steps, &quiet, &limits(MIN_PCT, MAX_PCT));
    let mut samples = Vec::new();
    while !over(&bench) {
        let sample = bench.tick().clone();
        samples.push(sample);
    }
    identify_feed_curve(&table(&samples), "feed_mm_min", "spindle_power_w").expect("curves")
}

fn over(bench: &Bench) -> bool {
    let panel = bench.machine.moment((bench.now_s() * 1e9) as i64).panel;
    bench.now_s() > 40.0 && panel.program == 0
}

fn table(samples: &[Sample]) -> Recording {
    let time_s = (0..samples.len()).map(|row| row as f64 / 10.0).collect();
    let mut recording = Recording::new("sweeps", time_s, None);
    for id in ChannelId::all() {
        let values = || samples.iter().map(|sample| sample.slot(id).value.as_ref().ok());
        if values().flatten().next().is_none() {
            continue;
        }
        let cells = match id.channel().kind {
            Kind::Text => Cells::Words(values().map(|it| it.and_then(Value::as_text).unwrap_or("")).collect::<Words>()),
            _ => Cells::Numbers(values().map(|it| it.and_then(Value::as_number)).collect::<Numbers>()),
        };
        recording.set_column(id.name(), cells);
    }
    recording
}

/// The law of the module, with these curves and this target.
fn law(learned: &FeedCurves, target_w: f64) -> ScriptFile {
    let family = learned.family(SPEED_RPM).expect("curves that do not cross");
    let mut rows = String::new();
    for it in family.curves() {
        let [c0, c1, c2, c3] = it.curve.coefficients;
        let _ = writeln!(
            rows,
            "[{:.4}, {:.4}, {:.4}, {c0:.6}, {c1:.6}, {c2:.10}, {c3:.12}, {:.4}],",
            it.depth_mm, it.curve.feed_min, it.curve.feed_max, it.sd
        );
    }
    let text = format!(
        r#"
const CURVES = [{rows}];
const TARGET_W = {target_w:.1};
const MIN_PCT = {MIN_PCT:.1};
const MAX_PCT = {MAX_PCT:.1};
// Longer than meter and controller lag behind each other. 切入后等待
const SETTLE_S = 0.5;

let pct = 100.0;
let known = has(spindle_power_w) && has(feed_mm_min) && has(feed_programmed_mm_min);
if state == "cutting" && state_s >= SETTLE_S && known && feed_mm_min > 10.0 && feed_programmed_mm_min > 10.0 {{
    // Smoothed over a few ticks: the meter is noisy, and feed and power are not of quite the same moment. 平滑
    let power_w = memory.power_w ?? spindle_power_w;
    let feed = memory.feed ?? feed_mm_min;
    power_w += 0.5 * (spindle_power_w - power_w);
    feed += 0.5 * (feed_mm_min - feed);
    memory.power_w = power_w;
    memory.feed = feed;
    let depth_mm = feed_curve_depth_mm(CURVES, feed, power_w);
    if has(depth_mm) {{
        let wanted = feed_curve_feed(CURVES, depth_mm, TARGET_W);
        // No feed of the curves gives the target: then the nearest that they have. 曲线范围内无解
        let wanted = if has(wanted) {{ wanted }} else if power_w > TARGET_W {{ 0.0 }} else {{ 1e6 }};
        pct = clamp(100.0 * wanted / feed_programmed_mm_min, MIN_PCT, MAX_PCT);
    }} else if power_w > TARGET_W {{
        // Above every curve: worn, hard, or deeper than anything tried. 超出曲线上限
        pct = MIN_PCT;
    }}
    request_feed_override(pct, "constant load");
}} else {{
    memory.power_w = ();
    memory.feed = ();
}}
"#
    );
    script("constant_load.rhai", text)
}

/// What was true while the tool was wholly in the work.
#[derive(Debug, Default)]
struct Outcome {
    power_w: Vec<f64>,
    cutting_s: f64,
    program_s: f64,
    reactions_ms: Vec<f64>,
    least_pct: u8,
    greatest_pct: u8,
}

impl Outcome {
    fn mean(&self) -> f64 {
        self.power_w.iter().sum::<f64>() / self.power_w.len() as f64
    }

    fn spread(&self) -> f64 {
        let mean = self.mean();
        (self.power_w.iter().map(|power| (power - mean).powi(2)).sum::<f64>() / self.power_w.len() as f64).sqrt()
    }

    fn greatest(&self) -> f64 {
        self.power_w.iter().copied().fold(0.0, f64::max)
    }

    fn told(&self, name: &str) -> String {
        format!(
            "{name}: program {:.1} s, in the cut {:.1} s; cutting power {:.0} W, standard deviation {:.0} W ({:.1} %), greatest \
             {:.0} W; override {} to {} %",
            self.program_s,
            self.cutting_s,
            self.mean(),
            self.spread(),
            100.0 * self.spread() / self.mean(),
            self.greatest(),
            self.least_pct,
            self.greatest_pct
        )
    }
}

/// Runs the part; armed or not is all the difference.
fn run(settings: SimulatedSettings, steps: &[ExperimentStep], scripts: &[ScriptFile], armed: bool) -> Outcome {
    let mut bench = Bench::new(settings, steps, scripts, &limits(MIN_PCT, MAX_PCT));
    let mut outcome = Outcome { least_pct: 100, greatest_pct: 100, ..Outcome::default() };
    let mut begun = false;
    while !over(&bench) {
        bench.tick();
        if armed && !begun && bench.now_s() > 30.0 {
            bench.arm();
            begun = true;
        }
        for moment in bench.looks() {
            outcome.program_s += f64::from(u8::from(moment.panel.program != 0)) * 0.02;
            if moment.truth.engaged > 0.99 {
                outcome.cutting_s += 0.02;
                outcome.power_w.push(moment.truth.cutting_power_w);
                outcome.least_pct = outcome.least_pct.min(moment.panel.feed_override_pct);
                outcome.greatest_pct = outcome.greatest_pct.max(moment.panel.feed_override_pct);
            }
        }
    }
    assert!(bench.faults.is_empty(), "{:?}", bench.faults);
    outcome.reactions_ms = bench.reactions.iter().map(|it| (it.seen_ns - it.sample_ns) as f64 / 1e6).collect();
    outcome.reactions_ms.sort_by(f64::total_cmp);
    outcome
}

fn percentile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() as f64 * share) as usize).min(sorted.len() - 1)]
}

/// The target: the power of the deepest cut at the programmed feed, which the programmer has allowed; the no-load power of
/// this speed on top, because the curves are those of the whole spindle.
const TARGET_W: f64 = 1720.0;

#[test]
fn a_part_with_varying_depth_takes_an_even_power_and_less_time() {
    let learned = curves();
    let law = [law(&learned, TARGET_W)];
    let plain = run(settings(1), &part(), &law, false);
    let steady = run(settings(1), &part(), &law, true);
    println!("{}\n{}", plain.told("plain feed"), steady.told("constant load"));
    let (p50, p99) = (percentile(&steady.reactions_ms, 0.5), percentile(&steady.reactions_ms, 0.99));
    println!(
        "{} steps of the override; from the sample to the step in force p50 {p50:.0} ms, p99 {p99:.0} ms (machine time, seen at \
         the 100 ms tick)",
        steady.reactions_ms.len()
    );
    assert_eq!(plain.greatest_pct, 100, "not armed: nothing is written");
    assert!(steady.spread() < 0.6 * plain.spread(), "the spread: {} and {}", plain.spread(), steady.spread());
    assert!(steady.program_s < 0.95 * plain.program_s, "the time: {} and {}", plain.program_s, steady.program_s);
    assert!(steady.least_pct >= 50 && steady.greatest_pct <= 150);
}
