//! Every state and every way out of it.

use crate::estimators::bed::{Bed, Now};
use adapters::Absence;
use rules::estimators::{Inference, NoEstimate, NoLoadOrigin, Settings, State, Visibility};

const IDLE: f64 = 500.0;

fn idle() -> Now {
    Now::turning(800.0, IDLE)
}

fn cut() -> Now {
    Now::turning(800.0, 960.0).fed(120.0)
}

#[test]
fn a_whole_cycle_there_and_back() {
    let mut bed = Bed::new(Settings::default());
    let off = Now { total_w: Some(0.4), ..Now::rest() };
    assert_eq!(bed.hold(off, 1.0).0, [State::Off]);
    assert_eq!(bed.hold(Now::rest(), 2.0).0, [State::Standby]);
    assert_eq!(bed.hold(idle(), 6.0).0, [State::SpindleStart, State::Idle]);
    assert_eq!(bed.hold(cut(), 5.0).0, [State::Idle, State::Cutting]);
    assert_eq!(bed.hold(idle().fed(120.0), 5.0).0, [State::Cutting, State::Idle]);
    assert_eq!(bed.hold(Now::rest(), 2.0).0, [State::Standby]);
    assert_eq!(bed.hold(off, 2.0).0, [State::Off]);
}

#[test]
fn a_cut_is_split_as_the_balance_says() {
    let mut bed = Bed::warmed_up();
    let estimates = bed.hold(cut(), 5.0).1;
    let cutting = estimates.cutting_power_w.expect("known");
    let loss = estimates.load_loss_w.expect("known");
    assert!((cutting.value - 460.0 / 1.18).abs() < 3.0 * cutting.sd, "{cutting:?}");
    assert!((cutting.value + loss.value - 460.0).abs() < 15.0);
    assert_eq!((estimates.no_load_origin, estimates.visibility), (NoLoadOrigin::Measured, Visibility::Visible));
}

#[test]
fn a_silent_meter_makes_it_unknown_and_never_off() {
    let mut bed = Bed::warmed_up();
    bed.hold(cut(), 5.0);
    let silent = Now { total_w: None, power_w: None, ..cut() };
    let (states, estimates) = bed.hold(silent, 5.0);
    assert_eq!(states, [State::Cutting, State::Unknown]);
    assert!(matches!(estimates.unknown_because, Some(NoEstimate::Input { absence: Absence::Timeout, .. })));
    assert!(matches!(estimates.cutting_power_w, Err(NoEstimate::Input { .. })));
    assert_eq!(bed.hold(cut(), 3.0).0, [State::Cutting]);
}

#[test]
fn a_silent_controller_makes_it_unknown_and_a_machine_that_is_off_makes_it_off() {
    let mut bed = Bed::warmed_up();
    let silent = Now { speed_rpm: None, feed_mm_min: None, ..idle() };
    assert_eq!(bed.hold(silent, 3.0).0, [State::Idle, State::Unknown]);
    bed.reason = Absence::MachineOff;
    assert_eq!(bed.hold(silent, 1.0).0, [State::Unknown], "the meter still sees power");
    assert_eq!(bed.hold(Now { total_w: Some(0.2), ..silent }, 1.0).0, [State::Off]);
    assert_eq!(bed.hold(Now { total_w: None, ..silent }, 1.0).0, [State::Off]);
}

/// Connected in the middle of a shift: what the machine takes at rest is not known. A control that refuses while its spindle turns is no machine at rest.
#[test]
fn a_control_that_refuses_while_its_spindle_turns_is_silent_although_the_rest_is_not_known() {
    let mut bed = Bed::new(Settings::default());
    bed.reason = Absence::MachineOff;
    bed.hold(cut(), 5.0);
    let refused = Now { speed_rpm: None, feed_mm_min: None, power_w: None, total_w: Some(3300.0), ..cut() };
    let (states, estimates) = bed.hold(refused, 5.0);
    assert!(!states.iter().any(|state| matches!(state, State::Standby | State::Off)), "{states:?}");
    assert_eq!(states.last(), Some(&State::Unknown), "{states:?}");
    assert!(matches!(estimates.unknown_because, Some(NoEstimate::ControlSilent { power_w }) if power_w == 3300.0));
    // A machine whose control has not been switched on yet is at rest.
    let mut bed = Bed::new(Settings::default());
    bed.reason = Absence::MachineOff;
    assert_eq!(bed.hold(Now { total_w: Some(180.0), ..refused }, 3.0).0.last(), Some(&State::Standby));
}

