//! What must hold for the merge whatever the sources do.

use super::*;
use crate::reading::Stamp;
use proptest::prelude::*;

const PERIOD_NS: i64 = 100_000_000;
const GAP_NS: i64 = GAP_PERIODS * PERIOD_NS;

#[derive(Debug, Clone)]
enum Step {
    /// A reading this long before or after the present.
    Read { lead_ns: i64, value: Option<f64> },
    /// A failed poll.
    Fail,
    /// Time goes on, and a tick happens.
    Tick { after_ns: i64 },
}

fn generate_step() -> impl Strategy<Value = Step> {
    prop_oneof![
        4 => (-GAP_NS * 2..GAP_NS, proptest::option::weighted(0.9, -1000.0..1000.0))
            .prop_map(|(lead_ns, value)| Step::Read { lead_ns, value }),
        1 => Just(Step::Fail),
        3 => (0..GAP_NS).prop_map(|after_ns| Step::Tick { after_ns }),
    ]
}

fn build_merge() -> (Merge, ChannelId) {
    let channel = ChannelId::from_name("axis_position_mm").expect("in the table");
    let plan = SourcePlan {
        name: "a".into(),
        channels: vec![channel],
        period: Duration::from_nanos(PERIOD_NS.unsigned_abs()),
        stand_in: Vec::new(),
    };
    (Merge::new(&[plan], Delay::default()), channel)
}

fn build_error() -> SourceError {
    SourceError::Line { source_name: "a".into(), what: "gone".into(), next: "Wait.".into() }
}

/// A sample, and every reading given before it.
type Tick = (Sample, Vec<(TimeNs, Option<f64>)>);

/// Runs the steps; returns the sample of every tick beside the readings given before it.
fn run_steps(steps: &[Step]) -> Vec<Tick> {
    let (mut merge, channel) = build_merge();
    let (mut now_ns, mut given, mut ticks) = (0_i64, Vec::new(), Vec::new());
    for step in steps {
        match step {
            Step::Read { lead_ns, value } => {
                let stamp = Stamp::from_exact_time(now_ns + lead_ns);
                given.push((stamp.mid_ns, *value));
                let reading = match value {
                    Some(number) => Reading::from_number(channel, stamp, *number),
                    None => Reading::from_absence(channel, stamp, Absence::Refused),
                };
                merge.push(SourceId(0), reading);
            }
            Step::Fail => merge.record_failure(SourceId(0), now_ns, &build_error()),
            Step::Tick { after_ns } => {
                now_ns += after_ns;
                let mut sample = Sample::new_empty(0);
                merge.sample_into(&mut sample, now_ns);
                ticks.push((sample, given.clone()));
            }
        }
    }
    ticks
}

/// The merge of a continuous channel in one sentence of code, for readings in order.
fn compute_expected(given: &[(TimeNs, Option<f64>)], at_ns: TimeNs) -> Result<f64, Absence> {
    let (before_ns, before) = *given.iter().rfind(|(ns, _)| *ns <= at_ns).ok_or(Absence::NotYetRead)?;
    let after = given.iter().find(|(ns, _)| *ns > at_ns && *ns - before_ns <= GAP_NS);
    match (before, after) {
        (Some(from), Some((after_ns, Some(to)))) if at_ns > before_ns => {
            let share = (at_ns - before_ns) as f64 / (after_ns - before_ns) as f64;
            Ok(from + (to - from) * share)
        }
        _ if at_ns - before_ns > GAP_NS => Err(Absence::Stale),
        (Some(from), _) => Ok(from),
        (None, _) => Err(Absence::Refused),
    }
}

