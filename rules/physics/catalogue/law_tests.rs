//! What single laws say: magnitudes, signs, and when they have nothing to say.

use super::find_effect;
use super::tests::{self, scene, set, set_words};
use crate::{Form, Scene};
use recording::Recording;

pub(super) fn column(kind: &str, scene: &Scene, form: &Form) -> Vec<f64> {
    tests::column(find_effect(kind).expect("known"), scene, form)
}

#[test]
fn the_published_cutting_power() {
    let mut recording = Recording::new("published", vec![0.0], None);
    for (name, value) in [("depth_of_cut_mm", 2.0), ("feed_per_rev_mm", 0.25), ("cutting_speed_m_min", 120.0)] {
        set(&mut recording, name, |_| value);
    }
    set(&mut recording, "spindle_power_w", |_| 1.0);
    let power = column("cutting_power", &scene(&recording, "spindle_power_w"), &Form::from_shape(&[("mc", 0.0)]));
    assert!((2000.0 * power[0] - 2000.0 * 2.0 * 0.25 * 120.0 / 60.0).abs() < 1e-9, "kc ap f vc / 60 W");
}

#[test]
fn drilling_is_milling_with_the_whole_diameter() {
    let mut recording = Recording::new("drill", vec![0.0], None);
    for (name, value) in [("diameter_mm", 10.0), ("feed_mm_min", 200.0), ("spindle_speed_rpm", 1000.0)] {
        set(&mut recording, name, |_| value);
    }
    set(&mut recording, "spindle_power_w", |_| 1.0);
    let form = Form { name: "drilling", ..Form::from_shape(&[("mc", 0.25)]) };
    let power = column("cutting_power", &scene(&recording, "spindle_power_w"), &form);
    let rate_cm3_min = std::f64::consts::PI * 100.0 / 4.0 * 200.0 / 1000.0;
    assert!((power[0] - 0.1_f64.powf(-0.25) * rate_cm3_min / 60.0).abs() < 1e-9);
}

#[test]
fn a_running_mean_and_a_lag_settle_to_the_input() {
    let mut recording = Recording::new("step", (0..200).map(|row| 0.1 * f64::from(row)).collect(), None);
    set(&mut recording, "spindle_power_w", |row| if row < 50 { 100.0 } else { 300.0 });
    let mut scene = scene(&recording, "spindle_power_w");
    scene.set_simulated(Some(scene.recorded_output().to_vec()));
    for name in ["mean", "lag"] {
        let form = Form { name, ..Form::from_shape(&[("window_s", 1.0)]) };
        let smear = column("meter_window", &scene, &form);
        assert!(smear[..49].iter().all(|value| value.abs() < 1e-9), "{name}: nothing before the edge");
        assert!(smear[50..58].iter().all(|value| *value < -10.0), "{name}: behind after the edge");
        assert!(smear[199].abs() < 1e-3, "{name}: settled");
    }
}

#[test]
fn inertia_is_the_rate_of_kinetic_energy() {
    let mut recording = Recording::new("ramp", (0..100).map(|row| 0.1 * f64::from(row)).collect(), None);
    set(&mut recording, "spindle_speed_rpm", |row| 20.0 * row as f64);
    set(&mut recording, "spindle_power_w", |_| 0.0);
    let power = column("spindle_inertia", &scene(&recording, "spindle_power_w"), &Form::without_shape());
    let energy_j: f64 = power[1..99].iter().map(|power| 0.1 * power).sum();
    let top = 1970.0 * std::f64::consts::PI / 30.0;
    assert!((energy_j / (0.5 * top * top) - 1.0).abs() < 0.01, "{energy_j}");
}

#[test]
fn run_out_needs_more_than_two_samples_per_turn() {
    let turning = |period_s: f64| {
        let mut recording = Recording::new("turn", (0..400).map(|row| period_s * f64::from(row)).collect(), None);
        for (name, value) in [("spindle_speed_rpm", 600.0), ("engaged", 1.0), ("depth_of_cut_mm", 1.0)] {
            set(&mut recording, name, |_| value);
        }
        set(&mut recording, "spindle_power_w", |_| 500.0);
        scene(&recording, "spindle_power_w")
    };
    let runout = find_effect("runout").expect("known");
    assert!(runout.propose_forms(&turning(0.06)).is_empty());
    let fast = turning(0.01);
    let cosine = column("runout", &fast, &runout.propose_forms(&fast)[0]);
    assert!((cosine[0] - cosine[10]).abs() < 1e-6, "ten turns a second, a hundred samples");
}

