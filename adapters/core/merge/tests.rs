//! The merge on readings chosen by hand.

use super::*;
use crate::reading::{Stamp, Value};
use std::sync::Arc;

const MS: i64 = 1_000_000;

fn channel(name: &str) -> ChannelId {
    ChannelId::from_name(name).expect("in the table")
}

fn plan(name: &str, channels: &[&str], period_ms: u64) -> SourcePlan {
    SourcePlan {
        name: name.to_owned(),
        channels: channels.iter().map(|name| channel(name)).collect(),
        period: Duration::from_millis(period_ms),
        stand_in: Vec::new(),
    }
}

/// One source at 100 ms with a speed, a counter and a word.
fn one() -> Merge {
    Merge::new(&[plan("cnc", &["spindle_speed_rpm", "part_count", "program"], 100)], Delay::default())
}

fn number(name: &str, at_ms: i64, number: f64) -> Reading {
    Reading::from_number(channel(name), Stamp::from_exact_time(at_ms * MS), number)
}

fn at(merge: &mut Merge, at_ms: i64) -> Sample {
    let mut sample = Sample::new_empty(0);
    merge.sample_into(&mut sample, at_ms * MS);
    sample
}

fn speed(merge: &mut Merge, at_ms: i64) -> Result<f64, Absence> {
    at(merge, at_ms).number(channel("spindle_speed_rpm"))
}

fn line_error() -> SourceError {
    SourceError::Line { source_name: "cnc".into(), what: "reset".into(), next: "Check the cable.".into() }
}

#[test]
fn a_continuous_channel_is_interpolated_and_a_held_one_is_not() {
    let mut merge = one();
    for (at_ms, value) in [(0, 100.0), (100, 200.0)] {
        merge.push(SourceId(0), number("spindle_speed_rpm", at_ms, value));
        merge.push(SourceId(0), number("part_count", at_ms, value));
    }
    let sample = at(&mut merge, 25);
    assert_eq!(sample.number(channel("spindle_speed_rpm")), Ok(125.0));
    assert_eq!(sample.slot(channel("spindle_speed_rpm")).age_ns, 0);
    assert_eq!(sample.number(channel("part_count")), Ok(100.0));
    assert_eq!(sample.slot(channel("part_count")).age_ns, 25 * MS);
    assert_eq!(sample.slot(channel("program")).value, Err(Absence::NotYetRead));
    assert_eq!(sample.slot(channel("total_power_w")).value, Err(Absence::NotProvided));
}

#[test]
fn nothing_bridges_a_gap_of_more_than_two_periods() {
    let mut merge = one();
    merge.push(SourceId(0), number("spindle_speed_rpm", 0, 100.0));
    merge.push(SourceId(0), number("spindle_speed_rpm", 201, 200.0));
    assert_eq!(speed(&mut merge, 100), Ok(100.0), "held, not interpolated");
    assert_eq!(speed(&mut merge, 200), Ok(100.0));
    assert_eq!(speed(&mut merge, 201), Ok(200.0));
    assert_eq!(speed(&mut merge, 401), Ok(200.0));
    assert_eq!(speed(&mut merge, 402), Err(Absence::Stale));
}

#[test]
fn the_sources_own_reason_stands_once_the_value_is_too_old() {
    let mut merge = one();
    merge.push(SourceId(0), number("spindle_speed_rpm", 0, 100.0));
    merge.record_failure(SourceId(0), 290 * MS, &line_error());
    assert_eq!(speed(&mut merge, 150), Ok(100.0));
    assert_eq!(speed(&mut merge, 250), Err(Absence::Disconnected), "the poll that failed began before its end");
    assert_eq!(speed(&mut merge, 300), Err(Absence::Disconnected));
    merge.push(SourceId(0), number("spindle_speed_rpm", 400, 50.0));
    assert_eq!(speed(&mut merge, 400), Ok(50.0));
    assert_eq!(speed(&mut merge, 700), Err(Absence::Stale), "the failure is over");
}

#[test]
fn a_machine_that_is_off_has_no_values_at_once() {
    let mut merge = one();
    merge.push(SourceId(0), number("spindle_speed_rpm", 0, 100.0));
    merge.record_failure(SourceId(0), 50 * MS, &SourceError::Off { source_name: "cnc".into() });
    assert_eq!(speed(&mut merge, 49), Ok(100.0));
    assert_eq!(speed(&mut merge, 50), Err(Absence::MachineOff));
}

#[test]
fn an_absent_reading_hides_the_value_before_it() {
    let mut merge = one();
    merge.push(SourceId(0), number("spindle_speed_rpm", 0, 100.0));
    let gone = Reading::from_absence(channel("spindle_speed_rpm"), Stamp::from_exact_time(100 * MS), Absence::Refused);
    merge.push(SourceId(0), gone);
    assert_eq!(speed(&mut merge, 99), Ok(100.0), "not interpolated towards an absence");
    assert_eq!(speed(&mut merge, 100), Err(Absence::Refused));
}