/// Whatever way a control goes silent, with and without a meter, for any time: its spindle, which turns on, is not seen to start.
#[test]
fn a_control_that_answers_again_at_the_same_speed_has_not_started_its_spindle() {
    let reasons = [Absence::MachineOff, Absence::Timeout, Absence::Disconnected, Absence::Stale];
    for (reason, seconds, known, meter) in reasons.into_iter().flat_map(|reason| {
        [1.0, 3.0, 8.0, 60.0].into_iter().flat_map(move |seconds| {
            [(true, true), (true, false), (false, true), (false, false)]
                .map(|(known, meter)| (reason, seconds, known, meter))
        })
    }) {
        let mut bed = if known { Bed::warmed_up() } else { Bed::new(Settings::default()) };
        if !meter {
            bed.lacks.push("total_power_w");
        }
        bed.reason = reason;
        bed.hold(idle(), 3.0);
        let silent = Now { speed_rpm: None, feed_mm_min: None, power_w: None, ..idle() };
        bed.hold(silent, seconds);
        let (states, _) = bed.hold(idle(), 5.0);
        let wrong = |state: &State| matches!(state, State::SpindleStart | State::SpeedChange | State::Cutting);
        assert!(!states.iter().any(wrong), "{reason} {seconds} s, learned {known}, meter {meter}: {states:?}");
        assert_eq!(
            states.last(),
            Some(&State::Idle),
            "{reason} {seconds} s, learned {known}, meter {meter}: {states:?}"
        );
    }
}

#[test]
fn a_box_that_is_connected_while_the_machine_works_tells_what_the_motion_says() {
    let mut bed = Bed::new(Settings::default());
    let first_s = (1..=50).find(|_| bed.tick(idle()).state == State::Idle).expect("idle is told");
    assert!(first_s <= 10, "{first_s} ticks of 0.1 s");
    let mut bed = Bed::new(Settings::default());
    let rapid = Now { rapid: true, ..Now::turning(800.0, 560.0).fed(8000.0) };
    assert_eq!(bed.hold(rapid, 3.0).0, [State::Unknown, State::Rapid]);
    assert_eq!(bed.hold(cut(), 10.0).0, [State::Unknown], "no claim under feed without a reference");
    assert_eq!(bed.hold(idle(), 10.0).0.last(), Some(&State::Idle));
    assert_eq!(bed.hold(cut(), 5.0).0.last(), Some(&State::Cutting), "learned at the first pause");
}

#[test]
fn a_dead_meter_contradicts_a_turning_spindle() {
    let mut bed = Bed::warmed_up();
    let (states, estimates) = bed.hold(Now { total_w: Some(0.1), power_w: Some(0.0), ..idle() }, 3.0);
    assert_eq!(states, [State::Idle, State::Unknown]);
    assert_eq!(estimates.unknown_because, Some(NoEstimate::Contradiction));
}

#[test]
fn after_a_restart_in_mid_cut_cutting_is_claimed_only_against_a_table() {
    let mut bed = Bed::new(Settings::default());
    let (states, estimates) = bed.hold(cut(), 30.0);
    assert_eq!(states, [State::Unknown]);
    assert_eq!(estimates.unknown_because, Some(NoEstimate::NotLearned));
    assert_eq!((estimates.visibility, estimates.spindle_turns), (Visibility::NoReference, Some(true)));
    assert_eq!(bed.learned_w(800.0), None);

    let mut settings = Settings::default();
    settings.set_no_load_table(0, &[(700.0, 450.0), (800.0, 500.0)]).expect("a table");
    let mut bed = Bed::new(settings);
    assert_eq!(bed.hold(cut(), 10.0).0, [State::Unknown, State::Idle, State::Cutting]);
}

