//! The published order, the arithmetic by hand, and the weakness that is known.

use super::*;

fn series<'a>(names: &'a [String], columns: &'a [Vec<f64>]) -> Vec<Series<'a>> {
    names.iter().zip(columns).map(|(name, values)| Series { name, values }).collect()
}

/// A warm-up over five hours, a row every five minutes: `rise * (1 - exp(-t / tau))` above `start`.
fn warm_up(start: f64, rise: f64, tau_min: f64) -> Vec<f64> {
    (0..60).map(|row| start + rise * (1.0 - (-f64::from(row) * 5.0 / tau_min).exp())).collect()
}

fn graded(error: &[f64], columns: &[Vec<f64>], normalisation: Normalisation) -> Grades {
    let names: Vec<String> = (1..=columns.len()).map(|at| format!("temperature_{at}_c")).collect();
    compute_grades(error, &series(&names, columns), normalisation, RHO_USUAL).expect("gradable")
}

#[test]
fn the_arithmetic_is_that_of_the_formula() {
    let error: Vec<f64> = [10.0, 12.0, 14.0, 16.0].repeat(2);
    let columns = [[20.0, 22.0, 24.0, 30.0].repeat(2), [20.0, 20.0, 21.0, 22.0].repeat(2)];
    let got = graded(&error, &columns, Normalisation::InitialImage);
    // Images: error 1 1.2 1.4 1.6; first 1 1.1 1.2 1.5; second 1 1 1.05 1.1. Differences up to 0.5.
    let xi = |delta: f64| 0.25 / (delta + 0.25);
    let first = (xi(0.0) + xi(0.1) + xi(0.2) + xi(0.1)) / 4.0;
    let second = (xi(0.0) + xi(0.2) + xi(0.35) + xi(0.5)) / 4.0;
    assert!((got.grades[0].grade - first).abs() < 1e-12 && (got.grades[1].grade - second).abs() < 1e-12);
    assert_eq!(got.order_sensors(), ["temperature_1_c", "temperature_2_c"]);
    let same = graded(&error, &[error.iter().map(|e| 15.0 + e).collect()], Normalisation::Range);
    assert_eq!(same.grades[0].grade, 1.0, "the same curve");
}

#[test]
fn the_initial_image_prefers_the_greatest_rise_and_the_range_the_right_dynamics() {
    let error = warm_up(20.0, 60.0, 70.0);
    // The spindle motor rises most and too quickly; the box has the dynamics of the error.
    let (motor, box_, bed) = (warm_up(20.0, 16.0, 25.0), warm_up(20.0, 9.0, 70.0), warm_up(20.0, 3.0, 200.0));
    let columns = [motor, box_, bed];
    let image = graded(&error, &columns, Normalisation::InitialImage);
    let range = graded(&error, &columns, Normalisation::Range);
    assert_eq!(image.order_sensors()[0], "temperature_1_c", "the weakness: {image:?}");
    assert_eq!(range.order_sensors()[0], "temperature_2_c", "{range:?}");
    assert!(range.grades[1].grade > 0.97);
}

#[test]
fn grades_hang_on_the_first_value_of_the_error_and_that_is_said() {
    let columns = [warm_up(20.0, 16.0, 25.0), warm_up(20.0, 9.0, 70.0)];
    let from_20 = graded(&warm_up(20.0, 60.0, 70.0), &columns, Normalisation::InitialImage);
    assert!((from_20.grades[0].grade - from_20.grades[1].grade).abs() > 0.02, "{from_20:?}");
    let names = ["temperature_1_c".to_owned(), "temperature_2_c".to_owned()];
    let sensors = series(&names, &columns);
    for start in [0.0, 1.0] {
        let refused = compute_grades(&warm_up(start, 60.0, 70.0), &sensors, Normalisation::InitialImage, RHO_USUAL);
        let refused = refused.expect_err("nothing can be divided by that").to_string();
        assert!(refused.starts_with("thermal_error_um: begins at"), "{refused}");
        assert!(compute_grades(&warm_up(start, 60.0, 70.0), &sensors, Normalisation::Range, RHO_USUAL).is_ok());
    }
    for rho in [0.0, -1.0, 1.1, f64::NAN] {
        assert_eq!(
            compute_grades(&warm_up(20.0, 60.0, 70.0), &sensors, Normalisation::Range, rho)
                .expect_err("no such rho")
                .kind,
            RefusalKind::OutOfRange
        );
    }
}

#[test]
fn kelvin_would_level_the_grades_and_is_refused() {
    let kelvin = [warm_up(293.15, 16.0, 25.0)];
    let names = ["temperature_1_c".to_owned()];
    let refused =
        compute_grades(&warm_up(20.0, 60.0, 70.0), &series(&names, &kelvin), Normalisation::InitialImage, RHO_USUAL);
    assert!(refused.expect_err("kelvin").to_string().contains("looks like K"));
}

#[test]
fn a_sensor_that_falls_is_turned_over_by_the_range() {
    let error = warm_up(20.0, 60.0, 70.0);
    let falling: Vec<f64> = error.iter().map(|e| 60.0 - 0.5 * e).collect();
    let got = graded(&error, &[falling], Normalisation::Range);
    assert!((got.grades[0].grade - 1.0).abs() < 1e-12);
}