/// Rows at this period with these inputs and an output of one.
pub(super) fn with_inputs(rows: u32, period_s: f64, output: &str, inputs: &[(&str, &dyn Fn(usize) -> f64)]) -> Scene {
    let mut recording = Recording::new("inputs", (0..rows).map(|row| period_s * f64::from(row)).collect(), None);
    inputs.iter().for_each(|(name, law)| set(&mut recording, name, law));
    set(&mut recording, output, |_| 1.0);
    scene(&recording, output)
}

pub(super) fn forms(kind: &str, scene: &Scene) -> Vec<Form> {
    find_effect(kind).expect("known").propose_forms(scene)
}

/// In constant power the excess grows out of nothing at base speed; the loss as a whole is there at once.
#[test]
fn in_excess_of_a_known_copper_loss_a_weak_field_begins_at_base_speed() {
    let speed = |row: usize| 1000.0 + 20.0 * row as f64;
    let mut motor = with_inputs(101, 1.0, "spindle_power_w", &[("spindle_speed_rpm", &speed)]);
    motor.set_load(Some(vec![3000.0; 101]));
    let loss = |name| {
        let form = Form { name, ..Form::from_shape(&[("base_speed_rpm", 1500.0)]) };
        find_effect("field_weakening").expect("known").compute_columns(&motor, &form).expect("columns").swap_remove(1).1
    };
    let (whole, excess) = (loss("whole"), loss("excess"));
    assert!(whole[25] == 0.0 && excess[25] == 0.0, "at base speed");
    assert!((whole[26] - 4e6).abs() < 1.0 && excess[26] < 0.05 * whole[26], "{} {}", whole[26], excess[26]);
    // At twice base speed the current for the same torque is twice as great.
    assert!((excess[100] / (4e6 / 4.0) - 3.0).abs() < 1e-9, "{}", excess[100]);
}

#[test]
fn warm_up_lowers_and_preload_raises_idle_power() {
    let idle = with_inputs(3600, 1.0, "spindle_power_w", &[("spindle_speed_rpm", &|_| 2000.0)]);
    let warm_up = column("bearing_warm_up", &idle, &Form { name: "lag", ..Form::from_shape(&[("tau_s", 600.0)]) });
    let warm = 2.0_f64.powf(10.0 / 3.0);
    assert!(warm_up[0] == 0.0 && (warm_up[3599] / -warm - 1.0).abs() < 0.01, "{}", warm_up[3599]);
    let gradient = Form { name: "gradient", ..Form::from_shape(&[("tau_s", 120.0), ("slow_tau_s", 720.0)]) };
    let preload = column("preload_growth", &idle, &gradient);
    let peak = preload.iter().copied().fold(0.0, f64::max);
    assert!(peak > 5.0 * preload[3599] && preload[3599] > 0.0, "rises, then falls as the housing follows");
}

#[test]
fn a_state_needs_a_recording_that_can_tell_it() {
    let short = with_inputs(60, 1.0, "spindle_power_w", &[("spindle_speed_rpm", &|_| 2000.0)]);
    assert!(forms("bearing_warm_up", &short).is_empty());
    assert!(forms("preload_growth", &short).is_empty());
}

#[test]
fn stribeck_needs_visits_at_creep() {
    let fast = |row: usize| if row % 20 < 10 { 0.5 } else { -0.5 };
    assert!(forms("stribeck", &with_inputs(400, 0.1, "force_n", &[("velocity_m_s", &fast)])).is_empty());
    let creeping = |row: usize| 0.5 * (row as f64 / 30.0).sin();
    let creep = with_inputs(400, 0.1, "force_n", &[("velocity_m_s", &creeping)]);
    let tried = forms("stribeck", &creep);
    assert!(tried.iter().any(|form| form.name == "lorentzian"), "{tried:?}");
    let level = |name| column("stribeck", &creep, &Form { name, ..Form::from_shape(&[("stribeck_speed", 0.1)]) })[45];
    // At nearly five times the Stribeck speed.
    assert!(level("") < 1e-9 && level("exponential") < 0.02 && (0.03..0.06).contains(&level("lorentzian")));
    let turning = |row: usize| 3000.0 * (row as f64 / 300.0).sin().abs();
    let spindle = with_inputs(4000, 0.1, "spindle_power_w", &[("spindle_speed_rpm", &turning)]);
    let tried = forms("stribeck", &spindle);
    assert!(!tried.is_empty() && tried.iter().all(|form| form.name.is_empty()), "{tried:?}");
}

