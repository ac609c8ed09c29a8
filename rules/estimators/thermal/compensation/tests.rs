//! Increments that add up, limits that hold, and what happens without a prediction.

use super::*;
use crate::estimate::Estimate;
use crate::thermal::predictor::Outside;
use proptest::prelude::*;

fn predicted(error_um: f64) -> ThermalPrediction {
    ThermalPrediction {
        error_um: Estimate { value: error_um, sd: 1.0 },
        law_sd_um: 0.1,
        safe_um: error_um,
        outside: None,
    }
}

fn settings() -> CompensationSettings {
    CompensationSettings { pulse_um: 0.7, limit_um: 50.0, slew_um_per_s: 2.0, dead_band_um: 1.0, ..Default::default() }
}

const RUNNING: AxisSituation = AxisSituation { bypass: false, reference_return: false };

/// Steps of a tenth of a second until the value stands.
fn settle(compensator: &mut Compensator, error_um: f64) -> (i64, CompensationStep) {
    let mut sum = 0;
    let mut last = compensator.advance_compensation(0.1, Some(&predicted(error_um)), RUNNING);
    sum += last.increment_pulses;
    for _ in 0..2000 {
        last = compensator.advance_compensation(0.1, Some(&predicted(error_um)), RUNNING);
        sum += last.increment_pulses;
    }
    (sum, last)
}

#[test]
fn the_increments_add_up_to_the_value_and_the_fraction_is_carried() {
    let mut compensator = Compensator::new(settings()).expect("settings");
    let (sum, last) = settle(&mut compensator, 20.0);
    assert_eq!(last.value_um, -20.0, "against the error");
    assert_eq!(sum, -28, "28 whole pulses of 0.7 um; 0.4 um are carried");
    assert!((last.remainder_um + 0.4).abs() < 1e-9 && (last.sent_um + 19.6).abs() < 1e-9);
    let (more, last) = settle(&mut compensator, 21.4);
    assert_eq!((more, last.value_um), (-2, -21.4), "the carried fraction came along");
}

#[test]
fn limits_hold_and_are_said() {
    let mut compensator = Compensator::new(settings()).expect("settings");
    let step = compensator.advance_compensation(0.5, Some(&predicted(-400.0)), RUNNING);
    assert!(step.clamped && (step.value_um - 1.0).abs() < 1e-12, "2 um/s for half a second: {step:?}");
    let pause = compensator.advance_compensation(3600.0, Some(&predicted(-400.0)), RUNNING);
    assert!((pause.value_um - 3.0).abs() < 1e-12, "a pause is no licence to jump");
    let (_, last) = settle(&mut compensator, -400.0);
    assert_eq!(last.value_um, 50.0);
    let (_, near) = settle(&mut compensator, -49.2);
    assert_eq!((near.value_um, near.standing), (50.0, Standing::DeadBand));
}

#[test]
fn without_a_prediction_the_value_stands_then_goes_home() {
    let mut compensator = Compensator::new(settings()).expect("settings");
    settle(&mut compensator, 20.0);
    let step = compensator.advance_compensation(0.1, None, RUNNING);
    assert_eq!((step.increment_pulses, step.value_um, step.standing), (0, -20.0, Standing::NoPrediction));
    assert_eq!(compensator.advance_compensation(0.1, Some(&predicted(f64::NAN)), RUNNING).value_um, -20.0);
    let gone = compensator.advance_compensation(700.0, None, RUNNING);
    assert_eq!(gone.standing, Standing::HeldTooLong);
    let home = (0..200).map(|_| compensator.advance_compensation(0.1, None, RUNNING)).last().expect("steps");
    assert_eq!((home.value_um, home.sent_um), (0.0, 0.0));
}

