//! The thermal error over a day of the simulated machine, before and after compensation, through an external offset of whole
//! micrometres and through the model of a pulse inserter between encoder and controller.
//!
//! The law is identified from another day (another seed) with a gauge that is noisy; the machine's true error (bearing,
//! housing and air, three time constants) is no function of the three temperatures that are measured.

use super::bench::{Bench, limits, script};
use adapters::recording::{Cells, Numbers};
use adapters::simulated::{Simulated, SimulatedSettings};
use adapters::words::execution;
use adapters::{Absence, Axis as MachineAxis, Recording};
use gateway::config::{self, GateMode};
use gateway::run::thermal::outside::OutsideWatch;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use rules::estimators::thermal::{
    AxisSituation, CompensationSettings, Compensator, Decoder, EDGES_PER_PULSE, Lines, Path, Predictor, PulseInserter,
    SelectionSettings, ThermalLaw, collect_rows, learn_law,
};
use rules::script::ScriptFile;
use std::time::Duration;

const SECOND_NS: i64 = 1_000_000_000;
const STEP_S: i64 = 5;
pub(super) const SENSORS: [&str; 3] = ["bearing_temperature_c", "motor_temperature_c", "ambient_temperature_c"];
/// The inserter lets edges leave at least so far apart.
const SPACING_NS: u64 = 1_000;

pub(super) fn machine(seed: u64) -> Simulated {
    Simulated::new("simulated://lathe", SimulatedSettings { seed, ..SimulatedSettings::default() }, 0)
}

/// Sensors with a tenth of a kelvin of noise, and the true error.
pub(super) fn look(machine: &Simulated, at_s: i64, dice: &mut Pcg64Mcg) -> ([f64; 3], f64) {
    let moment = machine.moment(at_s * SECOND_NS);
    let mut noisy = |true_c: f64| true_c + 0.1 * dice.sample::<f64, _>(StandardNormal);
    let electric = moment.electric;
    let sensors = [electric.bearing_temperature_c, electric.motor_temperature_c, electric.ambient_temperature_c];
    (sensors.map(&mut noisy), moment.truth.thermal_error_um)
}

/// The temperatures and the true error of a machine at a time, s.
pub(super) type Look<'a> = dyn FnMut(i64, &mut Pcg64Mcg) -> ([f64; 3], f64) + 'a;

/// A row per minute of this many hours, with a gauge that is wrong by half a micrometre.
fn recorded(look: &mut Look<'_>, seed: u64, hours: i64) -> Recording {
    let mut dice = Pcg64Mcg::seed_from_u64(seed);
    let rows: Vec<([f64; 3], f64)> = (0..hours * 60).map(|minute| look(minute * 60, &mut dice)).collect();
    let mut recording = Recording::new("a day", (0..rows.len()).map(|row| row as f64 * 60.0).collect(), None);
    for (at, name) in SENSORS.into_iter().enumerate() {
        recording.set_column(name, Cells::Numbers(Numbers::from_values(rows.iter().map(|row| row.0[at]).collect())));
    }
    let gauge = rows.iter().map(|row| row.1 + 0.5 * dice.sample::<f64, _>(StandardNormal)).collect();
    recording.set_column("thermal_error_um", Cells::Numbers(Numbers::from_values(gauge)));
    recording
}

/// The law that such a day of any machine gives.
pub(super) fn identify_law_of(look: &mut Look<'_>, seed: u64, hours: i64) -> ThermalLaw {
    let collected = collect_rows(&recorded(look, seed, hours)).expect("usable");
    let learned = learn_law(&collected.course, SelectionSettings::default(), None).expect("a law");
    learned.best_candidate().fit.law.clone()
}

/// The law of a day of the simulated machine.
fn identify_law(seed: u64, hours: i64) -> ThermalLaw {
    let machine = machine(seed);
    identify_law_of(&mut |at_s, dice| look(&machine, at_s, dice), seed, hours)
}

