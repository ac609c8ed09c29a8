//! The simulated machine: reproducible, physically plausible, obedient.

use super::*;
use crate::address::SimulatedMachine;
use adapter_core::channel::ChannelId;
use adapter_core::clock::{ManualClock, SECOND_NS};
use adapter_core::driver::{Actuator, LadderRequest, Pull, SourceError};
use adapter_core::merge::{Delay, Lockstep};
use adapter_core::override_pct::OverridePct;
use adapter_core::reading::{Absence, Reading};
use adapter_core::sample::Sample;
use std::collections::BTreeMap;

fn machine(settings: SimulatedSettings) -> Simulated {
    Simulated::new("simulated://lathe", settings, 0)
}

fn lathe() -> SimulatedSettings {
    SimulatedSettings::default()
}

fn mill() -> SimulatedSettings {
    SimulatedSettings { machine: SimulatedMachine::Mill, ..lathe() }
}

/// Every reading of both devices over so many seconds, printed.
fn printed(settings: SimulatedSettings, seconds: i64) -> String {
    let machine = machine(settings);
    let (mut controller, mut meter) = (machine.controller(), machine.meter());
    let (mut out, mut text) = (Vec::new(), String::new());
    while controller.next_ns() < Some(seconds * SECOND_NS) {
        let controller_first = controller.next_ns() <= meter.next_ns();
        let result = if controller_first { controller.pull_readings(&mut out) } else { meter.pull_readings(&mut out) };
        text.push_str(&format!("{result:?} {out:?}\n"));
        out.clear();
    }
    text
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_does_not() {
    let first = printed(lathe(), 120);
    assert!(first == printed(lathe(), 120));
    assert!(first != printed(SimulatedSettings { seed: 2, ..lathe() }, 120));
}

#[test]
fn asking_more_often_changes_nothing() {
    let (often, rarely) = (machine(lathe()), machine(lathe()));
    for at_ms in 0..200_000 {
        let _ = often.truth(at_ms * 1_000_000);
    }
    let at_ns = 200 * SECOND_NS;
    assert_eq!(often.moment(at_ns), rarely.moment(at_ns));
}

/// Seconds per true state, in steps of a tenth.
fn seconds_per_state(machine: &Simulated, seconds: i64) -> BTreeMap<&'static str, f64> {
    let mut sums = BTreeMap::new();
    for tenth in 0..seconds * 10 {
        *sums.entry(machine.truth(tenth * SECOND_NS / 10).state.as_word()).or_default() += 0.1;
    }
    sums
}

#[test]
fn all_states_come_within_minutes() {
    for settings in [lathe(), mill()] {
        let sums = seconds_per_state(&machine(settings), 420);
        for state in TrueState::ALL {
            assert!(sums.get(state.as_word()).copied().unwrap_or(0.0) > 0.5, "{:?}: {sums:?}", settings.machine);
        }
        assert!(sums["cutting"] > 60.0, "{sums:?}");
    }
}

#[test]
fn the_power_balances_at_every_moment() {
    for settings in [lathe(), mill()] {
        let machine = machine(settings);
        for tenth in 0..6000 {
            let truth = machine.truth(tenth * SECOND_NS / 10);
            let parts_w = truth.no_load_power_w + truth.transient_power_w + truth.cutting_power_w + truth.load_loss_w;
            assert!((truth.spindle_power_w - parts_w).abs() < 1e-6, "{truth:?}");
            assert!(truth.total_power_w >= truth.spindle_power_w - 1e-6, "{truth:?}");
            assert!(truth.cutting_power_w >= 0.0 && truth.load_loss_w >= 0.0 && truth.no_load_power_w >= 0.0);
            if truth.cutting_power_w > 50.0 && truth.engaged > 0.9 {
                let share = truth.load_loss_w / truth.cutting_power_w;
                assert!((0.05..0.45).contains(&share), "load loss {share} of the cut: {truth:?}");
            }
        }
    }
}