#[test]
fn an_entry_over_a_way_lasts_longer_at_a_slow_feed() {
    let place = |row: usize| row % 40;
    let engaged = |row: usize| f64::from(u8::from((10..40).contains(&place(row))));
    let feed = |row: usize| if (row / 40).is_multiple_of(2) { 60.0 } else { 240.0 };
    let inputs: [(&str, &dyn Fn(usize) -> f64); 2] = [("engaged", &engaged), ("feed_mm_min", &feed)];
    let mut scene = with_inputs(400, 1.0, "spindle_power_w", &inputs);
    scene.set_load(Some((0..400).map(|row| 500.0 * engaged(row)).collect()));
    assert!(forms("entry_exit", &scene).iter().any(|form| form.name == "travel"));
    let form = Form { name: "travel", ..Form::from_shape(&[("length_mm", 4.0), ("exit_length_mm", 4.0)]) };
    let entry = column("entry_exit", &scene, &form);
    let rows = |pass: usize| (40 * pass..40 * pass + 40).filter(|row| entry[*row] > 0.0).count();
    assert_eq!((rows(0), rows(1)), (4, 1), "a millimetre per row, and four");
    let even = with_inputs(400, 1.0, "spindle_power_w", &[("engaged", &engaged), ("feed_mm_min", &|_| 60.0)]);
    assert!(forms("entry_exit", &even).iter().all(|form| form.name != "travel"), "at one feed a way is a time");
}

#[test]
fn every_edge_wears_at_a_rate_of_its_own_and_breaks_in() {
    let mut recording = Recording::new("edges", (0..240).map(|row| 10.0 * f64::from(row)).collect(), None);
    set(&mut recording, "engaged", |_| 1.0);
    set(&mut recording, "cutting_time_min", |row| (row % 120) as f64 / 6.0);
    set(&mut recording, "cutting_speed_m_min", |_| 100.0);
    set(&mut recording, "diameter_mm", |_| 8.0);
    set(&mut recording, "spindle_power_w", |_| 1.0);
    set_words(&mut recording, "tool", |row| if row < 120 { "T1-a" } else { "T1-b" }.to_owned());
    let scene = scene(&recording, "spindle_power_w");
    let names: Vec<&str> = forms("flank_wear", &scene).iter().map(|form| form.name).collect();
    assert_eq!(names, ["", "", "", "", "break_in", "break_in", "edges", "edges"]);
    let edges = forms("flank_wear", &scene).swap_remove(6);
    let columns = find_effect("flank_wear").expect("known").compute_columns(&scene, &edges).expect("columns");
    assert_eq!(columns.iter().map(|(name, _)| *name).collect::<Vec<_>>(), ["k_1", "k_2"]);
    // Half the diameter of the drill cuts.
    assert!((columns[0].1[60] - 4.0 * 100.0 * 10.0).abs() < 1e-9 && columns[0].1[180] == 0.0);
    // A model that was accepted meets an edge that it has not seen.
    set_words(&mut recording, "tool", |_| "T9".to_owned());
    let columns = find_effect("flank_wear")
        .expect("known")
        .compute_columns(&super::tests::scene(&recording, "spindle_power_w"), &edges);
    let columns = columns.expect("columns");
    assert!((columns[0].1[60] - 2000.0).abs() < 1e-9 && (columns[1].1[180] - 2000.0).abs() < 1e-9, "half each");
    let broken_in =
        column("flank_wear", &scene, &Form { name: "break_in", ..Form::from_shape(&[("break_in_min", 1.0)]) });
    assert!(broken_in[119] / broken_in[30] < 1.01 && broken_in[30] / broken_in[3] > 2.0);
}

#[test]
fn directions_differ_only_where_both_are_visited() {
    let one_way = with_inputs(100, 0.1, "force_n", &[("velocity_m_s", &|row| 0.1 + row as f64 / 100.0)]);
    assert!(forms("direction_asymmetry", &one_way).is_empty());
    let both = with_inputs(100, 0.1, "force_n", &[("velocity_m_s", &|row| (row as f64 / 5.0).sin())]);
    let level = column("direction_asymmetry", &both, &Form::without_shape());
    assert!(level.iter().all(|level| (0.0..=1.0).contains(level)));
}

