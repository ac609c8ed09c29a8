//! What is seen of the service: which version runs, whether its page answers. What an update says about the box comes from here.

use super::UpdateError;
use std::fs;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// The unit of the package.
const UNIT: &str = "cnc-gateway.service";
/// The page answers within this time, or it does not answer.
const PAGE_WITHIN: Duration = Duration::from_secs(3);
/// Time between two looks.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// What the service manager says of the service.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ServiceState {
    /// Its word: `active`, `activating`, `inactive`, `failed`; `unknown` where the service manager does not answer.
    pub word: String,
    /// The slot that the running process was started from; `None`: no process runs, or none from a slot.
    pub slot: Option<String>,
}

/// How the service is started anew and looked at.
pub trait ServiceControl {
    /// Starts it anew and returns when that was asked for.
    ///
    /// # Errors
    /// The service manager refuses.
    fn restart(&self) -> Result<(), UpdateError>;

    /// What is seen of it now.
    fn read_state(&self) -> ServiceState;
}

/// The service of the package.
#[derive(Debug, Clone, Copy)]
pub struct SystemdService;

impl ServiceControl for SystemdService {
    fn restart(&self) -> Result<(), UpdateError> {
        // The unit of an older package has a limit of starts; those of an update do not count.
        let _no_limit = Command::new("systemctl").args(["reset-failed", UNIT]).output();
        let output = Command::new("systemctl").args(["restart", "--no-block", UNIT]).output();
        match output {
            Ok(output) if output.status.success() => Ok(()),
            Ok(output) => Err(UpdateError::Service(String::from_utf8_lossy(&output.stderr).trim().to_owned())),
            Err(error) => Err(UpdateError::Service(format!("systemctl cannot be started: {error}"))),
        }
    }

    fn read_state(&self) -> ServiceState {
        let output = Command::new("systemctl").args(["show", "--property=ActiveState,MainPID", UNIT]).output();
        let text = output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default();
        let value = |key: &str| text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        let process = value("MainPID").and_then(|number| number.parse::<u32>().ok()).filter(|number| *number > 0);
        ServiceState {
            word: value("ActiveState").filter(|word| !word.is_empty()).unwrap_or("unknown").to_owned(),
            slot: process.and_then(|number| slot_of_process(&number.to_string())),
        }
    }
}

/// The slot that a process was started from, where it was started from one. `self` is this process.
pub(super) fn slot_of_process(process: &str) -> Option<String> {
    let program = fs::read_link(Path::new("/proc").join(process).join("exe")).ok()?;
    let folder: PathBuf = program.parent()?.to_owned();
    let in_versions = folder.parent()?.file_name()? == "versions";
    in_versions.then(|| folder.file_name()?.to_str().map(str::to_owned))?
}

/// What the page says when it is asked for `/healthz`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PageAnswer {
    /// It answers that it is well.
    Well,
    /// It is served over TLS, and takes connections. What it would answer was not read.
    Encrypted,
    /// Nothing answers, or something else than 200, in words.
    Not(String),
    /// The configuration serves no page, or cannot be read.
    NotAsked(String),
}

/// Asks the page of `listen` (`HOST:PORT`) whether it is well.
#[must_use]
pub fn ask_page(listen: &str, tls: bool) -> PageAnswer {
    let connected = find_address(listen).and_then(|at| Ok((at, TcpStream::connect_timeout(&at, PAGE_WITHIN)?)));
    let (at, stream) = match connected {
        Ok(connected) => connected,
        Err(error) => return PageAnswer::Not(format!("nothing answers at {listen}: {error}")),
    };
    if tls {
        return PageAnswer::Encrypted;
    }
    match read_health(stream, at) {
        Ok(line) if line.split(' ').nth(1) == Some("200") => PageAnswer::Well,
        Ok(line) => PageAnswer::Not(format!("the page at {listen} answers {:?}", line.trim())),
        Err(error) => PageAnswer::Not(format!("the page at {listen} does not answer: {error}")),
    }
}

/// Where a page that listens there is reached from the box itself.
fn find_address(listen: &str) -> std::io::Result<SocketAddr> {
    let none = || std::io::Error::other("this is no address");
    let mut at = listen.to_socket_addrs()?.next().ok_or_else(none)?;
    if at.ip().is_unspecified() {
        at.set_ip(if at.is_ipv4() { [127, 0, 0, 1].into() } else { std::net::Ipv6Addr::LOCALHOST.into() });
    }
    Ok(at)
}

