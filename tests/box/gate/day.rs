//! In the default configuration nothing is ever written, as the simulated controller itself counts.

use testkit::process::run;
use testkit::process::{stdout, text};

/// The line at the end of a run in the default configuration, over so many seconds of machine time.
fn counted(seconds: &str) -> String {
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    std::fs::create_dir_all(data.join("scripts")).expect("a directory");
    let greedy = "if state == \"cutting\" { request_feed_override(60, \"greed\"); }";
    std::fs::write(data.join("scripts/greedy.rhai"), greedy).expect("a script");
    let told = run(&["run", "--data-dir", text(&data), "--listen", "127.0.0.1:0", "--speed", "max", "--for", seconds]);
    let said = stdout(&told);
    assert!(told.status.success(), "{said}");
    let database = data.join("history.db");
    let audit = run(&["history", "audit", "--history", text(&database), "--json", "--limit", "1000000"]);
    assert!(stdout(&audit).contains("\"shadow\"") && !stdout(&audit).contains("\"write\""), "{}", stdout(&audit));
    said.lines().find(|line| line.contains("has counted")).unwrap_or_default().to_owned()
}

#[test]
fn an_hour_in_the_default_configuration_writes_nothing() {
    let line = counted("1800");
    assert!(line.contains("the simulated controller has counted 0 writes"), "{line}");
}

/// `cargo test --release --test box a_day_in -- --ignored --nocapture`
#[test]
#[ignore = "1 minute: a day of machine time in the default configuration writes nothing"]
fn a_day_in_the_default_configuration_writes_nothing() {
    let line = counted("86400");
    println!("24 h of machine time, default configuration, a script that asks for 60 % in every cut: {line}");
    assert!(line.contains("the simulated controller has counted 0 writes"), "{line}");
}
