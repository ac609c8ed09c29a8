//! What people do: a box as it is delivered, wrong tokens, and what of the secrets can be read somewhere.

use crate::kills::status;
use crate::process::{Gateway, get, program, request, run, stdout, wait_for};
use crate::table::{Row, Scale};
use std::fs;
use std::path::Path;
use std::time::Duration;

fn post(address: &str, path: &str, body: &str) -> u16 {
    let (kind, length) = ("Content-Type: application/json\r\n", body.len());
    request(
        address,
        &format!("POST {path} HTTP/1.0\r\nHost: {address}\r\n{kind}Content-Length: {length}\r\n\r\n{body}"),
    )
    .status
}

/// X1: without a word of configuration.
pub(crate) fn as_delivered(_: &Scale) -> Row {
    let mut row = Row::new("no configuration: where it listens (ss), what it lets a stranger do, whether it can write");
    let directory = tempfile::tempdir().expect("a directory");
    let mut command = program();
    command.arg("run").arg("--data-dir").arg(directory.path()).args(["--listen", "127.0.0.1:0"]);
    let mut gateway = Gateway::spawn(command);
    let address = gateway.address();
    let gate = wait_for("a status", Duration::from_secs(60), || status(&address))["gate"].clone();
    row.must(gate["mode"] != "armed", gate["mode"].to_string());
    let usual = stdout(&run(&["--help"]));
    row.must(!usual.is_empty(), "no help");
    for path in ["/api/v1/arm", "/api/v1/scripts/own.rhai", "/api/v1/persons", "/api/v1/restore"] {
        let answer = post(&address, path, "{}");
        row.must((400..500).contains(&answer), format!("{path}: {answer}"));
        row.n += 1;
    }
    let persons = directory.path().join("persons.json");
    let open = fs::metadata(&persons)
        .is_ok_and(|file| std::os::unix::fs::PermissionsExt::mode(&file.permissions()) & 0o077 != 0);
    row.must(!open, "persons.json can be read by others");
    row.out_of_band = Some(0);
    row.note = format!("gate {}", gate["mode"]);
    row
}

/// X5: five tries, then a pause for that person; nobody else's, and never for giving the machine back.
pub(crate) fn wrong_tokens(_: &Scale) -> Row {
    let mut row =
        Row::new("wrong tokens until the pause; the same person with the right token, another person, disarm");
    let directory = tempfile::tempdir().expect("a directory");
    let mut gateway = Gateway::start(directory.path(), &[]);
    let address = gateway.address();
    let token = gateway.wait_said("with the token ");
    let token =
        token.split_once("with the token ").and_then(|it| it.1.split(';').next()).unwrap_or_default().to_owned();
    let mut answers = Vec::new();
    for _ in 0..8 {
        answers.push(post(&address, "/api/v1/login", "{\"name\":\"admin\",\"token\":\"wrong\"}"));
        row.n += 1;
    }
    row.must(answers.contains(&429), format!("{answers:?}"));
    let right = format!("{{\"name\":\"admin\",\"token\":\"{token}\"}}");
    let (login, disarm) = (post(&address, "/api/v1/login", &right), post(&address, "/api/v1/disarm", &right));
    row.must(login == 429, format!("the right token signs in during the pause: {login}"));
    row.must(disarm == 200, format!("disarm during the pause: {disarm}"));
    row.out_of_band = Some(0);
    row.note = format!("answers {answers:?}; then login {login}, disarm {disarm}");
    row
}

/// X9: words that are secrets, and everything that the box writes, says and serves.
pub(crate) fn secrets(_: &Scale) -> Row {
    let mut row = Row::new(
        "passwords in the configuration; looked for in logs, files, pages, metrics and the archive for support",
    );
    let directory = tempfile::tempdir().expect("a directory");
    let (data, config) = (directory.path().join("data"), directory.path().join("box.toml"));
    let canary = "canary7d1f";
    fs::write(directory.path().join("secret"), canary).expect("written");
    let lines = format!(
        "[[source]]\naddress = \"simulated://lathe\"\n[[sink]]\nname = \"a\"\naddress = \"mqtt://user@127.0.0.1:1/works?password_file={}\"\n",
        directory.path().join("secret").display()
    );
    fs::write(&config, lines).expect("written");
    let mut gateway =
        Gateway::start(&data, &["--config", config.to_str().expect("a path"), "--log", "json", "--log-level", "trace"]);
    let address = gateway.address();
    let token = gateway.wait_said("with the token ");
    let token =
        token.split_once("with the token ").and_then(|it| it.1.split(';').next()).unwrap_or_default().to_owned();
    wait_for("a status", Duration::from_secs(60), || status(&address));
    std::thread::sleep(Duration::from_secs(5));
    let pages = ["/", "/api/v1/status", "/metrics", "/api/v1/openapi.json"];
    let served: String = pages.iter().map(|path| get(&address, path).body).collect();
    row.must(!served.contains(canary) && !served.contains(&token), "a page tells a secret");
    let said = gateway.stop();
    row.must(!said.contains(canary), "the log tells a password");
    row.must(said.matches(&token).count() == 1, "the first token is told more than once");
    for file in files(&data) {
        let bytes = fs::read(&file).unwrap_or_default();
        let holds = |word: &str| bytes.windows(word.len()).any(|window| window == word.as_bytes());
        row.must(!holds(canary) && !holds(&token), format!("{} holds a secret", file.display()));
        row.n += 1;
    }
    row.note = format!("{} files, {} pages, a log of {} kB", row.n, pages.len(), said.len() / 1000);
    row
}

fn files(directory: &Path) -> Vec<std::path::PathBuf> {
    let entries = fs::read_dir(directory).into_iter().flatten().filter_map(Result::ok).map(|entry| entry.path());
    let (directories, mut found): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    found.extend(directories.iter().flat_map(|directory| files(directory)));
    found
}
