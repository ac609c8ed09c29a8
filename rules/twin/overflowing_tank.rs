//! A tank that a pump fills and that overflows, for tests: the model knows the pump only.

use super::{Diagnosis, diagnose, parse_model};
use adapters::Recording;
use adapters::recording::read_csv;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write;

const MODEL: &str = "schema = \"model/1\"\noutput = \"flow_l_min\"\n[[effect]]\nkind = \"linear\"\n\
                     columns = { pump_v = 2.0, one = 0.0 }\n";

/// Rows in runs of 150, with the level of each row and what is spilt at a level; recorded, and diagnosed.
pub(super) fn diagnosed(rows: u32, level: impl Fn(u32) -> f64, spilt: impl Fn(f64) -> f64) -> (Recording, Diagnosis) {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
    let mut text = String::from("time_s,run,pump_v,level_v,flow_l_min\n");
    for row in 0..rows {
        let (pump, level) = (3.0 + (f64::from(row) / 37.0).sin(), level(row));
        let noise: f64 = StandardNormal.sample(&mut rng);
        let flow = 2.0 * pump - spilt(level) + 0.2 * noise;
        writeln!(text, "{row},{},{pump:.5},{level:.5},{flow:.5}", row / 150).expect("a string takes it");
    }
    let recording = read_csv(text.as_bytes(), "tank.csv").expect("readable").recording;
    let found = diagnose(&recording, &parse_model(MODEL).expect("fine"), 1).expect("usable");
    (recording, found)
}
