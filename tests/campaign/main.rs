//! What the box survives: faults of processes, disks, clocks and lines, each with the truth counted at its source, as one
//! table.
//!
//! `cargo test --release --test campaign -- --ignored --nocapture campaign` runs everything (about 90 minutes on two cores) and prints the table
//! of the handbook's chapter `survives`; `CAMPAIGN=kill,clock` chooses rows by a part of their name, `CAMPAIGN_SCALE=0.1` runs a
//! tenth of the repetitions. What is not ignored here is the short version, of at most two minutes.
//!
//! Processes, sockets, brokers and databases are real. Where a partner is not installed its rows say so, and fail with
//! `CNC_GATEWAY_CI` set.

mod armed;
mod clocked_kills;
mod clocks;
mod disarm;
mod disks;
mod fuzz;
mod growth;
mod kills;
mod line;
mod partners;
mod power;
mod table;

use table::{Row, Scale, Table};

/// A name in the table, and what makes the fault.
type Fault = (&'static str, fn(&Scale) -> Row);

/// Every fault, in the order of the table.
fn faults() -> Vec<Fault> {
    vec![
        ("R1 kill", kills::at_random),
        ("R1 kill while the disk is slow", kills::with_slow_disk),
        ("R2 power cut", power::cuts),
        ("R2 power cut, pages out of order", power::reordered),
        ("R3 disk full", disks::full),
        ("R4 fsync fails", disks::fsync_fails),
        ("file removed while running", disks::removed),
        ("file replaced while running", disks::replaced),
        ("file damaged while running", disks::damaged),
        ("a reader that never ends", disks::endless_reader),
        ("R5 broker away", partners::broker_away),
        ("R6 broker restarts, MQTT", partners::broker_restarts),
        ("R6 broker restarts, Sparkplug", partners::sparkplug_restarts),
        ("lives of a few seconds", partners::short_lives),
        ("an item above the broker's limit", partners::too_large),
        ("R8 broker comes later", partners::broker_late),
        ("R12 clock leaps", clocks::leaps),
        ("R12 clock wrong at the start", clocks::wrong_at_start),
        ("R12 summer time", clocks::summer_time),
        ("killed with two outputs, clock off by less than 1 s", clocked_kills::with_small_errors),
        ("killed with two outputs, clock leaps", clocked_kills::with_leaps),
        ("R12 clock leaps while armed", armed::clock_leaps),
        ("stopped for 20 s while armed", armed::stopped),
        ("killed while armed", armed::killed),
        ("disk full while armed", armed::disk_full),
        ("control dies while armed", armed::control_dies),
        ("disarm under lock-out, flood, full disk, dead source", disarm::disarm),
        ("SIGTERM in the first moment", kills::early_term),
        ("growth in 72 h", growth::long_runs),
    ]
}

#[test]
#[ignore = "90 minutes: every fault of the chapter `survives`, as one table"]
fn campaign() {
    let chosen = std::env::var("CAMPAIGN").unwrap_or_default();
    let wanted = |name: &str| chosen.is_empty() || chosen.split(',').any(|part| name.contains(part));
    let scale = Scale::of_environment();
    let mut table = Table::default();
    for (name, fault) in faults().into_iter().filter(|(name, _)| wanted(name)) {
        table.run(name, || fault(&scale));
    }
    println!("\n{table}");
    table.assert_passed();
}

/// The short version: the faults that cost most when they come back, a few times each.
#[test]
fn the_worst_of_it_in_short() {
    let scale = Scale::short();
    let mut table = Table::default();
    let short: [Fault; 5] = [
        ("kill", kills::at_random),
        ("power cut", power::cuts),
        ("power cut, pages out of order", power::reordered),
        ("file removed while running", disks::removed),
        ("lives of a few seconds", partners::short_lives),
    ];
    for (name, fault) in short {
        table.run(name, || fault(&scale));
    }
    println!("\n{table}");
    table.assert_passed();
}
