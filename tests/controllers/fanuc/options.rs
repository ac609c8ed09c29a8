//! What a control refuses although it answers: the option of the interface, an option of some functions, protected memory. What
//! `doctor` says and returns, and what the status of a running box says.

use crate::fanuc::commands::doctor;
use crate::fanuc::support::{controller, serve};
use adapters::fanuc_server::{Server, ServerSettings};
use serde_json::Value;
use std::time::Duration;
use testkit::process::{get, wait_for};
use testkit::served::{prepared, started};

/// EW_NOOPT and EW_PROT of the vendor's header.
const NOOPT: i16 = 6;
const PROT: i16 = 7;

fn refusing(functions: impl IntoIterator<Item = u16>, code: i16) -> Server {
    let mut control = controller(4);
    control.refusals.extend(functions.into_iter().map(|function| (function, (code, 0))));
    serve(control, ServerSettings::default())
}

fn problems(report: &Value) -> Vec<String> {
    let list = report["problems"].as_array().into_iter().flatten();
    list.map(|one| {
        format!("{} | {}", one["what"].as_str().unwrap_or_default(), one["next"].as_str().unwrap_or_default())
    })
    .collect()
}

/// What the status of a box says of the only source, as soon as it says anything of the kind.
fn of_the_box(address: &str, part: &str) -> Vec<String> {
    let directory = tempfile::tempdir().expect("a directory");
    let config = prepared(directory.path(), "", &format!("[[source]]\naddress = \"{address}\"\n"));
    let (gateway, at) = started(&config);
    let told = wait_for(part, Duration::from_secs(60), || {
        let status = get(&at, "/api/v1/status").json();
        let told = problems(&status);
        told.iter().any(|line| line.contains(part)).then_some(told)
    });
    gateway.stop();
    told
}

#[test]
fn a_control_without_the_option_is_told() {
    let everything = (1..=0x1FF).chain([0x8001, 0x8002]);
    let server = refusing(everything, NOOPT);
    let address = format!("fanuc://{}", server.address());
    let (output, report) = doctor(&[&address]);
    let told = problems(&report);
    println!("EW_NOOPT on everything: rc {:?}, {told:#?}", output.status.code());
    assert_eq!(output.status.code(), Some(1));
    assert!(told.iter().any(|line| line.contains("EW_NOOPT 6")), "{told:?}");
    let told = of_the_box(&address, "EW_NOOPT 6");
    println!("run: {told:#?}");
}

#[test]
fn an_option_of_some_functions_and_protected_memory_are_one_sentence_each() {
    // Loads and currents of the servos, and spindles.
    let server = refusing([0x56, 0x40], NOOPT);
    let (output, report) = doctor(&[&format!("fanuc://{}", server.address())]);
    let told = problems(&report);
    println!("EW_NOOPT on loads: rc {:?}, {told:#?}", output.status.code());
    assert_eq!(
        (output.status.code(), told.iter().filter(|line| line.contains("EW_NOOPT 6")).count()),
        (Some(1), 1),
        "{told:?}"
    );

    let server = refusing([0x8001], PROT);
    let address = format!("fanuc://{}", server.address());
    let (output, report) = doctor(&[&address]);
    let told = problems(&report);
    println!("EW_PROT on PMC memory: rc {:?}, {told:#?}", output.status.code());
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(told.iter().filter(|line| line.contains("EW_PROT 7")).count(), 1, "one sentence: {told:?}");
    assert_eq!(told.len(), 1, "{told:?}");
    let told = of_the_box(&address, "EW_PROT 7");
    println!("run: {told:#?}");
}

#[test]
fn what_a_series_does_not_have_is_no_problem() {
    let server = refusing([0x57, 0xA4], 1);
    let (output, report) = doctor(&[&format!("fanuc://{}", server.address())]);
    assert_eq!((output.status.code(), problems(&report)), (Some(0), Vec::new()), "{report:#}");
}
