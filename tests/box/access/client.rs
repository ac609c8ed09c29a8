//! A plain client of the page that signs in, and a gateway to sign in to.

use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use testkit::process::{Answer, Gateway, program, request, run, stderr, stdout, text};

/// A gateway whose data directory lies in a directory of its own.
pub(crate) struct Testbed {
    pub(crate) gateway: Gateway,
    pub(crate) address: String,
    pub(crate) config: PathBuf,
    /// Of the administrator, who was made before the first start.
    pub(crate) token: String,
    pub(crate) directory: tempfile::TempDir,
}

/// Starts a simulated machine that may be armed, with these lines under `[http]`.
pub(crate) fn testbed(http: &str) -> Testbed {
    let directory = tempfile::tempdir().expect("a directory");
    let scripts = directory.path().join("data/scripts");
    std::fs::create_dir_all(&scripts).expect("a directory");
    std::fs::write(scripts.join("slow.rhai"), "request_feed_override(70, \"test\");").expect("a script");
    let config = directory.path().join("cnc-gateway.toml");
    let written = format!(
        "[gateway]\ndata_dir = \"data\"\n[[source]]\naddress = \"simulated://lathe?dropouts_per_h=0&begun_s=260\"\nname = \"lathe\"\n\
         [gate]\nmode = \"armed\"\nsource = \"lathe\"\n[http]\nlisten = \"127.0.0.1:0\"\n{http}"
    );
    std::fs::write(&config, written).expect("a configuration");
    let made = run(&["person", "add", "admin", "--role", "admin", "--config", text(&config)]);
    let token = stdout(&made).trim().rsplit(' ').next().expect("a token").to_owned();
    let (gateway, address) = started(&config);
    Testbed { gateway, address, config, token, directory }
}

/// The gateway of this configuration, and `HOST:PORT` of its page.
pub(crate) fn started(config: &Path) -> (Gateway, String) {
    let mut command = program();
    command.args(["run", "--config", text(config)]);
    let mut gateway = Gateway::spawn(command);
    let line = gateway.wait_said("live page: ");
    let address = line.split("://").nth(1).expect("an address").trim_end_matches('/').to_owned();
    (gateway, address)
}

impl Testbed {
    /// A client that nobody has signed in.
    pub(crate) fn client(&self) -> Client {
        Client { address: self.address.clone(), cookie: String::new() }
    }

    /// The administrator of the first start.
    pub(crate) fn admin(&self) -> Client {
        let mut client = self.client();
        let answer = client.sign_in("admin", &self.token);
        assert_eq!(answer.status, 200, "{}", answer.body);
        client
    }

    /// A new person of this role, made at the box, and the token.
    pub(crate) fn person(&self, name: &str, role: &str) -> String {
        let (code, said) = self.command(&["person", "add", name, "--role", role, "--json"]);
        assert_eq!(code, Some(0), "{said}");
        let told: Value = serde_json::from_str(&said).expect("JSON");
        told["token"].as_str().expect("a token").to_owned()
    }

    /// A command of the program about this gateway.
    pub(crate) fn command(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let told = run(&[arguments, &["--config", text(&self.config)]].concat());
        (told.status.code(), format!("{}{}", stdout(&told), stderr(&told)))
    }

    /// The audit after the end of the gateway; the chain holds.
    pub(crate) fn audit(&self) -> Vec<Value> {
        let database = self.directory.path().join("data/history.db");
        let verified = run(&["history", "audit", "--verify", "--history", text(&database)]);
        assert!(verified.status.success(), "{}{}", stdout(&verified), stderr(&verified));
        let told = run(&["history", "audit", "--json", "--history", text(&database)]);
        let document: Value = serde_json::from_str(&stdout(&told)).expect("JSON");
        document["rows"].as_array().expect("rows").clone()
    }
}

/// How many rows of the audit are of this kind and came out so, about this.
pub(crate) fn rows(audit: &[Value], kind: &str, outcome: &str, about: &str) -> usize {
    let fits = |row: &&Value| {
        let reason = row["reason"].as_str().unwrap_or_default();
        row["kind"] == kind && row["outcome"] == outcome && reason.contains(about)
    };
    audit.iter().filter(fits).count()
}

/// A browser without a page.
#[derive(Debug, Clone)]
pub(crate) struct Client {
    pub(crate) address: String,
    pub(crate) cookie: String,
}

impl Client {
    /// Sends a request as it is, with these further lines of the head.
    pub(crate) fn send(&self, verb: &str, path: &str, head: &str, body: &str) -> Answer {
        let cookie = if self.cookie.is_empty() { String::new() } else { format!("Cookie: {}\r\n", self.cookie) };
        let host = if head.contains("Host: ") { String::new() } else { format!("Host: {}\r\n", self.address) };
        let length = body.len();
        let text = format!("{verb} {path} HTTP/1.0\r\n{host}{cookie}{head}Content-Length: {length}\r\n\r\n{body}");
        request(&self.address, &text)
    }

    /// Only announces a body of so many bytes. A server that refuses it reads none of it and closes, which a client that is still
    /// sending megabytes would see as a broken line.
    pub(crate) fn announce(&self, verb: &str, path: &str, head: &str, length: usize) -> Answer {
        let cookie = if self.cookie.is_empty() { String::new() } else { format!("Cookie: {}\r\n", self.cookie) };
        let address = &self.address;
        let text =
            format!("{verb} {path} HTTP/1.0\r\nHost: {address}\r\n{cookie}{head}Content-Length: {length}\r\n\r\n");
        request(address, &text)
    }

    /// The same with a body of JSON.
    pub(crate) fn json(&self, verb: &str, path: &str, body: &Value) -> Answer {
        self.send(verb, path, "Content-Type: application/json\r\n", &body.to_string())
    }

    pub(crate) fn get(&self, path: &str) -> Answer {
        self.send("GET", path, "", "")
    }

    /// Signs in and keeps the cookie.
    pub(crate) fn sign_in(&mut self, name: &str, token: &str) -> Answer {
        let answer = self.json("POST", "/api/v1/login", &json!({ "name": name, "token": token }));
        let set = answer.head.lines().find_map(|line| line.strip_prefix("set-cookie: "));
        if let Some(pair) = set.and_then(|set| set.split(';').next()) {
            pair.clone_into(&mut self.cookie);
        }
        answer
    }
}
