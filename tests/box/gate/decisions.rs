//! The gate: nothing is written that should not be, whatever a script asks for.

use super::cut::{Random, TICK_NS, asking, cases, cutting, id, limits, set_number, set_text, stored};
use adapters::clock::{Clock, ManualClock, SECOND_NS};
use adapters::override_pct::OverridePct;
use adapters::simulated::{Simulated, SimulatedSettings};
use adapters::{Absence, Actuator, LadderRule, Sample, Slot, SourceError};
use gateway::config::{self, BUILT_IN_TEXT, GateMode};
use gateway::gate::{
    ArmError, Bound, Disarmed, Fault, Gate, GateOutcome, Hold, OverrideWriter, UnexpectedReading, Verdict,
};
use rules::script::{Host, ScriptFile, list_shipped_scripts};
use std::path::Path;
use std::time::Duration;

fn armed_gate() -> Gate {
    let mut gate = Gate::new(limits(GateMode::Armed));
    gate.arm("fitter", None, 0).expect("the configuration allows it");
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
        let broken = || SourceError::Line { source_name: "test".into(), what: "broken".into(), next: "mend it".into() };
        if self.refuses { Err(broken()) } else { Ok(()) }
    }

    fn read_feed_override(&mut self, _: &dyn Clock) -> Result<OverridePct, SourceError> {
        let last = self.writes.last().copied().unwrap_or(100);
        let shown = self.shown.filter(|(from, _)| self.writes.len() >= *from).map_or(last, |(_, shown)| shown);
        Ok(OverridePct::new(shown).expect("not 255"))
    }
}

fn writer<A: Actuator>(actuator: A) -> OverrideWriter<A> {
    OverrideWriter::new(actuator, stored(), &limits(GateMode::Armed))
}

#[test]
fn by_default_nothing_is_written_in_an_hour() {
    let config = config::parse("test", BUILT_IN_TEXT, Path::new(""), []).expect("it is accepted");
    let mut gate = Gate::new(config.gate);
    let mut writer = writer(Machine::new());
    let mut host = Host::new();
    let greedy =
        ScriptFile { name: "greedy.rhai".to_owned(), text: "request_feed_override(60, \"greed\");".to_owned() };
    let mut files = list_shipped_scripts();
    files.push(greedy);
    host.load_scripts(&files).expect("they compile");
    let clock = ManualClock::with_time(0);
    let mut permitted = Vec::new();
    for tick in 0..36_000 {
        clock.set_time(tick * TICK_NS);
        let (sample, estimates) = cutting(tick * TICK_NS);
        let decision = host.run_due_scripts(&sample, &estimates);
        let verdict = gate.decide_override(decision.request.as_ref(), &sample, estimates.state);
        assert_eq!(writer.write_verdict(&verdict, &clock), None);
        permitted.push(verdict.permitted.percent());
    }
    assert_eq!(writer.actuator().writes, [0_u8; 0], "the default configuration wrote to the machine");
    assert_eq!(permitted.last(), Some(&60), "in shadow it is decided all the same");
}

#[test]
fn arming_needs_the_configuration_a_person_and_ends_by_itself() {
    for mode in [GateMode::Off, GateMode::Shadow] {
        assert_eq!(Gate::new(limits(mode)).arm("fitter", None, 0).err(), Some(ArmError::Mode(mode.as_word())));
    }
    let mut gate = Gate::new(limits(GateMode::Armed));
    assert_eq!(gate.current_arming().err(), Some(Disarmed::Start), "disarmed after each start");
    assert_eq!(gate.arm("  ", None, 0).err(), Some(ArmError::Nobody));
    gate.arm("fitter", None, 0).expect("allowed");
    let lasts_ns = i64::try_from(limits(GateMode::Armed).armed_for.as_nanos()).expect("hours");
    for at_ns in (0..lasts_ns).step_by(9_000_000_000).chain([lasts_ns - 1]) {
        let (sample, estimates) = cutting(at_ns);
        assert!(gate.decide_override(None, &sample, estimates.state).armed);
    }
    let (sample, estimates) = cutting(lasts_ns);
    assert!(!gate.decide_override(None, &sample, estimates.state).armed);
    assert_eq!(gate.current_arming().err(), Some(Disarmed::Expired));
    gate.arm("fitter", None, lasts_ns).expect("again");
    let (sample, estimates) = cutting(5);
    assert!(!gate.decide_override(None, &sample, estimates.state).armed, "a clock that jumps back disarms");
}

