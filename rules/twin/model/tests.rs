//! Parts in their order, and what follows from one that has changed.

use super::*;
use crate::parse_model;
use recording::read_csv;
use std::fmt::Write;

const MODEL: &str = "schema = \"model/1\"\noutput = \"spindle_power_w\"\n\
    [[effect]]\nkind = \"no_load_power\"\nparameters = { p0_w = 100.0, p1_w_per_rpm = 0.2, p2_w_per_rpm2 = 1e-5 }\n\
    [[effect]]\nkind = \"cutting_power\"\nparameters = { kc11_n_per_mm2 = 1800.0, mc = 0.25 }\n\
    [[effect]]\nkind = \"load_loss\"\nparameters = { linear = 0.1 }\n\
    [[effect]]\nkind = \"engagement_timing\"\nparameters = { share = 1.0, delay_s = 0.6 }\n\
    [[effect]]\nkind = \"clock_lag\"\nparameters = { share = 1.0, delay_s = 0.4 }\n";

fn scene() -> Scene {
    let mut text = String::from(
        "time_s,spindle_power_w,spindle_speed_rpm,engaged,depth_of_cut_mm,feed_per_rev_mm,cutting_speed_m_min\n",
    );
    for row in 0..80_u32 {
        let (engaged, speed) = (u8::from(row % 20 >= 8), 900 + 100 * (row / 20));
        writeln!(text, "{row},500,{speed},{engaged},1.5,0.2,150").expect("a string takes it");
    }
    let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
    Scene::new(&recording, "spindle_power_w", &BTreeMap::new()).expect("recorded")
}

/// Whichever part changes, what is simulated again is what everything simulated anew gives.
#[test]
fn what_follows_from_a_change_is_simulated_again() {
    let mut scene = scene();
    let parts = parse_model(MODEL).expect("fine").parts;
    let before = simulate_parts(&parts, &mut scene).expect("simulated");
    for changed in 0..parts.len() {
        for parameter in 0..parts[changed].parameters.len() {
            let mut moved = parts.clone();
            moved[changed].parameters[parameter].value *= 1.1;
            let again = simulate_changed_part(&moved, &mut scene, &before, changed).expect("simulated");
            assert_eq!(again, simulate_parts(&moved, &mut scene).expect("simulated").total, "{changed} {parameter}");
        }
    }
}
