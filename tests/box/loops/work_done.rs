//! Energy, time and power of parts, programs and operations, as they are stored, against what the machine truly took.

use super::bench::{Bench, limits};
use adapters::simulated::SimulatedSettings;
use gateway::pipeline::PartDetail;
use std::collections::BTreeMap;

/// Seconds and joules.
type Sum = (f64, f64);

#[test]
fn energy_and_time_of_parts_programs_and_operations_are_those_of_the_machine() {
    let mut bench = Bench::at_work(SimulatedSettings::default(), &[], &limits(50.0, 120.0));
    let mut truth: Vec<(String, BTreeMap<String, Sum>)> = vec![Default::default()];
    let mut count = 0;
    while bench.now_s() < 2400.0 {
        bench.tick();
        for moment in bench.looks().collect::<Vec<_>>() {
            if moment.panel.part_count != count {
                count = moment.panel.part_count;
                truth.push(Default::default());
            }
            let Some((program, operations)) = truth.last_mut() else { continue };
            if moment.truth.engaged > 0.0 {
                *program = format!("O{}", moment.panel.program);
            }
            let sum = operations.entry(moment.panel.operation.to_owned()).or_default();
            *sum = (sum.0 + 0.02, sum.1 + 0.02 * moment.truth.total_power_w);
        }
    }
    assert!(bench.parts.len() >= 5, "{} parts", bench.parts.len());
    let mut worst = [0.0_f64; 4];
    let mut later = |at: usize, found: f64, expected: f64| worst[at] = worst[at].max((found / expected - 1.0).abs());
    // Before the first part the machine is switched on, of which the gateway sees less.
    for (part, (program, operations)) in bench.parts.iter().zip(&truth).skip(1) {
        assert_eq!(&part.program, program, "counted for the program that made it");
        let (seconds, joules) = operations.values().fold((0.0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
        later(0, part.energy_j.expect("measured"), joules);
        later(1, (part.ended_ns - part.began_ns) as f64 / 1e9, seconds);
        let detail: PartDetail = serde_json::from_str(&part.detail).expect("JSON");
        for operation in detail.operations.iter().filter(|it| !it.operation.is_empty()) {
            let (seconds, joules) = operations[&operation.operation];
            later(2, operation.energy_j.expect("measured"), joules);
            later(3, operation.seconds, seconds);
        }
    }
    let told = worst.map(|share| format!("{:.2} %", 100.0 * share));
    println!(
        "{} parts: worst error of the energy {}, of the time {}; of an operation {} and {}",
        bench.parts.len() - 1,
        told[0],
        told[1],
        told[2],
        told[3]
    );
    assert!(worst.iter().all(|share| *share < 0.01), "{told:?}");
}
