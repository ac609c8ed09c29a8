//! A box as the package lays it out, under a service manager in small: it does what the unit says of guard, program and restarts, on real
//! processes. What runs is then known from outside, and what the program prints of it can be compared.

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};
use testkit::process::{text, wait_for};

const GUARD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/gateway/package/guard");
const UNIT: &str = include_str!("../../../gateway/package/cnc-gateway.service");
pub(super) const UPDATES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/update");
/// A process that has lived for so long is ready; the unit waits for a word of it.
const READY_AFTER: Duration = Duration::from_millis(60);
/// The unit waits for 2 s; here time is shorter.
const RESTART_AFTER: Duration = Duration::from_millis(20);
/// What the manager is asked by files in its folder, as `systemctl` leaves them.
const SYSTEMCTL: &str = r#"cd @PLACE@/manager || exit 1
case "$1" in
  show) cat state ;;
  restart) : > restart ;;
esac"#;

pub(super) fn write_program(path: &Path, body: &str) {
    fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
    fs::write(path, format!("#!/bin/sh\n{body}\n")).expect("written");
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).expect("executable");
}

/// What the service manager does before every start.
pub(super) fn start_guard(home: &Path, state: &Path) {
    let runtime = home.with_file_name("no runtime folder");
    let mut guard = Command::new("sh");
    let status = guard.arg(GUARD).args([home, state, &runtime]).stderr(Stdio::null()).status().expect("sh");
    assert!(status.success(), "the guard keeps nothing from starting");
}

pub(super) fn current(home: &Path) -> String {
    fs::read_link(home.join("current")).expect("a link").to_string_lossy().into_owned()
}

/// A box with the version of a package, 0.1.0. Its service runs only when it is started.
pub(super) struct PackagedBox {
    /// Ends before its directory goes.
    manager: Option<Manager>,
    directory: tempfile::TempDir,
}

impl PackagedBox {
    pub(super) fn new() -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        let place = directory.path();
        let program = fs::read_to_string(format!("{UPDATES}/version.sh")).expect("a program");
        let program = program.replace("@VERSION@", "0.1.0");
        write_program(&place.join("home/versions/package/cnc-gateway"), program.trim_start_matches("#!/bin/sh\n"));
        symlink("versions/package", place.join("home/current")).expect("a link");
        for folder in ["data", "manager"] {
            fs::create_dir_all(place.join(folder)).expect("a folder");
        }
        write_program(&place.join("bin/systemctl"), &SYSTEMCTL.replace("@PLACE@", text(place)));
        fs::write(place.join("box.toml"), "[http]\nenabled = false\n[[source]]\naddress = \"simulated://lathe\"\n")
            .expect("written");
        Self { directory, manager: None }
    }

    /// The same with its service running.
    pub(super) fn started() -> Self {
        let mut made = Self::new();
        made.manager = Some(Manager::start(made.place()));
        wait_for("the version of the package", Duration::from_secs(10), || {
            (made.runs().as_deref() == Some("package")).then_some(())
        });
        made
    }

    pub(super) fn place(&self) -> &Path {
        self.directory.path()
    }

    pub(super) fn home(&self) -> PathBuf {
        self.place().join("home")
    }

    pub(super) fn data(&self) -> PathBuf {
        self.place().join("data")
    }

    /// How this version behaves from its next start on: `good`, `late`, `crash`, `hang`.
    pub(super) fn set_mode(&self, version: &str, mode: &str) {
        fs::write(self.data().join(format!("mode-{version}")), mode).expect("written");
    }

    /// `cnc-gateway update` in this box, under another program where one is given.
    pub(super) fn update_command(&self, under: &[&str], arguments: &[&str]) -> Command {
        let path = format!("{}:{}", self.place().join("bin").display(), std::env::var("PATH").unwrap_or_default());
        let words = [under, &[env!("CARGO_BIN_EXE_cnc-gateway"), "update"]].concat();
        let mut command = Command::new(words[0]);
        command.args(&words[1..]).env("PATH", path).env_remove("RUST_LOG").args(arguments);
        command.args(["--home", text(&self.home()), "--data-dir", text(&self.data())]);
        command.args(["--config", text(&self.place().join("box.toml")), "--confirm-within", "1.5"]);
        command
    }

    pub(super) fn update(&self, arguments: &[&str]) -> Output {
        self.update_command(&[], arguments).output().expect("started")
    }

    /// The word of the service manager for the service.
    pub(super) fn word(&self) -> String {
        self.read_state().lines().find_map(|line| line.strip_prefix("ActiveState=")).unwrap_or("unknown").to_owned()
    }

    fn read_state(&self) -> String {
        fs::read_to_string(self.place().join("manager/state")).unwrap_or_default()
    }

    /// The version whose process runs, seen from outside.
    pub(super) fn runs(&self) -> Option<String> {
        let state = self.read_state();
        let process = state.lines().find_map(|line| line.strip_prefix("MainPID="))?;
        let program = fs::read_link(format!("/proc/{process}/exe")).ok()?;
        let slot = program.parent()?.file_name()?.to_str()?;
        program.starts_with(self.home().canonicalize().ok()?).then(|| slot.to_owned())
    }

    pub(super) fn has_failed(&self) -> bool {
        self.place().join("manager/has-failed").exists()
    }

    /// How a person or the power starts it anew.
    pub(super) fn restart(&self) {
        fs::write(self.place().join("manager/restart"), "").expect("written");
        wait_for("the restart", Duration::from_secs(10), || {
            (!self.place().join("manager/restart").exists() && self.word() == "active").then_some(())
        });
    }

    /// The power fails and comes back: everything begins anew but the disk.
    pub(super) fn restart_all(&mut self) {
        self.manager = None;
        self.manager = Some(Manager::start(self.place()));
    }
}

