//! Experiments as moves, by the kind of the effect whose separating experiment they are.

use super::super::plan::{Envelope, Move, TRANSITION};
use std::collections::BTreeMap;

/// The experiment of this kind; the ordinary work, twice, where only a measurement or a look is asked for.
#[must_use]
pub fn list_moves(kind: &str, e: &Envelope) -> Vec<Move> {
    if e.drive_alone {
        return list_drive_moves(kind, e);
    }
    match kind {
        "no_load_power" | "windage" => repeat_moves(&build_idle_steps(e, 60.0)),
        "iron_loss" | "field_weakening" => [repeat_moves(&build_idle_steps(e, 45.0)), build_coast_down(e)].concat(),
        "bearing_warm_up" | "preload_growth" => build_warm_up(e),
        "stribeck" => repeat_moves(&build_axis_steps(e, &[0.005, 0.01, 0.02, 0.035, 0.05], 8.0)),
        "dry_friction" | "viscous_friction" if e.spindle => repeat_moves(&build_idle_steps(e, 60.0)),
        "dry_friction" | "viscous_friction" => repeat_moves(&build_axis_steps(e, &[0.1, 0.3, 0.6, 1.0], 8.0)),
        "axis_friction" | "gravity_axis" => repeat_moves(&build_axis_steps(e, &[0.2, 0.5, 1.0], 10.0)),
        "direction_asymmetry" => repeat_moves(&build_axis_steps(e, &[0.5, 0.5, 0.5], 8.0)),
        "axis_inertia" => repeat_moves(&build_rapid_moves(e)),
        "edge_force" | "cutting_power" => repeat_moves(&build_feed_steps(e)),
        "chip_thinning" => repeat_moves(&build_depth_steps(e)),
        "speed_softening" | "built_up_edge" | "runout" => repeat_moves(&build_speed_steps(e)),
        "chatter" | "saturation" => repeat_moves(&build_lighter_cuts(e)),
        "load_loss" | "copper_loss" | "inverter_loss" => repeat_moves(&build_equal_power_cuts(e)),
        "gear_stage" => repeat_moves(&build_stage_comparison(e)),
        "flank_wear" => build_insert_change(e),
        "hardness_batch" => build_lot_change(e),
        "coolant_regime" => repeat_moves(&build_coolant_comparison(e)),
        "auxiliary_switch" => repeat_moves(&build_switch_sequence()),
        "spindle_inertia" | "regeneration" | "meter_window" | "clock_lag" => build_start_sequence(e),
        "entry_exit" | "engagement_timing" => repeat_moves(&build_half_feed_pass(e)),
        "depth_taper" => build_reversed_pass(e),
        "override_delay" | "constant_load_control" => build_override_steps(e),
        "offset" => vec![build_standstill(60.0)],
        "zero_drift" => build_zero_checks(e),
        "coolant_temperature" => vec![with_command(build_standstill(2400.0), "coolant_on", 1.0)],
        "spindle_growth" => vec![build_idle(e.speed_rpm.1, 3600.0), build_standstill(3600.0)],
        "screw_growth" => (0..40).flat_map(|_| build_reversal(e, 0.6, 30.0)).collect(),
        "ambient_drift" => vec![with_instruction(build_standstill(12.0 * 3600.0), OVERNIGHT)],
        _ => repeat_moves(&build_ordinary_work(e)),
    }
}

/// The experiment where there is neither a spindle nor a cut.
fn list_drive_moves(kind: &str, e: &Envelope) -> Vec<Move> {
    match kind {
        "clock_lag" | "meter_window" | "axis_inertia" | "regeneration" | "engagement_timing" => {
            repeat_moves(&build_rapid_moves(e))
        }
        "stribeck" | "dry_friction" | "viscous_friction" | "axis_friction" | "direction_asymmetry" => {
            repeat_moves(&build_axis_steps(e, &[0.01, 0.03, 0.1, 0.3, 1.0], 8.0))
        }
        "bearing_warm_up" | "preload_growth" | "zero_drift" | "ambient_drift" => {
            let rest = build_move("axis", 60.0, &[(e.axis_column.as_str(), 0.0)]);
            let work = (0..30).flat_map(|_| build_reversal(e, 0.6, 10.0));
            repeat_moves(&std::iter::once(rest.clone()).chain(work).chain([rest]).collect::<Vec<_>>())
        }
        _ => repeat_moves(&build_axis_steps(e, &[0.2, 0.5, 1.0], 10.0)),
    }
}

