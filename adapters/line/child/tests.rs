//! Real children: a shell stands in for the program, because the test binary has no subcommands.

use super::*;
use std::time::{Duration, Instant};

/// A child whose program is a script. Another process writes it: while this one had it open for writing, a test that
/// starts a process at the same moment would keep it busy.
fn child(script: &str, deadline_ms: u64) -> (Supervised, tempfile::TempDir) {
    let directory = tempfile::tempdir().expect("a directory");
    let program = directory.path().join("child.sh");
    let text = format!("#!/bin/sh\n{script}\n");
    let written = std::process::Command::new("sh")
        .args(["-c", "printf %s \"$1\" > \"$0\" && chmod +x \"$0\""])
        .arg(&program)
        .arg(&text)
        .status();
    assert!(written.expect("a shell").success());
    let mut settings = ChildSettings::new("test", &[], Duration::from_millis(deadline_ms));
    settings.program = Some(program);
    settings.pause_min = Duration::from_millis(10);
    (Supervised::new(settings), directory)
}

/// Writing to the socket needs a descriptor of our own: standard input is the socket, in both directions.
const ECHO: &str = "cat <&0 >&0";

#[test]
fn a_child_answers_and_is_asked_again() {
    let (mut child, _directory) = child(ECHO, 5000);
    for round in 0..20u8 {
        let message = vec![round; 1000 * usize::from(round)];
        assert_eq!(child.request_answer(&message), Ok(message));
    }
    assert_eq!((child.counts().starts, child.counts().answers), (1, 20));
}

#[test]
fn a_child_that_hangs_is_killed_and_another_one_started() {
    let (mut child, _directory) = child("sleep 60", 150);
    let began = Instant::now();
    assert!(matches!(child.request_answer(b"hello"), Err(ChildError::Hung(_))));
    assert!(began.elapsed() < Duration::from_secs(5) && child.process_id().is_none());
    std::thread::sleep(Duration::from_millis(50));
    assert!(matches!(child.request_answer(b"hello"), Err(ChildError::Hung(_))));
    assert_eq!((child.counts().starts, child.counts().hung, child.generation()), (2, 2, 2));
}

#[test]
fn a_child_that_dies_is_told_with_its_status_and_waits_before_the_next_start() {
    let (mut child, _directory) = child("kill -ABRT $$", 5000);
    let Err(ChildError::Died(status)) = child.request_answer(b"hello") else { panic!("it died") };
    assert!(status.contains("signal"), "{status}");
    assert!(matches!(child.request_answer(b"hello"), Err(ChildError::Pausing(_) | ChildError::Died(_))));
}

#[test]
fn something_that_is_no_answer_ends_the_child() {
    let (mut child, _directory) = child("echo 'FOCAS2 log file is not found.' >&0; sleep 60", 5000);
    assert!(matches!(child.request_answer(b"hello"), Err(ChildError::NoAnswer(_))));
    assert!(matches!(
        child.request_answer(&vec![0; MESSAGE_MAX + 1]),
        Err(ChildError::Pausing(_) | ChildError::NoAnswer(_))
    ));
}

#[test]
fn a_program_that_is_not_there_is_told() {
    let mut settings = ChildSettings::new("test", &[], Duration::from_secs(1));
    settings.program = Some("/does/not/exist".into());
    assert!(matches!(Supervised::new(settings).request_answer(b"x"), Err(ChildError::Start(_))));
}

#[test]
fn nothing_is_left_of_two_hundred_children() {
    let files = || std::fs::read_dir("/proc/self/fd").map_or(0, Iterator::count);
    let (mut child, _directory) = child("exit 3", 5000);
    let before = files();
    // Other tests of this process open files at the same time; a leak would be 200 and more.
    for _ in 0..200 {
        let _ = child.request_answer(b"x");
        child.end_child();
    }
    assert!(files() <= before + 100, "{} files before, {} after", before, files());
    assert_eq!(child.counts().starts, 200);
}
