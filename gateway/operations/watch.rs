//! The recipe on disk: read and checked on a thread of its own, so that a slow disk never delays a tick. A change is
//! taken when it has stood still for one look, so that a file is not read while an editor is writing it.

use super::Loaded;
use rules::operations::{TEXT_MAX, parse};
use rules::script::Problem;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, SystemTime};

/// Time between two looks at the file.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// The recipe in a file.
///
/// # Errors
/// The file cannot be read, or everything that is wrong in it.
pub fn read(path: &Path) -> Result<Loaded, Vec<Problem>> {
    let name = path.display().to_string();
    let text = read_text(path).map_err(|error| vec![unreadable(&name, &error)])?;
    Ok(Loaded { recipe: parse(&name, &text)?, text })
}

/// No more than a recipe may be long, and one byte to see that it is longer.
fn read_text(path: &Path) -> std::io::Result<String> {
    let mut text = String::new();
    std::fs::File::open(path)?.take(TEXT_MAX as u64 + 1).read_to_string(&mut text)?;
    Ok(text)
}

fn unreadable(name: &str, error: &std::io::Error) -> Problem {
    let next = match error.kind() {
        std::io::ErrorKind::NotFound => "`path` under [operations] names it; create it, or leave the section out",
        std::io::ErrorKind::InvalidData => "save the file as UTF-8",
        _ => "look at the permissions",
    };
    let what = format!("the operations recipe cannot be read: {error}");
    Problem { file: name.to_owned(), line: None, column: None, what, next: next.to_owned() }
}

/// What a file is recognised by without reading it.
type Mark = Option<(SystemTime, u64)>;

fn mark(path: &Path) -> Mark {
    let metadata = std::fs::metadata(path).ok()?;
    Some((metadata.modified().ok()?, metadata.len()))
}

type Found = Result<Loaded, Vec<Problem>>;

/// Watches one file; ends when it is dropped.
#[derive(Debug)]
pub(super) struct Watcher {
    newest: Receiver<Found>,
    asked: SyncSender<()>,
}

impl Watcher {
    /// Starts to watch; what is there now is known already.
    pub(super) fn start(path: &Path) -> std::io::Result<Self> {
        let (send, newest) = sync_channel(1);
        let (asked, asks) = sync_channel(1);
        let watched = Watched { path: path.to_owned(), seen: mark(path), taken: mark(path) };
        std::thread::Builder::new().name("operations".to_owned()).spawn(move || watched.run(&asks, &send))?;
        Ok(Self { newest, asked })
    }

    /// Looks now, and reads when the file has changed. Returns at once.
    pub(super) fn ask(&self) {
        // A full queue means that it has been asked already.
        let _asked_before = self.asked.try_send(());
    }

    /// What was found since the last call, if anything was.
    pub(super) fn take(&self) -> Option<Found> {
        self.newest.try_recv().ok()
    }
}

struct Watched {
    path: PathBuf,
    seen: Mark,
    taken: Mark,
}

impl Watched {
    fn run(mut self, asks: &Receiver<()>, send: &SyncSender<Found>) {
        loop {
            let asked = match asks.recv_timeout(LOOK_EVERY) {
                Ok(()) => true,
                Err(RecvTimeoutError::Timeout) => false,
                Err(RecvTimeoutError::Disconnected) => return,
            };
            if let Some(found) = self.look(asked)
                && send.send(found).is_err()
            {
                return;
            }
        }
    }

    /// The file, when it has changed and stood still since the look before; when asked, as soon as it has changed.
    fn look(&mut self, asked: bool) -> Option<Found> {
        let now = mark(&self.path);
        let still = std::mem::replace(&mut self.seen, now) == now;
        if self.taken == now || !(still || asked) {
            return None;
        }
        self.taken = now;
        Some(read(&self.path))
    }
}
