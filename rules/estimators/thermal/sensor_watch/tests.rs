//! Days of a machine whose sensors fail: the compensated error is held against the uncompensated one.

use super::*;
use crate::thermal::{Path, ThermalLaw, ThermalTerm};
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const NAMES: [&str; 3] = ["motor_temperature_c", "temperature_1_c", "temperature_2_c"];
const SLOPES: [f64; 3] = [0.9, 2.0, -1.5];
const INTERCEPT_UM: f64 = -20.0;
const STEP_S: usize = 10;

/// Temperatures of a day without noise: a duty cycle of the motor, a housing behind it, a bed behind that; `air_c` in the morning.
fn day(seed: u64, air_c: f64, hours: usize) -> Vec<[f64; 3]> {
    let mut dice = Pcg64Mcg::seed_from_u64(seed);
    let (mut motor, mut housing, mut bed, mut load) = (air_c, air_c, air_c, 0.0);
    let toward = |from: f64, to: f64, tau_s: f64| from + (to - from) * STEP_S as f64 / tau_s;
    (0..hours * 3600 / STEP_S)
        .map(|step| {
            if step % 120 == 0 {
                load = dice.random_range(0.0..1.0);
            }
            let air = air_c + 4.0 * (step * STEP_S) as f64 / 28_800.0;
            motor = toward(motor, air + 25.0 * load, 1500.0);
            housing = toward(housing, 0.6 * air + 0.4 * motor, 3000.0);
            bed = toward(bed, 0.8 * air + 0.2 * housing, 9000.0);
            [motor, housing, bed]
        })
        .collect()
}

fn true_error_um(temperatures_c: &[f64; 3]) -> f64 {
    INTERCEPT_UM + temperatures_c.iter().zip(SLOPES).map(|(it, slope)| it * slope).sum::<f64>()
}

/// The law of three such days, with the covariance that least squares gives.
fn law() -> ThermalLaw {
    let rows: Vec<[f64; 3]> =
        [(1, 17.0), (2, 20.0), (3, 23.0)].iter().flat_map(|(seed, air)| day(*seed, *air, 8)).collect();
    let column = |at: usize, row: &[f64; 3]| if at == 0 { 1.0 } else { row[at - 1] };
    let product = |a: usize, b: usize| rows.iter().map(|row| column(a, row) * column(b, row)).sum::<f64>();
    let sums: Vec<Vec<f64>> = (0..4).map(|a| (0..4).map(|b| product(a, b)).collect()).collect();
    let covariance = crate::thermal::sensor_model::invert_matrix(&sums).expect("it can be inverted");
    let range = |at: usize| {
        let values = rows.iter().map(|row| row[at]);
        (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max))
    };
    let term = |at: usize| ThermalTerm {
        sensor: NAMES[at].to_owned(),
        path: Path::Direct,
        um_per_k: SLOPES[at],
        interval: (SLOPES[at] - 0.1, SLOPES[at] + 0.1),
        range_c: range(at),
    };
    ThermalLaw {
        intercept_um: INTERCEPT_UM,
        intercept_interval: (-21.0, -19.0),
        tau_s: None,
        tau_interval_s: None,
        residual_sd_um: 1.0,
        law_sd_max_um: 0.1,
        lag_spread_k: 0.0,
        terms: (0..3).map(term).collect(),
        covariance,
    }
}

/// What a day with a fault gives.
#[derive(Debug, Default)]
struct Day {
    /// Root mean square after the fault began, and greatest, um.
    compensated_um: (f64, f64),
    uncompensated_um: (f64, f64),
    /// Seconds until it was told, and of which sensor and fault.
    told: Option<(usize, SensorFault, usize)>,
    /// Looks at which a sensor without a fault was doubted.
    false_doubts: usize,
}