proptest! {
    #[test]
    fn a_value_is_always_supported_by_readings_within_two_periods(steps in prop::collection::vec(generate_step(), 1..80)) {
        let (_, channel) = build_merge();
        for (sample, given) in run_steps(&steps) {
            let slot = sample.slot(channel);
            let Ok(value) = &slot.value else { continue };
            let value = value.as_number().expect("a number");
            let near: Vec<f64> = given
                .iter()
                .filter(|(at_ns, _)| (at_ns - sample.at_ns).abs() <= GAP_NS)
                .filter_map(|(_, value)| *value)
                .collect();
            let least = near.iter().copied().fold(f64::INFINITY, f64::min);
            let greatest = near.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            prop_assert!(value >= least - 1e-9 && value <= greatest + 1e-9, "{value} outside {least}..{greatest}");
            prop_assert!(slot.age_ns >= 0 && slot.age_ns <= GAP_NS);
        }
    }

    #[test]
    fn sources_in_order_agree_with_the_plain_definition(
        steps in prop::collection::vec((PERIOD_NS / 2..GAP_NS * 2, proptest::option::weighted(0.9, -1000.0..1000.0)), 1..60),
        pauses in prop::collection::vec(0..PERIOD_NS, 1..200),
    ) {
        let (mut merge, channel) = build_merge();
        let (mut read_ns, mut tick_ns, mut given) = (0_i64, 0_i64, Vec::new());
        let mut steps = steps.into_iter();
        let mut sample = Sample::new_empty(0);
        for pause_ns in pauses {
            tick_ns += pause_ns;
            // Everything read by the time of the tick has arrived; the tick looks back by the delay.
            while read_ns <= tick_ns + merge.delay_ns() {
                let Some((step_ns, value)) = steps.next() else { break };
                read_ns += step_ns;
                given.push((read_ns, value));
                let stamp = Stamp::from_exact_time(read_ns);
                merge.push(SourceId(0), match value {
                    Some(number) => Reading::from_number(channel, stamp, number),
                    None => Reading::from_absence(channel, stamp, Absence::Refused),
                });
            }
            merge.sample_into(&mut sample, tick_ns);
            prop_assert_eq!(sample.number(channel), compute_expected(&given, tick_ns));
        }
    }

    #[test]
    fn the_same_steps_give_the_same_samples(steps in prop::collection::vec(generate_step(), 1..40)) {
        prop_assert_eq!(run_steps(&steps), run_steps(&steps));
    }

    #[test]
    fn the_order_of_arrival_before_a_tick_does_not_matter(
        values in prop::collection::vec(-1000.0..1000.0_f64, 2..7),
        swaps in prop::collection::vec((0..6_usize, 0..6_usize), 0..6),
        at_ns in 0..5 * PERIOD_NS,
    ) {
        let (mut sorted, channel) = build_merge();
        let (mut shuffled, _) = build_merge();
        let readings: Vec<Reading> = values.iter().enumerate().map(|(index, value)| {
            let at_ns = i64::try_from(index).expect("small") * PERIOD_NS / 2;
            Reading::from_number(channel, Stamp::from_exact_time(at_ns), *value)
        }).collect();
        let mut order = readings.clone();
        for (a, b) in swaps {
            let len = order.len();
            order.swap(a % len, b % len);
        }
        readings.into_iter().for_each(|reading| sorted.push(SourceId(0), reading));
        order.into_iter().for_each(|reading| shuffled.push(SourceId(0), reading));
        let (mut a, mut b) = (Sample::new_empty(0), Sample::new_empty(0));
        sorted.sample_into(&mut a, at_ns);
        shuffled.sample_into(&mut b, at_ns);
        prop_assert_eq!(a, b);
    }

    #[test]
    fn a_straight_line_is_reproduced_exactly(slope in -10.0..10.0_f64, ticks in prop::collection::vec(0..900_i64, 1..20)) {
        let (mut merge, channel) = build_merge();
        let line = |at_ms: i64| slope * f64::from(i32::try_from(at_ms).expect("small"));
        let mut ticks = ticks;
        ticks.sort_unstable();
        for at_ms in (0..=1000).step_by(100) {
            merge.push(SourceId(0), Reading::from_number(channel, Stamp::from_exact_time(at_ms * 1_000_000), line(at_ms)));
        }
        let mut sample = Sample::new_empty(0);
        for at_ms in ticks {
            merge.sample_into(&mut sample, at_ms * 1_000_000);
            if at_ms >= 200 {
                let got = sample.number(channel).expect("inside the readings");
                prop_assert!((got - line(at_ms)).abs() < 1e-6);
            }
        }
    }
}
