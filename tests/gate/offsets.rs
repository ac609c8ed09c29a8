//! Thermal offsets: what is decided, what reaches the control, and what is given back.

use super::cut::{Case, TICK_NS, common_cases, cutting, limits, set_number, set_text};
use adapters::Sample;
use adapters::clock::{ManualClock, SECOND_NS};
use adapters::offset::{Axis, Left, OffsetSink};
use adapters::simulated::{Simulated, SimulatedSettings};
use adapters::words::execution;
use gateway::config::{self, BUILT_IN_TEXT, GateMode};
use gateway::gate::offset::{Moved, OffsetBound, OffsetOutcome, Order, carry_out};
use gateway::gate::{Disarmed, Gate, Hold, OffsetVerdict};
use rules::estimators::{Estimates, State};
use rules::script::OffsetProposal;
use std::path::Path;
use std::time::Duration;

/// Z may be shifted by 5 um at a time and 12 um in all, once a minute.
fn offset_limits(mode: GateMode) -> config::Gate {
    let before = limits(GateMode::Shadow);
    let offset = config::Offset {
        mode,
        source: Some("test".to_owned()),
        axes: vec![Axis::Z],
        step_um: 5.0,
        total_um: 12.0,
        min_interval: Duration::from_secs(60),
        restore: true,
    };
    config::Gate { offset, ..before }
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
    gate.decide(None, &sample, &estimates);
    gate.shift(&proposals, &sample, &estimates).pop()
}

/// A control that does what it is told, at once.
fn obey(gate: &mut Gate, verdict: &OffsetVerdict) -> Option<f64> {
    let Some(Order::Shift { axis, wanted_um }) = verdict.order else { return None };
    let shifted = adapters::offset::Shifted {
        before_um: 0.0,
        base_um: 0.0,
        asked_um: wanted_um,
        after_um: wanted_um,
        changed_by_others: false,
    };
    gate.offsets_mut().answered(axis, Some(&shifted));
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
    assert!(!gate.decide(None, &sample, &estimates).armed, "armed for offsets only: no override is written");
}

#[test]
fn only_between_programs_with_fresh_values_and_no_alarm() {
    let mut cases = common_cases();
    cases.extend::<[Case; 3]>([
        ("active", |it, _| set_text(it, "execution", execution::ACTIVE), Hold::Running),
        ("stopped within", |it, _| set_text(it, "execution", execution::STOPPED), Hold::Running),
        ("a word nobody knows", |it, _| set_text(it, "execution", "RUNNING?"), Hold::Running),
    ]);
    for (what, spoil, hold) in cases {
        let mut gate = Gate::new(offset_limits(GateMode::Armed));
        gate.arm("fitter", None, 0).expect("may be armed");
        let (mut sample, mut estimates) = resting(0);
        spoil(&mut sample, &mut estimates);
        gate.decide(None, &sample, &estimates);
        let verdict = gate.shift(&[proposal(Axis::Z, 3.0)], &sample, &estimates).pop().expect("decided");
        assert_eq!((verdict.outcome, verdict.order), (OffsetOutcome::Held(hold), None), "{what}");
    }
}

#[test]
fn other_axes_and_what_is_no_number_move_nothing() {
    let mut gate = Gate::new(offset_limits(GateMode::Armed));
    gate.arm("fitter", None, 0).expect("may be armed");
    let (sample, estimates) = resting(0);
    gate.decide(None, &sample, &estimates);
    let verdict = gate.shift(&[proposal(Axis::X, 3.0)], &sample, &estimates).pop().expect("decided");
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
    gate.offsets_mut().resume(Axis::Z, 9.0);
    gate.arm("fitter", None, 0).expect("may be armed");
    let mut written = Vec::new();
    for tick in 0..2000 {
        let verdict = judged(&mut gate, tick * TICK_NS, None);
        written.extend(verdict.and_then(|verdict| obey(&mut gate, &verdict)).map(|um| (tick / 10, um)));
    }
    assert_eq!(written, [(10, 4.0), (70, 0.0)], "after ten seconds without a proposal");
    gate.offsets_mut().resume(Axis::Z, 9.0);
    gate.disarm(Disarmed::Person);
    let verdict = judged(&mut gate, 400 * SECOND_NS, Some(9.0)).expect("decided");
    assert_eq!(verdict.order, Some(Order::Restore(Axis::Z)));
    let mut keeping = Gate::new(offset_limits(GateMode::Armed));
    keeping = Gate::new(config::Gate {
        offset: config::Offset { restore: false, ..keeping.limits().offset.clone() },
        ..keeping.limits().clone()
    });
    keeping.offsets_mut().resume(Axis::Z, 9.0);
    assert_eq!(judged(&mut keeping, 400 * SECOND_NS, Some(9.0)).expect("decided").order, None);
}

/// The machine as the day finds it between two parts.
fn stood(machine: &Simulated) -> ManualClock {
    let rests = |s: &i64| {
        let panel = machine.moment(s * SECOND_NS).panel;
        panel.booted && panel.execution == execution::PROGRAM_COMPLETED
    };
    let s = (60..3600).find(rests).expect("a part is finished within the hour");
    ManualClock::at(s * SECOND_NS)
}

fn moved(sink: &mut dyn OffsetSink, clock: &ManualClock, order: Order) -> Moved {
    carry_out(sink, order, clock)
}

#[test]
fn the_simulated_control_counts_refuses_in_a_program_and_gives_back_what_the_operator_had() {
    let machine = Simulated::new("simulated://lathe", SimulatedSettings::default(), 0);
    machine.set_offset(Axis::Z, 40.0);
    let running = (60..3600).find(|s| machine.moment(s * SECOND_NS).panel.execution == execution::ACTIVE);
    let (mut sink, shift) = (machine.offsets(), |um| Order::Shift { axis: Axis::Z, wanted_um: um });
    let refused = moved(&mut sink, &ManualClock::at(running.expect("a program") * SECOND_NS), shift(3.0));
    assert!(refused.result.is_err() && refused.fault().is_none() && machine.written().writes() == 0, "{refused:?}");
    let clock = stood(&machine);
    let done = moved(&mut sink, &clock, shift(3.4)).result.expect("at rest").expect("shifted");
    assert_eq!((done.before_um, done.after_um, done.shift_um()), (40.0, 43.0, 3.0), "whole micrometres");
    machine.set_offset(Axis::Z, 100.0);
    let done = moved(&mut sink, &clock, shift(5.0)).result.expect("at rest").expect("shifted");
    assert!(done.changed_by_others && done.after_um == 105.0, "{done:?}");
    assert_eq!(machine.written().offsets, 2);
    // Another process of the gateway, which knows what this one has left.
    let mut sink = machine.offsets();
    sink.resume(Axis::Z, Left { base_um: 100.0, written_um: 105.0 });
    let done = moved(&mut sink, &clock, Order::Restore(Axis::Z)).result.expect("at rest").expect("given back");
    assert_eq!((done.after_um, machine.offset_um(Axis::Z)), (100.0, 100.0));
    machine.protect_offsets(true);
    let held_back = moved(&mut sink, &clock, shift(5.0));
    assert_eq!(held_back.fault().map(|fault| fault.disarmed()), Some(Disarmed::Offset), "{held_back:?}");
}