#[test]
fn the_numbers_are_those_of_a_small_lathe() {
    let machine = machine(SimulatedSettings { cut: CutLevel::Planned(1.0), ..lathe() });
    let mut at_800 = Vec::new();
    let (mut cuts, mut peak_w) = (Vec::new(), 0.0_f64);
    for tenth in 0..4000 {
        let truth = machine.truth(tenth * SECOND_NS / 10);
        peak_w = peak_w.max(truth.transient_power_w);
        if truth.state == TrueState::Idle && (truth.spindle_speed_rpm - 800.0).abs() < 5.0 {
            at_800.push(truth.no_load_power_w);
        }
        if truth.engaged > 0.95 {
            cuts.push(truth.cutting_power_w);
        }
    }
    let mean = at_800.iter().sum::<f64>() / at_800.len() as f64;
    assert!((430.0..580.0).contains(&mean), "{mean} W at 800 rpm");
    let greatest = cuts.iter().copied().fold(0.0, f64::max);
    assert!((500.0..3500.0).contains(&greatest), "{greatest} W in the cut");
    assert!(peak_w > 2500.0, "{peak_w} W at the start");
}

#[test]
fn a_slow_start_settles_with_its_time_constant() {
    let settle_s = |tau_s: f64| {
        let sums = seconds_per_state(&machine(SimulatedSettings { tau_s, ..lathe() }), 90);
        sums["spindle_start"]
    };
    let (fast, slow) = (settle_s(0.3), settle_s(2.0));
    assert!(slow > 3.0 * fast && fast > 1.0, "{fast} s and {slow} s");
}

#[test]
fn a_light_cut_adds_the_share_it_shall() {
    let machine = machine(SimulatedSettings { cut: CutLevel::OfNoLoad(0.05), ..lathe() });
    let mut shares = Vec::new();
    for tenth in 0..3000 {
        let truth = machine.truth(tenth * SECOND_NS / 10);
        if truth.engaged > 0.99 && truth.cutting_power_w > 0.0 {
            shares.push((truth.cutting_power_w + truth.load_loss_w) / truth.no_load_power_w);
        }
    }
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    assert!(shares.len() > 300 && (mean - 0.05).abs() < 0.002, "{mean} over {}", shares.len());
}

#[test]
fn the_feed_override_is_obeyed() {
    let (free, slowed) = (machine(lathe()), machine(lathe()));
    let clock = ManualClock::with_time(0);
    let mut feed = slowed.feed_override();
    assert!(matches!(feed.write_feed_override(&clock, OverridePct::FULL), Err(SourceError::Off { .. })));
    clock.set_time(60 * SECOND_NS);
    let half = OverridePct::new(50).expect("in range");
    let mut first_cut = |machine: &Simulated, written: bool| {
        let at = |tenth: i64| {
            clock.set_time(tenth * SECOND_NS / 10);
            if written {
                feed.write_feed_override(&clock, half).expect("the control is on");
            }
            machine.moment(tenth * SECOND_NS / 10)
        };
        (600..6000).map(at).find(|moment| moment.truth.engaged > 0.99).expect("a cut begins")
    };
    let (b, a) = (first_cut(&slowed, true), first_cut(&free, false));
    assert_eq!(feed.read_feed_override(&ManualClock::with_time(b.truth.at_ns)), Ok(half));
    assert_eq!((a.panel.feed_override_pct, b.panel.feed_override_pct), (100, 50));
    assert!(
        (b.panel.feed_mm_min / a.panel.feed_mm_min - 0.5).abs() < 0.02,
        "{} {}",
        a.panel.feed_mm_min,
        b.panel.feed_mm_min
    );
    assert!(b.truth.cutting_power_w < 0.8 * a.truth.cutting_power_w);
}

#[test]
fn threading_ignores_the_override() {
    let settings = SimulatedSettings { day: DaySettings { parts_per_lot: 1, ..lathe().day }, ..lathe() };
    let machine = machine(settings);
    machine.turn_dial(0, OverridePct::new(60).expect("in range"));
    let mut seen = false;
    for tenth in 0..15_000 {
        let panel = machine.moment(tenth * SECOND_NS / 10).panel;
        if panel.operation == "threading" && panel.override_locked && panel.feed_mm_min > 0.0 {
            seen = true;
            assert!(panel.feed_mm_min > 0.95 * panel.feed_programmed_mm_min, "{panel:?}");
        }
    }
    assert!(seen, "the third part has a thread");
}