/// Are these two told apart from others by the same experiment?
#[must_use]
pub fn has_same_experiment(a: &str, b: &str) -> bool {
    const GROUPS: [&[&str]; 8] = [
        &["no_load_power", "windage"],
        &["iron_loss", "field_weakening"],
        &["bearing_warm_up", "preload_growth"],
        &["dry_friction", "viscous_friction"],
        &["edge_force", "cutting_power"],
        &["speed_softening", "built_up_edge", "runout"],
        &["load_loss", "copper_loss", "inverter_loss"],
        &["spindle_inertia", "regeneration", "meter_window", "clock_lag"],
    ];
    a == b || GROUPS.iter().any(|group| group.contains(&a) && group.contains(&b))
}

type MoveText = (&'static str, &'static str);

const OVERNIGHT: MoveText = ("measure displacement and shop temperature overnight", "整夜测量位移和环境温度");
const NEW_INSERT: MoveText = ("change the insert, then repeat the same cut", "更换刀片，重复相同切削");
const OLD_LOT: MoveText = ("clamp a piece of the old lot, same insert", "装夹旧批次材料，使用同一刀片");
const REVERSED: MoveText = ("cut this pass in the opposite direction", "反向走刀");
const ORDINARY: MoveText = ("carry out what the report asks for, then run this", "先完成报告中要求的操作，再运行此段");
const DRIVE_OFF: MoveText = ("switch the drive off and let the spindle coast down", "断开驱动，让主轴自由停车");

fn build_move(operation: &'static str, seconds: f64, commands: &[(&str, f64)]) -> Move {
    let commands = commands.iter().map(|(name, value)| ((*name).to_owned(), round_command(*value))).collect();
    Move { seconds, run: 1, operation, commands, words: BTreeMap::new(), instruction: ("", "") }
}

/// Four significant digits: nobody sets a speed to a thousandth.
fn round_command(x: f64) -> f64 {
    super::super::text_report::format_short_number(x).parse().unwrap_or(x)
}

/// Drives on, nothing moves.
#[must_use]
pub fn build_standstill(seconds: f64) -> Move {
    build_move("standstill", seconds, &[("spindle_programmed_rpm", 0.0), ("engaged", 0.0)])
}

/// What a plan begins and ends with: the drives on, nothing moves.
#[must_use]
pub fn build_rest(e: &Envelope, seconds: f64) -> Move {
    if e.drive_alone { build_move("standstill", seconds, &[(&e.axis_column, 0.0)]) } else { build_standstill(seconds) }
}

fn build_idle(speed_rpm: f64, seconds: f64) -> Move {
    build_move("idle", seconds, &[("spindle_programmed_rpm", speed_rpm), ("engaged", 0.0)])
}

fn build_cut(e: &Envelope, speed_rpm: f64, feed_mm: f64, depth_mm: f64, seconds: f64) -> Move {
    let commands = [
        ("spindle_programmed_rpm", speed_rpm),
        ("feed_programmed_mm_min", feed_mm * speed_rpm),
        ("depth_of_cut_mm", depth_mm),
        ("diameter_mm", e.diameter_mm),
        ("engaged", 1.0),
    ];
    build_move("cut", seconds, &commands)
}

fn build_usual_cut(e: &Envelope, seconds: f64) -> Move {
    build_cut(e, e.cutting_speed_rpm, e.feed_mm.1, e.depth_mm.1, seconds)
}

/// The way to the commanded speed is what is looked at.
fn mark_transition(a: Move) -> Move {
    Move { operation: TRANSITION, ..a }
}

fn with_command(mut a: Move, channel: &str, value: f64) -> Move {
    a.commands.insert(channel.to_owned(), value);
    a
}

fn with_instruction(mut a: Move, instruction: MoveText) -> Move {
    a.instruction = instruction;
    a
}

fn with_word(mut a: Move, column: &'static str, word: &'static str) -> Move {
    a.words.insert(column, word);
    a
}

/// The same again, as a second run.
fn repeat_moves(moves: &[Move]) -> Vec<Move> {
    let second = moves.iter().map(|a| Move { run: a.run + 1, ..a.clone() });
    moves.iter().cloned().chain(second).collect()
}

/// `count` levels from `low` to `high` in equal ratios, in an order that a drift cannot imitate.
fn build_level_sequence((low, high): (f64, f64), count: u32) -> Vec<f64> {
    let low = low.max(high / 5.0).min(high / 2.5);
    let level = |index: u32| low * (high / low).powf(f64::from(index) / f64::from((count - 1).max(1)));
    let upward: Vec<f64> = (0..count).map(level).collect();
    let middle = upward.len() / 2;
    let (first, second) = upward.split_at(middle);
    let mut mixed = Vec::new();
    for (index, level) in second.iter().enumerate() {
        mixed.push(*level);
        mixed.extend(first.get(index));
    }
    mixed
}

