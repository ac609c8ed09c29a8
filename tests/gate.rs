//! The gate: nothing is written that should not be, whatever a script asks for.

use adapters::clock::{Clock, ManualClock, SECOND_NS};
use adapters::simulated::{Simulated, SimulatedSettings};
use adapters::units::OverridePct;
use adapters::words::{execution, mode, operation};
use adapters::{Absence, Actuator, ChannelId, Sample, Slot, SourceError, Value};
use gateway::config::{self, BUILT_IN_TEXT, GateMode};
use gateway::gate::{ArmError, Bound, Disarmed, Fault, Gate, Hold, Outcome, Verdict, Writer};
use rules::estimators::{Estimates, State};
use rules::script::{Host, OverrideRequest, ScriptFile, shipped};
use std::path::Path;
use std::time::Duration;

const TICK_NS: i64 = SECOND_NS / 10;

fn id(name: &str) -> ChannelId {
    ChannelId::of(name).expect("a channel")
}

fn set_number(sample: &mut Sample, name: &str, number: f64) {
    sample.set(id(name), Slot { value: Value::number(number), age_ns: 0 });
}

fn set_text(sample: &mut Sample, name: &str, text: &str) {
    sample.set(id(name), Slot { value: Ok(Value::Text(text.into())), age_ns: 0 });
}

/// A machine in the middle of an ordinary cut.
fn cutting(at_ns: i64) -> (Sample, Estimates) {
    let mut sample = Sample::empty(at_ns);
    for (name, number) in [("feed_mm_min", 200.0), ("spindle_speed_rpm", 1000.0), ("spindle_power_w", 2000.0)] {
        set_number(&mut sample, name, number);
    }
    set_text(&mut sample, "mode", mode::AUTOMATIC);
    set_text(&mut sample, "execution", execution::ACTIVE);
    set_text(&mut sample, "alarm", "");
    let mut estimates = Estimates::none(at_ns);
    estimates.state = State::Cutting;
    (sample, estimates)
}

fn limits(mode: GateMode) -> config::Gate {
    let config = config::parse("test", BUILT_IN_TEXT, Path::new(""), []).expect("it is accepted");
    config::Gate { mode, source: Some("test".to_owned()), ..config.gate }
}

fn asking(pct: f64) -> OverrideRequest {
    OverrideRequest { pct, reason: "test".into(), script: "test.rhai".into(), version: 1 }
}

fn armed_gate() -> Gate {
    let mut gate = Gate::new(limits(GateMode::Armed));
    gate.arm("fitter", 0).expect("the configuration allows it");
    gate
}

/// Counts what it is told and shows what the test wants.
struct Machine {
    writes: Vec<u8>,
    /// From so many writes on, this is shown whatever is written.
    shown: Option<(usize, u8)>,
    refuses: bool,
}

impl Machine {
    fn new() -> Self {
        Self { writes: Vec::new(), shown: None, refuses: false }
    }
}

impl Actuator for Machine {
    fn name(&self) -> &str {
        "test"
    }

    fn write_feed_override(&mut self, _: &dyn Clock, wanted: OverridePct) -> Result<(), SourceError> {
        self.writes.push(wanted.percent());
        if self.refuses { Err(SourceError::Off { source_name: "test".to_owned() }) } else { Ok(()) }
    }

    fn read_feed_override(&mut self, _: &dyn Clock) -> Result<OverridePct, SourceError> {
        let last = self.writes.last().copied().unwrap_or(100);
        let shown = self.shown.filter(|(from, _)| self.writes.len() >= *from).map_or(last, |(_, shown)| shown);
        Ok(OverridePct::new(shown).expect("not 255"))
    }
}

