//! Tool wear as a script sees it: limit, wear, and no number where none can be stood behind.

use super::*;

const SCRIPT: &str = "const WEAR = [930.0, 0.92, 0.75, 1.0, 3.2, 120.0, 0.15, 1.0, 20.0, 90.0, 150.0, 0.1, 0.2, 0.75, 1.25, 0.325];\n\
    let speed = cutting_speed_m_min(diameter_mm, spindle_speed_rpm);\n\
    let limit = wear_threshold_w(WEAR, speed, feed_per_rev_mm, depth_of_cut_mm, 0.3);\n\
    if has(limit) { note(`limit ${limit.round()}`); } else { note(why(\"wear_threshold_w\")); }\n\
    let wear = flank_wear_mm(WEAR, cutting_power_w, speed, feed_per_rev_mm, depth_of_cut_mm, 0.3);\n\
    if has(wear) { note(`wear ${(wear * 1000.0).round()} um`); }\n\
    let whole = wear_estimate(WEAR, cutting_power_w, cutting_power_sd_w, speed, feed_per_rev_mm, depth_of_cut_mm, 0.3);\n\
    if has(whole) { note(`extrapolated ${whole.extrapolated} observable ${whole.observable}`); }\n\
    if has(limit) { alarm_above(\"worn\", cutting_power_w, limit, 0.95 * limit, 0.0, \"change the edge\"); }";

fn notes(depth_mm: f64, power_w: f64) -> (Vec<String>, bool) {
    let mut host = host(SCRIPT);
    let values = [
        ("diameter_mm", 60.0),
        ("spindle_speed_rpm", 636.62),
        ("feed_per_rev_mm", 0.15),
        ("depth_of_cut_mm", depth_mm),
    ];
    let decision = host.run_due_scripts(&sample(0.0, &values), &cutting(0.0, power_w));
    assert!(decision.problems.is_empty(), "{}", told(&decision.problems));
    let notes = decision.notes.iter().map(|note| note.text.to_string()).collect();
    (notes, !host.alarms().is_empty())
}

#[test]
fn the_limit_and_the_wear_of_a_cut_are_numbers_with_units() {
    assert_eq!(
        notes(1.0, 1000.0),
        (
            vec!["limit 1045.0".to_owned(), "wear 182.0 um".to_owned(), "extrapolated 0.0 observable 1.0".to_owned()],
            false
        )
    );
    assert!(notes(1.0, 1060.0).1, "above the limit");
}

#[test]
fn outside_the_cuts_of_the_model_there_is_no_number_but_a_reason() {
    let (notes, alarm) = notes(2.5, 2600.0);
    assert!(notes[0].contains("depth_of_cut_mm lies outside the cuts"), "{notes:?}");
    assert_eq!((notes.len(), alarm), (2, false), "{notes:?}");
    assert!(notes[1].starts_with("extrapolated 1"), "{notes:?}");
}