#[test]
fn weight_needs_an_axis_declared_vertical() {
    let mut recording = Recording::new("axis", vec![0.0, 1.0], None);
    set(&mut recording, "z_axis_velocity_mm_min", |row| 6000.0 * row as f64);
    set(&mut recording, "total_power_w", |_| 1.0);
    let undeclared = Scene::new(&recording, "total_power_w", &std::collections::BTreeMap::new()).expect("recorded");
    assert!(forms("gravity_axis", &undeclared).is_empty());
    assert_eq!(column("gravity_axis", &scene(&recording, "total_power_w"), &Form::without_shape()), vec![0.0, 0.1]);
}

#[test]
fn a_late_meter_lies_below_a_rising_edge() {
    let mut late = with_inputs(20, 1.0, "spindle_power_w", &[]);
    late.set_simulated(Some((0..20).map(|row| if row < 10 { 100.0 } else { 500.0 }).collect()));
    let delay = |delay_s| Form { name: "delay", ..Form::from_shape(&[("delay_s", delay_s)]) };
    let column_of = |delay_s| column("clock_lag", &late, &delay(delay_s));
    assert_eq!(column_of(2.0)[10..13], [-400.0, -400.0, 0.0]);
    assert_eq!(column_of(-1.0)[9..11], [400.0, 0.0]);
    assert_eq!(column_of(0.5)[10], -200.0, "half-way between two rows");
}

#[test]
fn a_late_flag_moves_the_whole_step_of_the_cut() {
    let engaged = |row: usize| f64::from(u8::from((5..10).contains(&(row % 20))));
    let flagged = with_inputs(40, 1.0, "spindle_power_w", &[("engaged", &engaged)]);
    let column = column("engagement_timing", &flagged, &Form::from_shape(&[("delay_s", 1.0)]));
    assert_eq!((column[5], column[10]), (-800.0, 800.0));
    assert!(column.iter().enumerate().all(|(row, value)| *value == 0.0 || row % 20 == 5 || row % 20 == 10));
}

#[test]
fn taper_starts_again_in_every_pass_and_turns_with_the_direction() {
    let engaged = |row: usize| f64::from(u8::from(row % 20 < 11));
    let place = |row: usize| if row < 20 { (row % 20) as f64 } else { -((row % 20) as f64) };
    let passes = with_inputs(40, 1.0, "spindle_power_w", &[("engaged", &engaged), ("axis_position_mm", &place)]);
    let slope = column("depth_taper", &passes, &Form::without_shape());
    assert_eq!((slope[0], slope[10]), (-400.0, 400.0));
    assert_eq!((slope[20], slope[30], slope[15]), (400.0, -400.0, 0.0));
}

#[test]
fn a_batch_steps_at_a_run_with_two_runs_on_either_side() {
    let mut recording = Recording::new("runs", (0..60).map(f64::from).collect(), None);
    set(&mut recording, "engaged", |_| 1.0);
    set(&mut recording, "spindle_power_w", |_| 1.0);
    set_words(&mut recording, "run", |row| (row / 10).to_string());
    let runs = scene(&recording, "spindle_power_w");
    let steps = forms("hardness_batch", &runs);
    let starts: Vec<&str> = steps.iter().filter_map(|form| Some(form.place.as_ref()?.1.as_str())).collect();
    assert_eq!(starts, ["2", "3", "4"]);
    assert!((steps[0].ln_choices - 3.0_f64.ln()).abs() < 1e-12);
    let step = column("hardness_batch", &runs, &steps[1]);
    assert_eq!((step[29], step[30]), (0.0, 800.0));
}

#[test]
fn gear_stages_are_taken_from_their_channel() {
    let stage = |row: usize| if row < 50 { 1.0 } else { 2.0 };
    let speed = |row: usize| if row % 10 < 3 { 0.0 } else { 500.0 };
    let inputs: [(&str, &dyn Fn(usize) -> f64); 2] = [("gear_stage", &stage), ("spindle_speed_rpm", &speed)];
    let geared = with_inputs(100, 1.0, "spindle_power_w", &inputs);
    let forms = forms("gear_stage", &geared);
    assert_eq!(forms.len(), 4, "either may be the lossy one, with a slope or without");
    assert_eq!(forms[1].place, Some(("gear_stage".to_owned(), "2".to_owned())));
    let step = column("gear_stage", &geared, &forms[1]);
    assert_eq!((step[5], step[99], step[90]), (0.0, 1.0, 0.0), "wheels that stand take nothing");
}

