//! A vendor's library without the vendor: compiled here from C, really loaded by the real child process, with faults on
//! purpose.

use crate::process::program_path;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// The library in a directory of its own, and the file that tells it which fault to have.
pub struct Library {
    _directory: tempfile::TempDir,
    /// What is loaded.
    pub file: PathBuf,
    fault: PathBuf,
}

impl Library {
    /// Compiles `tests/SOURCE` with these flags besides.
    pub fn compiled(source: &str, flags: &[&str]) -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        let (file, fault) = (directory.path().join("libfake.so"), directory.path().join("fault"));
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(source);
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-O1", "-w", "-pthread"]).args(flags).arg("-o").arg(&file).arg(source);
        assert!(compiler.status().expect("a C compiler").success());
        Self { _directory: directory, file, fault }
    }

    /// From now on this goes wrong: `KIND FUNCTION [NUMBER]`.
    pub fn fault(&self, text: &str) {
        std::fs::write(&self.fault, text).expect("written");
    }

    /// From now on nothing goes wrong.
    pub fn well(&self) {
        let _was_well = std::fs::remove_file(&self.fault);
    }

    /// What the child needs to know.
    pub fn environment(&self) -> Vec<(String, String)> {
        vec![("FAKE_LIBRARY_FAULT".to_owned(), self.fault.display().to_string())]
    }

    /// The program that becomes the child.
    pub fn program() -> PathBuf {
        program_path()
    }
}

/// A poll in which the library fails in one function: one channel has a reason, the others flow, in the same poll. `lost`
/// looks at the readings of that poll; the time it took comes back.
pub fn poll_survives<T>(
    library: &Library,
    fault: &str,
    mut poll: impl FnMut() -> T,
    lost: impl FnOnce(&T),
) -> Duration {
    library.fault(fault);
    let began = Instant::now();
    let readings = poll();
    let took = began.elapsed();
    println!("{fault}: one channel lost, the others in the same poll, which took {} ms", took.as_millis());
    lost(&readings);
    library.well();
    took
}

/// Open files and children of this process.
fn own() -> (usize, usize) {
    let files = std::fs::read_dir("/proc/self/fd").map_or(0, Iterator::count);
    let me = std::process::id().to_string();
    let parent = |path: PathBuf| {
        let text = std::fs::read_to_string(path.join("stat")).ok()?;
        text.rsplit_once(')')?.1.split_whitespace().nth(1).map(str::to_owned)
    };
    let processes = std::fs::read_dir("/proc").expect("readable").flatten();
    (files, processes.filter_map(|entry| parent(entry.path())).filter(|parent| *parent == me).count())
}

/// Cycles in each of which the library dies in another of these ways; no file and no child is left of them.
pub fn nothing_is_left(library: &Library, count: usize, faults: [&str; 3], mut cycle: impl FnMut()) {
    let (before, began) = (own(), Instant::now());
    for index in 0..count {
        library.fault(faults[index % faults.len()]);
        cycle();
    }
    let after = own();
    println!(
        "{count} cycles with a dying library in {:.1} s: files and children {before:?} before, {after:?} after",
        began.elapsed().as_secs_f64()
    );
    assert!(after.0 <= before.0 + 60 && after.1 <= before.1 + 12, "other tests run beside this one; a leak is more");
}
