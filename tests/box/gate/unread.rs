//! Nobody reads what the gateway says: it ticks, serves, arms and writes all the same.

use super::running::{audit, has, order, prepared};
use std::io::{Read, Write};
use std::process::{Child, Stdio};
use std::time::Duration;
use testkit::process::{get, program, run, text, wait_for};

/// What a pipe takes before its writer has to wait.
const PIPE: usize = 65_536;

/// Ends with the test.
struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _gone = self.0.kill().and_then(|()| self.0.wait());
    }
}

/// A pipe that is full from the beginning.
fn full() -> (std::io::PipeReader, Stdio) {
    let (reader, mut writer) = std::io::pipe().expect("a pipe");
    writer.write_all(&vec![b'.'; PIPE]).expect("room");
    (reader, writer.into())
}

#[test]
fn a_full_pipe_stops_neither_the_tick_nor_the_writing() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = prepared(directory.path(), "simulated://lathe?dropouts_per_h=0&begun_s=110");
    let port = testkit::port::free_port();
    let address = format!("127.0.0.1:{port}");
    let ((mut told, operator), (_logged, engineer)) = (full(), full());
    let mut command = program();
    command.args(["run", "--config", text(&config), "--listen", &address, "--log", "text"]);
    let mut gateway = Killed(command.stdout(operator).stderr(engineer).spawn().expect("the program starts"));
    drop(command);
    let ticks = || -> u64 {
        let up = std::net::TcpStream::connect(&address).is_ok();
        if up { get(&address, "/api/v1/status").json()["tick"]["count"].as_u64().unwrap_or(0) } else { 0 }
    };
    let before = wait_for("the first ticks", Duration::from_secs(60), || Some(ticks()).filter(|count| *count > 0));
    assert_eq!(order(&config, &["arm", "--by", "fitter"]).0, Some(0));
    wait_for("a write", Duration::from_secs(100), || has(&audit(directory.path()), "write", "written").then_some(()));
    wait_for("the next ticks", Duration::from_secs(60), || (ticks() > before + 20).then_some(()));
    let stopped = std::process::Command::new("kill").args(["-TERM", &gateway.0.id().to_string()]).status();
    assert!(stopped.expect("kill runs").success());
    let ended = wait_for("its end", Duration::from_secs(30), || gateway.0.try_wait().expect("a child"));
    assert!(ended.success(), "{ended}");
    told.read_exact(&mut vec![0; PIPE]).expect("what was there before");
    let database = directory.path().join("data/history.db");
    assert!(run(&["history", "audit", "--verify", "--history", text(&database)]).status.success());
}
