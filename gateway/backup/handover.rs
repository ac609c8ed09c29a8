//! What a restore has laid ready for the next start: what estimators, scripts, wear, thermal law and twin have learned. A running box
//! holds these in memory and writes them every minute and at its end; so they take their place before the next start reads them.

use super::list::{Fate, of_name};
use super::list_names;
use gateway_base::log::{Notice, Severity};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Folder in the data directory.
const FOLDER: &str = "restored";
/// What has waited for longer is dropped: what the box has learned since is worth more.
const WAITS_MAX: Duration = Duration::from_secs(24 * 3600);

/// Where these files are laid ready, and which of those that wait already have to go.
pub(super) fn plan_waiting(data_dir: &Path, files: &[(String, String)]) -> (Vec<(PathBuf, String)>, Vec<PathBuf>) {
    let folder = data_dir.join(FOLDER);
    let is_new = |name: &String| files.iter().any(|(new, _)| new == name);
    let old = list_names(&folder).into_iter().filter(|name| !is_new(name)).map(|name| folder.join(name)).collect();
    (files.iter().map(|(name, text)| (folder.join(name), text.clone())).collect(), old)
}

fn clear(folder: &Path) -> std::io::Result<()> {
    match std::fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Before anything is read at a start: what waits takes its place. Tells so, or why not; nothing where nothing waits.
pub fn install_waiting_files(data_dir: &Path) -> Option<Notice> {
    let folder = data_dir.join(FOLDER);
    let waiting = list_names(&folder);
    if waiting.is_empty() {
        return None;
    }
    let laid = std::fs::metadata(&folder).and_then(|it| it.modified()).ok()?;
    // A time in the future is as good as now.
    let notice = if laid.elapsed().unwrap_or_default() > WAITS_MAX {
        let text = "what a restore had laid ready more than a day ago was dropped: what was learned since is kept";
        Notice::new(Severity::Warning, "restored", text)
    } else {
        let put = |name: &&String| {
            of_name(name) == Some(Fate::AtStart) && std::fs::rename(folder.join(name), data_dir.join(name)).is_ok()
        };
        let taken: Vec<&str> = waiting.iter().filter(put).map(String::as_str).collect();
        Notice::new(Severity::Info, "restored", format!("what was learned is that of the backup: {}", taken.join(", ")))
    };
    if let Err(error) = clear(&folder) {
        tracing::warn!("{} could not be removed: {error}", folder.display());
    }
    Some(notice)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_waits_is_taken_once_and_not_after_a_day() {
        let directory = tempfile::tempdir().expect("a directory");
        let place = directory.path();
        std::fs::write(place.join("wear.json"), "old").expect("written");
        assert!(install_waiting_files(place).is_none());
        let lay_ready = |text: &str| {
            let (files, old) = plan_waiting(place, &[("wear.json".to_owned(), text.to_owned())]);
            assert_eq!((files.len(), old), (1, Vec::new()));
            gateway_base::files::replace_durably(&files[0].0, &files[0].1).expect("laid");
        };
        lay_ready("new");
        assert!(install_waiting_files(place).is_some_and(|notice| notice.operator.contains("wear.json")));
        let text = || std::fs::read_to_string(place.join("wear.json")).expect("there");
        assert_eq!(text(), "new");
        assert!(install_waiting_files(place).is_none() && !place.join(FOLDER).exists());
        lay_ready("too old");
        let long_ago = std::time::SystemTime::now() - 2 * WAITS_MAX;
        std::fs::File::open(place.join(FOLDER)).and_then(|it| it.set_modified(long_ago)).expect("aged");
        assert!(install_waiting_files(place).is_some_and(|notice| notice.operator.contains("dropped")));
        assert_eq!(text(), "new");
    }
}