#[test]
fn a_ceiling_is_where_the_recording_piles_up() {
    let mut recording = Recording::new("ceiling", (0..100).map(f64::from).collect(), None);
    set(&mut recording, "spindle_power_w", |row| (10.0 * row as f64).min(800.0));
    let forms = forms("saturation", &scene(&recording, "spindle_power_w"));
    assert_eq!(forms.iter().filter_map(|form| form.shape_value("ceiling")).collect::<Vec<_>>(), [800.0]);
    // Without a pile only a simulation that goes well beyond the recording suggests a ceiling.
    set(&mut recording, "spindle_power_w", |row| 10.0 * row as f64);
    let mut agreed = scene(&recording, "spindle_power_w");
    agreed.set_simulated(Some(vec![0.0; 100]));
    assert!(find_effect("saturation").expect("known").propose_forms(&agreed).is_empty());
}

#[test]
fn thermal_effects_speak_of_displacements_only() {
    let speed: (&str, &dyn Fn(usize) -> f64) = ("spindle_speed_rpm", &|row| 1000.0 + row as f64);
    let displaced = with_inputs(3600, 1.0, "thermal_error_um", &[speed, ("engaged", &|_| 1.0)]);
    let powered = with_inputs(3600, 1.0, "spindle_power_w", &[speed]);
    assert!(!forms("spindle_growth", &displaced).is_empty() && forms("spindle_growth", &powered).is_empty());
    for kind in ["windage", "load_loss", "hardness_batch", "bearing_warm_up", "dry_friction", "flank_wear"] {
        assert!(forms(kind, &displaced).is_empty(), "{kind}");
    }
}

#[test]
fn a_taper_by_distance_is_the_same_at_the_same_place_of_every_pass() {
    let mut recording = Recording::new("passes", (0..120).map(f64::from).collect(), None);
    // A long pass of 60 rows and a short one of 30, both at 60 mm/min: a millimetre per row.
    let place = |row: usize| if row < 60 { Some(row) } else { row.checked_sub(80).filter(|row| *row < 30) };
    set(&mut recording, "engaged", |row| f64::from(u8::from(place(row).is_some())));
    set(&mut recording, "feed_mm_min", |_| 60.0);
    set(&mut recording, "spindle_power_w", |_| 1000.0);
    let mut scene = scene(&recording, "spindle_power_w");
    scene.set_load(Some(vec![500.0; 120]));
    let names: Vec<&str> =
        find_effect("depth_taper").expect("known").propose_forms(&scene).iter().map(|form| form.name).collect();
    assert_eq!(names, ["linear", "quadratic", "distance", "distance_quadratic"]);
    let taper = column("depth_taper", &scene, &Form { name: "distance", ..Form::without_shape() });
    assert!(taper[20] > 0.0 && (taper[20] - taper[100]).abs() < 1e-9, "{} {}", taper[20], taper[100]);
    let share = column("depth_taper", &scene, &Form { name: "linear", ..Form::without_shape() });
    assert!((share[59] - share[109]).abs() < 1e-9, "by share the ends of both passes are alike");
}

#[test]
fn a_flag_that_is_late_within_a_row_moves_the_whole_cut() {
    // A row in which the tool was in the work for three quarters shows three quarters of the load.
    let share = |row: usize| if row == 10 { 0.75 } else { f64::from(u8::from(row > 10)) };
    let scene = with_inputs(40, 1.0, "spindle_power_w", &[("engaged", &share), ("depth_of_cut_mm", &|_| 1.0)]);
    let moved = column("engagement_timing", &scene, &Form::from_shape(&[("delay_s", -0.5)]));
    let whole = 800.0;
    assert!((moved[9] - 0.375 * whole).abs() < 1e-9, "{}", moved[9]);
    assert!((moved[10] - 0.125 * whole).abs() < 1e-9, "{}", moved[10]);
}

#[test]
fn delays_of_part_of_a_row_are_tried_where_rows_are_fast() {
    let delays_at = |period_s: f64| -> Vec<f64> {
        let mut scene = with_inputs(40, period_s, "axis_force_n", &[]);
        scene.set_simulated(Some((0..40).map(|row| f64::from(row % 7)).collect()));
        forms("clock_lag", &scene).iter().filter_map(|form| form.shape_value("delay_s")).filter(|s| *s > 0.0).collect()
    };
    assert_eq!(delays_at(1.0), [0.25, 0.5, 1.0, 1.5, 2.0, 3.0]);
    let fast = delays_at(0.02);
    assert!(fast.iter().filter(|delay_s| **delay_s < 0.02).count() == 2, "{fast:?}");
    assert!(fast.windows(2).all(|pair| pair[0] < pair[1] && pair[1] < 3.0 * pair[0]), "no gaps: {fast:?}");
}

