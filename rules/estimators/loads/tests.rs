//! The laws in a closed loop with a cut that answers: ramps of entry and exit, light cuts, hard spots, steps of depth.

use super::LoadEstimator;
use crate::{Estimate, Estimates, Settings, State};
use adapter_core::clock::SECOND_NS;
use adapter_core::{ChannelId, Sample, Slot, Value};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::collections::VecDeque;

const TICK_S: f64 = 0.1;
const PROGRAMMED: f64 = 200.0;

/// A cut whose power follows the feed, behind the moving average of a meter, and a machine whose feed follows what is asked for.
struct Loop {
    estimator: LoadEstimator,
    settings: Settings,
    estimates: Estimates,
    sample: Sample,
    rng: Pcg64Mcg,
    /// Feed over the programmed feed.
    feed: f64,
    powers: VecDeque<f64>,
    noise: f64,
    asked_pct: f64,
    /// The axes come to rest at the end of a block, whatever the override.
    stops: bool,
}

impl Loop {
    fn new(seed: u64, noise: f64, settings: Settings) -> Self {
        let (estimates, sample) = (Estimates::without_samples(0), Sample::new_empty(0));
        let rng = Pcg64Mcg::seed_from_u64(seed);
        let powers = VecDeque::from(vec![0.0; 5]);
        Self {
            estimator: LoadEstimator::default(),
            settings,
            estimates,
            sample,
            rng,
            feed: 1.0,
            powers,
            noise,
            asked_pct: 100.0,
            stops: false,
        }
    }

    fn set(&mut self, name: &str, value: Value) {
        self.sample.set_slot(ChannelId::from_name(name).expect("a channel"), Slot { value: Ok(value), age_ns: 0 });
    }

    /// One tick; `heaviness` is the cutting power at the programmed feed, W. Gives what is asked for, %.
    fn tick(&mut self, heaviness: f64, cutting: bool) -> f64 {
        // The gate: 50 %/s down, 10 %/s up.
        self.feed += (self.asked_pct / 100.0 - self.feed).clamp(-0.5 * TICK_S, 0.1 * TICK_S);
        let noise: f64 = (0..6).map(|_| self.rng.random_range(-1.0..1.0)).sum::<f64>() / 1.414;
        let power = heaviness * self.feed.powf(0.75) + noise * self.noise;
        self.powers.pop_front();
        self.powers.push_back(power);
        self.tick_as_it_is(cutting)
    }

    /// One tick at the feed and with the powers that are set.
    fn tick_as_it_is(&mut self, cutting: bool) -> f64 {
        self.sample.at_ns += SECOND_NS / 10;
        self.estimates.at_ns = self.sample.at_ns;
        let state = if cutting { State::Cutting } else { State::Idle };
        if state != self.estimates.state {
            (self.estimates.state, self.estimates.since_ns) = (state, self.sample.at_ns);
        }
        let mean = self.powers.iter().sum::<f64>() / 5.0;
        self.estimates.cutting_power_w = Ok(Estimate { value: mean.max(0.0), sd: 10.0 });
        let (feed, pct) = (PROGRAMMED * self.feed, if self.stops { 100.0 } else { 100.0 * self.feed });
        self.set("feed_mm_min", Value::Number(feed));
        self.set("feed_programmed_mm_min", Value::Number(PROGRAMMED));
        self.set("feed_override_pct", Value::Number(pct.round()));
        self.estimator.step(&self.sample, &mut self.estimates, &self.settings);
        let loads = &self.estimates.loads;
        self.asked_pct = loads.load_override_pct.or(loads.learned_override_pct).unwrap_or(100.0);
        self.asked_pct
    }
}

fn settings(target_w: f64, most_pct: f64) -> Settings {
    let mut settings = Settings::default();
    settings.set_value("constant_load_target_w", target_w).expect("in range");
    settings.set_value("constant_load_max_pct", most_pct).expect("in range");
    settings
}

/// A cut: seconds of ramp in, seconds of full depth, seconds of ramp out.
fn cut_at(at_s: f64, ramp_s: f64, full_s: f64) -> f64 {
    if at_s < ramp_s {
        at_s / ramp_s
    } else if at_s < ramp_s + full_s {
        1.0
    } else {
        (1.0 - (at_s - ramp_s - full_s) / ramp_s).max(0.0)
    }
}

#[derive(Default, Debug)]
struct Ramps {
    rises: u32,
    greatest_rise_pct: f64,
    changes: u32,
    minutes: f64,
    settled_pct: Vec<f64>,
}