#[test]
fn by_default_nothing_is_written_in_an_hour() {
    let config = config::parse("test", BUILT_IN_TEXT, Path::new(""), []).expect("it is accepted");
    let mut gate = Gate::new(config.gate);
    let mut writer = Writer::new(Machine::new());
    let mut host = Host::new();
    let greedy =
        ScriptFile { name: "greedy.rhai".to_owned(), text: "request_feed_override(60, \"greed\");".to_owned() };
    let mut files = shipped();
    files.push(greedy);
    host.load(&files).expect("they compile");
    let clock = ManualClock::at(0);
    let mut permitted = Vec::new();
    for tick in 0..36_000 {
        clock.set(tick * TICK_NS);
        let (sample, estimates) = cutting(tick * TICK_NS);
        let decision = host.tick(&sample, &estimates);
        let verdict = gate.decide(decision.request.as_ref(), &sample, &estimates);
        assert_eq!(writer.step(&verdict, &clock), None);
        permitted.push(verdict.permitted.percent());
    }
    assert_eq!(writer.actuator().writes, [0_u8; 0], "the default configuration wrote to the machine");
    assert_eq!(permitted.last(), Some(&60), "in shadow it is decided all the same");
}

#[test]
fn arming_needs_the_configuration_a_person_and_ends_by_itself() {
    for mode in [GateMode::Off, GateMode::Shadow] {
        assert_eq!(Gate::new(limits(mode)).arm("fitter", 0).err(), Some(ArmError::Mode(mode.word())));
    }
    let mut gate = Gate::new(limits(GateMode::Armed));
    assert_eq!(gate.armed().err(), Some(Disarmed::Start), "disarmed after each start");
    assert_eq!(gate.arm("  ", 0).err(), Some(ArmError::Nobody));
    gate.arm("fitter", 0).expect("allowed");
    let lasts_ns = i64::try_from(limits(GateMode::Armed).armed_for.as_nanos()).expect("hours");
    let (sample, estimates) = cutting(lasts_ns - 1);
    assert!(gate.decide(None, &sample, &estimates).armed);
    let (sample, estimates) = cutting(lasts_ns);
    assert!(!gate.decide(None, &sample, &estimates).armed);
    assert_eq!(gate.armed().err(), Some(Disarmed::Expired));
    gate.arm("fitter", lasts_ns).expect("again");
    let (sample, estimates) = cutting(5);
    assert!(!gate.decide(None, &sample, &estimates).armed, "a clock that jumps back disarms");
}

