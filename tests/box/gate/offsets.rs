//! Thermal offsets: what is decided, what reaches the control, and what is given back.

use super::cut::{Case, TICK_NS, common_cases, cutting, limits, set_number, set_text};
use adapters::clock::{Clock, ManualClock, SECOND_NS};
use adapters::offset::{Axis, LastWrite, OffsetSink};
use adapters::simulated::{Simulated, SimulatedOffsets, SimulatedSettings};
use adapters::words::execution;
use adapters::{Sample, SourceError};
use gateway::config::{self, BUILT_IN_TEXT, GateMode};
use gateway::gate::offset::{Moved, OffsetAccount, OffsetBound, OffsetJournal, OffsetOrder, OffsetOutcome, Shifted};
use gateway::gate::{Disarmed, Gate, Hold, OffsetVerdict};
use rules::estimators::{Estimates, State};
use rules::script::OffsetProposal;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

/// Z may be shifted by 5 um at a time and 12 um in all, once a minute.
fn offset_limits(mode: GateMode) -> config::GateConfig {
    let before = limits(GateMode::Shadow);
    let offset = config::OffsetConfig {
        mode,
        source: Some("test".to_owned()),
        axes: vec![Axis::Z],
        step_um: 5.0,
        total_um: 12.0,
        min_interval: Duration::from_secs(60),
        restore: true,
    };
    config::GateConfig { offset, ..before }
}

fn proposal(axis: Axis, offset_um: f64) -> OffsetProposal {
    OffsetProposal { axis, offset_um, reason: "thermal error".into(), script: "thermal.rhai".into(), version: 1 }
}

/// Between two programs.
fn resting(at_ns: i64) -> (Sample, Estimates) {
    let (mut sample, mut estimates) = cutting(at_ns);
    set_text(&mut sample, "execution", execution::PROGRAM_COMPLETED);
    set_number(&mut sample, "feed_mm_min", 0.0);
    estimates.state = State::Idle;
    (sample, estimates)
}

fn judged(gate: &mut Gate, at_ns: i64, um: Option<f64>) -> Option<OffsetVerdict> {
    let (sample, estimates) = resting(at_ns);
    let proposals: Vec<OffsetProposal> = um.map(|um| proposal(Axis::Z, um)).into_iter().collect();
    gate.decide_override(None, &sample, estimates.state);
    gate.judge_offsets(&proposals, &sample, estimates.state).pop()
}

fn answer(order: OffsetOrder, result: Result<Option<Shifted>, SourceError>) -> Moved {
    Moved { at_ns: 0, order, result, left: None, kept: Ok(()) }
}

/// A control that does what it is told, at once.
fn obey(gate: &mut Gate, verdict: &OffsetVerdict) -> Option<f64> {
    let Some(OffsetOrder::Shift { wanted_um, .. }) = verdict.order else { return None };
    let (base_um, before_um, last) = (0.0, 0.0, LastWrite::InForce);
    let shifted = Shifted { before_um, base_um, asked_um: wanted_um, after_um: wanted_um, last };
    gate.offsets_mut().accept_answer(&answer(verdict.order?, Ok(Some(shifted))));
    Some(wanted_um)
}

#[test]
fn as_configured_by_default_nothing_is_decided() {
    let config = config::parse("test", BUILT_IN_TEXT, Path::new(""), []).expect("accepted");
    assert_eq!((config.gate.offset.mode, config.gate.offset.axes.len()), (GateMode::Off, 0));
    let mut gate = Gate::new(config.gate);
    assert_eq!(judged(&mut gate, 0, Some(10.0)), None);
}

#[test]
fn a_shift_is_made_by_steps_with_rests_and_never_beyond_the_total() {
    let mut gate = Gate::new(offset_limits(GateMode::Armed));
    gate.arm("fitter", None, 0).expect("offsets alone may be armed");
    let mut written = Vec::new();
    for tick in 0..6000 {
        let verdict = judged(&mut gate, tick * TICK_NS, Some(30.4)).expect("decided");
        assert!(verdict.permitted_um.abs() <= 12.0);
        written.extend(obey(&mut gate, &verdict).map(|um| (tick / 10, um)));
    }
    assert_eq!(written, [(0, 5.0), (60, 10.0), (120, 12.0)], "seconds and micrometres");
    let verdict = judged(&mut gate, 700 * SECOND_NS, Some(30.4)).expect("decided");
    assert_eq!(verdict.outcome, OffsetOutcome::Limited(OffsetBound::Total));
    let (sample, estimates) = resting(701 * SECOND_NS);
    assert!(
        !gate.decide_override(None, &sample, estimates.state).armed,
        "armed for offsets only: no override is written"
    );
}