/// The first line of the answer.
fn read_health(mut stream: TcpStream, at: SocketAddr) -> std::io::Result<String> {
    stream.set_read_timeout(Some(PAGE_WITHIN))?;
    stream.set_write_timeout(Some(PAGE_WITHIN))?;
    write!(stream, "GET /healthz HTTP/1.0\r\nHost: {at}\r\n\r\n")?;
    let mut answer = String::new();
    stream.take(512).read_to_string(&mut answer)?;
    Ok(answer.lines().next().unwrap_or_default().to_owned())
}

/// What was seen of the box at one look.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BoxState {
    /// What the service manager says.
    pub service: ServiceState,
    /// What the page says.
    pub page: PageAnswer,
}

impl BoxState {
    /// The service is active with this slot, and nothing speaks against its page.
    #[must_use]
    pub fn runs_slot(&self, slot: &str) -> bool {
        let page_is_bad = matches!(self.page, PageAnswer::Not(_));
        self.service.word == "active" && self.service.slot.as_deref() == Some(slot) && !page_is_bad
    }
}

impl std::fmt::Display for BoxState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the service is {}, ", self.service.word)?;
        match &self.service.slot {
            Some(slot) => write!(f, "{slot} runs, ")?,
            None => f.write_str("no version of this box runs, ")?,
        }
        match &self.page {
            PageAnswer::Well => f.write_str("its page answers"),
            PageAnswer::Encrypted => f.write_str("its page takes connections (over TLS; its answer was not read)"),
            PageAnswer::Not(why) => f.write_str(why),
            PageAnswer::NotAsked(why) => write!(f, "its page was not asked ({why})"),
        }
    }
}

/// Looks until the service runs this slot and its page answers, for so long at most. Gives what was seen last.
#[must_use]
pub fn look_until_runs(
    slot: &str,
    service: &dyn ServiceControl,
    ask: impl Fn() -> PageAnswer,
    within: Duration,
) -> BoxState {
    let until = Instant::now() + within;
    loop {
        let seen = BoxState { service: service.read_state(), page: ask() };
        if seen.runs_slot(slot) || Instant::now() >= until {
            return seen;
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::BufRead;
    use std::net::TcpListener;

    fn page_that_answers(line: &'static str) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let at = listener.local_addr().expect("an address").to_string();
        std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().expect("asked");
            // A socket that is closed with something unread resets the connection.
            let lines = std::io::BufReader::new(&stream).lines().map(|line| line.expect("a request"));
            let asked: Vec<String> = lines.take_while(|line| !line.is_empty()).collect();
            assert!(asked[0].starts_with("GET /healthz "), "{asked:?}");
            write!(stream, "{line}\r\n\r\n").expect("answered");
        });
        at
    }

    #[test]
    fn the_page_is_what_answers_and_not_what_should() {
        assert_eq!(ask_page(&page_that_answers("HTTP/1.0 200 OK"), false), PageAnswer::Well);
        let starting = ask_page(&page_that_answers("HTTP/1.0 503 Service Unavailable"), false);
        assert!(matches!(&starting, PageAnswer::Not(why) if why.contains("503")), "{starting:?}");
        let free = TcpListener::bind("127.0.0.1:0").and_then(|it| it.local_addr()).expect("a port").to_string();
        for (listen, tls) in [(free.as_str(), false), (free.as_str(), true), ("no address", false)] {
            assert!(matches!(ask_page(listen, tls), PageAnswer::Not(_)), "{listen}");
        }
    }

    #[test]
    fn a_box_runs_a_slot_only_when_all_of_it_is_seen() {
        let seen = |word: &str, slot: Option<&str>, page| BoxState {
            service: ServiceState { word: word.to_owned(), slot: slot.map(str::to_owned) },
            page,
        };
        assert!(seen("active", Some("package"), PageAnswer::Well).runs_slot("package"));
        for other in [
            seen("failed", None, PageAnswer::Not("nothing".to_owned())),
            seen("activating", Some("package"), PageAnswer::Well),
            seen("active", Some("0.4.0"), PageAnswer::Well),
            seen("active", Some("package"), PageAnswer::Not("nothing".to_owned())),
        ] {
            assert!(!other.runs_slot("package"), "{other}");
        }
        assert_eq!(slot_of_process("self"), None);
    }
}