#[test]
fn late_readings_are_put_in_their_place_or_counted_away() {
    let mut merge = one();
    merge.push(SourceId(0), number("spindle_speed_rpm", 0, 0.0));
    merge.push(SourceId(0), number("spindle_speed_rpm", 200, 200.0));
    merge.push(SourceId(0), number("spindle_speed_rpm", 100, 300.0));
    assert_eq!(speed(&mut merge, 150), Ok(250.0));
    merge.push(SourceId(0), number("spindle_speed_rpm", 140, 220.0));
    assert_eq!(speed(&mut merge, 170), Ok(210.0), "late but nearer to the next tick");
    merge.push(SourceId(0), number("spindle_speed_rpm", 120, 999.0));
    merge.push(SourceId(0), number("spindle_speed_rpm", 200, 100.0));
    assert_eq!(speed(&mut merge, 200), Ok(100.0), "the later word on the same instant counts");
    let counts = merge.counts(SourceId(0));
    assert_eq!((counts.readings, counts.out_of_order, counts.late), (6, 2, 1));
    assert_eq!((counts.too_late, counts.repeated), (1, 1));
}

#[test]
fn readings_of_a_clock_ahead_are_dropped_when_it_steps_back() {
    let mut merge = one();
    merge.push(SourceId(0), number("spindle_speed_rpm", 3_600_000, 1.0));
    merge.push(SourceId(0), number("spindle_speed_rpm", 0, 2.0));
    merge.push(SourceId(0), number("spindle_speed_rpm", 100, 2.0));
    assert_eq!(speed(&mut merge, 100), Ok(2.0));
    assert_eq!(merge.counts(SourceId(0)).clock_steps, 1);
    assert_eq!(speed(&mut merge, 3_600_000), Err(Absence::Stale));
}

#[test]
fn a_tick_that_goes_back_is_counted_and_survived() {
    let mut merge = one();
    for at_ms in [3_600_000, 3_600_100] {
        merge.push(SourceId(0), number("spindle_speed_rpm", at_ms, 1.0));
    }
    assert_eq!(speed(&mut merge, 3_600_050), Ok(1.0));
    assert!(speed(&mut merge, 0).is_err());
    merge.push(SourceId(0), number("spindle_speed_rpm", 10, 2.0));
    assert_eq!((speed(&mut merge, 20), merge.tick_steps()), (Ok(2.0), 1));
}

#[test]
fn words_hold_and_unannounced_channels_are_counted() {
    let mut merge = one();
    merge.push(SourceId(0), Reading::from_text(channel("program"), Stamp::from_exact_time(0), Arc::from("O1001")));
    merge.push(SourceId(0), number("total_power_w", 0, 1.0));
    let sample = at(&mut merge, 150);
    assert_eq!(sample.text(channel("program")), Some("O1001"));
    assert_eq!(sample.slot(channel("program")).value, Ok(Value::Text(Arc::from("O1001"))));
    assert_eq!(merge.counts(SourceId(0)).unannounced, 1);
}

#[test]
fn the_delay_follows_the_slowest_source_up_to_a_limit() {
    let delay_ms = |periods: &[u64]| {
        let plans: Vec<_> = periods.iter().map(|period| plan("a", &["part_count"], *period)).collect();
        Merge::new(&plans, Delay::default()).delay_ns() / MS
    };
    assert_eq!(delay_ms(&[100, 200]), 250);
    assert_eq!(delay_ms(&[100, 10_000]), 1_000);
    assert_eq!(delay_ms(&[]), 0);
}

#[test]
fn a_slower_source_than_promised_can_be_told() {
    let mut merge = one();
    merge.set_period(SourceId(0), Duration::from_millis(300));
    merge.push(SourceId(0), number("spindle_speed_rpm", 0, 100.0));
    assert_eq!(speed(&mut merge, 600), Ok(100.0));
}

#[test]
fn a_source_that_lags_is_put_back_to_its_time() {
    let power = ChannelId::from_name("spindle_power_w").expect("in the table");
    let plan = SourcePlan {
        name: "meter".to_owned(),
        channels: vec![power],
        period: Duration::from_millis(100),
        stand_in: vec![],
    };
    let mut merge = Merge::new(&[plan], Delay::SlowestPeriod);
    let plain_ns = merge.delay_ns();
    let (mut sample, mut last_ns, mut error) = (Sample::new_empty(0), i64::MIN, f64::INFINITY);
    for tick in 1..=100_i64 {
        let now_ns = tick * 100_000_000;
        merge.set_lag_ns(SourceId(0), (tick * 5_000_000).min(240_000_000));
        // The meter says at t what was true 240 ms before: a ramp of 1 W per ms.
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let said_w = (now_ns / 1_000_000 - 240) as f64;
        merge.push(SourceId(0), Reading::from_number(power, Stamp::from_exact_time(now_ns), said_w));
        let at_ns = now_ns - merge.delay_ns();
        assert!(at_ns > last_ns, "ticks keep their order");
        last_ns = at_ns;
        merge.sample_into(&mut sample, at_ns);
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let truth_w = at_ns as f64 / 1e6;
        error = sample.number(power).map_or(f64::INFINITY, |found_w| (found_w - truth_w).abs());
    }
    assert_eq!((merge.delay_ns() - plain_ns, merge.lag_ns(SourceId(0))), (240_000_000, 240_000_000));
    assert!(error < 1e-6, "{error} W");
    merge.set_lag_ns(SourceId(0), i64::MIN);
    assert_eq!(merge.lag_ns(SourceId(0)), -2_000_000_000, "bounded");
}
