//! The temperatures of a thermal law over a day in which one sensor is lost, jumps, or freezes.

use super::super::thermal::{SENSORS, identify_law, look, machine};
use super::{Counted, Told};
use adapters::Absence;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rules::estimators::thermal::{SensorFault, SensorModel, SensorWatch};

pub(super) const NAME: &str = "temperatures of a lathe";

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

pub(super) fn run(seed: u64) -> Counted {
    let law = identify_law(11, 8);
    let mut counted = Counted::default();
    for (name, fault) in FAULTS {
        let (machine, mut dice) = (machine(200 + seed), Pcg64Mcg::seed_from_u64(seed));
        let mut watch = SensorWatch::new(SensorModel::from_law(&law, &SENSORS), SENSORS.len());
        let from_s = dice.random_range(3600..7200) / STEP_S * STEP_S;
        let sensor = dice.random_range(0..2_usize);
        let (mut told_s, mut stands_at) = (None, None);
        for at_s in (STEP_S..DAY_S).step_by(STEP_S as usize) {
            let (mut temperatures_c, _) = look(&machine, at_s, &mut dice);
            let mut read = temperatures_c.map(Ok);
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
                counted.healthy_s += STEP_S as f64;
                counted.false_alarms.extend(doubted.map(|it| format!("{at_s} s: {}", SENSORS[it.sensor])));
            } else if doubted.is_some_and(|it| it.sensor == sensor) {
                told_s = Some((at_s - from_s) as f64);
                break;
            }
        }
        counted.told.push(Told { fault: name, after_s: told_s, by: "watch of the sensors".to_owned() });
    }
    counted
}