/// A process that was stopped and goes on sees fresh values at once, and has seen none for as long as it stood.
#[test]
fn ten_seconds_without_a_tick_end_the_arming_like_ten_seconds_without_values() {
    for (pause_s, armed) in [(9, true), (10, false), (20, false), (86_400, false)] {
        let mut gate = Gate::new(limits(GateMode::Armed));
        gate.arm("fitter", None, 0).expect("allowed");
        let (sample, estimates) = cutting(TICK_NS);
        assert!(gate.decide_override(None, &sample, estimates.state).armed);
        let (sample, estimates) = cutting(TICK_NS + pause_s * 1_000_000_000);
        assert_eq!(gate.decide_override(None, &sample, estimates.state).armed, armed, "{pause_s} s");
        let why = if pause_s > 3_600 { Disarmed::Expired } else { Disarmed::Silent };
        assert_eq!(gate.current_arming().err(), (!armed).then_some(why), "{pause_s} s");
    }
}

#[test]
fn every_hold_gives_the_programmed_feed_at_once_and_says_why() {
    for (what, change, hold) in cases() {
        let mut gate = armed_gate();
        for tick in 0..100 {
            let (sample, estimates) = cutting(tick * TICK_NS);
            gate.decide_override(Some(&asking(60.0)), &sample, estimates.state);
        }
        let (mut sample, mut estimates) = cutting(100 * TICK_NS);
        let before = gate.decide_override(Some(&asking(60.0)), &sample, estimates.state);
        assert_eq!((before.permitted.percent(), before.outcome), (60, GateOutcome::Permitted), "{what}");
        sample.at_ns += TICK_NS;
        change(&mut sample, &mut estimates);
        let verdict = gate.decide_override(Some(&asking(60.0)), &sample, estimates.state);
        assert_eq!((verdict.permitted.percent(), verdict.outcome), (100, GateOutcome::Held(hold)), "{what}");
        assert!(
            verdict.reason().starts_with("no override, the dial counts: ") && !hold.describe_in_chinese().is_empty()
        );
        assert_eq!(verdict.as_word(), "held");
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
        let mut decide = |sample: &Sample| {
            matches!(gate.decide_override(None, sample, estimates.state).outcome, GateOutcome::Held(_))
        };
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
    assert_eq!(
        gate.decide_override(Some(&asking(80.0)), &sample, estimates.state).outcome,
        GateOutcome::Held(Hold::Off)
    );
}

#[test]
fn silence_of_the_machine_disarms_after_ten_seconds() {
    let mut gate = armed_gate();
    for tick in 0..=100 {
        let (mut sample, estimates) = cutting(tick * TICK_NS);
        sample.set_slot(id("mode"), Slot::from_absence(Absence::Disconnected));
        assert_eq!(gate.decide_override(None, &sample, estimates.state).armed, tick < 100, "tick {tick}");
    }
    assert_eq!(gate.current_arming().err(), Some(Disarmed::Silent));
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
        let verdict = gate.decide_override(random.request().as_ref(), &sample, estimates.state);
        let now = f64::from(verdict.permitted.percent());
        assert!(now >= limits.min_pct && now <= limits.max_pct, "{verdict:?}");
        let step_s = step_ns as f64 / SECOND_NS as f64;
        if matches!(verdict.outcome, GateOutcome::Held(_)) {
            held += 1;
            assert_eq!(now, 100.0, "{verdict:?}");
        } else {
            // Whole percent: a step may be one more than the exact change.
            assert!(now - before <= limits.slew_up_pct_per_s * step_s + 1.0, "{before} -> {verdict:?}");
            assert!(before - now <= limits.slew_down_pct_per_s * step_s + 1.0, "{before} -> {verdict:?}");
        }
        if matches!(verdict.outcome, GateOutcome::Refused) {
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
    let mut gate = Gate::new(config::GateConfig { above_dial: true, ..limits(GateMode::Armed) });
    let mut outcome_at = |tick: i64, pct: f64| {
        let (sample, estimates) = cutting(tick * TICK_NS);
        gate.decide_override(Some(&asking(pct)), &sample, estimates.state)
    };
    let first = outcome_at(0, 55.0);
    assert_eq!((first.outcome, first.permitted.percent()), (GateOutcome::Limited(Bound::Slew), 100));
    assert_eq!(outcome_at(1, 55.0).permitted.percent(), 95);
    assert_eq!(outcome_at(2, 10.0).outcome, GateOutcome::Limited(Bound::Least));
    assert_eq!(outcome_at(3, 200.0).outcome, GateOutcome::Limited(Bound::Greatest));
    assert_eq!(outcome_at(4, 300.0).outcome, GateOutcome::Refused);
}

#[test]
fn never_above_the_operators_dial_unless_configured() {
    let pct = |percent: u8| OverridePct::new(percent).expect("an override");
    let decided = |above_dial: bool, dial: Option<f64>| {
        let mut gate = Gate::new(config::GateConfig { above_dial, ..limits(GateMode::Armed) });
        let mut last = None;
        for tick in 0..60 {
            let (mut sample, estimates) = cutting(tick * TICK_NS);
            dial.into_iter().for_each(|dial| set_number(&mut sample, "feed_override_dial_pct", dial));
            last = Some(gate.decide_override(Some(&asking(115.0)), &sample, estimates.state));
        }
        last.map(|verdict| (verdict.permitted.percent(), verdict.outcome)).expect("decided")
    };
    assert_eq!(decided(false, None), (100, GateOutcome::Limited(Bound::Dial(pct(100)))), "nobody knows the dial");
    assert_eq!(decided(false, Some(110.0)), (110, GateOutcome::Limited(Bound::Dial(pct(110)))));
    assert_eq!(
        decided(false, Some(60.0)),
        (100, GateOutcome::Limited(Bound::Dial(pct(100)))),
        "the ladder takes the lesser one"
    );
    let asked_60 = |dial: f64| {
        let mut gate = Gate::new(limits(GateMode::Armed));
        let decide = |tick: i64| {
            let (mut sample, estimates) = cutting(tick * TICK_NS);
            set_number(&mut sample, "feed_override_dial_pct", dial);
            gate.decide_override(Some(&asking(60.0)), &sample, estimates.state)
        };
        (0..60).map(decide).last().map(|verdict| (verdict.permitted.percent(), verdict.outcome)).expect("decided")
    };
    assert_eq!(
        asked_60(60.0),
        (100, GateOutcome::DialCounts(OverridePct::new(60).expect("not 255"))),
        "nothing is asked that the dial does already"
    );
    assert_eq!(asked_60(61.0), (60, GateOutcome::Permitted));
    assert_eq!(decided(false, Some(120.0)), (115, GateOutcome::Permitted));
    assert_eq!(decided(true, Some(60.0)), (115, GateOutcome::Permitted), "the ladder multiplies: 69 %");
}

#[test]
fn arming_lasts_no_longer_than_the_configuration_allows() {
    let mut gate = Gate::new(limits(GateMode::Armed));
    for wrong in [Duration::ZERO, Duration::from_secs(8 * 3600 + 1), Duration::MAX] {
        assert_eq!(gate.arm("fitter", Some(wrong), 0).err(), Some(ArmError::Lasts(8 * 3600)), "{wrong:?}");
    }
    let armed = gate.arm("fitter", Some(Duration::from_secs(60)), 0).expect("allowed");
    assert_eq!(armed.until_ns, 60 * SECOND_NS);
}

fn run(
    gate: &mut Gate,
    writer: &mut OverrideWriter<Machine>,
    ticks: std::ops::Range<i64>,
    pct: f64,
) -> Vec<Option<Fault>> {
    let clock = ManualClock::with_time(0);
    let mut faults = Vec::new();
    for tick in ticks {
        clock.set_time(tick * TICK_NS);
        let (sample, estimates) = cutting(tick * TICK_NS);
        let verdict = gate.decide_override(Some(&asking(pct)), &sample, estimates.state);
        if let Some(written) = writer.write_verdict(&verdict, &clock) {
            if let Some(fault) = &written.fault {
                gate.disarm(fault.disarm_reason());
            }
            faults.push(written.fault);
        }
    }
    faults
}

#[test]
fn an_armed_gate_writes_reads_back_and_gives_the_machine_back() {
    let mut gate = armed_gate();
    let mut writer = writer(Machine::new());
    let faults = run(&mut gate, &mut writer, 0..30, 80.0);
    assert!(faults.iter().all(Option::is_none), "{faults:?}");
    let writes = writer.actuator().writes.clone();
    assert_eq!(writes[..3], [95, 85, 80], "nothing is written at 100 %: {writes:?}");
    assert!(writes.len() < 14, "unchanged, it is written only as a sign of life: {writes:?}");
    gate.disarm(Disarmed::Person);
    run(&mut gate, &mut writer, 30..40, 80.0);
    assert_eq!(writer.actuator().writes.len(), writes.len() + 1, "given back once");
    assert_eq!(writer.actuator().writes.last(), Some(&100));
}

#[test]
fn a_machine_that_does_not_take_the_override_disarms_the_gate_once() {
    let mut gate = armed_gate();
    let mut dial = writer(Machine { shown: Some((4, 37)), ..Machine::new() });
    let told: Vec<_> = run(&mut gate, &mut dial, 0..60, 80.0).into_iter().flatten().collect();
    let mismatch = |found| Fault::ReadBack {
        asked: OverridePct::new(80).expect("not 255"),
        shown: UnexpectedReading {
            found: OverridePct::new(found).expect("not 255"),
            dial: None,
            rule: LadderRule::Least,
        },
    };
    assert_eq!(told, [mismatch(37)], "once");
    assert_eq!(gate.current_arming().err(), Some(Disarmed::ReadBack));

    let mut gate = armed_gate();
    let mut lagging = writer(Machine { shown: Some((0, 100)), ..Machine::new() });
    let faults = run(&mut gate, &mut lagging, 0..60, 80.0);
    let mismatches: Vec<_> = faults.into_iter().flatten().collect();
    assert_eq!(mismatches, [mismatch(100)]);
    assert_eq!(gate.current_arming().err(), Some(Disarmed::ReadBack));
    assert_eq!(lagging.actuator().writes.last(), Some(&100), "the machine is given back");
    assert!(mismatches[0].to_string().contains("80 % was written and 100 % is in force"));
}

#[test]
fn a_broken_line_disarms_the_gate() {
    let mut gate = armed_gate();
    let mut writer = writer(Machine { refuses: true, ..Machine::new() });
    let faults = run(&mut gate, &mut writer, 0..20, 80.0);
    assert!(matches!(faults[0], Some(Fault::Line(_))));
    assert_eq!(gate.current_arming().err(), Some(Disarmed::Line));
    assert_eq!(writer.actuator().writes.len(), 2, "one attempt, and one to give the machine back");
}

#[test]
fn the_simulated_machine_follows_an_armed_gate_and_returns_to_its_panel() {
    let machine = Simulated::new("simulated://lathe", SimulatedSettings::default(), 0);
    let clock = ManualClock::with_time(0);
    let cut_ns = (0..8 * 3600)
        .map(|second| second * SECOND_NS)
        .find(|at_ns| machine.truth(*at_ns).state == adapters::simulated::TrueState::Cutting)
        .expect("it cuts within a day");
    clock.set_time(cut_ns);
    let mut gate = Gate::new(limits(GateMode::Armed));
    gate.arm("fitter", None, cut_ns).expect("allowed");
    let mut writer = writer(machine.feed_override());
    let mut last = None;
    for tick in 0..20 {
        clock.set_time(cut_ns + tick * TICK_NS);
        let (sample, estimates) = cutting(cut_ns + tick * TICK_NS);
        let verdict: Verdict = gate.decide_override(Some(&asking(80.0)), &sample, estimates.state);
        last = writer.write_verdict(&verdict, &clock).or(last);
    }
    let last = last.expect("it has written");
    assert_eq!((last.fault, last.after.map(OverridePct::percent)), (None, Some(80)));
    assert_eq!(writer.release_machine(&clock).map(|given| given.asked), Some(OverridePct::FULL));
    assert_eq!(writer.release_machine(&clock), None);
    assert!(gate.limits().stale <= Duration::from_secs(1));
}
