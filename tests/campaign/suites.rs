//! Faults that have a suite of their own: it is run, and what it says is counted.

use crate::table::{Row, Scale};
use std::process::Command;
use std::time::Instant;

/// Runs tests of a suite by a part of their names.
fn suite(how: &'static str, suite: &str, filter: &[&str]) -> Row {
    let mut row = Row::new(how);
    let began = Instant::now();
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(["test", "--offline", "--test", suite]);
    if !cfg!(debug_assertions) {
        command.arg("--release");
    }
    command.arg("--").args(filter);
    let output = command.current_dir(env!("CARGO_MANIFEST_DIR")).output().expect("cargo runs");
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let result = said.lines().find(|line| line.starts_with("test result:")).unwrap_or("it did not run").to_owned();
    let passed = result.split(" passed").next().and_then(|words| words.rsplit(' ').next()?.parse().ok()).unwrap_or(0);
    row.n = passed;
    row.must(output.status.success() && passed > 0, &result);
    let failed: Vec<&str> = said.lines().filter(|line| line.starts_with("test ") && line.ends_with("FAILED")).collect();
    row.must(failed.is_empty(), failed.join("; "));
    row.note = format!("n: tests of the suite `{suite}` in {:.0} s", began.elapsed().as_secs_f64());
    row
}

pub(crate) fn vendor(_: &Scale) -> Row {
    suite("a library that hangs, aborts and crashes in its own process", "fanuc", &["vendor"])
}

pub(crate) fn access(_: &Scale) -> Row {
    suite(
        "every route of the router without a person, as a viewer and with a strange Host",
        "access",
        &["walk", "signed_in", "far"],
    )
}

pub(crate) fn tls(_: &Scale) -> Row {
    suite(
        "certificates of others, old versions, no certificate, over HTTPS, MQTT, NATS and PostgreSQL",
        "fleet",
        &["secured"],
    )
}

pub(crate) fn crowd(_: &Scale) -> Row {
    suite("10,000 half-open and 1,000 reading sockets; ticks, orders", "access", &["crowd", "--include-ignored"])
}

pub(crate) fn advisories(_: &Scale) -> Row {
    suite("the lock file against the list of known advisories", "tidy", &["advisories"])
}