/// One thing that is wrong in an otherwise ordinary cut, and why 100 % is held then.
type Case = (&'static str, fn(&mut Sample, &mut Estimates), Hold);

fn cases() -> Vec<Case> {
    let missing = |name: &str, why| Hold::Missing(id(name), why);
    vec![
        ("rapid flag", |it, _| set_number(it, "rapid", 1.0), Hold::Rapid),
        ("rapid state", |_, estimates| estimates.state = State::Rapid, Hold::Rapid),
        ("unknown state", |_, estimates| estimates.state = State::Unknown, Hold::StateUnknown),
        ("threading", |it, _| set_text(it, "operation", operation::THREADING), Hold::Threading),
        ("tapping", |it, _| set_text(it, "operation", operation::TAPPING), Hold::Tapping),
        ("alarm", |it, _| set_text(it, "alarm", "PS0010"), Hold::Alarm),
        ("manual", |it, _| set_text(it, "mode", mode::MANUAL), Hold::Manual),
        ("MDI", |it, _| set_text(it, "mode", mode::MANUAL_DATA_INPUT), Hold::Mdi),
        ("single block", |it, _| set_text(it, "mode", mode::SEMI_AUTOMATIC), Hold::SingleBlock),
        ("edit", |it, _| set_text(it, "mode", mode::EDIT), Hold::NotAutomatic),
        ("a word nobody knows", |it, _| set_text(it, "mode", "AUTO?"), Hold::NotAutomatic),
        ("feed hold", |it, _| set_text(it, "execution", execution::FEED_HOLD), Hold::FeedHold),
        ("stopped", |it, _| set_text(it, "execution", execution::STOPPED), Hold::NotRunning),
        ("interrupted", |it, _| set_text(it, "execution", execution::INTERRUPTED), Hold::NotRunning),
        ("ready", |it, _| set_text(it, "execution", execution::READY), Hold::NotRunning),
        ("no mode", |it, _| it.set(id("mode"), Slot::absent(Absence::Timeout)), missing("mode", Absence::Timeout)),
        (
            "no feed",
            |it, _| it.set(id("feed_mm_min"), Slot::absent(Absence::Disconnected)),
            missing("feed_mm_min", Absence::Disconnected),
        ),
        (
            "old speed",
            |it, _| it.set(id("spindle_speed_rpm"), Slot { value: Value::number(1000.0), age_ns: SECOND_NS }),
            missing("spindle_speed_rpm", Absence::Stale),
        ),
        ("a silent alarm", |it, _| it.set(id("alarm"), Slot::absent(Absence::Stale)), missing("alarm", Absence::Stale)),
        ("no load", |it, _| it.set(id("spindle_power_w"), Slot::absent(Absence::Stale)), Hold::OnlyEstimated),
    ]
}

#[test]
fn every_hold_gives_the_programmed_feed_at_once_and_says_why() {
    for (what, change, hold) in cases() {
        let mut gate = armed_gate();
        for tick in 0..100 {
            let (sample, estimates) = cutting(tick * TICK_NS);
            gate.decide(Some(&asking(60.0)), &sample, &estimates);
        }
        let (mut sample, mut estimates) = cutting(100 * TICK_NS);
        let before = gate.decide(Some(&asking(60.0)), &sample, &estimates);
        assert_eq!((before.permitted.percent(), before.outcome), (60, Outcome::Permitted), "{what}");
        sample.at_ns += TICK_NS;
        change(&mut sample, &mut estimates);
        let verdict = gate.decide(Some(&asking(60.0)), &sample, &estimates);
        assert_eq!((verdict.permitted.percent(), verdict.outcome), (100, Outcome::Held(hold)), "{what}");
        assert!(verdict.reason().starts_with("100 % is held: ") && !hold.zh().is_empty());
        assert_eq!(verdict.word(), "held");
    }
}

#[test]
fn threads_in_nc_blocks_hold_until_another_motion() {
    for (block, held) in [
        ("G33 Z-20 F1.5", true),
        ("G32 Z-20 F1.5", true),
        ("G76 X20 Z-30", true),
        ("G92 X19.2 Z-20 F1.5", true),
        ("G84 Z-10 F1.25", true),
        ("G84.2 Z-10 F1.25", true),
        ("G74 Z-10 F1.25", true),
        ("G63", true),
        ("N10 M29 S500 G98 G84 X0 Z-10", true),
        ("G1 X10 F200", false),
        ("G83 Z-30 Q5 (no G84 here)", false),
        ("G96 S180", false),
    ] {
        let mut gate = armed_gate();
        let (mut sample, estimates) = cutting(0);
        set_text(&mut sample, "block", block);
        let mut decide = |sample: &Sample| matches!(gate.decide(None, sample, &estimates).outcome, Outcome::Held(_));
        assert_eq!(decide(&sample), held, "{block}");
        set_text(&mut sample, "block", "X5");
        assert_eq!(decide(&sample), held, "{block}, next line");
        set_text(&mut sample, "block", "G80");
        assert!(!decide(&sample), "{block}, G80");
    }
}

#[test]
fn off_is_off() {
    let mut gate = Gate::new(limits(GateMode::Off));
    let (sample, estimates) = cutting(0);
    assert_eq!(gate.decide(Some(&asking(80.0)), &sample, &estimates).outcome, Outcome::Held(Hold::Off));
}

#[test]
fn silence_of_the_machine_disarms_after_ten_seconds() {
    let mut gate = armed_gate();
    for tick in 0..=100 {
        let (mut sample, estimates) = cutting(tick * TICK_NS);
        sample.set(id("mode"), Slot::absent(Absence::Disconnected));
        assert_eq!(gate.decide(None, &sample, &estimates).armed, tick < 100, "tick {tick}");
    }
    assert_eq!(gate.armed().err(), Some(Disarmed::Silent));
}

/// A generator of numbers for the random test: cheap, seeded, of no quality that matters here.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    fn request(&mut self) -> Option<OverrideRequest> {
        let special = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 300.0, 255.0, 254.0, 0.0, -0.0, 1e300, 49.999];
        match self.next() % 4 {
            0 => None,
            1 => Some(asking(special[(self.next() % special.len() as u64) as usize])),
            2 => Some(asking(f64::from_bits(self.next() << 33 | self.next()))),
            _ => Some(asking((self.next() % 2_000) as f64 / 10.0)),
        }
    }
}

