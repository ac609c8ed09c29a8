//! Who looks after the threads of a running box: what each does, and what follows when it breaks off.
//!
//! A panic of any thread is known to `adapter_core`'s list at the moment it happens (the hook of [`gateway_base::log::keep_crash_reports`]), whoever
//! has caught it. The tick compares at every tick, before anything is decided: it disarms the gate, tells it as an event and as a problem of
//! the status that stands until the process ends, and, where the thread is not started again, nobody can arm any more. A thread that hangs
//! is the matter of [`service_manager`](super::service_manager): the sign of life of the whole process ends.

use adapters::threads::{BrokenThread, count_panics, list_broken};
use gateway_base::log::{Notice, Severity};
use gateway_status::StatusProblem;

/// What follows when a thread breaks off, besides that the gate is disarmed and that it is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Consequence {
    /// The machine is given back to its dial, and the process ends with an error; the service manager starts it again.
    ProcessEnds,
    /// It is begun anew by itself.
    BeginsAnew,
    /// What broke off was one piece of work; the thread goes on with the next one.
    GoesOn,
    /// What it does is not done any more until somebody starts the process again; nobody can arm until then.
    Stays,
}

/// A kind of thread.
#[derive(Debug, Clone, Copy)]
pub struct ThreadKind {
    /// Name of the thread, as the system shows it.
    pub name: &'static str,
    /// What it does, in words that stand behind "the thread that".
    pub does: &'static str,
    /// What follows when it breaks off.
    pub consequence: Consequence,
}

const fn kind(name: &'static str, does: &'static str, consequence: Consequence) -> ThreadKind {
    ThreadKind { name, does, consequence }
}

/// Every thread of a running box. A name that is not in here is treated as one that stays away.
pub const THREADS: &[ThreadKind] = &[
    kind("tick", "decides at every tick", Consequence::ProcessEnds),
    kind("gate", "writes to the machine", Consequence::Stays),
    kind("history", "writes the history", Consequence::BeginsAnew),
    kind("audit", "keeps the newest rows of the audit beside the history", Consequence::Stays),
    kind("source", "polls a source", Consequence::GoesOn),
    kind("mqtt", "reads from a broker", Consequence::Stays),
    kind("waveform", "reads a waveform", Consequence::Stays),
    kind("serve", "answers the page and serves the sinks", Consequence::GoesOn),
    kind("control", "takes orders at the box", Consequence::Stays),
    kind("save", "saves what is learned", Consequence::Stays),
    kind("wear", "reads the wear models", Consequence::Stays),
    kind("twin", "waits for diagnoses", Consequence::Stays),
    kind("files", "waits for diagnoses of files", Consequence::Stays),
    kind("align", "estimates how late meters are", Consequence::BeginsAnew),
    kind("backup", "takes backups", Consequence::Stays),
    kind("backup work", "writes a copy to its target", Consequence::Stays),
    kind("scripts", "watches the scripts", Consequence::Stays),
    kind("operations", "watches the recipe", Consequence::Stays),
    kind("opening", "tells the service manager that the box opens", Consequence::Stays),
    kind("told", "tells the operator", Consequence::Stays),
    kind("log", "writes the log", Consequence::Stays),
];

fn find_kind(name: &str) -> ThreadKind {
    let unknown = kind("", "has no other name", Consequence::Stays);
    THREADS.iter().copied().find(|known| known.name == name).unwrap_or(unknown)
}

/// What the tick knows of the threads.
#[derive(Debug)]
pub struct Supervisor {
    panics: u64,
    /// What was known at the last look.
    known: Vec<BrokenThread>,
}

/// What a look has found.
#[derive(Debug)]
pub struct Breakage {
    /// What the person at the box is to be told of it.
    pub notices: Vec<Notice>,
    /// Name of a thread that is not started again.
    pub gone: Option<String>,
}

impl Supervisor {
    /// What broke off before this moment is known and no news.
    #[must_use]
    pub fn new() -> Self {
        Self { panics: count_panics(), known: list_broken() }
    }

