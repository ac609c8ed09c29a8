//! Runs the built binary as a child process on files that hold no truth.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::concealed::case::Case;
use crate::concealed::score::answer::Answer;

/// Where the files of this process lie: what the tool is given, and the truth beside it.
pub(crate) fn workshop() -> (PathBuf, PathBuf) {
    let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("concealed-{}", std::process::id()));
    (root.join("given"), root.join("truth"))
}

/// Writes the case, asks the tool, reads the answer; the truth is written elsewhere and only by `keep`.
pub(crate) fn ask(case: &Case) -> Result<Answer, String> {
    let (given, _) = workshop();
    let folder = given.join(&case.group).join(&case.name);
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    std::fs::write(folder.join("recording.csv"), case.table.csv()).map_err(|e| e.to_string())?;
    std::fs::write(folder.join("model.toml"), &case.model).map_err(|e| e.to_string())?;
    diagnose(&folder.join("model.toml"), &[folder.join("recording.csv")], &folder)
}

/// `cnc-gateway diagnose` on any model and recordings, with its outputs in `out`.
pub(crate) fn diagnose(model: &Path, recordings: &[PathBuf], out: &Path) -> Result<Answer, String> {
    let (json, rows) = (out.join("diagnosis.json"), out.join("rows.csv"));
    let start = Instant::now();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cnc-gateway"));
    command
        .arg("diagnose")
        .arg("--model")
        .arg(model)
        .arg("--recording")
        .args(recordings)
        .arg("--json")
        .arg(&json)
        .arg("--rows")
        .arg(&rows);
    let status = within(&mut command, &out.join("stderr.txt"))?;
    let seconds = start.elapsed().as_secs_f64();
    if !status.success() {
        let said = std::fs::read_to_string(out.join("stderr.txt")).unwrap_or_default();
        let first: Vec<&str> = said.lines().take(3).collect();
        return Err(format!("{status}: {}", first.join(" / ")));
    }
    let read = |path: &Path| std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()));
    Answer::read(&read(&json)?, &read(&rows)?, seconds)
}

/// Longest that one question may take.
const PATIENCE: Duration = Duration::from_secs(180);

/// Runs a child to its end, or stops it when it takes too long; what it complains of goes to `complaints`.
fn within(command: &mut Command, complaints: &Path) -> Result<ExitStatus, String> {
    let file = std::fs::File::create(complaints).map_err(|e| e.to_string())?;
    let started = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(file).spawn();
    let mut child = started.map_err(|e| format!("the binary did not start: {e}"))?;
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            return Ok(status);
        }
        if start.elapsed() > PATIENCE {
            let stopped = child.kill().and_then(|()| child.wait());
            return Err(format!("no answer within {} s ({stopped:?})", PATIENCE.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(4));
    }
}

/// Removes a case that needs no second look.
pub(crate) fn discard(case: &Case) {
    let (given, _) = workshop();
    // A folder that is left behind costs disk space only.
    let _ = std::fs::remove_dir_all(given.join(&case.group).join(&case.name));
}

/// Keeps a case with its truth beside it and says where.
pub(crate) fn keep(case: &Case) -> PathBuf {
    let (given, sealed) = workshop();
    if let Err(error) = case.write(&given, &sealed) {
        println!("{}: could not be kept: {error}", case.name);
    }
    given.join(&case.group).join(&case.name)
}

/// Removes everything that this process wrote.
pub(crate) fn clear() {
    let root = workshop().0.parent().map(Path::to_path_buf).unwrap_or_default();
    // A folder that is left behind costs disk space only.
    let _ = std::fs::remove_dir_all(root);
}
