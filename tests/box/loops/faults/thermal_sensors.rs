//! The temperatures of a thermal law over a day in which one sensor is lost, jumps, or freezes: of the simulated lathe, and of a machine
//! of another maker, whose heat goes by laws of its own.

use super::super::thermal::{Look, SENSORS, identify_law_of, look, machine};
use super::{Counted, Told};
use adapters::Absence;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use rules::estimators::thermal::{SensorFault, SensorModel, SensorWatch, ThermalLaw};
use std::f64::consts::TAU;

type Run = fn(u64) -> Counted;

pub(super) const MACHINES: [(&str, Run); 2] =
    [("temperatures of a lathe", run_lathe), ("temperatures of another maker", run_foreign)];

const STEP_S: i64 = 5;
/// A day of six hours; the fault comes after one to two of them.
const DAY_S: i64 = 6 * 3600;
/// The box tells of a sensor that is lost after so long, s.
const LOST_S: i64 = 30;

const FAULTS: [(&str, SensorFault); 3] = [
    ("a temperature is lost", SensorFault::Lost),
    ("a temperature jumps by 20 K", SensorFault::Jumped),
    ("a temperature freezes", SensorFault::Frozen),
];

fn run_lathe(seed: u64) -> Counted {
    let identified = machine(11);
    let law = identify_law_of(&mut |at_s, dice| look(&identified, at_s, dice), 11, 8);
    let mut counted = Counted::default();
    for (name, fault) in FAULTS {
        let machine = machine(200 + seed);
        counted.watch_day(&law, (name, fault), seed, &mut |at_s, dice| look(&machine, at_s, dice));
    }
    counted
}

fn run_foreign(seed: u64) -> Counted {
    let mut identified = ForeignHeat::new(11);
    let law = identify_law_of(&mut |at_s, dice| identified.look(at_s, dice), 11, 8);
    let mut counted = Counted::default();
    for (name, fault) in FAULTS {
        let mut heat = ForeignHeat::new(200 + seed);
        counted.watch_day(&law, (name, fault), seed, &mut |at_s, dice| heat.look(at_s, dice));
    }
    counted
}

impl Counted {
    /// A day with this fault of one of its sensors.
    fn watch_day(
        &mut self,
        law: &ThermalLaw,
        (name, fault): (&'static str, SensorFault),
        seed: u64,
        look: &mut Look<'_>,
    ) {
        let mut dice = Pcg64Mcg::seed_from_u64(seed);
        // Those that the law looks at, as the box watches them.
        let watched: Vec<usize> =
            (0..SENSORS.len()).filter(|at| law.terms.iter().any(|it| it.sensor == SENSORS[*at])).collect();
        let names: Vec<&str> = watched.iter().map(|at| SENSORS[*at]).collect();
        let mut watch = SensorWatch::new(SensorModel::from_law(law, &names), names.len());
        let from_s = dice.random_range(3600..7200) / STEP_S * STEP_S;
        let sensor = dice.random_range(0..watched.len());
        let (mut told_s, mut stands_at) = (None, None);
        for at_s in (STEP_S..DAY_S).step_by(STEP_S as usize) {
            let (all_c, _) = look(at_s, &mut dice);
            let mut temperatures_c: Vec<f64> = watched.iter().map(|at| all_c[*at]).collect();
            let mut read: Vec<Result<f64, Absence>> = temperatures_c.iter().copied().map(Ok).collect();
            if at_s >= from_s {
                let stood = *stands_at.get_or_insert(temperatures_c[sensor]);
                temperatures_c[sensor] =
                    if fault == SensorFault::Frozen { stood } else { temperatures_c[sensor] + 20.0 };
                read[sensor] =
                    if fault == SensorFault::Lost { Err(Absence::Timeout) } else { Ok(temperatures_c[sensor]) };
            }
            watch.replace_doubted(at_s * 1_000_000_000, &mut read);
            let due = |since_ns: i64| fault != SensorFault::Lost || at_s - since_ns / 1_000_000_000 >= LOST_S;
            let doubted = watch.list_doubted().iter().find(|it| due(it.since_ns));
            if at_s < from_s {
                self.healthy_s += STEP_S as f64;
                self.false_alarms.extend(doubted.map(|it| format!("{at_s} s: {}", names[it.sensor])));
            } else if doubted.is_some_and(|it| it.sensor == sensor) {
                told_s = Some((at_s - from_s) as f64);
                break;
            }
        }
        self.told.push(Told { fault: name, after_s: told_s, by: "watch of the sensors".to_owned() });
    }
}

/// Heat of a machine of another maker: its bearing warms with the square of the speed, its motor with the load, and a column that nobody
/// measures follows both and the hall. Its sensors show tenths of a kelvin.
struct ForeignHeat {
    dice: Pcg64Mcg,
    at_s: i64,
    /// Until when speed and load are as they are, as shares of the greatest.
    until_s: i64,
    speed: f64,
    load: f64,
    phase: f64,
    bearing_c: f64,
    motor_c: f64,
    column_c: f64,
}

impl ForeignHeat {
    fn new(seed: u64) -> Self {
        let mut dice = Pcg64Mcg::seed_from_u64(88_000 + seed);
        let phase = dice.random_range(0.0..1.0);
        Self { dice, at_s: 0, until_s: 0, speed: 0.0, load: 0.0, phase, bearing_c: 20.0, motor_c: 20.0, column_c: 20.0 }
    }

    fn air_c(&self) -> f64 {
        21.0 + 2.5 * (TAU * (self.at_s as f64 / 36_000.0 + self.phase)).sin()
    }

    fn advance(&mut self) {
        self.at_s += STEP_S;
        if self.at_s >= self.until_s {
            self.until_s = self.at_s + self.dice.random_range(300..2400);
            let stands = self.dice.random_bool(0.2);
            self.speed = if stands { 0.0 } else { self.dice.random_range(0.3..1.0) };
            self.load = if stands { 0.0 } else { self.dice.random_range(0.1..1.0) };
        }
        let air_c = self.air_c();
        let toward = |now: f64, to: f64, tau_s: f64| now + (to - now) * STEP_S as f64 / tau_s;
        self.bearing_c = toward(self.bearing_c, air_c + 4.0 + 24.0 * self.speed * self.speed, 700.0);
        self.motor_c = toward(self.motor_c, air_c + 6.0 + 34.0 * self.load * self.speed.sqrt(), 1500.0);
        let column_c = air_c + 0.35 * (self.bearing_c - air_c) + 0.1 * (self.motor_c - air_c);
        self.column_c = toward(self.column_c, column_c, 3600.0);
    }

    fn look(&mut self, at_s: i64, dice: &mut Pcg64Mcg) -> ([f64; 3], f64) {
        while self.at_s < at_s {
            self.advance();
        }
        let mut show = |true_c: f64| (10.0 * (true_c + 0.12 * dice.sample::<f64, _>(StandardNormal))).round() / 10.0;
        let error_um = 1.1 * (self.bearing_c - 20.0) + 1.8 * (self.column_c - 20.0) - 0.7 * (self.air_c() - 20.0);
        ([self.bearing_c, self.motor_c, self.air_c()].map(&mut show), error_um)
    }
}