    /// What broke off since the last call; nothing as a rule.
    pub fn look_at_threads(&mut self) -> Option<Breakage> {
        let panics = count_panics();
        if std::mem::replace(&mut self.panics, panics) == panics {
            return None;
        }
        let now = list_broken();
        let is_new = |broken: &&BrokenThread| !self.known.contains(broken);
        let news: Vec<BrokenThread> = now.iter().filter(is_new).cloned().collect();
        self.known = now;
        let notice = |broken: &BrokenThread| {
            Notice::new(Severity::Error, "thread_broke_off", describe_broken(broken)).with_detail(broken.what.as_str())
        };
        let stays = |broken: &&BrokenThread| find_kind(&broken.thread).consequence == Consequence::Stays;
        let gone = news.iter().find(stays).map(|broken| broken.thread.clone());
        Some(Breakage { notices: news.iter().map(notice).collect(), gone })
    }

    /// What broke off since the start, while the process lives.
    #[must_use]
    pub fn list_problems(&self) -> Vec<StatusProblem> {
        let problem = |broken: &BrokenThread| StatusProblem {
            what: describe_broken(broken),
            next: advise(find_kind(&broken.thread).consequence).to_owned(),
        };
        self.known.iter().map(problem).collect()
    }
}

impl Default for Supervisor {
    fn default() -> Self {
        Self::new()
    }
}

fn describe_broken(broken: &BrokenThread) -> String {
    let BrokenThread { thread, what, count } = broken;
    let times = if *count == 1 { String::new() } else { format!(" {count} times") };
    format!("the thread {thread:?}, which {}, broke off{times}: {what}", find_kind(thread).does)
}

fn advise(consequence: Consequence) -> &'static str {
    match consequence {
        Consequence::ProcessEnds | Consequence::Stays => {
            "start the gateway again, and report this with the folder `crashes` of the data directory"
        }
        Consequence::BeginsAnew | Consequence::GoesOn => {
            "it goes on by itself; report this with the folder `crashes` of the data directory"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapters::threads::record_panic;

    #[test]
    fn what_breaks_off_is_told_once_and_shown_from_then_on() {
        let mut supervisor = Supervisor::new();
        assert!(supervisor.look_at_threads().is_none());
        record_panic("save", "at save.rs:1: x");
        let found = supervisor.look_at_threads().expect("news");
        assert_eq!((found.notices.len(), found.gone.as_deref()), (1, Some("save")));
        assert!(supervisor.look_at_threads().is_none());
        let shown = supervisor.list_problems();
        assert!(
            shown.iter().any(|it| it.what.contains("saves what is learned") && it.what.contains("save.rs:1")),
            "{shown:?}"
        );
    }

    /// The names of threads stand in the sources and in the table: one that only the sources have would be told without what it does.
    #[test]
    fn every_thread_of_the_box_is_in_the_table() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let mut found = Vec::new();
        for folder in [
            "adapters/worker",
            "adapters/waveform",
            "gateway/run",
            "gateway/history",
            "gateway/base",
            "gateway/control",
            "gateway/diagnosis",
            "gateway/backup",
            "gateway/status",
        ] {
            list_names(&root.join(folder), &mut found);
        }
        assert!(found.len() >= 12, "{found:?}");
        // A child process has threads of its own: its parent and its limit of time.
        let missing: Vec<&String> = found
            .iter()
            .filter(|name| {
                !["parent", "limit"].contains(&name.as_str()) && THREADS.iter().all(|kind| kind.name != **name)
            })
            .collect();
        assert!(missing.is_empty(), "{missing:?}");
    }

    fn list_names(folder: &std::path::Path, found: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                list_names(&path, found);
            } else if path.extension().is_some_and(|end| end == "rs") {
                let text = std::fs::read_to_string(&path).expect("text");
                for part in text.split(concat!("thread::", "Builder::new()")).skip(1) {
                    let named = part.split(".name(").nth(1).and_then(|rest| rest.strip_prefix('"'));
                    found.extend(named.and_then(|rest| rest.split('"').next()).map(str::to_owned));
                }
            }
        }
    }
}