/// A day of eight hours; `spoil` gives what the failing sensor shows in the place of its value, after four hours.
fn run_day(seed: u64, air_c: f64, sensor: usize, spoil: impl Fn(f64, f64) -> Option<f64>) -> Day {
    let model = SensorModel::from_law(&law(), &NAMES).expect("the law tells how its temperatures go together");
    let mut watch = SensorWatch::new(Some(model), NAMES.len());
    let mut dice = Pcg64Mcg::seed_from_u64(100 + seed);
    let mut found = Day::default();
    let (mut at_fault, mut squares, mut count) = (None, (0.0, 0.0), 0.0);
    for (step, true_c) in day(seed, air_c, 8).iter().enumerate() {
        let at_s = step * STEP_S;
        let noisy = true_c.map(|it| ((it + 0.1 * dice.sample::<f64, _>(StandardNormal)) * 100.0).round() / 100.0);
        let mut temperatures: Vec<Result<f64, Absence>> = noisy.iter().map(|it| Ok(*it)).collect();
        let failed = at_s >= 4 * 3600;
        if failed {
            let before = *at_fault.get_or_insert(noisy[sensor]);
            temperatures[sensor] = spoil(before, noisy[sensor]).ok_or(Absence::Timeout);
        }
        watch.replace_doubted(at_s as i64 * SECOND_NS, &mut temperatures);
        let wrong = watch.list_doubted().iter().filter(|it| it.sensor != sensor || !failed).count();
        found.false_doubts += wrong;
        if !failed {
            continue;
        }
        let first = watch.list_doubted().iter().find(|it| it.sensor == sensor);
        found.told = found.told.or(first.map(|it| (it.sensor, it.fault, at_s - 4 * 3600)));
        let predicted: f64 =
            INTERCEPT_UM + temperatures.iter().zip(SLOPES).map(|(it, slope)| it.unwrap_or(0.0) * slope).sum::<f64>();
        let (error, without) = (true_error_um(true_c) - predicted, true_error_um(true_c));
        squares = (squares.0 + error * error, squares.1 + without * without);
        count += 1.0;
        found.compensated_um.1 = found.compensated_um.1.max(error.abs());
        found.uncompensated_um.1 = found.uncompensated_um.1.max(without.abs());
    }
    found.compensated_um.0 = (squares.0 / count).sqrt();
    found.uncompensated_um.0 = (squares.1 / count).sqrt();
    found
}

#[test]
fn a_sensor_that_is_lost_jumps_or_freezes_is_told_and_the_error_stays_below_the_uncompensated_one() {
    for (sensor, sensor_name) in NAMES.into_iter().enumerate() {
        for seed in 10..14 {
            let lost = run_day(seed, 20.0, sensor, |_, _| None);
            let jump = run_day(seed, 20.0, sensor, |_, _| Some(85.0));
            let higher = run_day(seed, 20.0, sensor, |_, now| Some(now + 15.0));
            let frozen = run_day(seed, 20.0, sensor, |before, _| Some(before));
            for (name, day, fault, within_s) in [
                ("lost", &lost, SensorFault::Lost, 0),
                ("85 C", &jump, SensorFault::Jumped, 0),
                ("15 K more", &higher, SensorFault::Jumped, 0),
                ("frozen", &frozen, SensorFault::Frozen, 2 * 3600),
            ] {
                println!("{name} {sensor_name} seed {seed}: {day:?}");
                assert_eq!(day.false_doubts, 0, "{name} {sensor} {seed}");
                assert!(day.compensated_um.0 < day.uncompensated_um.0, "{name} {sensor} {seed}: {day:?}");
                assert!(day.compensated_um.1 < day.uncompensated_um.1, "{name} {sensor} {seed}: {day:?}");
                let told = day.told.filter(|(_, known, after_s)| *known == fault && *after_s <= within_s);
                // A bed that hardly moves is the same whether it is frozen or not.
                assert!(
                    told.is_some() || (name == "frozen" && day.compensated_um.1 < 6.0),
                    "{name} {sensor} {seed}: {day:?}"
                );
            }
        }
    }
}

/// A colder and a hotter day than any of the identification: no sensor is doubted.
#[test]
fn another_day_is_no_fault() {
    for (seed, air_c) in (20..32).zip([5.0, 10.0, 14.0, 20.0, 26.0, 32.0].into_iter().cycle()) {
        let day = run_day(seed, air_c, 0, |_, now| Some(now));
        assert_eq!((day.false_doubts, day.told), (0, None), "{air_c} C: {day:?}");
    }
}

/// A sensor that was away for ten minutes is believed again at once, one that shows another value after minutes of agreement.
#[test]
fn a_sensor_that_comes_back_is_believed_again() {
    let model = SensorModel::from_law(&law(), &NAMES);
    let mut watch = SensorWatch::new(model, NAMES.len());
    let mut doubted_at = Vec::new();
    for (step, true_c) in day(40, 20.0, 3).iter().enumerate() {
        let at_s = step * STEP_S;
        let mut temperatures: Vec<Result<f64, Absence>> = true_c.iter().map(|it| Ok(*it)).collect();
        match at_s {
            3600..4200 => temperatures[1] = Err(Absence::Timeout),
            6000..6100 => temperatures[1] = Ok(90.0),
            _ => {}
        }
        watch.replace_doubted(at_s as i64 * SECOND_NS, &mut temperatures);
        doubted_at.extend(watch.list_doubted().iter().map(|it| (it.sensor, at_s)));
    }
    assert!(doubted_at.iter().all(|(sensor, at_s)| *sensor == 1 && (3600..6200).contains(at_s)), "{doubted_at:?}");
    assert!(!doubted_at.iter().any(|(_, at_s)| (4200..6000).contains(at_s)), "{doubted_at:?}");
}