fn build_idle_steps(e: &Envelope, seconds: f64) -> Vec<Move> {
    build_level_sequence(e.speed_rpm, 5).into_iter().map(|n| build_idle(n, seconds / 2.0)).collect()
}

fn build_coast_down(e: &Envelope) -> Vec<Move> {
    vec![build_idle(e.speed_rpm.1, 30.0), mark_transition(with_instruction(build_standstill(60.0), DRIVE_OFF))]
}

/// From cold: hold the highest speed, look at the zero and at a lower speed, and again warm.
fn build_warm_up(e: &Envelope) -> Vec<Move> {
    let (low, high) = (e.speed_rpm.1 / 2.5, e.speed_rpm.1);
    let cold = [
        build_standstill(60.0),
        build_idle(low, 30.0),
        build_idle(high, 900.0),
        build_idle(low, 30.0),
        build_standstill(60.0),
    ];
    let warm = [build_idle(high, 180.0), build_idle(low, 30.0), build_standstill(60.0)];
    let warm = warm.into_iter().map(|a| Move { run: 2, ..a });
    cold.into_iter().chain(warm).collect()
}

/// Half an hour of zero, with short looks at idle that a drift of the meter shifts by as much.
fn build_zero_checks(e: &Envelope) -> Vec<Move> {
    let look = |run: u32| {
        [build_standstill(540.0), build_idle(e.speed_rpm.1 / 2.5, 30.0), build_idle(e.speed_rpm.1, 30.0)]
            .map(|a| Move { run, ..a })
    };
    (1..=3).flat_map(look).collect()
}

fn build_reversal(e: &Envelope, share: f64, seconds: f64) -> Vec<Move> {
    let go = |sign: f64| build_move("axis", seconds, &[(e.axis_column.as_str(), sign * share * e.axis_speed)]);
    vec![go(1.0), go(-1.0)]
}

fn build_axis_steps(e: &Envelope, shares: &[f64], seconds: f64) -> Vec<Move> {
    let rest = build_move("axis", 5.0, &[(e.axis_column.as_str(), 0.0)]);
    shares.iter().flat_map(|share| [build_reversal(e, *share, seconds), vec![rest.clone()]].concat()).collect()
}

fn build_rapid_moves(e: &Envelope) -> Vec<Move> {
    (0..10)
        .flat_map(|_| [build_reversal(e, 1.0, 1.0), vec![build_move("axis", 2.0, &[(&e.axis_column, 0.0)])]].concat())
        .collect()
}

/// Four feeds up to the greatest recorded one, the largest four times the smallest.
fn build_feed_steps(e: &Envelope) -> Vec<Move> {
    let feeds = build_level_sequence((e.feed_mm.1 / 4.0, e.feed_mm.1), 4).into_iter();
    let cuts = feeds.map(|f| build_cut(e, e.cutting_speed_rpm, f, e.depth_mm.1, 35.0));
    [build_idle(e.cutting_speed_rpm, 20.0)].into_iter().chain(cuts).collect()
}

fn build_depth_steps(e: &Envelope) -> Vec<Move> {
    let depths = build_level_sequence((e.depth_mm.1 / 5.0, e.depth_mm.1), 4);
    depths.into_iter().map(|depth| build_cut(e, e.cutting_speed_rpm, e.feed_mm.1, depth, 30.0)).collect()
}

fn build_speed_steps(e: &Envelope) -> Vec<Move> {
    let speeds = build_level_sequence(e.speed_rpm, 5);
    speeds.into_iter().flat_map(|n| [build_idle(n, 8.0), build_cut(e, n, e.feed_mm.1, e.depth_mm.1, 25.0)]).collect()
}

fn build_lighter_cuts(e: &Envelope) -> Vec<Move> {
    let n = e.cutting_speed_rpm;
    [(1.0, 1.0), (0.67, 1.0), (0.5, 1.0), (1.0, 0.9)]
        .map(|(depth, speed)| build_cut(e, speed * n, e.feed_mm.1, depth * e.depth_mm.1, 30.0))
        .to_vec()
}

/// The same cutting power at a low and at twice the speed, lightly and heavily: the depth goes down as the speed goes up.
fn build_equal_power_cuts(e: &Envelope) -> Vec<Move> {
    let (low, high) = (e.speed_rpm.1 / 2.0, e.speed_rpm.1);
    let mut moves = Vec::new();
    for share in [0.4, 1.0] {
        for (n, depth) in [(low, e.depth_mm.1), (high, e.depth_mm.1 / 2.0)] {
            moves.extend([build_idle(n, 15.0), build_cut(e, n, e.feed_mm.1, share * depth, 35.0)]);
        }
    }
    moves
}