/// Many cuts with ramps of this length.
fn ramps(ramp_s: f64, share: f64, noise: f64, most_pct: f64) -> Ramps {
    let mut found = Ramps::default();
    for seed in 0..20 {
        let mut machine = Loop::new(seed, noise * share * 1000.0, settings(1000.0, most_pct));
        for _ in 0..10 {
            machine.tick(0.0, false);
        }
        let (full_s, mut before, mut at_s) = (12.0, 100.0, 0.0);
        while at_s < full_s + 2.0 * ramp_s {
            let depth = cut_at(at_s, ramp_s, full_s);
            let pct = machine.tick(share * 1000.0 * depth, true);
            let in_ramp = depth < 0.999;
            if in_ramp && pct > before + 1e-9 {
                found.rises += 1;
                found.greatest_rise_pct = found.greatest_rise_pct.max(pct - before);
            }
            found.changes += u32::from((pct - before).abs() > 0.5);
            if (at_s - ramp_s - full_s + 0.2).abs() < 0.05 {
                found.settled_pct.push(pct);
            }
            before = pct;
            at_s += TICK_S;
        }
        found.minutes += at_s / 60.0;
    }
    found
}

#[test]
fn the_request_never_rises_in_a_ramp() {
    println!(
        "| ramp s | load of the target | noise | rises in ramps | decisions per minute | asked for at the end, % |"
    );
    for ramp_s in [0.5, 1.0, 2.0, 3.0, 4.0, 5.0] {
        for (share, noise) in [(0.7, 0.02), (0.25, 0.05), (0.12, 0.1), (1.5, 0.03)] {
            let found = ramps(ramp_s, share, noise, 110.0);
            let mean = found.settled_pct.iter().sum::<f64>() / found.settled_pct.len() as f64;
            let per_min = f64::from(found.changes) / found.minutes;
            println!("| {ramp_s} | {share} | {noise} | {} | {per_min:.1} | {mean:.1} |", found.rises);
            assert_eq!(found.rises, 0, "ramp {ramp_s} s, load {share}: {found:?}");
            assert!(per_min < 60.0, "{found:?}");
        }
    }
}

#[test]
fn a_light_cut_rises_to_what_is_allowed_and_a_heavy_one_to_the_target() {
    let at = |share: f64, most_pct: f64| {
        let mut machine = Loop::new(7, 10.0, settings(1000.0, most_pct));
        machine.tick(0.0, false);
        (0..300).map(|_| machine.tick(share * 1000.0, true)).last().expect("ticks")
    };
    assert_eq!(at(0.7, 110.0), 110.0);
    assert_eq!(at(0.7, 100.0), 100.0, "never faster unless chosen");
    let heavy = at(1.36, 110.0);
    assert!((heavy - 66.4).abs() < 3.0, "{heavy}");
    assert_eq!(at(3.0, 110.0), 60.0);
    assert_eq!(at(0.05, 110.0), 100.0, "air");
}

#[test]
fn a_step_of_depth_lowers_at_once_and_does_not_overshoot() {
    let mut machine = Loop::new(3, 15.0, settings(1000.0, 110.0));
    machine.tick(0.0, false);
    (0..60).for_each(|_| {
        machine.tick(900.0, true);
    });
    let steps: Vec<f64> = (0..40).map(|_| machine.tick(1300.0, true)).collect();
    let first = steps.iter().position(|pct| *pct < 95.0).expect("lowered");
    let least = steps.iter().copied().fold(f64::INFINITY, f64::min);
    println!("lowered after {:.1} s; least {least:.1} %, at the end {:.1} %", first as f64 * TICK_S, steps[39]);
    assert!(first <= 5 && least > 66.0, "{steps:?}");
}

#[test]
fn a_hard_spot_lowers_and_what_follows_rises_again() {
    let mut machine = Loop::new(4, 15.0, settings(1000.0, 100.0));
    machine.tick(0.0, false);
    (0..50).for_each(|_| {
        machine.tick(800.0, true);
    });
    let spot: Vec<f64> = (0..20).map(|_| machine.tick(1800.0, true)).collect();
    let after: Vec<f64> = (0..60).map(|_| machine.tick(800.0, true)).collect();
    assert!(spot[19] <= 62.0, "{spot:?}");
    let back = after.iter().position(|pct| *pct >= 100.0).expect("back");
    println!("back at 100 % {:.1} s after the hard spot", back as f64 * TICK_S);
    assert!((10..=40).contains(&back), "{after:?}");
}

fn text(machine: &mut Loop, name: &str, text: &str) {
    machine.set(name, Value::Text(text.into()));
}

