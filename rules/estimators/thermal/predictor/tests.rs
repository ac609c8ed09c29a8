//! The law at work on thirteen points.

use super::*;
use crate::thermal::law::ThermalTerm;

const SECOND_NS: i64 = 1_000_000_000;

fn law(points: usize, path: Path) -> ThermalLaw {
    let term = |at: usize| ThermalTerm {
        sensor: format!("temperature_{}_c", at + 1),
        path,
        um_per_k: 1.0 + at as f64,
        interval: (0.9 + at as f64, 1.1 + at as f64),
        range_c: (20.0, 40.0),
    };
    let mut covariance = vec![vec![0.0; points + 1]; points + 1];
    covariance.iter_mut().enumerate().for_each(|(at, row)| row[at] = if at == 0 { 1.0 } else { 1e-4 });
    ThermalLaw {
        intercept_um: -100.0,
        intercept_interval: (-102.0, -98.0),
        tau_s: (path == Path::Lagged).then_some(600.0),
        tau_interval_s: None,
        residual_sd_um: 1.0,
        law_sd_max_um: 2.0,
        lag_spread_k: 2.0,
        terms: (0..points).map(term).collect(),
        covariance,
    }
}

fn predictor(law: ThermalLaw) -> Predictor {
    let names: Vec<String> = (1..=13).map(|at| format!("temperature_{at}_c")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    Predictor::new(law, &names).expect("a law of known sensors")
}

#[test]
fn thirteen_points_give_an_error_with_its_deviation() {
    let mut predictor = predictor(law(13, Path::Direct));
    let temperatures: Vec<Result<f64, Absence>> = (0..13).map(|at| Ok(25.0 + f64::from(at))).collect();
    let got = predictor.predict_error(0, &temperatures).expect("every sensor answers");
    let expected = -100.0 + (0..13).map(|at| (1.0 + f64::from(at)) * (25.0 + f64::from(at))).sum::<f64>();
    assert!((got.error_um.value - expected).abs() < 1e-9);
    assert!(got.error_um.sd >= 1.0 && got.law_sd_um > 0.0 && got.is_inside_range());
    let beside = got.compare_with_measured(Ok(expected + 1.0));
    assert!(beside.residual_um.is_ok_and(|it| (it.value - 1.0).abs() < 1e-9) && !beside.contradicts);
    assert!(got.compare_with_measured(Ok(expected + 50.0)).contradicts);
    assert_eq!(got.compare_with_measured(Err(Absence::Stale)).residual_um, Err(Absence::Stale));
}

#[test]
fn a_missing_sensor_is_a_reason_and_an_unused_one_is_none() {
    let mut predictor = predictor(law(4, Path::Direct));
    let mut temperatures = vec![Ok(25.0); 13];
    temperatures[9] = Err(Absence::Timeout);
    assert!(predictor.predict_error(0, &temperatures).is_ok(), "the tenth sensor is not in the law");
    temperatures[2] = Err(Absence::Stale);
    let missing = predictor.predict_error(0, &temperatures);
    assert_eq!(missing, Err(NoPrediction::Missing { sensor: 2, absence: Absence::Stale }));
    temperatures[2] = Ok(f64::NAN);
    assert_eq!(predictor.predict_error(0, &temperatures).map_err(NoPrediction::as_word), Err("input_missing"));
    temperatures[2] = Ok(298.15);
    assert_eq!(predictor.predict_error(0, &temperatures), Err(NoPrediction::Kelvin { sensor: 2 }));
    assert_eq!(predictor.predict_error(0, &temperatures[..5]), Err(NoPrediction::TooFew));
}

#[test]
fn temperatures_outside_the_range_are_flagged_alone_and_together() {
    let mut far = predictor(law(4, Path::Direct));
    let mut temperatures = vec![Ok(30.0); 13];
    assert!(far.predict_error(0, &temperatures).expect("a number").is_inside_range());
    temperatures[1] = Ok(45.0);
    let outside = far.predict_error(0, &temperatures).expect("a number, flagged").outside;
    assert_eq!(outside, Some(Outside::Sensor { sensor: 1, temperature_c: 45.0, range_c: (20.0, 40.0) }));
    let near = far.predict_error(0, &temperatures).expect("a number");
    assert!(
        !near.is_at_the_edge() && near.error_um.sd > 2.5,
        "five kelvin at 2 um/K, a quarter of that in doubt: {near:?}"
    );
    temperatures[1] = Ok(70.0);
    let edge = far.predict_error(0, &temperatures).expect("a number");
    let at_edge_um = near.error_um.value + 2.0 * (50.0 - 45.0);
    assert!(edge.is_at_the_edge() && (edge.safe_um - at_edge_um).abs() < 1e-9 && edge.error_um.sd > 10.0, "{edge:?}");
    // Two sensors that always rose together, one hot and one cold: each inside, together never seen.
    let mut pair = law(2, Path::Direct);
    pair.covariance = vec![vec![0.1, 0.0, 0.0], vec![0.0, 1.0, -0.999], vec![0.0, -0.999, 1.0]];
    let mut pair = predictor(pair);
    let mut temperatures = vec![Ok(30.0); 13];
    assert!(pair.predict_error(0, &temperatures).expect("a number").is_inside_range());
    temperatures[1] = Ok(22.0);
    assert_eq!(pair.predict_error(0, &temperatures).expect("a number").outside, Some(Outside::Combination));
}

#[test]
fn a_lagged_law_follows_late_and_is_unsure_of_its_beginning() {
    let mut late = predictor(law(1, Path::Lagged));
    let at = |predictor: &mut Predictor, t_s: i64, c: f64| {
        let mut temperatures = [Err(Absence::NotProvided); 13];
        temperatures[0] = Ok(c);
        predictor.predict_error(t_s * SECOND_NS, &temperatures).expect("the sensor answers")
    };
    let first = at(&mut late, 0, 20.0);
    assert!((first.error_um.value + 80.0).abs() < 1e-9 && first.error_um.sd > 2.0);
    let stepped = at(&mut late, 1, 30.0);
    assert!(stepped.error_um.value < -79.9, "the structure has not warmed yet");
    let after_tau = at(&mut late, 601, 30.0);
    assert!((after_tau.error_um.value + 80.0 - 10.0 * (1.0 - (-1.0_f64).exp())).abs() < 0.02, "{after_tau:?}");
    let settled = at(&mut late, 20_000, 30.0);
    assert!((settled.error_um.value + 70.0).abs() < 1e-6 && settled.error_um.sd < first.error_um.sd);
    let back = at(&mut late, 10_000, 35.0);
    assert!((back.error_um.value - settled.error_um.value).abs() < 1e-6, "time that goes back moves nothing");
}

#[test]
fn a_law_that_was_typed_in_wrong_is_refused() {
    let told = |change: &dyn Fn(&mut ThermalLaw)| {
        let mut law = law(2, Path::Direct);
        change(&mut law);
        Predictor::new(law, &["temperature_1_c", "temperature_2_c"]).expect_err("wrong").to_string()
    };
    assert!(told(&|law| law.terms[1].sensor = "oil_c".into()).starts_with("oil_c: no source delivers it"));
    assert!(told(&|law| law.covariance.truncate(2)).contains("not 3 by 3"));
    assert!(told(&|law| law.terms[0].path = Path::Lagged).contains("time constant"));
    assert!(told(&|law| law.residual_sd_um = f64::NAN).contains("number"));
    assert!(told(&|law| law.terms.clear()).contains("0 terms"));
}
