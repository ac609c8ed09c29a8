//! A panic leaves a report: what broke off, where, and in which version. Names of functions come from the symbols that the
//! package keeps in a file of its own; without them the report holds addresses, which that file translates.

use crate::files::keep_last;
use adapter_core::text::shorten_text;
use adapter_core::threads::record_panic;
use std::backtrace::Backtrace;
use std::fs;
use std::panic::PanicHookInfo;
use std::path::Path;
use std::time::SystemTime;

/// Reports that are kept; a box that breaks off at every start must not fill its disk.
const REPORTS_MAX: usize = 20;
/// Folder in the data directory.
const FOLDER: &str = "crashes";
/// What the names of reports begin with; what else lies there stays.
const REPORT: &str = "crash-";

/// From now on a panic of any thread is known to whoever looks after the threads, and writes a report into this data directory, besides
/// what is printed.
pub fn keep_crash_reports(data_dir: &Path) {
    let folder = data_dir.join(FOLDER);
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        before(info);
        record_panic(&thread_name(), &describe_place(info));
        // There is nobody left to tell when not even this can be written.
        let _not_written = write_report(&folder, info);
    }));
}

fn thread_name() -> String {
    std::thread::current().name().unwrap_or("without a name").to_owned()
}

/// What and where, in one line.
fn describe_place(info: &PanicHookInfo<'_>) -> String {
    let said = info.payload_as_str().unwrap_or("a panic");
    let place = info.location().map_or(String::new(), |place| format!("{}:{}: ", place.file(), place.line()));
    shorten_text(format!("{place}{said}"))
}

fn write_report(folder: &Path, info: &PanicHookInfo<'_>) -> std::io::Result<()> {
    fs::create_dir_all(folder)?;
    // A full folder must not keep this report from being written.
    let _full = remove_oldest(folder);
    // Not the box's clock: whoever breaks off may hold its lock.
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let thread = thread_name();
    let text = format!(
        "cnc-gateway {}\nseconds since 1970: {}\nthread: {thread}\n{info}\n\n{}\n",
        env!("CARGO_PKG_VERSION"),
        since_1970.as_secs(),
        Backtrace::force_capture()
    );
    fs::write(folder.join(format!("{REPORT}{:013}.txt", since_1970.as_millis())), text)
}

/// Makes room for one more.
fn remove_oldest(folder: &Path) -> std::io::Result<()> {
    keep_last(folder, REPORTS_MAX - 1, |name| name.starts_with(REPORT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_reports_go() {
        let folder = tempfile::tempdir().expect("a directory");
        for number in 0..REPORTS_MAX + 5 {
            fs::write(folder.path().join(format!("crash-{number:03}.txt")), "x").expect("written");
        }
        remove_oldest(folder.path()).expect("removed");
        let left = fs::read_dir(folder.path()).expect("read").count();
        assert_eq!(left, REPORTS_MAX - 1);
        assert!(!folder.path().join("crash-000.txt").exists());
    }
}