#[test]
fn a_controller_unseen_takes_from_heavy_cuts_after_a_while() {
    let engaged = |row: usize| f64::from(u8::from(row % 20 >= 5));
    let depth = |row: usize| 1.0 + (row / 20 % 3) as f64;
    let program = |_: usize| 200.0;
    let inputs: [(&str, &dyn Fn(usize) -> f64); 3] =
        [("engaged", &engaged), ("depth_of_cut_mm", &depth), ("feed_programmed_mm_min", &program)];
    let scene = with_inputs(120, 1.0, "spindle_power_w", &inputs);
    let tried = forms("constant_load_control", &scene);
    assert!(!tried.is_empty() && tried.iter().all(|form| form.name == "unseen"), "{tried:?}");
    let form = Form { name: "unseen", ..Form::from_shape(&[("exponent", 0.5), ("tau_s", 2.0)]) };
    let taken = column("constant_load_control", &scene, &form);
    // Three times the depth is heavy, one is light, two is the median.
    assert!(taken[45].abs() < 1e-9 && taken[59] < -100.0 && taken[50] > taken[59], "{:?}", &taken[40..60]);
    assert!(taken[19] > 100.0 && taken[39].abs() < 1e-9, "{} {}", taken[19], taken[39]);
    let with_dial_and_actual = |dial: &dyn Fn(usize) -> f64, actual: &dyn Fn(usize) -> f64| {
        let inputs = [inputs[0], inputs[1], inputs[2], ("feed_override_pct", dial), ("feed_mm_min", actual)];
        forms("constant_load_control", &with_inputs(120, 1.0, "spindle_power_w", &inputs)).len()
    };
    let turned = |row: usize| if row.is_multiple_of(2) { 200.0 } else { 150.0 };
    assert_eq!(with_dial_and_actual(&|_| 100.0, &turned), 0, "what the feed became is known");
    assert_eq!(with_dial_and_actual(&|_| 100.0, &program), tried.len());
    assert_eq!(with_dial_and_actual(&|row| turned(row) / 2.0, &turned), tried.len(), "no more than the dial asks for");
}

#[test]
fn the_friction_of_a_feed_drive_falls_as_it_warms() {
    let velocity = |row: usize| 6000.0 * (row as f64 / 9.0).sin();
    let scene = with_inputs(1200, 1.0, "axis_force_n", &[("axis_velocity_mm_min", &velocity)]);
    let tried = forms("bearing_warm_up", &scene);
    assert!(tried.iter().any(|form| form.shape_value("tau_s") == Some(150.0)), "{tried:?}");
    let fall = column("bearing_warm_up", &scene, &Form { name: "lag", ..Form::from_shape(&[("tau_s", 150.0)]) });
    assert!((0..1200).all(|row| fall[row] * velocity(row) <= 0.0), "against the friction, whatever the direction");
    let size = |rows: std::ops::Range<usize>| fall[rows].iter().map(|x| x.abs()).fold(0.0, f64::max);
    assert!(size(1000..1200) > 5.0 * size(0..20));
}

#[test]
fn a_removal_rate_of_the_moment_has_the_engagement_in_it_already() {
    let engaged = |row: usize| [0.0, 0.5, 1.0, 0.5][row % 4];
    let full = 3.0 * 10.0 * 400.0 / 1000.0;
    let section = |rate: &dyn Fn(usize) -> f64| {
        let one = |value: f64| move |_: usize| value;
        let (depth, width, feed, tooth, diameter) = (one(3.0), one(10.0), one(400.0), one(0.1), one(40.0));
        let inputs: [(&str, &dyn Fn(usize) -> f64); 7] = [
            ("engaged", &engaged),
            ("depth_of_cut_mm", &depth),
            ("width_of_cut_mm", &width),
            ("feed_mm_min", &feed),
            ("feed_per_tooth_mm", &tooth),
            ("diameter_mm", &diameter),
            ("removal_rate_cm3_min", rate),
        ];
        let scene = with_inputs(80, 1.0, "spindle_power_w", &inputs);
        let form = Form { name: "milling", ..Form::from_shape(&[("mc", 0.25)]) };
        column("cutting_power", &scene, &form)
    };
    let (moment, nominal) = (section(&|row| full * engaged(row)), section(&|_| full));
    assert!(moment.iter().zip(&nominal).all(|(a, b)| (a - b).abs() < 1e-9), "{:?} {:?}", &moment[..4], &nominal[..4]);
}