#[test]
fn a_restart_with_a_snapshot_goes_on_where_it_stopped() {
    let mut bed = Bed::warmed_up();
    bed.hold(cut(), 3.0);
    let text = bed.pipeline.take_snapshot().to_string();
    let value = serde_json::from_str(&text).expect("a snapshot is JSON");
    bed.pipeline = Inference::from_snapshot(Settings::default(), value).expect("its own snapshot");
    assert_eq!(bed.hold(cut(), 3.0).0, [State::Cutting]);
    bed.pause(600.0);
    assert_eq!(bed.hold(cut(), 5.0).0, [State::Unknown, State::Idle, State::Cutting]);
    assert!(Inference::from_snapshot(Settings::default(), serde_json::json!({"version": 1})).is_err());
}

#[test]
fn a_change_of_speed_is_no_cut_and_is_learned_by_itself() {
    let mut bed = Bed::warmed_up();
    let states: Vec<State> =
        (1..=8).map(|k| bed.tick(Now::turning(800.0 + 50.0 * f64::from(k), 1500.0)).state).collect();
    assert!(states[1..].iter().all(|state| *state == State::SpeedChange), "{states:?}");
    assert_eq!(bed.hold(Now::turning(1200.0, 700.0), 10.0).0, [State::SpeedChange, State::Idle]);
    assert!((bed.learned_w(1200.0).expect("learned") / 700.0 - 1.0).abs() < 0.01);
    assert!((bed.learned_w(800.0).expect("kept") / 500.0 - 1.0).abs() < 0.01);
}

#[test]
fn another_gear_stage_shares_no_power() {
    let mut bed = Bed::warmed_up();
    let geared = Now { stage: 2.0, ..Now::turning(800.0, 900.0) };
    let (states, estimates) = bed.hold(geared.fed(100.0), 12.0);
    assert_eq!(states, [State::SpeedChange, State::Unknown]);
    assert_eq!(estimates.no_load_power_w, Err(NoEstimate::NotLearned));
    assert_eq!(bed.hold(geared, 5.0).0.last(), Some(&State::Idle));
    assert_eq!(bed.pipeline.no_load().points().count(), 2);
}

#[test]
fn rapid_traverse_never_cuts() {
    let mut bed = Bed::warmed_up();
    let rapid = Now { rapid: true, ..Now::turning(800.0, 560.0).fed(8000.0) };
    let (states, estimates) = bed.hold(rapid, 5.0);
    assert_eq!(states, [State::Rapid]);
    assert_eq!(estimates.visibility, Visibility::NotAsked);
}

#[test]
fn feed_hold_leaves_cutting_after_the_debounce_and_a_blink_does_not() {
    let mut bed = Bed::warmed_up();
    bed.hold(cut(), 5.0);
    assert_eq!(bed.hold(cut().fed(0.0), 0.2).0, [State::Cutting]);
    assert_eq!(bed.hold(cut(), 2.0).0, [State::Cutting]);
    assert_eq!(bed.hold(idle(), 3.0).0, [State::Cutting, State::Idle]);
}

#[test]
fn a_reversing_spindle_with_feed_is_not_standing_still() {
    let mut bed = Bed::warmed_up();
    let mut settings = Settings::default();
    settings.set_value("reversal_s", 1.0).expect("in range");
    bed.pipeline.apply_settings(settings);
    bed.hold(cut(), 2.0);
    let mut states = Vec::new();
    for k in -8..=8 {
        states.push(bed.tick(Now::turning(f64::from(-100 * k), 700.0).fed(400.0)).state);
    }
    assert!(!states.contains(&State::Standby) && states.contains(&State::SpeedChange), "{states:?}");
    assert_eq!(bed.hold(Now::turning(-800.0, IDLE), 5.0).0.last(), Some(&State::Idle));
    assert_eq!(bed.hold(Now::rest(), 1.0).0, [State::Standby]);
    let (states, _) = bed.hold(Now::rest().fed(100.0), 2.0);
    assert_eq!(states, [State::Standby]);
}

