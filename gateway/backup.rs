//! What makes a box this box, as an archive, and its way back: scripts with their settings, drafts and versions, the recipe, the
//! model, what was learned, and the configuration. The history is too large for it and stays; persons and keys stay, because a
//! backup goes from hand to hand.
//!
//! Back go scripts, recipe and model alone, after all of them have been checked, and what they replace is kept as an archive. The
//! configuration in an archive is to be read: it says which machine is polled, and a restart with the wrong one would poll another.

use crate::archive::Entry;
use crate::files::{replace, replace_durably};
use rules::script::ScriptFile;
use std::path::{Path, PathBuf};

/// The longest file that goes into a backup.
const FILE_MAX: u64 = 8 << 20;
/// Archives of what was replaced that are kept.
const BEFORE_MAX: usize = 5;

/// Where everything is.
#[derive(Debug, Clone)]
pub struct Places {
    /// The data directory.
    pub data_dir: PathBuf,
    /// The scripts.
    pub scripts: PathBuf,
    /// The recipe.
    pub operations: Option<PathBuf>,
    /// The model.
    pub model: Option<PathBuf>,
    /// The configuration.
    pub configuration: Option<PathBuf>,
}

/// The files of a backup, in the order of their names.
#[must_use]
pub fn collect(places: &Places) -> Vec<Entry> {
    let mut files = Vec::new();
    folder(&mut files, &places.scripts, "scripts", |name| name.ends_with(".rhai"));
    for below in ["drafts", "versions"] {
        folder(&mut files, &places.data_dir.join(below), below, |_| true);
    }
    let learned = ["estimators.json", "twin.json", "scripts_in_charge.json"].map(|name| places.data_dir.join(name));
    for path in learned {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        one(&mut files, &path, format!("learned/{name}"));
    }
    let named = [
        ("operations.toml", &places.operations),
        ("model.toml", &places.model),
        ("configuration.toml", &places.configuration),
    ];
    for (name, path) in named {
        path.iter().for_each(|path| one(&mut files, path, name.to_owned()));
    }
    files
}

fn folder(files: &mut Vec<Entry>, directory: &Path, name: &str, wanted: impl Fn(&str) -> bool) {
    let Ok(entries) = std::fs::read_dir(directory) else { return };
    let mut names: Vec<String> = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.retain(|name| wanted(name));
    names.sort();
    for file in names {
        one(files, &directory.join(&file), format!("{name}/{file}"));
    }
}

fn one(files: &mut Vec<Entry>, path: &Path, name: String) {
    if std::fs::metadata(path).is_ok_and(|file| file.is_file() && file.len() <= FILE_MAX)
        && let Ok(content) = std::fs::read(path)
    {
        files.push((name, content));
    }
}

