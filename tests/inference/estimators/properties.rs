//! Whatever comes in: no panic, no number that is none, and the same continuation from a snapshot.

use crate::estimators::bed::{Bed, Now};
use adapters::Absence;
use proptest::prelude::*;
use rules::estimators::{Estimates, Inference, Settings};

fn number() -> impl Strategy<Value = Option<f64>> {
    prop_oneof![
        1 => Just(None),
        1 => Just(Some(0.0)),
        4 => (-3000.0..6000.0).prop_map(Some),
        1 => prop_oneof![
            Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(f64::MAX), Just(f64::MIN),
            Just(f64::MIN_POSITIVE), Just(-0.0)
        ].prop_map(Some),
    ]
}

/// Wild inputs, and mild ones that let the detector settle.
fn now() -> impl Strategy<Value = (Now, usize, f64)> {
    let wild = (number(), number(), number(), number(), any::<bool>(), -1.0..9.0).prop_map(
        |(total_w, power_w, speed_rpm, feed_mm_min, rapid, stage): (_, _, _, _, _, f64)| Now {
            total_w,
            power_w,
            speed_rpm,
            feed_mm_min,
            rapid,
            stage: stage.round(),
        },
    );
    let mild = (0.0..4.0, 300.0..900.0, 0.0..2.0).prop_map(|(speed, power, feed): (f64, f64, f64)| {
        Now::turning(400.0 * speed.round(), power).fed(100.0 * feed.round())
    });
    (prop_oneof![1 => wild, 2 => mild], 1..40_usize, prop_oneof![6 => Just(0.0), 1 => -50.0..5000.0])
}

fn check(estimates: &Estimates) -> Result<(), TestCaseError> {
    for (name, estimated) in estimates.list_quantities() {
        if let Ok(estimate) = estimated {
            prop_assert!(estimate.value.is_finite() && estimate.sd.is_finite(), "{name}: {estimate:?}");
            prop_assert!(estimate.sd >= 0.0, "{name}: {estimate:?}");
        }
    }
    prop_assert!(estimates.noise_gain.is_finite());
    prop_assert!(estimates.since_ns <= estimates.at_ns);
    Ok(())
}

fn settings() -> impl Strategy<Value = Settings> {
    (3.0..20.0, 5.0..30.0, 0.005..0.2, -0.4..0.5, -1e-4..1e-4).prop_map(
        |(filter, window, c2, linear, quadratic): (f64, f64, f64, f64, f64)| {
            let mut settings = Settings::default();
            let values = [
                ("filter_samples", filter.round()),
                ("window_samples", window.round()),
                ("c2_on", c2),
                ("load_loss_linear", linear),
                ("load_loss_quadratic_per_w", quadratic),
            ];
            values.into_iter().for_each(|(name, value)| settings.set_value(name, value).expect("in range"));
            settings
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_samples_give_finite_estimates_and_a_snapshot_continues_alike(
        settings in settings(),
        before in prop::collection::vec(now(), 1..25),
        after in prop::collection::vec(now(), 1..15),
        off in any::<bool>(),
    ) {
        let mut bed = Bed::new(settings.clone());
        bed.reason = if off { Absence::MachineOff } else { Absence::Stale };
        for (now, ticks, pause_s) in before {
            bed.pause(pause_s);
            for _ in 0..ticks {
                check(&bed.tick(now))?;
            }
        }
        let text = bed.pipeline.take_snapshot().to_string();
        let value = serde_json::from_str(&text).expect("a snapshot is JSON");
        let mut restored = Inference::from_snapshot(settings, value).expect("its own snapshot");
        for (now, ticks, pause_s) in after {
            bed.pause(pause_s);
            for _ in 0..ticks {
                let sample = bed.sample(now);
                let expected = *bed.pipeline.update_with_sample(&sample);
                check(&expected)?;
                prop_assert_eq!(*restored.update_with_sample(&sample), expected);
            }
        }
        prop_assert_eq!(restored.take_snapshot(), bed.pipeline.take_snapshot());
    }
}