/// Root of the mean square and greatest magnitude.
fn size(errors: &[f64]) -> (f64, f64) {
    let squares: f64 = errors.iter().map(|it| it * it).sum();
    ((squares / errors.len() as f64).sqrt(), errors.iter().fold(0.0, |worst, it| worst.max(it.abs())))
}

/// An axis that goes to and fro under the inserter; what its controller counts besides is the offset.
struct Axis {
    inserter: PulseInserter,
    controller: Decoder,
    encoder_edges: i64,
    at_ns: u64,
}

impl Axis {
    fn new() -> Self {
        let lines = Lines::from_position(0);
        Self {
            inserter: PulseInserter::new(lines, 0, SPACING_NS),
            controller: Decoder::new(lines, 0),
            encoder_edges: 0,
            at_ns: 0,
        }
    }

    /// Forty edges one way, forty back, with time for the pulses in between; then the offset, in pulses.
    fn traverse(&mut self, pulses: i64) -> i64 {
        self.inserter.request_pulses(pulses);
        for step in 0..80 {
            self.encoder_edges += if step < 40 { 1 } else { -1 };
            self.at_ns += 100_000;
            let mut left = Vec::new();
            let lines = Lines::from_position(self.encoder_edges);
            self.inserter.advance_to(self.at_ns, lines, |edge| left.push(edge)).expect("slow enough");
            for edge in left {
                self.controller.decode_lines(edge.lines, edge.at_ns).expect("no edge is lost");
            }
        }
        (self.controller.position_edges() - self.encoder_edges) / EDGES_PER_PULSE
    }
}

/// The shipped script with this law, as an integrator would write it from what `identify thermal` prints.
fn shipped(law: &ThermalLaw) -> ScriptFile {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/rules/scripts/thermal.rhai");
    let mut text = std::fs::read_to_string(path).expect("the shipped script");
    let sensors = ["motor_temperature_c", "bearing_temperature_c", "ambient_temperature_c"];
    let per_k = |path: Path| {
        let sums = sensors.map(|sensor| {
            let terms = law.terms.iter().filter(|term| term.sensor == sensor && term.path == path);
            terms.map(|term| term.um_per_k).sum::<f64>()
        });
        format!("{sums:?}")
    };
    let constants = [
        ("INTERCEPT_UM", format!("{:?}", law.intercept_um)),
        ("UM_PER_K", per_k(Path::Direct)),
        ("LATE_UM_PER_K", per_k(Path::Lagged)),
        ("TAU_S", format!("{:?}", law.tau_s.unwrap_or(0.0))),
        ("LIMIT_UM", "150.0".to_owned()),
    ];
    for (constant, value) in constants {
        let begin = text.find(&format!("const {constant} = ")).expect("a constant of the script");
        let end = begin + text[begin..].find(';').expect("it ends");
        text.replace_range(begin..end, &format!("const {constant} = {value}"));
    }
    script("thermal.rhai", text)
}

/// Offsets alone: ten micrometres at a time, once a minute.
fn offset_limits() -> config::GateConfig {
    let before = limits(50.0, 120.0);
    let offset = config::OffsetConfig {
        mode: GateMode::Armed,
        axes: vec![MachineAxis::Z],
        step_um: 10.0,
        total_um: 150.0,
        min_interval: Duration::from_secs(60),
        ..before.offset.clone()
    };
    config::GateConfig { mode: GateMode::Shadow, armed_for: Duration::from_secs(86_400), offset, ..before }
}