#[test]
fn outside_the_range_it_follows_and_far_outside_it_holds_the_edge() {
    let mut compensator = Compensator::new(settings()).expect("settings");
    let settle = |compensator: &mut Compensator, prediction: ThermalPrediction| {
        (0..400).map(|_| compensator.advance_compensation(0.1, Some(&prediction), RUNNING)).last().expect("steps")
    };
    let beyond = ThermalPrediction { outside: Some(Outside::Combination), ..predicted(30.0) };
    let step = settle(&mut compensator, beyond);
    assert_eq!((step.value_um, step.standing), (-30.0, Standing::Extrapolated));
    let far = ThermalPrediction { safe_um: 40.0, ..ThermalPrediction { outside: beyond.outside, ..predicted(49.0) } };
    let step = settle(&mut compensator, far);
    assert_eq!((step.value_um, step.standing), (-40.0, Standing::AtTheEdge));
    let unsure = Estimate { value: -20.0, sd: 25.0 };
    let step = settle(&mut compensator, ThermalPrediction { error_um: unsure, safe_um: -20.0, ..beyond });
    assert_eq!((step.value_um, step.standing), (-40.0, Standing::Doubted), "the last value that was safe stands");
}

#[test]
fn bypass_takes_everything_back() {
    let mut compensator = Compensator::new(settings()).expect("settings");
    let (sent, _) = settle(&mut compensator, 20.0);
    let bypass = AxisSituation { bypass: true, ..RUNNING };
    let back: i64 =
        (0..200).map(|_| compensator.advance_compensation(0.1, Some(&predicted(20.0)), bypass).increment_pulses).sum();
    assert_eq!(sent + back, 0);
}

#[test]
fn after_a_reference_return_the_value_is_sent_anew() {
    let mut compensator = Compensator::new(settings()).expect("settings");
    let (sent, _) = settle(&mut compensator, 20.0);
    let returning = AxisSituation { reference_return: true, ..RUNNING };
    let step = compensator.advance_compensation(0.1, Some(&predicted(20.0)), returning);
    assert_eq!((step.increment_pulses, step.sent_um, step.standing), (0, 0.0, Standing::ReferenceReturn));
    let (again, last) = settle(&mut compensator, 20.0);
    assert_eq!((again, last.value_um), (sent, -20.0));
}

#[test]
fn settings_that_cannot_work_are_refused() {
    let refused = |change: &dyn Fn(&mut CompensationSettings)| {
        let mut settings = settings();
        change(&mut settings);
        Compensator::new(settings).expect_err("cannot work").name
    };
    assert_eq!(refused(&|it| it.pulse_um = 0.0), "pulse_um");
    assert_eq!(refused(&|it| it.limit_um = 0.05), "limit_um");
    assert_eq!(refused(&|it| it.slew_um_per_s = -1.0), "slew_um_per_s");
    assert_eq!(refused(&|it| it.dead_band_um = f64::NAN), "dead_band_um");
    assert_eq!(refused(&|it| it.hold_s = f64::INFINITY), "hold_s");
    let wrong = CompensationSettings { limit_um: 0.05, ..settings() }.check_values().expect_err("millimetres");
    assert!(wrong.to_string().contains("is it in mm?"), "{wrong}");
}

proptest! {
    /// Whatever comes in: the sum of increments is never a whole pulse from the value, the value never beyond the limit,
    /// never faster than the slew limit.
    #[test]
    fn any_course_adds_up(course in proptest::collection::vec(
        (0.0_f64..3.0, proptest::option::of(-200.0_f64..200.0), 0_u8..20), 1..300)
    ) {
        let mut compensator = Compensator::new(settings()).expect("settings");
        let (mut sum, mut before) = (0, 0.0);
        for (dt_s, error_um, what) in course {
            let axis = AxisSituation { bypass: what == 0, reference_return: what == 1 };
            let prediction = error_um.map(predicted);
            let step = compensator.advance_compensation(dt_s, prediction.as_ref(), axis);
            if axis.reference_return {
                (sum, before) = (0, 0.0);
            }
            sum += step.increment_pulses;
            prop_assert!((sum as f64 * 0.7 - step.value_um).abs() < 0.7 + 1e-9);
            prop_assert!((sum as f64 * 0.7 - step.sent_um).abs() < 1e-9);
            prop_assert!(step.value_um.abs() <= 50.0);
            prop_assert!((step.value_um - before).abs() <= 2.0 * dt_s.min(1.0) + 1e-9);
            before = step.value_um;
        }
    }
}