/// The service manager in small; ends with the processes of the service when it is dropped.
struct Manager {
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Manager {
    fn start(place: &Path) -> Self {
        let ends = Arc::new(AtomicBool::new(false));
        let service = Service { place: place.to_owned(), starts: Vec::new(), ends: ends.clone() };
        Self { ends, thread: Some(std::thread::spawn(move || service.keep_running())) }
    }
}

impl Drop for Manager {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A test that fails already says more.
            let _broke_off = thread.join();
        }
    }
}

struct Service {
    place: PathBuf,
    starts: Vec<Instant>,
    ends: Arc<AtomicBool>,
}

impl Service {
    fn keep_running(mut self) {
        while !self.ends.load(Ordering::Relaxed) {
            if self.is_over_limit() {
                self.tell("failed", 0);
                fs::write(self.place.join("manager/has-failed"), "").expect("written");
                return;
            }
            self.tell("activating", 0);
            start_guard(&self.place.join("home"), &self.place.join("data"));
            match self.start_program() {
                Ok(child) => self.watch(child),
                Err(_) => sleep(RESTART_AFTER),
            }
        }
    }

    /// The limit of starts in the unit; 0 is none.
    fn is_over_limit(&mut self) -> bool {
        let value = |key: &str| UNIT.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('=')?.parse().ok());
        // What the service manager has without these lines.
        let (interval_s, burst) = (value("StartLimitIntervalSec").unwrap_or(10), value("StartLimitBurst").unwrap_or(5));
        self.starts.retain(|start| start.elapsed() < Duration::from_secs(interval_s));
        self.starts.push(Instant::now());
        interval_s > 0 && self.starts.len() as u64 > burst
    }

    fn start_program(&self) -> std::io::Result<Child> {
        let mut command = Command::new(self.place.join("home/current/cnc-gateway"));
        command.args(["run", "--data-dir", text(&self.place.join("data"))]);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).process_group(0).spawn()
    }

    fn watch(&self, mut child: Child) {
        let (began, mut is_ready) = (Instant::now(), false);
        let restart = self.place.join("manager/restart");
        while matches!(child.try_wait(), Ok(None)) {
            if !is_ready && began.elapsed() >= READY_AFTER {
                is_ready = true;
                self.tell("active", child.id());
            }
            let is_wanted = !restart.exists() && !self.ends.load(Ordering::Relaxed);
            if !is_wanted {
                let group = format!("-{}", child.id());
                Command::new("kill").args(["-KILL", "--", &group]).stderr(Stdio::null()).status().expect("kill runs");
                child.wait().expect("a child");
                // Nobody may take what was so before for the next start.
                self.tell("deactivating", 0);
                let _asked_by_nobody = fs::remove_file(&restart);
                return;
            }
            sleep(Duration::from_millis(5));
        }
        // A program that ends is started again; a restart that somebody asked for meanwhile is done by that, too.
        let _asked_by_nobody = fs::remove_file(&restart);
        self.tell("activating", 0);
        sleep(RESTART_AFTER);
    }

    fn tell(&self, word: &str, process: u32) {
        let (path, fresh) = (self.place.join("manager/state"), self.place.join("manager/state.new"));
        fs::write(&fresh, format!("ActiveState={word}\nMainPID={process}\n")).expect("written");
        fs::rename(&fresh, &path).expect("renamed");
    }
}
