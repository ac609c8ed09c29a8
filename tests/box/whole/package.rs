//! What a package adds to the program: the guard before every start, the service manager, the first configuration.

use super::service::{PackagedBox, current, start_guard, write_program};
use std::fs;
use std::io::Write;
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixDatagram;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use testkit::process::{Gateway, get, program, run, stderr, stdout, text, wait_for};

#[test]
fn a_version_that_nobody_confirms_is_taken_back_at_the_fourth_start() {
    let packaged = PackagedBox::new();
    let (home, state) = (packaged.home(), packaged.data());
    write_program(&home.join("versions/9.9.9/cnc-gateway"), "exit 1");
    // As an update of an older version leaves it: no starts, and no way back.
    let begin = || {
        fs::write(home.join("trial"), "package 9.9.9 0\n").expect("written");
        fs::remove_file(home.join("current")).expect("removed");
        symlink("versions/9.9.9", home.join("current")).expect("a link");
    };
    begin();
    for _ in 0..3 {
        start_guard(&home, &state);
        assert_eq!(current(&home), "versions/9.9.9");
    }
    start_guard(&home, &state);
    assert_eq!(current(&home), "versions/package");
    assert!(!home.join("trial").exists());
    assert!(fs::read_to_string(home.join("rolled-back")).expect("told").contains("9.9.9"));

    begin();
    fs::write(state.join("confirmed"), "9.9.9").expect("written");
    (0..5).for_each(|_| start_guard(&home, &state));
    assert_eq!(current(&home), "versions/9.9.9", "a version that is well stays");

    // The power failed while the trial was written: half a line, another name, a name that leads elsewhere.
    for half in ["", "package", "package 9.9", "package ../../tmp 0\n", "nothing 9.9.9 0\n", "package 9.9.9 x"] {
        fs::write(home.join("trial"), half).expect("written");
        start_guard(&home, &state);
        assert_eq!(current(&home), "versions/9.9.9", "{half:?}");
    }
}

#[test]
fn a_box_is_set_up_with_one_command() {
    let mut control = program();
    control.args(["serve", "fanuc", "--machine", "lathe", "--listen", "127.0.0.1:0"]);
    let mut control = Gateway::spawn(control);
    let line = control.wait_said("fanuc://");
    let control_address = line.split_whitespace().next().expect("an address");
    let directory = tempfile::tempdir().expect("a directory");
    let (config, data) = (directory.path().join("box.toml"), directory.path().join("data"));
    let command = ["setup", "--yes", "--name", "CK6136", "--admin", "Li Wei", "--control", control_address];
    let files = ["--out", text(&config), "--data-dir", text(&data)];
    let output = run(&[&command[..], &files[..]].concat());
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    let said = stdout(&output);
    assert!(said.contains("answers") && said.contains("token, shown only now, of Li Wei"), "{said}");
    let checked = run(&["check", "--config", text(&config)]);
    assert_eq!(checked.status.code(), Some(0), "{}", stdout(&checked));
    let mut gateway = Gateway::start(&data, &["--config", text(&config)]);
    let address = gateway.address();
    wait_for("a value of the control", Duration::from_secs(30), || {
        let status = get(&address, "/api/v1/status").json();
        let channels = status["channels"].as_array()?.clone();
        channels.iter().any(|row| row["name"] == "program" && row["value"].is_string()).then_some(())
    });
    gateway.stop();
}

/// Answers that are piped in are taken, the language is asked first, and what is started with the file alone knows the person whose token
/// was shown.
#[test]
fn a_box_that_was_set_up_elsewhere_takes_the_token_that_was_shown() {
    let directory = tempfile::tempdir().expect("a directory");
    let (config, data) = (directory.path().join("box.toml"), directory.path().join("data"));
    let mut command = program();
    command.args(["setup", "--out", text(&config), "--data-dir", "data"]).current_dir(directory.path());
    let mut setup = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it starts");
    let answers = "zh\nCK6136\nsimulated://lathe?begun_s=600\nnone\nn\nLi\n";
    setup.stdin.take().expect("piped").write_all(answers.as_bytes()).expect("answered");
    let output = setup.wait_with_output().expect("it ends");
    let said = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("机床名称") && said.contains("令牌"), "asked in Chinese: {said}");
    let written = fs::read_to_string(&config).expect("written");
    assert!(written.contains("language = \"zh\"") && written.contains("name = \"CK6136\""), "{written}");
    assert!(written.contains(&format!("data_dir = \"{}\"", text(&data))), "{written}");
    let token = said.lines().find(|line| line.contains("令牌") && line.contains("Li:")).expect("a token");
    let token = token.rsplit(' ').next().expect("a token");
    let mut command = program();
    command.args(["run", "--config", text(&config), "--listen", "127.0.0.1:0"]);
    let mut gateway = Gateway::spawn(command);
    let address = gateway.address();
    let body = format!("{{\"name\":\"Li\",\"token\":\"{token}\"}}");
    let asked = format!(
        "POST /api/v1/login HTTP/1.0\r\nHost: {address}\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    );
    assert_eq!(testkit::process::request(&address, &asked).status, 200, "the token of the setup signs in");
    gateway.stop();
}

