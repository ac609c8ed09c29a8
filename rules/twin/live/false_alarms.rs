//! How often a healthy machine is called different, and how soon a changed one is: counted over simulated weeks.

use super::block::SettledSecond;
use super::regime::Regime;
use super::watch::{Mismatch, Notice, Watch};
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal, StudentT};
use rand_pcg::Pcg64Mcg;

/// Healthy noise of unit standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    White,
    /// AR(1) of .97 per second.
    Slow,
    /// The same under a white meter.
    SlowAndWhite,
    /// Student's t with three degrees of freedom, and a pulse of 30 deviations every few minutes.
    HeavyAndPulses,
    /// Read in steps of one deviation.
    Coarse,
    /// Another level every 40 minutes, as lots of material have, under white noise of the same size.
    Lots,
    /// A level that wanders with a memory of 40 minutes, under white noise of the same size.
    Wander,
}

const ALL: [Kind; 7] =
    [Kind::White, Kind::Slow, Kind::SlowAndWhite, Kind::HeavyAndPulses, Kind::Coarse, Kind::Lots, Kind::Wander];

struct SimulatedNoise {
    kind: Kind,
    rng: Pcg64Mcg,
    slow: f64,
    left_s: u32,
}

impl SimulatedNoise {
    fn next(&mut self) -> f64 {
        let normal = |rng: &mut Pcg64Mcg| -> f64 { StandardNormal.sample(rng) };
        let white = normal(&mut self.rng);
        let memory = |slow: f64, keep: f64, kick: f64| slow * keep + kick * (1.0 - keep * keep).sqrt();
        match self.kind {
            Kind::White => white,
            Kind::Slow | Kind::SlowAndWhite => {
                self.slow = memory(self.slow, 0.97, white);
                if self.kind == Kind::Slow { self.slow } else { self.slow + normal(&mut self.rng) }
            }
            Kind::HeavyAndPulses => {
                let heavy: f64 = StudentT::new(3.0).expect("a distribution").sample(&mut self.rng);
                let pulse = if self.rng.random_bool(0.005) { 30.0 } else { 0.0 };
                heavy / 1.7 + pulse
            }
            Kind::Coarse => (white + 0.3).round(),
            Kind::Lots => {
                if self.left_s == 0 {
                    self.left_s = 2400;
                    self.slow = self.rng.random_range(-1.7..1.7);
                }
                self.left_s -= 1;
                self.slow + white
            }
            Kind::Wander => {
                self.slow = memory(self.slow, (-1.0_f64 / 2400.0).exp(), normal(&mut self.rng));
                self.slow + white
            }
        }
    }
}

/// A machine that idles, cuts with two tools and stands, minute after minute.
struct Machine {
    noise: SimulatedNoise,
    at_s: f64,
    watch: Watch,
}

impl Machine {
    fn new(kind: Kind, seed: u64) -> Self {
        let noise = SimulatedNoise { kind, rng: Pcg64Mcg::seed_from_u64(seed), slow: 0.0, left_s: 0 };
        Self { noise, at_s: 0.0, watch: Watch::default() }
    }

    /// So many hours with `shift` deviations added in the cut; what was noticed.
    fn run(&mut self, hours: f64, shift: f64) -> Vec<(f64, Notice)> {
        let until_s = self.at_s + hours * 3600.0;
        let mut noticed = Vec::new();
        while self.at_s < until_s {
            self.at_s += 1.0;
            let (regime, work, speed) = match self.at_s as u64 % 300 {
                0..50 => (Regime::Standby, "", 0.0),
                50..110 => (Regime::Idle, "", 800.0),
                110..210 => (Regime::Cutting, "T1", 800.0),
                _ => (Regime::Cutting, "T2", 1200.0),
            };
            let change = if regime == Regime::Cutting { shift } else { 0.0 };
            // Noise of a tenth of the output, so that the least band is a fifth of a deviation.
            let residual = 10.0 * (self.noise.next() + change);
            let second = SettledSecond { at_s: self.at_s, expected: 100.0, residual };
            let notice = self.watch.update_with_second(Some((regime, work.to_owned())), speed, second);
            noticed.extend(notice.map(|notice| (self.at_s, notice)));
        }
        noticed
    }
}