#[test]
fn the_meter_shows_the_truth_when_it_is_ideal() {
    let machine = machine(lathe().with_ideal_meter());
    let meter = machine.meter();
    let mut compared = 0;
    for tenth in 300..3000 {
        let at_ns = tenth * SECOND_NS / 10;
        let truths = [0, 50, 100, 150].map(|back| machine.truth(at_ns - back * 1_000_000));
        let values = meter.read_values(at_ns).expect("no dropouts");
        let calm = truths.iter().all(|truth| (truth.spindle_power_w - truths[0].spindle_power_w).abs() < 2.0);
        if calm && truths[0].spindle_power_w > 0.0 {
            compared += 1;
            assert!((values.spindle_power_w - truths[1].spindle_power_w).abs() < 3.0, "{values:?} {:?}", truths[1]);
        }
    }
    assert!(compared > 200, "{compared}");
}

#[test]
fn the_real_meter_adds_noise_ripple_pulses_and_silence() {
    let mut settings = lathe();
    settings.meter.dropouts_per_h = 60.0;
    settings.meter.pulse_probability = 0.01;
    let machine = machine(settings);
    let mut meter = machine.meter();
    let (mut out, mut silent, mut pulses, mut squares, mut count) = (Vec::new(), 0, 0, 0.0, 0.0_f64);
    while meter.next_ns() < Some(900 * SECOND_NS) {
        let at_ns = meter.next_ns().unwrap_or(0);
        silent += i32::from(meter.pull_readings(&mut out).is_err());
        let truth = machine.truth(at_ns - 70_000_000);
        if let Some(power) = out.first().and_then(|reading: &Reading| reading.value.as_ref().ok()?.as_number())
            && truth.state == TrueState::Idle
        {
            let error = power - truth.spindle_power_w;
            if error.abs() > 300.0 {
                pulses += 1;
            } else {
                squares += (error / truth.spindle_power_w).powi(2);
                count += 1.0;
            }
        }
        out.clear();
    }
    let sigma = (squares / count).sqrt();
    assert!(silent > 20, "{silent} silent polls");
    assert!(pulses > 3, "{pulses} pulses");
    assert!((0.008..0.05).contains(&sigma), "{sigma} relative error in idle");
}

#[test]
fn wear_grows_and_edges_are_changed() {
    let machine = machine(lathe());
    let (mut last_edge, mut greatest_mm, mut heat_um) = (0, 0.0_f64, 0.0_f64);
    let hours = 7;
    for second in 0..hours * 3600 {
        let moment = machine.moment(second * SECOND_NS);
        last_edge = last_edge.max(moment.panel.edge);
        greatest_mm = greatest_mm.max(moment.truth.flank_wear_mm);
        heat_um = heat_um.max(moment.truth.thermal_error_um);
    }
    let panel = machine.moment(hours * 3600 * SECOND_NS).panel;
    assert!(last_edge >= 1, "no edge was changed; worst wear {greatest_mm} mm");
    assert!((0.25..0.45).contains(&greatest_mm), "{greatest_mm} mm");
    assert!((10.0..120.0).contains(&heat_um), "{heat_um} um");
    assert!(panel.part_count > 60, "{} parts in {hours} h", panel.part_count);
}

#[test]
fn the_night_comes_and_the_morning_after() {
    let day = DaySettings { shift_s: 1200.0, lunch_s: 60.0, night_s: 600.0, ..lathe().day };
    let machine = machine(SimulatedSettings { day, ..lathe() });
    let mut words: Vec<&str> = Vec::new();
    for second in 0..4800 {
        let word = machine.truth(second * SECOND_NS).state.as_word();
        if words.last() != Some(&word) && (word == "off" || word == "cutting") {
            words.push(word);
        }
    }
    words.dedup();
    assert_eq!(words[..4], ["off", "cutting", "off", "cutting"]);
}

