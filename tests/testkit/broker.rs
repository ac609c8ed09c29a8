//! A real mosquitto on a free port of this computer; killed when dropped.

use crate::port::free_port;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A broker that can be killed and started again at the same port.
pub struct Broker {
    child: Option<Child>,
    directory: tempfile::TempDir,
    /// Where it listens.
    pub port: u16,
}

/// The program, if it is installed. Debian puts it where ordinary users do not look.
pub fn program(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let places = std::env::split_paths(&path).chain([PathBuf::from("/usr/sbin"), PathBuf::from("/usr/bin")]);
    let found = places.map(|place| place.join(name)).find(|file| file.is_file());
    if found.is_none() {
        assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "{name} is not installed");
        eprintln!("SKIPPED: {name} is not installed (Debian: mosquitto, mosquitto-clients)");
    }
    found
}

impl Broker {
    /// An open broker; `None` when mosquitto is not installed.
    pub fn start() -> Option<Self> {
        Self::with("allow_anonymous true\n", |_| {})
    }

    /// A broker with these further lines in its configuration; `{dir}` is a directory of its own, which is prepared first.
    pub fn with(lines: &str, prepare: impl FnOnce(&Path)) -> Option<Self> {
        program("mosquitto")?;
        let directory = tempfile::tempdir().expect("a directory");
        prepare(directory.path());
        let mut broker = Self { child: None, directory, port: free_port() };
        let own = broker.directory.path().display().to_string();
        let text = format!(
            "listener {} 127.0.0.1\nset_tcp_nodelay true\npersistence false\nlog_type none\n{}",
            broker.port,
            lines.replace("{dir}", &own)
        );
        std::fs::write(broker.directory.path().join("conf"), text).expect("writable");
        broker.run();
        Some(broker)
    }

    /// Starts it, again after [`Broker::kill`].
    pub fn run(&mut self) {
        let mut command = Command::new(program("mosquitto").expect("found before"));
        command.arg("-c").arg(self.directory.path().join("conf")).stdout(Stdio::null()).stderr(Stdio::null());
        let child = self.child.insert(command.spawn().expect("mosquitto starts"));
        let until = Instant::now() + Duration::from_secs(10);
        while TcpStream::connect(("127.0.0.1", self.port)).is_err() {
            let ended = child.try_wait().expect("a child of ours");
            assert!(ended.is_none() && Instant::now() < until, "mosquitto does not listen at {}: {ended:?}", self.port);
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Ends it without a goodbye.
    pub fn kill(&mut self) {
        if let Some(mut child) = self.child.take() {
            child.kill().expect("it runs");
            child.wait().expect("it ends");
        }
    }
}

impl Drop for Broker {
    fn drop(&mut self) {
        self.kill();
    }
}