#[test]
fn nothing_is_learned_while_feeding() {
    let mut bed = Bed::warmed_up();
    let before = bed.learned_w(800.0).expect("learned");
    bed.hold(Now::turning(800.0, 508.0).fed(100.0), 60.0);
    bed.hold(cut(), 60.0);
    assert_eq!(bed.learned_w(800.0), Some(before));
}

#[test]
fn power_above_the_known_one_is_learned_only_when_it_lasts_and_below_it_soon() {
    let mut bed = Bed::warmed_up();
    bed.hold(Now::turning(800.0, 560.0), 8.0);
    assert!(bed.learned_w(800.0).expect("learned") < 510.0, "perhaps a cut nobody reported");
    bed.hold(Now::turning(800.0, 560.0), 30.0);
    assert!((bed.learned_w(800.0).expect("learned") - 560.0).abs() < 6.0);
    bed.hold(Now::turning(800.0, 500.0), 8.0);
    assert!((bed.learned_w(800.0).expect("learned") - 500.0).abs() < 6.0);
}

#[test]
fn a_start_with_the_axes_moving_gives_an_upper_bound_only() {
    let mut bed = Bed::new(Settings::default());
    bed.hold(Now::rest(), 1.0);
    let (states, estimates) = bed.hold(idle().fed(150.0), 10.0);
    assert_eq!(states, [State::SpindleStart, State::Idle]);
    assert_eq!(estimates.no_load_origin, NoLoadOrigin::UpperBound);
    assert_eq!(estimates.visibility, Visibility::BelowVisibility);
    assert_eq!(bed.pipeline.no_load().points().count(), 0, "nothing is learned while feeding");
    assert_eq!(bed.hold(cut(), 3.0).0, [State::Idle, State::Cutting]);
}

#[test]
fn a_cut_right_after_the_start_is_seen_against_the_table() {
    let mut bed = Bed::warmed_up();
    bed.hold(Now::rest(), 5.0);
    let (states, _) = bed.hold(cut(), 10.0);
    assert_eq!(states, [State::SpindleStart, State::Idle, State::Cutting]);
}

#[test]
fn the_state_does_not_chatter_around_the_threshold() {
    let mut bed = Bed::warmed_up();
    let mut changes = 0;
    for tick in 0..3000_u32 {
        let wave = 0.03 + 0.012 * (f64::from(tick) * 0.9).sin();
        let before = bed.pipeline.estimates().state;
        changes += u32::from(bed.tick(Now::turning(800.0, IDLE * (1.0 + wave)).fed(100.0)).state != before);
    }
    assert!(changes <= 20, "{changes} changes in 300 s");
}

#[test]
fn total_power_stands_in_where_the_spindle_has_no_meter() {
    let mut bed = Bed::new(Settings::default());
    bed.lacks = vec!["spindle_power_w", "gear_stage", "rapid"];
    bed.hold(Now::rest(), 5.0);
    assert_eq!(bed.hold(idle(), 10.0).0, [State::SpindleStart, State::Idle]);
    assert_eq!(bed.hold(cut(), 5.0).0, [State::Idle, State::Cutting]);
    assert!((bed.learned_w(800.0).expect("learned") - IDLE).abs() < 10.0);
}

#[test]
fn without_a_total_meter_the_controller_tells_on_from_off() {
    let mut bed = Bed::new(Settings::default());
    bed.lacks = vec!["total_power_w", "gear_stage", "rapid"];
    assert_eq!(bed.hold(Now::rest(), 1.0).0, [State::Standby]);
    assert_eq!(bed.hold(idle(), 10.0).0, [State::SpindleStart, State::Idle]);
    assert_eq!(bed.hold(cut(), 5.0).0, [State::Idle, State::Cutting]);
}

#[test]
fn power_below_no_load_power_is_a_reason_and_no_negative_cut() {
    let mut bed = Bed::warmed_up();
    let estimates = bed.hold(Now::turning(800.0, 300.0).fed(100.0), 2.0).1;
    assert_eq!(estimates.cutting_power_w, Err(NoEstimate::BelowNoLoad));
}