/// Sources answer one after the other, at the start and after a night in which the machine was off: nobody is doubted for it, and what
/// they show is what counts.
#[test]
fn sensors_that_come_one_after_the_other_are_believed_from_their_first_value() {
    for (off_s, air_c) in [(60, 20.0), (12 * 3600, 14.0), (12 * 3600, 30.0)] {
        let mut watch = SensorWatch::new(SensorModel::from_law(&law(), &NAMES), NAMES.len());
        let mut at_s = 0;
        for (morning, day_air_c) in [(1, 20.0), (2, air_c)] {
            for (step, true_c) in day(50 + morning, day_air_c, 3).iter().enumerate() {
                at_s += STEP_S as i64;
                let come = |sensor: usize| step >= 2 * sensor;
                let seen: Vec<_> =
                    (0..3).map(|it| if come(it) { Ok(true_c[it]) } else { Err(Absence::NotYetRead) }).collect();
                let mut temperatures = seen.clone();
                watch.replace_doubted(at_s * SECOND_NS, &mut temperatures);
                let doubted: Vec<usize> = watch.list_doubted().iter().map(|it| it.sensor).collect();
                // After a minute they are cold at once, which no heat explains: only a night does.
                if morning == 1 || off_s > 600 {
                    assert!(doubted.iter().all(|it| !come(*it)), "{off_s} {air_c} {morning} {step}: {doubted:?}");
                    let same = (0..3).filter(|it| come(*it)).all(|it| temperatures[it] == seen[it]);
                    assert!(same, "{off_s} {air_c} {morning} {step}: {temperatures:?}");
                }
            }
            at_s += off_s;
            watch.replace_doubted(at_s * SECOND_NS, &mut [Err(Absence::MachineOff); 3]);
        }
    }
}

#[test]
fn a_law_that_does_not_tell_has_no_model() {
    let mut law = law();
    for (at, row) in law.covariance.iter_mut().enumerate() {
        row.iter_mut().enumerate().for_each(|(column, entry)| *entry = if column == at { 1e-4 } else { 0.0 });
    }
    assert_eq!(SensorModel::from_law(&law, &NAMES), None);
    let mut watch = SensorWatch::new(None, 3);
    let mut temperatures = vec![Ok(20.0), Ok(21.0), Ok(22.0)];
    assert_eq!(watch.replace_doubted(0, &mut temperatures), 0.0);
    temperatures[1] = Ok(60.0);
    watch.replace_doubted(SECOND_NS, &mut temperatures);
    assert_eq!(temperatures, [Ok(20.0), Err(Absence::OutOfRange), Ok(22.0)]);
}

/// Sensors of many kinds without a model: noise of .02 to .3 K, steps of .01 to .5 K. One that shows noise is told when it freezes; one with coarse
/// steps may stand still for hours, and is not told without the others.
#[test]
fn a_sensor_whose_noise_is_gone_is_told_without_the_others() {
    let mut told_of = [0, 0];
    for seed in 0..40 {
        let mut dice = Pcg64Mcg::seed_from_u64(700 + seed);
        let (noise_k, step_k) = (dice.random_range(0.02..0.3), dice.random_range(0.01..0.5));
        let mut watch = SensorWatch::new(None, 1);
        let (mut stood, mut told_s) = (None, None);
        for (step, true_c) in day(seed, 20.0, 8).iter().enumerate() {
            let at_s = step * STEP_S;
            // The machine stands still in the last two hours before the fault: its temperature hardly changes.
            let warm_c = if at_s < 4 * 3600 { true_c[1] } else { 24.0 };
            let noisy = warm_c + noise_k * dice.sample::<f64, _>(StandardNormal);
            let mut shown = f64::round(noisy / step_k) * step_k;
            if at_s >= 6 * 3600 {
                shown = *stood.get_or_insert(shown);
            }
            watch.replace_doubted(at_s as i64 * SECOND_NS, &mut [Ok(shown)]);
            let frozen = watch.list_doubted().iter().any(|it| it.fault == SensorFault::Frozen);
            assert!(!frozen || at_s >= 6 * 3600, "{seed}: noise {noise_k} K, steps of {step_k} K, after {at_s} s");
            told_s = told_s.or(frozen.then_some(at_s.saturating_sub(6 * 3600)));
        }
        if noise_k > step_k {
            told_of[0] += 1;
            assert!(told_s.is_some_and(|it| it <= 1200), "{seed}: noise {noise_k} K, steps of {step_k} K: {told_s:?}");
        } else {
            told_of[1] += usize::from(told_s.is_some());
        }
    }
    println!("{} of 40 show noise beyond their steps and are told; of the others {}", told_of[0], told_of[1]);
    assert!(told_of[0] >= 5, "{told_of:?}");
}