/// Parts at one place, then one with so many times the power.
fn taught(machine: &mut Loop, parts: u32, power_w: f64) {
    text(machine, "program", "O1");
    text(machine, "tool", "T1-1");
    text(machine, "block", "N10");
    for part in 0..parts {
        machine.set("part_count", Value::Number(f64::from(part)));
        (0..10).for_each(|_| {
            machine.tick(0.0, false);
        });
        (0..100).for_each(|_| {
            machine.tick(power_w, true);
        });
    }
    machine.set("part_count", Value::Number(f64::from(parts)));
    (0..10).for_each(|_| {
        machine.tick(0.0, false);
    });
}

#[test]
fn what_was_learned_is_held_and_wear_and_lots_are_not() {
    let learned = || {
        let mut machine = Loop::new(5, 20.0, Settings::default());
        taught(&mut machine, 3, 1000.0);
        machine
    };
    for (share, asks) in [(1.0, false), (1.3, false), (1.45, false), (1.9, false), (2.4, true)] {
        let mut machine = learned();
        let least = (0..100).map(|_| machine.tick(share * 1000.0, true)).fold(f64::INFINITY, f64::min);
        assert_eq!(least < 99.0, asks, "{share}: {least}");
        let loads = machine.estimates.loads;
        let expected = 1000.0 * machine.feed.powf(0.75);
        let power_w = loads.learned_power_w.expect("learned");
        assert!((power_w / expected - 1.0).abs() < 0.05, "{power_w} at {} of the feed", machine.feed);
    }
    let mut machine = learned();
    text(&mut machine, "tool", "T2-1");
    (0..50).for_each(|_| {
        machine.tick(9000.0, true);
    });
    assert!(machine.estimates.loads.learned_power_w.is_err(), "another tool is learned by itself");
    text(&mut machine, "tool", "T1-2");
    machine.tick(1000.0, true);
    assert!(machine.estimates.loads.learned_power_w.is_ok(), "another edge of the tool is the same place");
    machine.estimator.learn_anew("O1");
    machine.tick(1000.0, true);
    assert!(machine.estimates.loads.learned_power_w.is_err(), "learned anew");
}

#[test]
fn what_was_learned_outlives_the_process() {
    let mut machine = Loop::new(6, 20.0, Settings::default());
    taught(&mut machine, 3, 1000.0);
    let stored = serde_json::to_value(&machine.estimator).expect("numbers and texts");
    machine.estimator = serde_json::from_value(stored).expect("of this version");
    (0..3).for_each(|_| {
        machine.tick(1000.0, true);
    });
    let power_w = machine.estimates.loads.learned_power_w.expect("still learned");
    assert!((power_w - 1000.0).abs() < 40.0, "{power_w}");
}

#[test]
fn at_the_least_feed_is_what_the_machine_does() {
    let mut machine = Loop::new(1, 1.0, settings(1000.0, 100.0));
    let in_force = |machine: &mut Loop, said: f64, feed: f64| {
        machine.sample.at_ns += SECOND_NS / 10;
        machine.set("feed_override_pct", Value::Number(said));
        machine.set("feed_mm_min", Value::Number(feed));
        machine.set("feed_programmed_mm_min", Value::Number(PROGRAMMED));
        machine.estimator.step(&machine.sample, &mut machine.estimates, &machine.settings);
        machine.estimates.loads.feed_in_force_pct.expect("known")
    };
    assert_eq!(in_force(&mut machine, 60.0, 120.0), 60.0);
    assert_eq!(in_force(&mut machine, 100.0, 80.0), 100.0, "a corner is no override");
    assert_eq!(in_force(&mut machine, 60.0, 200.0), 100.0, "an override that does not act");
}

/// Blocks end at any moment of a cut: the feed falls to nothing within a tick or more, the power follows later, and the drive shows a peak of
/// up to twice the load. The axes are slower than anything that would be asked for, so nothing is asked for.
#[test]
fn the_end_of_a_block_asks_for_no_other_feed() {
    for seed in 0..200 {
        let mut machine = Loop::new(seed, 15.0, settings(1000.0, 100.0));
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        machine.tick(0.0, false);
        let ticks = rng.random_range(2..60);
        (0..ticks).for_each(|_| {
            assert_eq!(machine.tick(850.0, true), 100.0, "seed {seed}: a cut below its target");
        });
        let peak = rng.random_range(1.0..2.0);
        let stops_in = rng.random_range(1..4);
        machine.stops = true;
        for tick in 1..=6 {
            // The feed is that between two readings of the control; the loop would raise it again.
            machine.feed = (1.0 - f64::from(tick) / f64::from(stops_in)).max(0.0);
            let feed = machine.feed;
            let power_w = 850.0 * if feed < 0.6 { peak } else { 1.0 };
            machine.powers.iter_mut().for_each(|power| *power = power_w);
            let asked = machine.tick_as_it_is(true);
            assert!(asked > 99.0, "seed {seed}, {tick} ticks after the end began, feed {feed}: {asked}");
        }
    }
}