/// Puts scripts, recipe and model of a backup in place; `before` is an archive of what is there now, and its name. Gives what was
/// done, in words.
///
/// # Errors
/// What is wrong with the backup, before anything was changed; or a file that cannot be written.
pub fn restore(places: &Places, files: &[Entry], before: (&[u8], &str)) -> Result<String, String> {
    let text =
        |name: &str, content: &[u8]| String::from_utf8(content.to_vec()).map_err(|_| format!("{name} is no text"));
    let mut scripts = Vec::new();
    for (name, content) in files {
        if let Some(file) = name.strip_prefix("scripts/") {
            if !crate::drafts::is_name(file) {
                return Err(format!("{name:?} is no name of a script"));
            }
            scripts.push(ScriptFile { name: file.to_owned(), text: text(name, content)? });
        }
    }
    let whole =
        |name: &str| files.iter().find(|(it, _)| it == name).map(|(_, content)| text(name, content)).transpose();
    let recipe = whole("operations.toml")?.zip(places.operations.clone());
    let model = whole("model.toml")?.zip(places.model.clone());
    if scripts.is_empty() && recipe.is_none() && model.is_none() {
        return Err("the archive holds no script, no recipe and no model that this box has a place for".to_owned());
    }
    check(&scripts, recipe.as_ref().map(|(text, _)| text.as_str()), model.as_ref().map(|(text, _)| text.as_str()))?;
    keep_before(&places.data_dir, before)?;
    put_scripts(&places.scripts, &scripts)?;
    for (text, path) in recipe.iter().chain(&model) {
        replace_durably(path, text).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    let what = [
        (!scripts.is_empty()).then(|| format!("{} scripts", scripts.len())),
        recipe.map(|_| "the recipe".to_owned()),
        model.map(|_| "the model".to_owned()),
    ];
    let what: Vec<String> = what.into_iter().flatten().collect();
    Ok(format!("{} restored; what was there before is kept as {} in the data directory", what.join(", "), before.1))
}

fn check(scripts: &[ScriptFile], recipe: Option<&str>, model: Option<&str>) -> Result<(), String> {
    if !scripts.is_empty() {
        rules::script::prepare(scripts).map_err(lines)?;
    }
    if let Some(recipe) = recipe {
        rules::operations::parse("operations.toml", recipe).map_err(lines)?;
    }
    if let Some(model) = model {
        rules::twin::parse_model(model).map_err(lines)?;
    }
    Ok(())
}

/// Every problem on a line of its own.
fn lines<P: std::fmt::Display>(all: Vec<P>) -> String {
    all.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

fn keep_before(data_dir: &Path, (archive, name): (&[u8], &str)) -> Result<(), String> {
    let say = |error: std::io::Error| format!("what is there now could not be kept: {error}");
    std::fs::write(data_dir.join(name), archive).map_err(say)?;
    let names =
        std::fs::read_dir(data_dir).map_err(say)?.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> =
        names.filter(|it| it.contains("-before-restore-") && it.ends_with(".tar.gz")).collect();
    names.sort();
    let surplus = names.len().saturating_sub(BEFORE_MAX);
    names[..surplus].iter().try_for_each(|name| std::fs::remove_file(data_dir.join(name))).map_err(say)
}

/// The scripts of the backup and no others: one that is not in it would still decide.
fn put_scripts(directory: &Path, scripts: &[ScriptFile]) -> Result<(), String> {
    if scripts.is_empty() {
        return Ok(());
    }
    let say = |error: std::io::Error| format!("{}: {error}", directory.display());
    for file in scripts {
        replace(&directory.join(&file.name), &file.text).map_err(say)?;
    }
    let there =
        std::fs::read_dir(directory).map_err(say)?.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let surplus = there.filter(|name| name.ends_with(".rhai") && !scripts.iter().any(|file| file.name == *name));
    for name in surplus {
        std::fs::remove_file(directory.join(name)).map_err(say)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rules::script::shipped;

    fn places(below: &Path) -> Places {
        Places {
            data_dir: below.to_owned(),
            scripts: below.join("scripts"),
            operations: Some(below.join("recipe.toml")),
            model: None,
            configuration: None,
        }
    }

    #[test]
    fn a_backup_comes_back_as_it_was_and_a_broken_one_changes_nothing() {
        let directory = tempfile::tempdir().expect("a directory");
        let places = places(directory.path());
        for file in shipped() {
            replace(&places.scripts.join(&file.name), &file.text).expect("written");
        }
        replace(&directory.path().join("persons.json"), "secret").expect("written");
        let taken = collect(&places);
        assert!(taken.iter().all(|(name, content)| !name.contains("persons") && content != b"secret"));
        let first = &shipped()[0].name.clone();
        replace(&places.scripts.join(first), "// gone").expect("written");
        replace(&places.scripts.join("another.rhai"), "// by somebody").expect("written");
        let mut broken = taken.clone();
        broken.push(("scripts/bad.rhai".to_owned(), b"fn {".to_vec()));
        for wrong in [broken, vec![("scripts/../../x.rhai".to_owned(), Vec::new())], Vec::new()] {
            assert!(restore(&places, &wrong, (b"", "x-before-restore-0.tar.gz")).is_err());
        }
        assert!(places.scripts.join("another.rhai").exists(), "nothing was changed");
        let done = restore(&places, &taken, (b"before", "x-before-restore-1.tar.gz")).expect("restored");
        assert!(done.contains("scripts restored"), "{done}");
        assert_eq!(collect(&places), taken);
        assert!(!places.scripts.join("another.rhai").exists());
        assert_eq!(std::fs::read(directory.path().join("x-before-restore-1.tar.gz")).expect("kept"), b"before");
    }
}
