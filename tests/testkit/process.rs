//! A real gateway as a child process, and a plain HTTP client to ask it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// Where the program under test is. Cargo says so to every test that it runs, and knows it only while it compiles tests of the
/// program's own package, which this is not; a test that is run by hand looks beside its own folder, `target/PROFILE/deps`.
pub fn program_path() -> PathBuf {
    let beside = || {
        let own = std::env::current_exe().expect("this test");
        own.ancestors().nth(2).expect("below target").join("cnc-gateway")
    };
    let path = std::env::var_os("CARGO_BIN_EXE_cnc-gateway").map_or_else(beside, PathBuf::from);
    assert!(path.is_file(), "{} is not there: run the test by cargo", path.display());
    path
}

/// The program under test.
pub fn program() -> Command {
    let mut command = Command::new(program_path());
    command.env_remove("RUST_LOG");
    command
}

/// Runs the program to its end.
pub fn run(arguments: &[&str]) -> Output {
    program().args(arguments).output().expect("the program starts")
}

/// Standard output as text.
pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("a path")
}

/// Standard error as text.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Asks until `ready` gives something; fails after `limit`.
pub fn wait_for<T>(what: &str, limit: Duration, mut ready: impl FnMut() -> Option<T>) -> T {
    let until = Instant::now() + limit;
    loop {
        if let Some(found) = ready() {
            return found;
        }
        assert!(Instant::now() < until, "waited {limit:?} in vain: {what}");
        thread::sleep(Duration::from_millis(20));
    }
}

/// A running gateway; killed when dropped.
pub struct Gateway {
    child: Child,
    said: Arc<Mutex<Vec<String>>>,
}

impl Gateway {
    /// `run` in `data_dir` on a free port, with further arguments.
    pub fn start(data_dir: &Path, arguments: &[&str]) -> Self {
        let mut command = program();
        command.arg("run").arg("--data-dir").arg(data_dir).args(["--listen", "127.0.0.1:0"]).args(arguments);
        Self::spawn(command)
    }

    /// Any command; its lines are collected.
    pub fn spawn(mut command: Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
        let said = Arc::new(Mutex::new(Vec::new()));
        collect(child.stdout.take().expect("piped"), &said);
        collect(child.stderr.take().expect("piped"), &said);
        Self { child, said }
    }

    /// Process number.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Everything it has said so far.
    pub fn said(&self) -> String {
        self.said.lock().expect("no panic in between").join("\n")
    }

    /// Waits for a line that holds `part`.
    pub fn wait_said(&mut self, part: &str) -> String {
        wait_for(&format!("{part:?}; it said:\n{}", self.said()), Duration::from_secs(90), || {
            let said = self.said();
            if let Some(status) = self.child.try_wait().expect("a child") {
                assert!(said.contains(part), "it ended with {status} and had said:\n{said}");
            }
            said.lines().find(|line| line.contains(part)).map(str::to_owned)
        })
    }

    /// `127.0.0.1:PORT` of the page, from what it says.
    pub fn address(&mut self) -> String {
        let line = self.wait_said("live page: http://");
        let (_, rest) = line.split_once("http://").expect("an address");
        rest.trim_end_matches('/').to_owned()
    }

    /// The addresses of its page, `127.0.0.1:PORT`, one for each time that the box has begun.
    pub fn list_pages(&self) -> Vec<String> {
        let said = self.said();
        let pages = said.lines().filter_map(|line| line.split_once("live page: http://"));
        pages.map(|(_, page)| page.trim_end_matches('/').to_owned()).collect()
    }

    /// Sends a signal by name: `TERM`, `INT`, `HUP`, `KILL`.
    pub fn signal(&self, name: &str) {
        let sent =
            Command::new("kill").args([&format!("-{name}"), &self.pid().to_string()]).status().expect("kill runs");
        assert!(sent.success());
    }

    /// Waits for its end.
    pub fn wait(&mut self) -> ExitStatus {
        self.wait_at_most(Duration::from_secs(120))
    }

    /// Waits for its end, so long.
    pub fn wait_at_most(&mut self, limit: Duration) -> ExitStatus {
        let child = &mut self.child;
        wait_for("the end of the process", limit, || child.try_wait().expect("a child"))
    }

    /// SIGTERM and a clean end.
    pub fn stop(mut self) -> String {
        self.signal("TERM");
        let status = self.wait();
        assert!(status.success(), "ended with {status}:\n{}", self.said());
        thread::sleep(Duration::from_millis(50));
        self.said()
    }

    /// Has it ended?
    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().expect("a child").is_some()
    }

    /// SIGKILL.
    pub fn kill(mut self) {
        self.child.kill().expect("killed");
        self.child.wait().expect("a child");
    }
}

impl Drop for Gateway {
    fn drop(&mut self) {
        let _already_gone = self.child.kill();
        let _reaped = self.child.wait();
    }
}

fn collect(stream: impl Read + Send + 'static, said: &Arc<Mutex<Vec<String>>>) {
    let said = said.clone();
    thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            said.lock().expect("no panic in between").push(line);
        }
    });
}

/// An answer.
#[derive(Debug)]
pub struct Answer {
    /// Status code.
    pub status: u16,
    /// Header lines.
    pub head: String,
    /// Body.
    pub body: String,
}

impl Answer {
    /// The body as JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.body).unwrap_or_else(|error| panic!("{error}: {}", self.body))
    }
}

/// `GET path` at `address`.
pub fn get(address: &str, path: &str) -> Answer {
    try_get(address, path).expect("it listens and answers")
}

/// The same of a box that may be starting again at this moment.
pub fn try_get(address: &str, path: &str) -> std::io::Result<Answer> {
    try_request(address, &format!("GET {path} HTTP/1.0\r\nHost: {address}\r\n\r\n"))
}

/// Sends a request as it is and reads until the server closes.
pub fn request(address: &str, text: &str) -> Answer {
    try_request(address, text).expect("it listens and answers")
}

fn try_request(address: &str, text: &str) -> std::io::Result<Answer> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(Duration::from_secs(20)))?;
    stream.write_all(text.as_bytes())?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer)?;
    let answer = String::from_utf8_lossy(&answer).into_owned();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap_or((&answer, ""));
    let status = head.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
    Ok(Answer { status, head: head.to_owned(), body: body.to_owned() })
}

/// The real recordings beside the checkout, or by `CNC_GATEWAY_SHARED`; says so when they are absent.
pub fn shared(file: &str) -> Option<PathBuf> {
    let root = std::env::var_os("CNC_GATEWAY_SHARED").map(PathBuf::from);
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let path = root.unwrap_or(beside).join("data").join(file);
    if path.exists() {
        return Some(path);
    }
    eprintln!("SKIPPED: no recording at {}; set CNC_GATEWAY_SHARED to the directory that holds data/", path.display());
    None
}