#[test]
fn both_devices_merge_into_one_picture() {
    let machine = machine(lathe());
    let sources: Vec<Box<dyn Pull>> = vec![Box::new(machine.controller()), Box::new(machine.meter())];
    let mut lockstep = Lockstep::new(sources, Delay::default());
    let mut sample = Sample::new_empty(0);
    let of = |name: &str| ChannelId::from_name(name).expect("in the table");
    let (mut off, mut close, mut turning) = (0, 0, 0);
    for tick in 10..3000 {
        assert!(lockstep.sample_into(&mut sample, tick * SECOND_NS / 10));
        let truth = machine.truth(sample.at_ns);
        match sample.number(of("spindle_speed_rpm")) {
            Err(Absence::MachineOff) => off += 1,
            Ok(speed) if truth.spindle_speed_rpm > 100.0 => {
                turning += 1;
                close += i32::from((speed - truth.spindle_speed_rpm).abs() < 0.03 * truth.spindle_speed_rpm);
            }
            _ => {}
        }
    }
    assert!(off > 50, "{off} ticks with the machine off");
    assert!(close * 100 > turning * 95 && turning > 500, "{close} of {turning}");
    assert!(sample.provided_slots().count() >= 30);
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(24))]
    #[test]
    fn no_setting_makes_it_fail(
        seed: u64,
        tau_s in 0.05..5.0_f64,
        cut in 0.0..3.0_f64,
        percent in 0..=254_u8,
        is_mill: bool,
        speed_changes: bool,
    ) {
        let base = if is_mill { mill() } else { lathe() };
        let settings = SimulatedSettings { seed, tau_s, cut: CutLevel::Planned(cut), speed_changes, ..base };
        let refused = out_of_range(settings, percent);
        proptest::prop_assert!(refused.is_none(), "{refused:?}");
    }
}

/// The first reading outside its channel's range.
fn out_of_range(settings: SimulatedSettings, percent: u8) -> Option<Reading> {
    let machine = machine(settings);
    machine.turn_dial(40 * SECOND_NS, OverridePct::new(percent).expect("in range"));
    let (mut controller, mut meter, mut out) = (machine.controller(), machine.meter(), Vec::new());
    for _ in 0..4000 {
        let _ = controller.pull_readings(&mut out);
        let _ = meter.pull_readings(&mut out);
        if let Some(refused) = out.drain(..).find(|reading| reading.value == Err(Absence::OutOfRange)) {
            return Some(refused);
        }
    }
    None
}

#[test]
fn three_times_the_planned_cut_at_more_than_twice_the_feed_stays_on_the_display() {
    let settings =
        SimulatedSettings { seed: 10_129_099_058_646_574_734, tau_s: 1.098, cut: CutLevel::Planned(2.94), ..lathe() };
    assert_eq!(out_of_range(settings, 246), None);
}

/// Seconds from the beginning to the first moment of which this is true, looked at every tenth.
fn first_s(machine: &Simulated, from_s: i64, what: impl Fn(&Moment) -> bool) -> i64 {
    let at = |tenth: i64| machine.moment(tenth * SECOND_NS / 10);
    (from_s * 10..from_s * 10 + 20_000).find(|tenth| what(&at(*tenth))).expect("it happens") / 10
}

#[test]
fn a_feed_hold_stops_the_axes_and_a_stop_the_program_until_the_operator_comes() {
    let machine = machine(lathe());
    let mut ladder = machine.feed_override();
    let cut_s = first_s(&machine, 60, |moment| moment.truth.engaged > 0.99);
    let clock = ManualClock::with_time((cut_s + 1) * SECOND_NS);
    ladder.ask_ladder(&clock, LadderRequest::FeedHold).expect("the control is on");
    let held = machine.moment((cut_s + 2) * SECOND_NS).panel;
    assert_eq!((held.execution, held.feed_mm_min), (adapter_core::words::execution::FEED_HOLD, 0.0));
    let on_s = first_s(&machine, cut_s + 2, |moment| moment.panel.feed_mm_min > 0.0);
    assert!((44..=47).contains(&(on_s - cut_s)), "{on_s} {cut_s}");
    clock.set_time((on_s + 1) * SECOND_NS);
    ladder.ask_ladder(&clock, LadderRequest::Stop).expect("the control is on");
    let stood_s =
        first_s(&machine, on_s + 1, |moment| moment.panel.execution == adapter_core::words::execution::STOPPED);
    let before = machine.moment((stood_s - 1) * SECOND_NS).panel;
    let after_s = first_s(&machine, stood_s, |moment| moment.panel.execution == adapter_core::words::execution::ACTIVE);
    let after = machine.moment(after_s * SECOND_NS).panel;
    assert!(after_s - stood_s >= 45 && after.part_count == 1, "{after:?}");
    assert!(before.part_count <= 1 && machine.written().count_writes() == 2);
}