fn list_mismatches(noticed: &[(f64, Notice)]) -> impl Iterator<Item = (f64, &Mismatch)> {
    noticed.iter().filter_map(|(at_s, notice)| match notice {
        Notice::Begins(mismatch) => Some((*at_s, mismatch)),
        _ => None,
    })
}

#[test]
fn a_healthy_machine_is_called_different_about_once_in_thirty_days_at_most() {
    const MACHINES: u64 = 10;
    const DAYS: f64 = 7.0;
    let mut table = Vec::new();
    for kind in ALL {
        let alarms = |seed| {
            let mut machine = Machine::new(kind, seed);
            let learned = machine.run(9.0, 0.0);
            assert!(list_mismatches(&learned).count() == 0, "{kind:?} {seed}: {learned:?}");
            list_mismatches(&machine.run(24.0 * DAYS, 0.0)).count()
        };
        let count: usize = (1..=MACHINES).map(alarms).sum();
        table.push((kind, count, count as f64 * 30.0 / (DAYS * MACHINES as f64)));
    }
    for (kind, count, rate) in &table {
        println!("{kind:?}: {count} in {} days, {rate:.2} in 30 days", DAYS * MACHINES as f64);
    }
    assert!(table.iter().all(|(_, _, rate)| *rate <= 1.0), "{table:?}");
}

#[test]
fn a_change_is_noticed_within_the_hour_and_its_onset_lies_in_the_interval() {
    for (kind, deviations) in [
        (Kind::White, 0.6),
        (Kind::Slow, 3.0),
        (Kind::SlowAndWhite, 3.0),
        (Kind::HeavyAndPulses, 1.0),
        (Kind::Lots, 7.0),
    ] {
        let (mut seen, mut covered, mut delay_s) = (0, 0, 0.0);
        for seed in 1..=10 {
            let mut machine = Machine::new(kind, 100 + seed);
            machine.run(12.0, 0.0);
            let changed_s = machine.at_s;
            let noticed = machine.run(3.0, deviations);
            let Some((at_s, mismatch)) = list_mismatches(&noticed).next() else { continue };
            let onset = mismatch.onset.expect("the start was healthy");
            seen += 1;
            delay_s += at_s - changed_s;
            covered += usize::from((onset.low_s..=onset.high_s).contains(&changed_s));
            assert_eq!(mismatch.regime, Regime::Cutting);
            assert!(mismatch.mean > 0.0);
        }
        println!(
            "{kind:?} + {deviations}: {seen} of 10, onset in its interval {covered}, after {:.0} s",
            delay_s / f64::from(seen)
        );
        assert!(seen >= 9, "{kind:?}: {seen}");
        assert!(covered >= 8, "{kind:?}: {covered} of {seen}");
    }
}

#[test]
fn a_change_that_goes_away_is_taken_back() {
    let mut machine = Machine::new(Kind::White, 5);
    machine.run(12.0, 0.0);
    assert_eq!(list_mismatches(&machine.run(1.0, 1.0)).count(), 1);
    let after = machine.run(2.0, 0.0);
    assert!(after.iter().any(|(_, notice)| *notice == Notice::Ends(Regime::Cutting)), "{after:?}");
    assert_eq!(list_mismatches(&machine.run(12.0, 0.0)).count(), 0);
}

#[test]
fn what_was_learned_survives_a_restart() {
    let mut machine = Machine::new(Kind::SlowAndWhite, 9);
    machine.run(12.0, 0.0);
    let text = serde_json::to_string(&machine.watch.to_state()).expect("plain data");
    machine.watch = Watch::new(serde_json::from_str(&text).expect("the same"));
    assert_eq!(list_mismatches(&machine.run(1.0, 3.0)).count(), 1);
}
