//! A spindle for tests: heat from random speeds, six temperature points with their own time constants, slow noise.

use super::course::{Course, Sensor};
use super::lagged::compute_lagged_states;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

pub(super) const STEP_S: f64 = 60.0;
/// Name, rise in kelvin at full speed, time constant in minutes.
const POINTS: [(&str, f64, f64); 6] = [
    ("motor_temperature_c", 16.0, 25.0),
    ("bearing_temperature_c", 12.0, 12.0),
    ("temperature_1_c", 9.0, 70.0),
    ("temperature_2_c", 8.9, 71.0),
    ("temperature_3_c", 4.0, 200.0),
    ("ambient_temperature_c", 0.0, 1.0),
];

/// Slow noise with white noise on top, um, and its memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rough {
    pub(super) slow_um: f64,
    pub(super) memory_s: f64,
    pub(super) white_um: f64,
}

pub(super) const ROUGH: Rough = Rough { slow_um: 1.5, memory_s: 1200.0, white_um: 0.3 };

pub(super) fn create_random(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

fn sample_normal(random: &mut Pcg64) -> f64 {
    StandardNormal.sample(random)
}

/// `runs` runs of `rows` rows each, a row a minute, half an hour apart; the error is still zero.
pub(super) fn warm_ups(random: &mut Pcg64, runs: usize, rows: usize) -> Course {
    let mut heats = [0.0; POINTS.len()];
    let mut values = vec![Vec::new(); POINTS.len()];
    let (mut clock_s, mut ranges) = (Vec::new(), Vec::new());
    let (mut speed, mut left) = (0.0_f64, 0);
    let phase = random.random_range(0.0..6.0);
    for minute in 0..runs * (rows + 30) {
        let resting = minute % (rows + 30) >= rows;
        if left == 0 {
            left = random.random_range(20..70);
            speed = if random.random_bool(0.3) { 0.0 } else { random.random_range(0.2..1.0) };
        }
        left -= 1;
        let ambient = 21.0 + 2.0 * (minute as f64 / 1440.0 * std::f64::consts::TAU + phase).sin();
        let heat = if resting { 0.0 } else { speed.powf(1.5) };
        for (at, (_, rise, tau)) in POINTS.iter().enumerate() {
            heats[at] += (heat - heats[at]) * (1.0 - (-1.0 / tau).exp());
            if !resting {
                values[at].push(ambient + rise * heats[at] + 0.03 * sample_normal(random));
            }
        }
        if !resting {
            clock_s.push(minute as f64 * STEP_S);
        }
    }
    ranges.extend((0..runs).map(|run| run * rows..(run + 1) * rows));
    let sensors = POINTS.iter().zip(values).map(|((name, ..), values)| Sensor::new(*name, values)).collect();
    let zero = vec![0.0; clock_s.len()];
    Course::new(clock_s, ranges, true, zero, sensors)
}

/// The same course with an error: a constant, um/K on sensors by name, late by `tau_s` unless that is zero.
pub(super) fn with_error(
    random: &mut Pcg64,
    course: &Course,
    law: (f64, &[(&str, f64)]),
    tau_s: f64,
    rough: Rough,
) -> Course {
    let mut error = vec![law.0; course.rows()];
    for (name, um_per_k) in law.1 {
        let sensor = course.sensors().iter().find(|sensor| sensor.name == *name).expect("a sensor");
        let seen =
            if tau_s > 0.0 { compute_lagged_states(course, &sensor.values, tau_s) } else { sensor.values.clone() };
        error.iter_mut().zip(seen).for_each(|(error, value)| *error += um_per_k * value);
    }
    let mut slow = rough.slow_um * sample_normal(random);
    for (row, error) in error.iter_mut().enumerate() {
        let decay = course.since_s(row).map_or(0.0, |dt_s| (-dt_s / rough.memory_s).exp());
        slow = decay * slow + (1.0 - decay * decay).sqrt() * rough.slow_um * sample_normal(random);
        *error += slow + rough.white_um * sample_normal(random);
    }
    let runs = course.runs().to_vec();
    Course::new(course.clock_s().to_vec(), runs, course.pauses_known(), error, course.sensors().to_vec())
}