/// What the service manager hears of a box that it has started.
struct NotifySocket {
    socket: UnixDatagram,
    directory: tempfile::TempDir,
}

impl NotifySocket {
    fn new() -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        let socket = UnixDatagram::bind(directory.path().join("notify")).expect("a socket");
        socket.set_read_timeout(Some(Duration::from_millis(200))).expect("a limit");
        Self { socket, directory }
    }

    /// Starts a box that tells this socket.
    fn start_box(&self) -> Gateway {
        let mut command = program();
        let data = self.directory.path().join("data");
        command.args(["run", "--data-dir", text(&data), "--listen", "127.0.0.1:0"]);
        command.env("NOTIFY_SOCKET", self.directory.path().join("notify"));
        Gateway::spawn(command)
    }

    /// What comes next; nothing where nothing comes within 200 ms.
    fn hear(&self) -> String {
        let mut bytes = [0; 4096];
        let length = self.socket.recv(&mut bytes).unwrap_or(0);
        String::from_utf8_lossy(&bytes[..length]).into_owned()
    }

    fn wait_line(&self, begin: &str) {
        wait_for(begin, Duration::from_secs(30), || {
            self.hear().lines().any(|line| line.starts_with(begin)).then_some(())
        });
    }
}

#[test]
fn the_service_manager_hears_of_the_start_of_life_and_of_the_end() {
    let notified = NotifySocket::new();
    let began = Instant::now();
    let mut gateway = notified.start_box();
    notified.wait_line("READY=1");
    println!("ready after {:.2} s", began.elapsed().as_secs_f64());
    (0..3).for_each(|_| notified.wait_line("WATCHDOG=1"));
    // Stopped as a whole it gives no sign of life, and goes on when it may.
    gateway.signal("STOP");
    while !notified.hear().is_empty() {}
    // Signs come about once a second.
    let until = Instant::now() + Duration::from_secs(3);
    while Instant::now() < until {
        assert_eq!(notified.hear(), "", "a sign of life of a process that stands still");
    }
    gateway.signal("CONT");
    notified.wait_line("WATCHDOG=1");
    gateway.signal("TERM");
    notified.wait_line("STOPPING=1");
    assert!(gateway.wait().success());
}

/// How long a thread that hangs goes unnoticed: all its calls of the system are held up by strace. Ended by the service manager it is
/// `WatchdogSec` (30 s) later.
#[test]
#[ignore = "2 minutes: how long a thread that hangs goes unnoticed; needs strace and the right to trace"]
fn a_thread_that_hangs_ends_the_sign_of_life() {
    for (thread, part) in [("source", "poll"), ("history", "history"), ("serve", "page"), ("tick", "")] {
        let notified = NotifySocket::new();
        let mut gateway = notified.start_box();
        notified.wait_line("READY=1");
        gateway.address();
        let mut holding = hold_threads(gateway.pid(), thread);
        let (began, mut last_sign, mut told) = (Instant::now(), Duration::ZERO, String::new());
        while began.elapsed() < Duration::from_secs(26) {
            let heard = notified.hear();
            if heard.contains("WATCHDOG=1") {
                last_sign = began.elapsed();
            }
            if heard.contains("stands still") {
                told = heard;
            }
        }
        println!("{thread}: last sign of life after {:.1} s; told: {}", last_sign.as_secs_f64(), told.trim());
        assert!(last_sign < Duration::from_secs(23), "{thread}: a sign of life after {last_sign:?}");
        assert!(part.is_empty() || told.contains(part), "{thread}: told {told:?}");
        let _ended = (holding.kill(), holding.wait());
        gateway.kill();
    }
}

/// strace at every thread of this name; each of its calls waits for five minutes.
fn hold_threads(pid: u32, name: &str) -> std::process::Child {
    let mut strace = Command::new("strace");
    strace.args(["-qq", "-o", "/dev/null", "-e", "trace=all", "-e", "inject=all:delay_enter=300000000"]);
    let threads = fs::read_dir(format!("/proc/{pid}/task")).expect("it runs").flatten();
    let mut count = 0;
    for thread in threads {
        let named = fs::read_to_string(thread.path().join("comm")).is_ok_and(|found| found.trim() == name);
        if named {
            strace.arg("-p").arg(thread.file_name());
            count += 1;
        }
    }
    assert!(count > 0, "no thread {name}");
    strace.stderr(Stdio::null()).spawn().expect("strace runs")
}
