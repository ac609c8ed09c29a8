//! What nobody expects of a script, a person, a clock or a controller: the arming ends, or the controller takes its time, while
//! something is on its way to the machine.

use super::cut::{TICK_NS, asking, cutting, limits, stored};
use adapters::clock::{Clock, ManualClock, SECOND_NS, SystemClock};
use adapters::override_pct::OverridePct;
use adapters::{Actuator, Axis, LadderRequest, OffsetSink, SourceError};
use gateway::config::GateMode;
use gateway::gate::offset::{OffsetAccount, OffsetJournal, OffsetOrder};
use gateway::gate::{Disarmed, Fault, Gate, GateOutcome, OverrideWriter, ScriptRequest, Verdict, audit};
use gateway::run::actuator_worker::{ActuatorReport, ActuatorWorker, Tools};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

/// What waits for the controller beside the override.
const SHIFT: OffsetOrder = OffsetOrder::Shift { axis: Axis::Z, from_um: 0.0, wanted_um: 5.0 };

/// What a controller may do to whoever writes to it.
#[derive(Default)]
struct State {
    /// Everything written.
    log: Vec<String>,
    /// It does not answer.
    stuck: bool,
    /// The driver breaks down.
    panics: bool,
    /// What is shown whatever is written.
    shown: Option<u8>,
}

/// A controller that does as the test wants; the test keeps the other end.
#[derive(Clone, Default)]
struct Controller(Arc<(Mutex<State>, Condvar)>);

impl Controller {
    fn set(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.0.0.lock().expect("no panic in between"));
        self.0.1.notify_all();
    }

    fn log(&self) -> Vec<String> {
        self.0.0.lock().expect("no panic in between").log.clone()
    }

    fn does(&self, what: String) {
        let state = self.0.0.lock().expect("no panic in between");
        let mut state = self.0.1.wait_while(state, |state| state.stuck).expect("no panic in between");
        state.log.push(what);
        let panics = state.panics;
        drop(state);
        assert!(!panics, "the driver breaks down, as this test wants");
    }
}

impl Actuator for Controller {
    fn name(&self) -> &str {
        "test"
    }

    fn write_feed_override(&mut self, _: &dyn Clock, wanted: OverridePct) -> Result<(), SourceError> {
        self.does(wanted.percent().to_string());
        Ok(())
    }

    fn read_feed_override(&mut self, _: &dyn Clock) -> Result<OverridePct, SourceError> {
        let state = self.0.0.lock().expect("no panic in between");
        let last = || state.log.iter().rev().find_map(|line| line.parse().ok()).unwrap_or(100);
        Ok(OverridePct::new(state.shown.unwrap_or_else(last)).expect("not 255"))
    }

    fn ask_ladder(&mut self, _: &dyn Clock, request: LadderRequest) -> Result<(), SourceError> {
        self.does(request.as_word().to_owned());
        Ok(())
    }
}

impl OffsetSink for Controller {
    fn name(&self) -> &str {
        "test"
    }

    fn offset_name(&self) -> &'static str {
        "the offset"
    }

    fn at_rest(&mut self, _: &dyn Clock, _: Axis) -> Result<f64, SourceError> {
        Ok(0.0)
    }

    fn write(&mut self, _: &dyn Clock, axis: Axis, _: f64, wanted_um: f64) -> Result<f64, SourceError> {
        self.does(format!("{} {wanted_um}", axis.as_word()));
        Ok(wanted_um)
    }
}

fn verdict(pct: u8, armed: bool) -> Verdict {
    let permitted = OverridePct::new(pct).expect("not 255");
    Verdict { at_ns: 0, wanted_pct: None, permitted, outcome: GateOutcome::Permitted, armed }
}

/// A hand of its own thread, holding this controller.
fn actuator_worker(controller: &Controller, directory: &tempfile::TempDir) -> ActuatorWorker {
    let book = OffsetJournal::open(directory.path(), "test").expect("readable");
    let offsets = Some(OffsetAccount::new(Box::new(controller.clone()), book));
    let tools = Tools { audit: stored().into(), actuator: Some(Box::new(controller.clone())), offsets };
    ActuatorWorker::start(tools, &limits(GateMode::Armed), Arc::new(SystemClock::new()), Duration::from_millis(100))
        .expect("a thread")
}