/// `GATE_CASES` sets the number of ticks; 100,000 otherwise.
#[test]
fn whatever_is_asked_for_the_override_stays_in_the_band_and_moves_slowly() {
    let count: i64 = std::env::var("GATE_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(100_000);
    let mut random = Random(20_261_121);
    let mut gate = armed_gate();
    let limits = gate.limits().clone();
    let cases = cases();
    let (mut at_ns, mut before, mut held) = (0_i64, 100.0_f64, 0_u64);
    let mut at_least = 100.0_f64;
    for _ in 0..count {
        let step_ns = TICK_NS / 2 + (random.next() % 100_000_000) as i64;
        at_ns += step_ns;
        let (mut sample, mut estimates) = cutting(at_ns);
        if random.next().is_multiple_of(50) {
            cases[(random.next() % cases.len() as u64) as usize].1(&mut sample, &mut estimates);
        }
        let verdict = gate.decide(random.request().as_ref(), &sample, &estimates);
        let now = f64::from(verdict.permitted.percent());
        assert!(now >= limits.min_pct && now <= limits.max_pct, "{verdict:?}");
        let step_s = step_ns as f64 / SECOND_NS as f64;
        if matches!(verdict.outcome, Outcome::Held(_)) {
            held += 1;
            assert_eq!(now, 100.0, "{verdict:?}");
        } else {
            // Whole percent: a step may be one more than the exact change.
            assert!(now - before <= limits.slew_up_pct_per_s * step_s + 1.0, "{before} -> {verdict:?}");
            assert!(before - now <= limits.slew_down_pct_per_s * step_s + 1.0, "{before} -> {verdict:?}");
        }
        if matches!(verdict.outcome, Outcome::Refused) {
            assert!((now - 100.0).abs() <= (before - 100.0).abs(), "a mistake never moves it away from 100 %");
        }
        before = now;
        at_least = at_least.min(now);
    }
    assert!(held > 0 && at_least < 80.0, "the test has reached both: {held} held, least {at_least} %");
    println!("{count} random requests: in the band, within the slew limit; {held} held at 100 %, least {at_least} %");
}

#[test]
fn the_pace_and_the_band_are_told() {
    let mut gate = armed_gate();
    let mut outcome_at = |tick: i64, pct: f64| {
        let (sample, estimates) = cutting(tick * TICK_NS);
        gate.decide(Some(&asking(pct)), &sample, &estimates)
    };
    let first = outcome_at(0, 55.0);
    assert_eq!((first.outcome, first.permitted.percent()), (Outcome::Limited(Bound::Slew), 100));
    assert_eq!(outcome_at(1, 55.0).permitted.percent(), 95);
    assert_eq!(outcome_at(2, 10.0).outcome, Outcome::Limited(Bound::Least));
    assert_eq!(outcome_at(3, 200.0).outcome, Outcome::Limited(Bound::Greatest));
    assert_eq!(outcome_at(4, 300.0).outcome, Outcome::Refused);
}

fn run(gate: &mut Gate, writer: &mut Writer<Machine>, ticks: std::ops::Range<i64>, pct: f64) -> Vec<Option<Fault>> {
    let clock = ManualClock::at(0);
    let mut faults = Vec::new();
    for tick in ticks {
        clock.set(tick * TICK_NS);
        let (sample, estimates) = cutting(tick * TICK_NS);
        let verdict = gate.decide(Some(&asking(pct)), &sample, &estimates);
        if let Some(written) = writer.step(&verdict, &clock) {
            if let Some(fault) = &written.fault {
                gate.disarm(fault.disarmed());
            }
            faults.push(written.fault);
        }
    }
    faults
}

#[test]
fn an_armed_gate_writes_reads_back_and_gives_the_machine_back() {
    let mut gate = armed_gate();
    let mut writer = Writer::new(Machine::new());
    let faults = run(&mut gate, &mut writer, 0..30, 80.0);
    assert!(faults.iter().all(Option::is_none), "{faults:?}");
    let writes = writer.actuator().writes.clone();
    assert_eq!(writes[..5], [100, 95, 90, 85, 80], "{writes:?}");
    assert!(writes.len() < 12, "unchanged, it is written only as a sign of life: {writes:?}");
    gate.disarm(Disarmed::Person);
    run(&mut gate, &mut writer, 30..40, 80.0);
    assert_eq!(writer.actuator().writes.len(), writes.len() + 1, "given back once");
    assert_eq!(writer.actuator().writes.last(), Some(&100));
}

#[test]
fn a_machine_that_does_not_take_the_override_disarms_the_gate_once() {
    let mut gate = armed_gate();
    let mut dial = Writer::new(Machine { shown: Some((8, 37)), ..Machine::new() });
    let told: Vec<_> = run(&mut gate, &mut dial, 0..60, 80.0).into_iter().flatten().collect();
    let mismatch = |asked| Fault::ReadBack {
        asked: OverridePct::new(asked).expect("not 255"),
        found: OverridePct::new(37).expect("not 255"),
    };
    assert_eq!(told, [mismatch(80), mismatch(100)], "once while holding, once when giving the machine back");
    assert_eq!(gate.armed().err(), Some(Disarmed::ReadBack));

    let mut gate = armed_gate();
    let mut lagging = Writer::new(Machine { shown: Some((0, 100)), ..Machine::new() });
    let faults = run(&mut gate, &mut lagging, 0..60, 80.0);
    let mismatches: Vec<_> = faults.into_iter().flatten().collect();
    assert_eq!(mismatches, [Fault::ReadBack { asked: OverridePct::new(80).expect("80"), found: OverridePct::FULL }]);
    assert_eq!(gate.armed().err(), Some(Disarmed::ReadBack));
    assert_eq!(lagging.actuator().writes.last(), Some(&100), "the machine is given back");
    assert!(mismatches[0].to_string().contains("80 % was written and 100 % is in force"));
}

#[test]
fn a_broken_line_disarms_the_gate() {
    let mut gate = armed_gate();
    let mut writer = Writer::new(Machine { refuses: true, ..Machine::new() });
    let faults = run(&mut gate, &mut writer, 0..20, 80.0);
    assert!(matches!(faults[0], Some(Fault::Line(_))));
    assert_eq!(gate.armed().err(), Some(Disarmed::Line));
    assert_eq!(writer.actuator().writes.len(), 2, "one attempt, and one to give the machine back");
}

#[test]
fn the_simulated_machine_follows_an_armed_gate_and_returns_to_its_panel() {
    let machine = Simulated::new("simulated://lathe", SimulatedSettings::default(), 0);
    let clock = ManualClock::at(0);
    let cut_ns = (0..8 * 3600)
        .map(|second| second * SECOND_NS)
        .find(|at_ns| machine.truth(*at_ns).state == adapters::simulated::TrueState::Cutting)
        .expect("it cuts within a day");
    clock.set(cut_ns);
    let mut gate = Gate::new(limits(GateMode::Armed));
    gate.arm("fitter", cut_ns).expect("allowed");
    let mut writer = Writer::new(machine.feed_override());
    let mut last = None;
    for tick in 0..20 {
        clock.set(cut_ns + tick * TICK_NS);
        let (sample, estimates) = cutting(cut_ns + tick * TICK_NS);
        let verdict: Verdict = gate.decide(Some(&asking(80.0)), &sample, &estimates);
        last = writer.step(&verdict, &clock).or(last);
    }
    let last = last.expect("it has written");
    assert_eq!((last.fault, last.after.map(OverridePct::percent)), (None, Some(80)));
    assert_eq!(writer.release(&clock).map(|given| given.asked), Some(OverridePct::FULL));
    assert_eq!(writer.release(&clock), None);
    assert!(gate.limits().stale <= Duration::from_secs(1));
}