/// The whole loop: sensors, merge, shipped script, gate, control. What is true is asked of the machine while it cuts.
fn through_the_gate(law: &ThermalLaw, hours: i64) {
    let settings = SimulatedSettings { seed: 12, ..SimulatedSettings::default() };
    let mut bench = Bench::at_work(settings, &[shipped(law)], &offset_limits());
    bench.period_ns = SECOND_NS;
    let (mut before, mut after, mut changes_in_programs, mut in_force) = (Vec::new(), Vec::new(), 0, 0.0);
    for at_s in 1..=hours * 3600 {
        bench.tick();
        let moment = bench.machine.moment(at_s * SECOND_NS);
        if moment.panel.booted && bench.pipeline.gate().current_arming().is_err() {
            bench.arm();
        }
        let offset_um = bench.machine.offset_um(MachineAxis::Z);
        let runs = moment.panel.execution == execution::ACTIVE;
        let changed = std::mem::replace(&mut in_force, offset_um) != offset_um;
        changes_in_programs += usize::from(runs && changed);
        if moment.truth.engaged > 0.99 {
            before.push(moment.truth.thermal_error_um);
            after.push(moment.truth.thermal_error_um + offset_um);
        }
    }
    let ((b, b_max), (a, a_max)) = (size(&before), size(&after));
    let counts = bench.machine.written();
    println!(
        "through the gate over {hours} h, while cutting: before RMS {b:.1} um, greatest {b_max:.1} um; after RMS {a:.2} um, greatest \
         {a_max:.1} um; {} writes of the offset counted by the machine, {} in a program",
        counts.offsets, changes_in_programs
    );
    assert!(bench.faults.is_empty(), "{:?}", bench.faults);
    assert_eq!(counts.count_writes(), counts.offsets, "nothing else is written");
    assert_eq!(changes_in_programs, 0, "between programs only");
    assert!(counts.offsets > 3 && a < 0.3 * b && a_max < b_max, "{b} {a}");
}

fn day(hours: i64) {
    let law = identify_law(11, hours);
    through_the_gate(&law, hours);
    println!("law: {} terms, late {:?} s, residual {:.2} um", law.terms.len(), law.tau_s, law.residual_sd_um);
    let settings = CompensationSettings { pulse_um: 1.0, limit_um: 150.0, ..CompensationSettings::default() };
    let (mut offset, mut inserted) =
        (Compensator::new(settings).expect("usable"), Compensator::new(settings).expect("usable"));
    let mut predictor = Predictor::new(law, &SENSORS).expect("usable");
    let (machine, mut dice, mut axis) = (machine(12), Pcg64Mcg::seed_from_u64(12), Axis::new());
    let (mut before, mut after, mut through) = (Vec::new(), Vec::new(), Vec::new());
    for step in 0..hours * 3600 / STEP_S {
        let at_s = step * STEP_S;
        let (temperatures, error_um) = look(&machine, at_s, &mut dice);
        let off = !machine.moment(at_s * SECOND_NS).panel.booted;
        let read = temperatures.map(|value| if off { Err(Absence::MachineOff) } else { Ok(value) });
        let prediction = predictor.predict_error(at_s * SECOND_NS, &read).ok();
        let situation = AxisSituation::default();
        let sink = offset.advance_compensation(STEP_S as f64, prediction.as_ref(), situation);
        let pulses = inserted.advance_compensation(STEP_S as f64, prediction.as_ref(), situation).increment_pulses;
        let counted = axis.traverse(pulses);
        if !off {
            before.push(error_um);
            after.push(error_um + sink.sent_um);
            through.push(error_um + counted as f64 * settings.pulse_um);
        }
    }
    let ((b, b_max), (a, a_max), (p, p_max)) = (size(&before), size(&after), size(&through));
    println!(
        "thermal error over {hours} h, machine on: before RMS {b:.1} um, greatest {b_max:.1} um; external offset RMS {a:.2} um, \
         greatest {a_max:.1} um; pulse inserter RMS {p:.2} um, greatest {p_max:.1} um"
    );
    assert!(a < 0.35 * b && p < 0.35 * b, "{b} {a} {p}");
    assert!((a - p).abs() < 0.2, "both ways carry the same increments: {a} {p}");
}

/// What a kelvin of the whole machine is worth: bearing, housing and air against the error, as the simulated machine has them.
const UM_PER_K: f64 = 0.85 + 1.9 - 0.6;