fn build_stage_comparison(e: &Envelope) -> Vec<Move> {
    let n = e.cutting_speed_rpm;
    let in_stage = |stage: f64| {
        [build_standstill(5.0), build_idle(n, 30.0), build_usual_cut(e, 40.0)]
            .map(|a| with_command(a, "gear_stage", stage))
    };
    [in_stage(1.0), in_stage(2.0)].concat()
}

fn build_insert_change(e: &Envelope) -> Vec<Move> {
    let part = |word: &'static str, run: u32| {
        [
            build_idle(e.cutting_speed_rpm, 10.0),
            build_usual_cut(e, 35.0),
            build_cut(e, e.cutting_speed_rpm, e.feed_mm.1 / 2.0, e.depth_mm.1, 35.0),
        ]
        .map(|a| Move { run, ..with_word(a, "tool", word) })
    };
    let change = Move { run: 2, ..with_instruction(with_word(build_standstill(5.0), "tool", "new"), NEW_INSERT) };
    [part("worn", 1).to_vec(), vec![change], part("new", 2).to_vec(), part("new", 3).to_vec()].concat()
}

fn build_lot_change(e: &Envelope) -> Vec<Move> {
    let part = |word: &'static str, run: u32| {
        [build_idle(e.cutting_speed_rpm, 10.0), build_usual_cut(e, 50.0)]
            .map(|a| Move { run, ..with_word(a, "lot", word) })
    };
    let change = Move { run: 2, ..with_instruction(with_word(build_standstill(5.0), "lot", "old"), OLD_LOT) };
    [part("new", 1).to_vec(), vec![change], part("old", 2).to_vec(), part("new", 3).to_vec()].concat()
}

fn build_coolant_comparison(e: &Envelope) -> Vec<Move> {
    let both = |on: f64| {
        [build_idle(e.cutting_speed_rpm, 20.0), build_usual_cut(e, 35.0)].map(|a| with_command(a, "coolant_on", on))
    };
    [both(0.0), both(1.0)].concat()
}

fn build_switch_sequence() -> Vec<Move> {
    let state = |coolant, hydraulics| {
        with_command(with_command(build_standstill(30.0), "coolant_on", coolant), "hydraulics_on", hydraulics)
    };
    vec![state(0.0, 0.0), state(1.0, 0.0), state(0.0, 0.0), state(0.0, 1.0), state(1.0, 1.0)]
}

/// Five starts and stops, then five entries into the cut.
fn build_start_sequence(e: &Envelope) -> Vec<Move> {
    let start =
        |run: u32| [build_standstill(8.0), build_idle(e.speed_rpm.1, 12.0)].map(|a| Move { run, ..mark_transition(a) });
    let entry = |run: u32| {
        [build_idle(e.cutting_speed_rpm, 5.0), build_usual_cut(e, 8.0)].map(|a| Move { run, ..mark_transition(a) })
    };
    (1..=5).flat_map(start).chain((6..=10).flat_map(entry)).collect()
}

fn build_half_feed_pass(e: &Envelope) -> Vec<Move> {
    let n = e.cutting_speed_rpm;
    let pass = |feed, seconds| [build_idle(n, 6.0), build_cut(e, n, feed, e.depth_mm.1, seconds)];
    [pass(e.feed_mm.1, 15.0), pass(e.feed_mm.1 / 2.0, 30.0)].concat()
}

fn build_reversed_pass(e: &Envelope) -> Vec<Move> {
    let there = [build_idle(e.cutting_speed_rpm, 10.0), build_usual_cut(e, 50.0)];
    let back = [build_idle(e.cutting_speed_rpm, 10.0), with_instruction(build_usual_cut(e, 50.0), REVERSED)]
        .map(|a| Move { run: 2, ..a });
    [there, back].concat()
}

fn build_override_steps(e: &Envelope) -> Vec<Move> {
    let step = |index: u32| {
        let percent = if index.is_multiple_of(2) { 80.0 } else { 120.0 };
        Move { run: 1 + index / 5, ..with_command(build_usual_cut(e, 15.0), "feed_override_pct", percent) }
    };
    (0..10).map(step).collect()
}

fn build_ordinary_work(e: &Envelope) -> Vec<Move> {
    let first = with_instruction(build_idle(e.cutting_speed_rpm, 20.0), ORDINARY);
    vec![
        first,
        build_usual_cut(e, 40.0),
        build_idle(e.speed_rpm.1, 20.0),
        build_cut(e, e.cutting_speed_rpm, e.feed_mm.1, e.depth_mm.1 / 2.0, 40.0),
    ]
}