#[test]
fn only_between_programs_with_fresh_values_and_no_alarm() {
    let mut cases = common_cases();
    cases.extend::<[Case; 2]>([
        ("active", |it, _| set_text(it, "execution", execution::ACTIVE), Hold::Running),
        ("stopped within", |it, _| set_text(it, "execution", execution::STOPPED), Hold::Running),
    ]);
    for (what, spoil, hold) in cases {
        let mut gate = Gate::new(offset_limits(GateMode::Armed));
        gate.arm("fitter", None, 0).expect("may be armed");
        let (mut sample, mut estimates) = resting(0);
        spoil(&mut sample, &mut estimates);
        gate.decide_override(None, &sample, estimates.state);
        let verdict = gate.judge_offsets(&[proposal(Axis::Z, 3.0)], &sample, estimates.state).pop().expect("decided");
        assert_eq!((verdict.outcome, verdict.order), (OffsetOutcome::Held(hold), None), "{what}");
    }
}

#[test]
fn other_axes_and_what_is_no_number_move_nothing() {
    let mut gate = Gate::new(offset_limits(GateMode::Armed));
    gate.arm("fitter", None, 0).expect("may be armed");
    let (sample, estimates) = resting(0);
    gate.decide_override(None, &sample, estimates.state);
    let verdict = gate.judge_offsets(&[proposal(Axis::X, 3.0)], &sample, estimates.state).pop().expect("decided");
    assert_eq!((verdict.outcome, verdict.order), (OffsetOutcome::NotAllowed, None));
    for mistake in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let verdict = judged(&mut gate, 0, Some(mistake)).expect("decided");
        assert_eq!((verdict.outcome, verdict.order), (OffsetOutcome::Refused, None), "{mistake}");
    }
}

#[test]
fn in_shadow_and_before_arming_everything_is_decided_and_nothing_ordered() {
    for mode in [GateMode::Shadow, GateMode::Armed] {
        let mut gate = Gate::new(offset_limits(mode));
        assert_eq!(gate.arm("fitter", None, 0).is_ok(), mode == GateMode::Armed);
        gate.disarm(Disarmed::Person);
        let verdict = judged(&mut gate, 0, Some(4.0)).expect("decided");
        assert_eq!((verdict.outcome, verdict.permitted_um, verdict.order), (OffsetOutcome::Permitted, 4.0, None));
    }
}

#[test]
fn without_a_proposal_the_shift_goes_back_by_steps_and_after_disarming_at_once() {
    let mut gate = Gate::new(offset_limits(GateMode::Armed));
    gate.offsets_mut().resume_shift(Axis::Z, 9.0);
    gate.arm("fitter", None, 0).expect("may be armed");
    let mut written = Vec::new();
    for tick in 0..2000 {
        let verdict = judged(&mut gate, tick * TICK_NS, None);
        written.extend(verdict.and_then(|verdict| obey(&mut gate, &verdict)).map(|um| (tick / 10, um)));
    }
    assert_eq!(written, [(10, 4.0), (70, 0.0)], "after ten seconds without a proposal");
    gate.offsets_mut().resume_shift(Axis::Z, 9.0);
    gate.disarm(Disarmed::Person);
    let verdict = judged(&mut gate, 400 * SECOND_NS, Some(9.0)).expect("decided");
    assert_eq!(verdict.order, Some(OffsetOrder::Restore(Axis::Z)));
    let mut keeping = Gate::new(offset_limits(GateMode::Armed));
    keeping = Gate::new(config::GateConfig {
        offset: config::OffsetConfig { restore: false, ..keeping.limits().offset.clone() },
        ..keeping.limits().clone()
    });
    keeping.offsets_mut().resume_shift(Axis::Z, 9.0);
    assert_eq!(judged(&mut keeping, 400 * SECOND_NS, Some(9.0)).expect("decided").order, None);
}

/// The machine as the day finds it between two parts.
fn stood(machine: &Simulated) -> ManualClock {
    let rests = |s: &i64| {
        let panel = machine.moment(s * SECOND_NS).panel;
        panel.booted && panel.execution == execution::PROGRAM_COMPLETED
    };
    let s = (60..3600).find(rests).expect("a part is finished within the hour");
    ManualClock::with_time(s * SECOND_NS)
}

