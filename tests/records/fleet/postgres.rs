//! A PostgreSQL cluster of the test's own in a directory that is removed afterwards.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use testkit::port::free_port;
use testkit::process::wait_for;

/// A running server with a database `postgres` and everyone as its owner.
pub(crate) struct Postgres {
    child: Option<Child>,
    directory: tempfile::TempDir,
    port: u16,
    bin: PathBuf,
    settings: Vec<String>,
}

/// Where Debian keeps the programs of the server.
fn programs() -> Option<PathBuf> {
    let versions = std::fs::read_dir("/usr/lib/postgresql").ok().into_iter().flatten().filter_map(Result::ok);
    let found = versions.map(|version| version.path().join("bin")).find(|bin| bin.join("initdb").is_file());
    if found.is_none() {
        assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "PostgreSQL is not installed");
        eprintln!("SKIPPED: PostgreSQL is not installed (Debian: postgresql)");
    }
    found
}

/// The server refuses to run as root; then it runs as the user that its package has made.
fn as_ordinary_user(program: &Path) -> Command {
    if !rustix_is_root() {
        return Command::new(program);
    }
    let mut command = Command::new("setpriv");
    command.args(["--reuid=postgres", "--regid=postgres", "--clear-groups", "--"]).arg(program);
    command
}

fn rustix_is_root() -> bool {
    let said = Command::new("id").arg("-u").output().expect("id runs");
    String::from_utf8_lossy(&said.stdout).trim() == "0"
}

/// A file that the server owns and nobody else reads.
fn place(from: &Path, to: &Path) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::copy(from, to).expect("copied");
    std::fs::set_permissions(to, std::fs::Permissions::from_mode(0o600)).expect("changed");
    if rustix_is_root() {
        assert!(Command::new("chown").arg("postgres").arg(to).status().expect("chown runs").success());
    }
}

impl Postgres {
    /// Makes and starts one; `None` where it is not installed.
    pub(crate) fn start() -> Option<Self> {
        Self::with(&[], |_| {}, &[])
    }

    /// One with these files in its directory, after `prepare`d pg_hba.conf, and these settings.
    pub(crate) fn with(files: &[(&Path, &str)], prepare: impl FnOnce(&Path), settings: &[&str]) -> Option<Self> {
        let bin = programs()?;
        let directory = tempfile::tempdir().expect("a directory");
        if rustix_is_root() {
            let owned = Command::new("chown").arg("postgres").arg(directory.path()).status();
            assert!(owned.expect("chown runs").success());
        }
        let settings = settings.iter().map(|setting| (*setting).to_owned()).collect();
        let mut postgres = Self { child: None, directory, port: free_port(), bin, settings };
        let data = postgres.directory.path().join("data");
        let mut init = as_ordinary_user(&postgres.bin.join("initdb"));
        init.args(["--auth=trust", "--username=postgres", "--encoding=UTF8", "--no-sync", "-D"]).arg(&data);
        let made = init.current_dir("/").output().expect("initdb runs");
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        prepare(&data);
        for (from, name) in files {
            place(from, &data.join(name));
        }
        postgres.run();
        Some(postgres)
    }

    /// Starts the server, again after [`Postgres::crash`].
    pub(crate) fn run(&mut self) {
        let mut server = as_ordinary_user(&self.bin.join("postgres"));
        server.arg("-D").arg(self.directory.path().join("data"));
        server.args(["-p", &self.port.to_string(), "-c", "listen_addresses=127.0.0.1"]);
        server.arg("-c").arg(format!("unix_socket_directories={}", self.directory.path().display()));
        for setting in &self.settings {
            server.args(["-c", setting]);
        }
        server.current_dir("/").stdout(Stdio::null()).stderr(Stdio::null());
        self.child = Some(server.spawn().expect("it starts"));
        wait_for("PostgreSQL", Duration::from_secs(60), || self.try_sql("SELECT 1").ok());
    }

    /// SIGQUIT: the server ends its own children at once and writes nothing more, so that the next start recovers from its log.
    pub(crate) fn crash(&mut self) {
        let Some(mut child) = self.child.take() else { return };
        let _told = Command::new("kill").args(["-QUIT", &child.id().to_string()]).status();
        let _ended = child.wait();
    }

    /// Its address with this user and host, and these keys at the end.
    pub(crate) fn address_of(&self, user: &str, host: &str, keys: &str) -> String {
        format!("postgres://{user}@{host}:{}/postgres{keys}", self.port)
    }

    /// Its address.
    pub(crate) fn address(&self) -> String {
        format!("postgres://postgres@127.0.0.1:{}/postgres", self.port)
    }

    fn try_sql(&self, statement: &str) -> Result<String, String> {
        let mut client = Command::new(self.bin.join("psql"));
        // Whatever the server asks others for, this comes through its socket.
        client.env("PGHOST", self.directory.path()).env("PGPORT", self.port.to_string());
        client.args([
            "-X",
            "-A",
            "-t",
            "-F",
            "|",
            "-v",
            "ON_ERROR_STOP=1",
            "-U",
            "postgres",
            "-d",
            "postgres",
            "-c",
            statement,
        ]);
        let said = client.output().expect("psql runs");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
        if said.status.success() { Ok(text(&said.stdout)) } else { Err(text(&said.stderr)) }
    }

    /// What psql prints for a statement: rows as lines, columns apart by `|`.
    pub(crate) fn sql(&self, statement: &str) -> String {
        self.try_sql(statement).unwrap_or_else(|error| panic!("{statement}: {error}"))
    }

    /// A number.
    pub(crate) fn number(&self, statement: &str) -> u64 {
        let said = self.try_sql(statement).unwrap_or_default();
        said.parse().unwrap_or(0)
    }
}

impl Drop for Postgres {
    fn drop(&mut self) {
        self.crash();
    }
}
