//! Model files, and directories of the user's own hypotheses.

use rules::twin::{Model, Part, parse_hypotheses, parse_model};
use std::path::Path;

/// Reads a model.
///
/// # Errors
/// Every problem of the file, with its line.
pub fn read_model(path: &Path) -> Result<Model, Vec<String>> {
    let text = read(path).map_err(|problem| vec![problem])?;
    parse_model(&text).map_err(|problems| format_problems(path, &problems))
}

/// Reads every `.toml` file of a directory, in the order of their names, as hypotheses besides the catalogue.
///
/// # Errors
/// Every problem of every file, with its line.
pub fn read_hypotheses(directory: &Path) -> Result<Vec<Part>, Vec<String>> {
    let cannot =
        |error| vec![format!("{}: {error}. --effects-dir names a directory of .toml files.", directory.display())];
    let entries = std::fs::read_dir(directory).map_err(cannot)?;
    let mut paths: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    paths.sort();
    let (mut parts, mut problems) = (Vec::new(), Vec::new());
    for path in &paths {
        match read(path) {
            Ok(text) => match parse_hypotheses(&text) {
                Ok(more) => parts.extend(more),
                Err(wrong) => problems.extend(format_problems(path, &wrong)),
            },
            Err(problem) => problems.push(problem),
        }
    }
    if problems.is_empty() { Ok(parts) } else { Err(problems) }
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path)
        .map_err(|error| format!("{}: {error}. Check the path; a model is a TOML file (model/1).", path.display()))
}

fn format_problems(path: &Path, problems: &[rules::twin::Problem]) -> Vec<String> {
    problems.iter().map(|problem| format!("{}, {problem}", path.display())).collect()
}