/// The machine between two parts, with this set by the operator, and what the gate holds of it.
struct Bench {
    machine: Simulated,
    clock: ManualClock,
    directory: TempDir,
}

impl Bench {
    fn new(operator_um: f64) -> Self {
        let machine = Simulated::new("simulated://lathe", SimulatedSettings::default(), 0);
        machine.set_offset(Axis::Z, operator_um);
        Self { clock: stood(&machine), machine, directory: tempfile::tempdir().expect("a directory") }
    }

    /// As after a start of the gateway.
    fn account(&self, sink: Box<dyn OffsetSink>) -> OffsetAccount {
        let book = OffsetJournal::open(self.directory.path(), "simulated://lathe").expect("readable");
        OffsetAccount::new(sink, book)
    }

    fn started(&self) -> OffsetAccount {
        self.account(Box::new(self.machine.offsets()))
    }
}

fn shift(from_um: f64, wanted_um: f64) -> OffsetOrder {
    OffsetOrder::Shift { axis: Axis::Z, from_um, wanted_um }
}

fn done(account: &mut OffsetAccount, clock: &ManualClock, order: OffsetOrder) -> Shifted {
    account.carry_out(order, clock).result.expect("at rest").expect("something to do")
}

#[test]
fn the_simulated_control_counts_refuses_in_a_program_and_gives_back_what_the_operator_had() {
    let bench = Bench::new(40.0);
    let Bench { machine, clock, .. } = &bench;
    let running = (60..3600).find(|s| machine.moment(s * SECOND_NS).panel.execution == execution::ACTIVE);
    let mut account = bench.started();
    let refused = account.carry_out(shift(0.0, 3.0), &ManualClock::with_time(running.expect("a program") * SECOND_NS));
    assert!(
        refused.result.is_err() && refused.fault().is_none() && machine.written().count_writes() == 0,
        "{refused:?}"
    );
    let shifted = done(&mut account, clock, shift(0.0, 3.4));
    assert_eq!((shifted.before_um, shifted.after_um, shifted.shift_um()), (40.0, 43.0, 3.0), "whole micrometres");
    // Another process of the gateway, which knows what this one has left.
    let mut account = bench.started();
    let back = done(&mut account, clock, OffsetOrder::Restore(Axis::Z));
    assert_eq!((back.after_um, machine.offset_um(Axis::Z), machine.written().offsets), (40.0, 40.0, 2));
    assert_eq!(account.carry_out(OffsetOrder::Restore(Axis::Z), clock).result, Ok(None), "nothing is left");
    machine.protect_offsets(true);
    let held_back = account.carry_out(shift(0.0, 5.0), clock);
    assert_eq!(held_back.fault().map(|fault| fault.disarm_reason()), Some(Disarmed::Offset), "{held_back:?}");
}

#[test]
fn what_the_operator_sets_anew_is_the_beginning_and_no_step_is_made_on_top_of_it_unasked() {
    let bench = Bench::new(40.0);
    let Bench { machine, clock, .. } = &bench;
    let mut account = bench.started();
    done(&mut account, clock, shift(0.0, 5.0));
    machine.set_offset(Axis::Z, 100.0);
    let found = done(&mut account, clock, shift(5.0, 10.0));
    assert_eq!((found.last, found.shift_um(), machine.offset_um(Axis::Z)), (LastWrite::Replaced, 0.0, 100.0));
    let shifted = done(&mut account, clock, shift(0.0, 5.0));
    assert_eq!((shifted.base_um, shifted.after_um), (100.0, 105.0), "by a step from where the gate knows it to be");
    machine.set_offset(Axis::Z, 7.0);
    let found = done(&mut account, clock, OffsetOrder::Restore(Axis::Z));
    assert_eq!((found.last, machine.offset_um(Axis::Z)), (LastWrite::Replaced, 7.0), "it is the operator's");
    assert_eq!(machine.written().offsets, 2);
}

/// A control behind a line that fails in the middle of a write: after the control has taken it, or before.
struct Broken {
    sink: SimulatedOffsets,
    taken: bool,
}

impl OffsetSink for Broken {
    fn name(&self) -> &str {
        self.sink.name()
    }

    fn offset_name(&self) -> &'static str {
        self.sink.offset_name()
    }

    fn at_rest(&mut self, clock: &dyn Clock, axis: Axis) -> Result<f64, SourceError> {
        self.sink.at_rest(clock, axis)
    }

    fn write(&mut self, clock: &dyn Clock, axis: Axis, found_um: f64, wanted_um: f64) -> Result<f64, SourceError> {
        if self.taken {
            self.sink.write(clock, axis, found_um, wanted_um)?;
        }
        let (source_name, what, next) = (self.name().to_owned(), "cut".to_owned(), String::new());
        Err(SourceError::Line { source_name, what, next })
    }
}

