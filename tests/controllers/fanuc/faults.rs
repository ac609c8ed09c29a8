//! Everything that goes wrong on a line, seeded: typed results, no panic, nothing left open, and the way back.

use crate::fanuc::support::{controller, number, opened, poll, serve};
use adapters::fanuc_server::{InjectedFault, ServerSettings};
use adapters::{Source, SourceError};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::collections::BTreeMap;
use std::time::Duration;

/// Which kind of failure.
fn kind(result: &Result<Vec<adapters::Reading>, SourceError>) -> &'static str {
    match result {
        Ok(_) => "answered",
        Err(SourceError::Line { .. }) => "line",
        Err(SourceError::Timeout { .. }) => "timeout",
        Err(SourceError::Refused { .. }) => "refused",
        Err(SourceError::Decode { .. }) => "no sense",
        Err(SourceError::Off { .. }) => "off",
        Err(SourceError::End { .. }) => "end",
    }
}

fn after(fault: InjectedFault, source: &mut dyn Source, server: &adapters::fanuc_server::Server) -> &'static str {
    poll(source).expect("well before the fault");
    server.inject_fault(fault);
    let found = kind(&poll(source));
    server.inject_fault(InjectedFault::None);
    assert_eq!(number(&poll(source).expect("well after the fault"), "spindle_speed_rpm"), 1200.0, "{fault:?}");
    found
}

#[test]
fn every_fault_has_its_name_and_the_next_poll_is_well() {
    let server = serve(controller(4), ServerSettings::default());
    let mut opened = opened(&server, "timeout_ms=600");
    let source = opened.sources[0].as_mut();
    let expected = [
        (InjectedFault::Silence, "timeout"),
        (InjectedFault::Delay(Duration::from_millis(20)), "answered"),
        (InjectedFault::Delay(Duration::from_millis(1200)), "timeout"),
        (InjectedFault::ByteByByte(Duration::from_millis(5)), "timeout"),
        (InjectedFault::Truncated, "timeout"),
        (InjectedFault::Reset, "line"),
        (InjectedFault::WrongEcho, "no sense"),
        (InjectedFault::WrongMagic, "no sense"),
        (InjectedFault::WrongCount, "no sense"),
        (InjectedFault::HugeLength, "no sense"),
        (InjectedFault::PowerOff, "line"),
    ];
    for (fault, name) in expected {
        assert_eq!(after(fault, source, &server), name, "{fault:?}");
    }
    wait_for(|| server.count_sessions() == 1, "every given-up connection was closed");
}

#[test]
fn an_answer_may_come_byte_by_byte() {
    let server = serve(controller(4), ServerSettings::default());
    let mut opened = opened(&server, "timeout_ms=20000");
    assert_eq!(
        after(InjectedFault::ByteByByte(Duration::from_micros(1)), opened.sources[0].as_mut(), &server),
        "answered"
    );
}

fn wait_for(mut holds: impl FnMut() -> bool, what: &str) {
    for _ in 0..200 {
        if holds() {
            return;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("not within four seconds: {what}");
}

#[test]
fn a_machine_that_is_switched_off_is_off_and_comes_back() {
    let server = serve(controller(3), ServerSettings::default());
    let mut opened = opened(&server, "timeout_ms=500");
    let source = opened.sources[0].as_mut();
    poll(source).expect("on");
    server.inject_fault(InjectedFault::PowerOff);
    assert_eq!(kind(&poll(source)), "line", "the moment of power-off is a broken line");
    for _ in 0..5 {
        assert_eq!(kind(&poll(source)), "off");
    }
    server.inject_fault(InjectedFault::None);
    assert_eq!(kind(&poll(source)), "answered");
}

/// Open files and threads of this process.
fn own() -> (usize, usize) {
    let count = |what: &str| std::fs::read_dir(format!("/proc/self/{what}")).map_or(0, Iterator::count);
    (count("fd"), count("task"))
}

#[test]
fn seeded_flapping_gives_typed_results_and_leaves_nothing_open() {
    const POLLS: usize = 1500;
    let server = serve(controller(4), ServerSettings::default());
    let mut opened = opened(&server, "timeout_ms=60&duty_pct=100");
    let source = opened.sources[0].as_mut();
    let mut random = Pcg64Mcg::seed_from_u64(20_261_121);
    let mut kinds: BTreeMap<&str, usize> = BTreeMap::new();
    let before = own();
    for _ in 0..POLLS {
        let fault = match random.random_range(0..60) {
            0 => InjectedFault::Silence,
            1 => InjectedFault::Truncated,
            2..=4 => InjectedFault::Reset,
            5..=7 => InjectedFault::WrongEcho,
            8..=10 => InjectedFault::WrongMagic,
            11..=13 => InjectedFault::WrongCount,
            14..=16 => InjectedFault::HugeLength,
            17..=19 => InjectedFault::PowerOff,
            20..=22 => InjectedFault::NoSession,
            23 => InjectedFault::Delay(Duration::from_millis(90)),
            _ => InjectedFault::None,
        };
        server.inject_fault(fault);
        *kinds.entry(kind(&poll(source))).or_default() += 1;
    }
    server.inject_fault(InjectedFault::None);
    poll(source).expect("well again");
    wait_for(|| server.count_sessions() == 1, "one connection is left");
    wait_for(|| own().0 <= before.0 + 8 && own().1 <= before.1 + 8, "no open file and no thread is left");
    println!("{POLLS} polls, {} connections: {kinds:?}", server.count_opened());
    assert!(kinds["answered"] > POLLS / 2 && kinds.contains_key("no sense") && kinds.contains_key("off"));
}
