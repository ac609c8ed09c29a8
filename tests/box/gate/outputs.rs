//! Whatever a script gives, what reaches the controller is inside the band and moves no faster than the slew limit allows.

use super::cut::{Random, TICK_NS, cases, cutting, limits, set_number, stored};
use adapters::clock::{Clock, ManualClock, SECOND_NS, TimeNs};
use adapters::override_pct::OverridePct;
use adapters::{Actuator, SourceError};
use gateway::config::GateMode;
use gateway::gate::{Gate, GateOutcome, OverrideWriter};
use rules::script::{Host, ScriptFile};

/// Asks for what the channel `temperature_1_c` says: numbers of every kind, and everything that is no number. What can never be a
/// request is refused when it is written down as such, so it stands in variables.
const SCRIPT: &str = r#"
let kind = temperature_1_c ?? 0.0;
let value = temperature_2_c ?? 0.0;
if kind == 0.0 { request_feed_override(value, "a number"); }
if kind == 1.0 { request_feed_override(0.0 / 0.0, "not a number"); }
if kind == 2.0 { request_feed_override(1.0 / 0.0, "infinite"); }
if kind == 3.0 { request_feed_override(-1.0 / 0.0, "infinite the other way"); }
if kind == 4.0 { let pct = -1; request_feed_override(pct, "minus one"); }
if kind == 5.0 { let pct = 300; request_feed_override(pct, "three hundred"); }
if kind == 6.0 { let words = "80"; request_feed_override(words, "a string"); }
if kind == 7.0 { request_feed_override(#{ pct: 80 }, "a map"); }
if kind == 8.0 { request_feed_override([80], "an array"); }
if kind == 9.0 { request_feed_override((), "nothing"); }
if kind == 10.0 { let pct = true; request_feed_override(pct, "a truth"); }
if kind == 11.0 { request_feed_override(value * 1e300 * 1e300, "too large"); }
if kind == 12.0 { throw "gives up"; }
if kind == 13.0 { loop { } }
"#;
/// Kinds that are numbers; the script goes on after them.
const NUMBERS: [u64; 7] = [0, 1, 2, 3, 4, 5, 11];
/// The last kind is slow by design: a loop that is stopped. It comes seldom.
const KINDS: u64 = 13;

/// Mostly numbers; one in forty is of any kind, one in four thousand a loop.
fn kind(random: &mut Random) -> u64 {
    match random.next() % 4000 {
        0 => KINDS,
        1..=100 => random.next() % KINDS,
        _ => NUMBERS[(random.next() % 7) as usize],
    }
}

/// Remembers every write with its time, and has it in force at once.
struct Controller {
    writes: Vec<(TimeNs, u8)>,
}

impl Actuator for Controller {
    fn name(&self) -> &str {
        "controller"
    }

    fn write_feed_override(&mut self, clock: &dyn Clock, wanted: OverridePct) -> Result<(), SourceError> {
        self.writes.push((clock.now_ns(), wanted.percent()));
        Ok(())
    }

    fn read_feed_override(&mut self, _: &dyn Clock) -> Result<OverridePct, SourceError> {
        let last = self.writes.last().map_or(100, |(_, pct)| *pct);
        Ok(OverridePct::new(last).expect("not 255"))
    }
}

fn host() -> Host {
    let mut host = Host::new();
    host.load_scripts(&[ScriptFile { name: "mad.rhai".to_owned(), text: SCRIPT.to_owned() }]).expect("it compiles");
    host
}

/// A host that has given up on the script is begun anew, so that every kind goes on being tried.
fn renewed(host: Host) -> Host {
    let gave_up = host.status().scripts.iter().any(|script| script.condition.as_word() != "running");
    if gave_up { self::host() } else { host }
}

fn run(count: u64) -> (Vec<(TimeNs, u8)>, [u64; 3]) {
    let mut random = Random(20_261_122);
    let mut gate = Gate::new(gateway::config::GateConfig {
        above_dial: true,
        armed_for: std::time::Duration::MAX,
        ..limits(GateMode::Armed)
    });
    gate.arm("fitter", Some(std::time::Duration::from_secs(86_400 * 300)), 0).expect("allowed");
    let mut writer = OverrideWriter::new(Controller { writes: Vec::new() }, stored(), gate.limits());
    let (mut host, clock, cases) = (host(), ManualClock::with_time(0), cases());
    let (mut at_ns, mut told) = (0, [0_u64; 3]);
    for _ in 0..count {
        at_ns += TICK_NS / 2 + (random.next() % 100_000_000) as i64;
        clock.set_time(at_ns);
        let (mut sample, mut estimates) = cutting(at_ns);
        let kind = if random.next().is_multiple_of(2) { 0 } else { kind(&mut random) };
        set_number(&mut sample, "temperature_1_c", kind as f64);
        set_number(&mut sample, "temperature_2_c", (random.next() % 3600) as f64 / 10.0 - 60.0);
        if random.next().is_multiple_of(100) {
            cases[(random.next() % cases.len() as u64) as usize].1(&mut sample, &mut estimates);
        }
        let verdict =
            gate.decide_override(host.run_due_scripts(&sample, &estimates).request.as_ref(), &sample, estimates.state);
        match verdict.outcome {
            GateOutcome::Held(_) => told[0] += 1,
            GateOutcome::Refused => told[1] += 1,
            _ => told[2] += 1,
        }
        writer.write_verdict(&verdict, &clock);
        host = renewed(host);
    }
    (std::mem::take(&mut writer_actuator(writer).writes), told)
}

fn writer_actuator(writer: OverrideWriter<Controller>) -> Controller {
    Controller { writes: writer.actuator().writes.clone() }
}

fn check(count: u64) {
    let (writes, [held, refused, others]) = run(count);
    let limits = limits(GateMode::Armed);
    let (mut least, mut greatest) = (100_u8, 100_u8);
    for pair in writes.windows(2) {
        let ((from_ns, from), (to_ns, to)) = (pair[0], pair[1]);
        (least, greatest) = (least.min(to), greatest.max(to));
        assert!(f64::from(to) >= limits.min_pct && f64::from(to) <= limits.max_pct, "{pair:?}");
        let seconds = (to_ns - from_ns) as f64 / SECOND_NS as f64;
        let (up, down) = (limits.slew_up_pct_per_s * seconds + 1.0, limits.slew_down_pct_per_s * seconds + 1.0);
        let change = f64::from(to) - f64::from(from);
        // A hold gives the programmed feed at once; everything else moves at its pace.
        assert!(to == 100 || (change <= up && -change <= down), "{pair:?}");
    }
    assert!(least < 60 && greatest > 101 && held > 0 && refused > 0, "{least} {greatest} {held} {refused}");
    println!(
        "{count} outputs of a script (numbers, NaN, infinities, -1, 300, strings, maps, arrays, errors, loops): {} writes \
         reached the controller, all from {least} to {greatest} % and within the slew limits; {held} ticks held, {refused} \
         requests refused, {others} others",
        writes.len()
    );
}

#[test]
fn whatever_a_script_gives_the_controller_gets_what_the_band_and_the_pace_allow() {
    check(20_000);
}

/// `cargo test --release --test box a_million_outputs -- --ignored --nocapture`
#[test]
#[ignore = "1 minute: a million random script outputs stay within band and slew"]
fn a_million_outputs() {
    check(1_000_000);
}