#[test]
fn a_write_whose_end_nobody_saw_is_settled_by_looking_and_never_made_twice() {
    for (taken, last) in [(true, LastWrite::Taken), (false, LastWrite::NotTaken)] {
        for restarted in [false, true] {
            let bench = Bench::new(40.0);
            let Bench { machine, clock, .. } = &bench;
            let mut account = bench.account(Box::new(Broken { sink: machine.offsets(), taken }));
            let broken = account.carry_out(shift(0.0, 5.0), clock);
            assert!(broken.fault().is_some() && broken.is_open(), "{broken:?}");
            if restarted {
                account = bench.started();
            }
            let writes = machine.written().offsets;
            let found = done(&mut account, clock, OffsetOrder::Look(Axis::Z));
            let shift_um = if taken { 5.0 } else { 0.0 };
            assert_eq!((found.last, found.base_um, found.shift_um()), (last, 40.0, shift_um), "{restarted}");
            assert_eq!(machine.written().offsets, writes, "looking writes nothing");
            let mut account = bench.started();
            account.carry_out(OffsetOrder::Restore(Axis::Z), clock).result.expect("at rest");
            assert_eq!(machine.offset_um(Axis::Z), 40.0, "what the operator had set, whatever happened");
        }
    }
}

#[test]
fn what_cannot_be_accounted_for_is_not_written() {
    let bench = Bench::new(40.0);
    let mut account = bench.started();
    // A directory stands where the file is to be written.
    std::fs::create_dir(bench.directory.path().join("offsets.json.writing")).expect("made");
    let refused = account.carry_out(shift(0.0, 5.0), &bench.clock);
    let text = refused.result.as_ref().expect_err("refused").to_string();
    assert!(text.contains("could not be accounted for") && refused.fault().is_none() && !refused.is_open(), "{text}");
    assert_eq!(bench.machine.written().count_writes(), 0);
}

#[test]
fn what_is_in_doubt_is_looked_at_before_anything_is_written_and_other_axes_are_given_back() {
    let mut gate = Gate::new(offset_limits(GateMode::Armed));
    gate.offsets_mut().resume_shift(Axis::X, 4.0);
    gate.offsets_mut().resume_shift(Axis::Z, 5.0);
    gate.offsets_mut().mark_unsettled(Axis::Z);
    gate.arm("fitter", None, 0).expect("may be armed");
    let (sample, estimates) = resting(0);
    gate.decide_override(None, &sample, estimates.state);
    let orders = |gate: &mut Gate, at_ns| {
        let (sample, estimates) = resting(at_ns);
        gate.decide_override(None, &sample, estimates.state);
        let verdicts = gate.judge_offsets(&[proposal(Axis::Z, 9.0), proposal(Axis::X, 9.0)], &sample, estimates.state);
        let mut orders: Vec<OffsetOrder> = verdicts.into_iter().filter_map(|verdict| verdict.order).collect();
        orders.extend(gate.collect_look_orders(&sample, estimates.state));
        orders
    };
    assert_eq!(orders(&mut gate, 0), [OffsetOrder::Look(Axis::Z)]);
    assert_eq!(orders(&mut gate, 5 * SECOND_NS), [], "it has not been answered");
    let off = SourceError::Off { source_name: "test".to_owned() };
    gate.offsets_mut().accept_answer(&answer(OffsetOrder::Look(Axis::Z), Err(off)));
    assert_eq!(orders(&mut gate, 6 * SECOND_NS), [OffsetOrder::Look(Axis::Z)], "again");
    let found = Shifted { before_um: 3.0, base_um: 0.0, asked_um: 3.0, after_um: 3.0, last: LastWrite::NotTaken };
    gate.offsets_mut().accept_answer(&answer(OffsetOrder::Look(Axis::Z), Ok(Some(found))));
    assert_eq!(orders(&mut gate, 7 * SECOND_NS), [OffsetOrder::Shift { axis: Axis::Z, from_um: 3.0, wanted_um: 8.0 }]);
    assert_eq!(
        orders(&mut gate, 70 * SECOND_NS),
        [OffsetOrder::Restore(Axis::X)],
        "the configuration does not name it"
    );
}