/// A day whose temperatures begin so many kelvins below the least that the identification saw; which of them is a body of the machine
/// (the whole hall is colder, and the error with it) or one sensor that sits at another place.
struct ColdDay {
    outside_k: f64,
    hours: i64,
    whole_hall: bool,
}

impl ColdDay {
    /// The compensation over the day: RMS and greatest error without and with it, and what is told.
    fn run(&self, law: &ThermalLaw) -> ([f64; 4], Vec<String>) {
        let (machine, mut dice) = (machine(12), Pcg64Mcg::seed_from_u64(12));
        let least = |sensor: &str| {
            let ranges = law.terms.iter().filter(|term| term.sensor == sensor).map(|term| term.range_c.0);
            ranges.fold(f64::NAN, f64::max)
        };
        let (first, _) = look(&machine, 0, &mut dice);
        let below: Vec<f64> =
            SENSORS.iter().zip(first).map(|(sensor, at_c)| at_c - least(sensor) + self.outside_k).collect();
        // All bodies shift by what brings the first of them so far outside.
        let by_k = below.iter().copied().filter(|it| it.is_finite()).fold(f64::INFINITY, f64::min);
        let mut predictor = Predictor::new(law.clone(), &SENSORS).expect("usable");
        let settings = CompensationSettings { limit_um: 150.0, ..CompensationSettings::default() };
        let mut compensator = Compensator::new(settings).expect("usable");
        let (mut watch, mut told) = (OutsideWatch::default(), Vec::new());
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for at_s in (0..self.hours * 3600).step_by(usize::try_from(STEP_S).expect("small")) {
            let (mut temperatures, mut error_um) = look(&machine, at_s, &mut dice);
            if self.whole_hall {
                temperatures = temperatures.map(|at_c| at_c - by_k);
                error_um -= UM_PER_K * by_k;
            } else {
                temperatures[0] -= below[0];
            }
            if !machine.moment(at_s * SECOND_NS).panel.booted {
                continue;
            }
            let read = temperatures.map(Ok);
            let prediction = predictor.predict_error(at_s * SECOND_NS, &read).ok();
            let step = compensator.advance_compensation(STEP_S as f64, prediction.as_ref(), AxisSituation::default());
            let notice = watch.watch_step(at_s * SECOND_NS, prediction.as_ref(), &step, &SENSORS);
            told.extend(notice.map(|notice| format!("{:.2} h: {}", at_s as f64 / 3600.0, notice.operator)));
            before.push(error_um);
            after.push(error_um + step.sent_um);
        }
        let ((b, b_max), (a, a_max)) = (size(&before), size(&after));
        ([b, b_max, a, a_max], told)
    }
}

/// `cargo test --test box days_that_begin -- --nocapture`
#[test]
fn days_that_begin_outside_the_range_are_compensated_and_told() {
    let law = identify_law(11, 8);
    for whole_hall in [true, false] {
        for outside_k in [1.0, 3.0, 8.0] {
            let day = ColdDay { outside_k, hours: 8, whole_hall };
            let ([b, b_max, a, a_max], told) = day.run(&law);
            println!(
                "{outside_k} K below, {}: before RMS {b:.1} um, greatest {b_max:.1} um; after RMS {a:.1} um, greatest {a_max:.1} um",
                if whole_hall { "the whole hall" } else { "the bearing sensor alone" }
            );
            told.iter().for_each(|line| println!("  {line}"));
            // One kelvin of a sensor that ranged over twenty lies within the margin of its range: there the law holds as it is.
            assert!(outside_k < 2.0 || told.iter().any(|line| line.contains("outside")), "{told:?}");
            assert!(a < b, "compensated, not withheld: {a} {b}");
        }
    }
}

#[test]
fn the_thermal_error_is_compensated_through_both_sinks() {
    day(5);
}

/// `cargo test --release --test box a_day_of -- --ignored --nocapture`
#[test]
#[ignore = "30 seconds: thermal offsets over two simulated days, through the gate"]
fn a_day_of_thermal_error() {
    day(24);
}