/// A hand whose controller has begun to write 90 % and does not come back from it.
fn stuck(directory: &tempfile::TempDir) -> (Controller, ActuatorWorker) {
    let controller = Controller::default();
    let mut actuator_worker = actuator_worker(&controller, directory);
    controller.set(|state| state.stuck = true);
    lay(&mut actuator_worker, &verdict(90, true), &[]);
    std::thread::sleep(Duration::from_millis(100));
    (controller, actuator_worker)
}

/// Listens until something of this kind is told.
fn told<T>(actuator_worker: &mut ActuatorWorker, mut of: impl FnMut(ActuatorReport) -> Option<T>) -> T {
    let until = Instant::now() + Duration::from_secs(20);
    loop {
        let mut found = None;
        actuator_worker.receive_reports(|said| found = found.take().or_else(|| of(said)));
        if let Some(found) = found {
            return found;
        }
        assert!(Instant::now() < until, "waited in vain");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn lay(actuator_worker: &mut ActuatorWorker, verdict: &Verdict, asks: &[ScriptRequest]) -> Vec<ActuatorReport> {
    let mut said = Vec::new();
    actuator_worker.submit_verdict(verdict, asks, 0, |it| said.push(it));
    said
}

#[test]
fn whoever_arms_finds_the_machine_at_its_dial_and_never_with_a_leap() {
    let mut gate = Gate::new(limits(GateMode::Armed));
    let decide = |gate: &mut Gate, tick: i64| {
        let (sample, estimates) = cutting(tick * TICK_NS);
        gate.decide_override(Some(&asking(60.0)), &sample, estimates.state)
    };
    (0..50).for_each(|tick| assert!(!decide(&mut gate, tick).armed));
    assert_eq!(decide(&mut gate, 50).permitted.percent(), 60, "decided while nobody writes");
    gate.arm("fitter", None, 50 * TICK_NS).expect("allowed");
    let writes: Vec<u8> = (51..60).map(|tick| decide(&mut gate, tick).permitted.percent()).collect();
    let greatest = (limits(GateMode::Armed).slew_down_pct_per_s / 10.0) as u8;
    assert_eq!(writes[0], 100, "{writes:?}");
    assert!(writes.windows(2).all(|pair| pair[0] - pair[1] <= greatest), "{writes:?}");
    gate.disarm(Disarmed::Person);
    gate.arm("fitter", None, 59 * TICK_NS).expect("allowed");
    assert!(!decide(&mut gate, 60).armed, "the end of an arming is seen, and the machine given back, before the next");
    let again = decide(&mut gate, 61);
    assert!(again.armed && again.permitted.percent() == 100, "{again:?}");
}

#[test]
fn after_a_fault_nothing_is_written_until_the_gate_has_let_go() {
    let (controller, clock) = (Controller::default(), ManualClock::with_time(0));
    let mut writer = OverrideWriter::new(controller.clone(), stored(), &limits(GateMode::Armed));
    writer.write_verdict(&verdict(90, true), &clock);
    controller.set(|state| state.shown = Some(37));
    clock.set_time(SECOND_NS / 2);
    let fault = writer.write_verdict(&verdict(80, true), &clock).and_then(|written| written.fault);
    assert!(matches!(fault, Some(Fault::ReadBack { .. })), "{fault:?}");
    clock.set_time(SECOND_NS);
    assert_eq!(writer.write_verdict(&verdict(70, true), &clock), None, "laid down before the tick has heard of it");
    writer.write_verdict(&verdict(100, false), &clock);
    assert_eq!(controller.log(), ["90", "80", "100"]);
}

#[test]
fn a_ladder_that_has_taken_the_dial_back_is_not_written_over() {
    let (controller, clock) = (Controller::default(), ManualClock::with_time(0));
    let mut writer = OverrideWriter::new(controller.clone(), stored(), &limits(GateMode::Armed));
    writer.write_verdict(&verdict(60, true), &clock);
    controller.set(|state| state.shown = Some(100));
    clock.set_time(2 * SECOND_NS);
    let written = writer.write_verdict(&verdict(60, true), &clock).expect("a fault");
    assert_eq!(written.fault, Some(Fault::Late { silent_ms: 2000 }));
    assert_eq!(controller.log(), ["60"], "a leap from 100 to 60 % is not made");
    // The signs of life were late and the ladder has not minded.
    let mut writer = OverrideWriter::new(Controller::default(), stored(), &limits(GateMode::Armed));
    clock.set_time(0);
    writer.write_verdict(&verdict(60, true), &clock);
    clock.set_time(2 * SECOND_NS);
    assert_eq!(writer.write_verdict(&verdict(60, true), &clock).and_then(|written| written.fault), None);
}

#[test]
fn what_waits_for_a_slow_controller_goes_nowhere_once_the_gate_is_disarmed() {
    let directory = tempfile::tempdir().expect("a directory");
    let (controller, mut actuator_worker) = stuck(&directory);
    let stop =
        ScriptRequest { request: LadderRequest::Stop, reason: "worn".into(), script: "a.rhai".into(), version: 1 };
    lay(&mut actuator_worker, &verdict(80, true), &[stop]);
    actuator_worker.order_shifts(&[SHIFT], true, 0, |_| {});
    // Disarmed, by a person or because the time is over, while all that waits.
    let said = lay(&mut actuator_worker, &verdict(100, false), &[]);
    assert!(matches!(&said[..], [ActuatorReport::Asked(_, Some(why))] if why.contains("disarmed")), "{said:?}");
    let mut withdrawn = Vec::new();
    actuator_worker.order_shifts(&[], false, 0, |said| withdrawn.push(format!("{said:?}")));
    assert!(withdrawn.len() == 1 && withdrawn[0].contains("Withdrawn"), "{withdrawn:?}");
    controller.set(|state| state.stuck = false);
    actuator_worker.close(|_| {});
    assert_eq!(controller.log(), ["90", "100"], "what was under way, and the way back to the dial");
}

#[test]
fn what_has_waited_too_long_goes_nowhere_either() {
    let directory = tempfile::tempdir().expect("a directory");
    let (controller, mut actuator_worker) = stuck(&directory);
    lay(&mut actuator_worker, &verdict(80, true), &[]);
    actuator_worker.order_shifts(&[SHIFT], true, 0, |_| {});
    // The tick hangs from now on, and the controller for two seconds more.
    std::thread::sleep(Duration::from_millis(2300));
    controller.set(|state| state.stuck = false);
    let (mut fault, mut withdrawn) = (None, None);
    told(&mut actuator_worker, |said| {
        match said {
            ActuatorReport::Written(written) => fault = fault.take().or(written.fault),
            ActuatorReport::Withdrawn(order) => withdrawn = Some(order),
            _ => {}
        }
        (fault.is_some() && withdrawn.is_some()).then_some(())
    });
    assert!(matches!(fault, Some(Fault::Late { silent_ms }) if silent_ms >= 2000), "{fault:?}");
    assert_eq!(withdrawn, Some(SHIFT));
    actuator_worker.close(|_| {});
    assert_eq!(controller.log(), ["90", "100"], "neither the old verdict nor the old order");
}

#[test]
fn a_thread_that_dies_is_noticed() {
    let directory = tempfile::tempdir().expect("a directory");
    let controller = Controller::default();
    let mut actuator_worker = actuator_worker(&controller, &directory);
    controller.set(|state| state.panics = true);
    lay(&mut actuator_worker, &verdict(90, true), &[]);
    let fault = told(&mut actuator_worker, |said| match said {
        ActuatorReport::Fault(fault) => Some(fault),
        _ => None,
    });
    assert_eq!((fault.disarm_reason(), &fault), (Disarmed::Line, &Fault::Gone));
    assert!(fault.to_string().contains("Start the gateway again"));
}

#[test]
fn every_write_says_which_script_of_which_version_asked_for_it_and_why() {
    let mut gate = Gate::new(limits(GateMode::Armed));
    gate.arm("fitter", None, 0).expect("allowed");
    let (clock, mut trail) = (ManualClock::with_time(0), audit::Trail::default());
    let mut writer = OverrideWriter::new(Controller::default(), stored(), gate.limits());
    let mut rows = Vec::new();
    for tick in 0..20 {
        clock.set_time(tick * TICK_NS);
        let (sample, estimates) = cutting(tick * TICK_NS);
        let request = asking(80.0);
        let verdict = gate.decide_override(Some(&request), &sample, estimates.state);
        let _told = trail.audit_override(Some(&request), &verdict);
        let written = writer.write_verdict(&verdict, &clock);
        rows.extend(written.and_then(|written| trail.command_from_write(&written, "lathe")));
    }
    assert!(rows.len() > 2, "{rows:?}");
    for row in &rows {
        assert_eq!((row.script.as_str(), row.script_version.as_str()), ("test.rhai", "0000000000000001"), "{row:?}");
        assert!(row.reason.ends_with(": test") && row.before.is_some() && row.after.is_some(), "{row:?}");
    }
    let released = writer.release_machine(&clock).and_then(|written| trail.write(&written)).expect("given back");
    assert_eq!(released.script, "", "the gateway by itself");
}
