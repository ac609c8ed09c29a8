//! What makes a box this box, as an archive, and its way back.
//!
//! In an archive is whatever a decision depends on: scripts with the list of what was delivered, the settings in force, the recipe,
//! the models of machine and thermal error, the wear models of the library, what estimators, scripts and twin have learned,
//! annotations and what was identified; and the configuration, to be read. [`list`] names every file of the data directory, with
//! the reason where it is not in an archive. The history is copied beside it ([`copy_history`]).
//!
//! A restore ([`restore_backup`]) checks everything first, then changes everything or nothing, and what it replaces is kept as an archive. The
//! configuration is not put back: it says which machine is polled, and a restart with the wrong one would poll another.

pub mod archive;
mod error;
mod handover;
pub mod list;
mod origin;
mod put_back;
mod restore;
mod schedule;
mod target;

pub use error::{BackupError, PutBack, RestoreError};
pub use handover::install_waiting_files as take_restored;
pub use origin::BoxOrigin;
pub use restore::{RestoreRequest, restore_backup};
pub use schedule::{BackupSchedule, take_backup};

use crate::archive::ArchivedFile;
use gateway_base::convert::seconds_to_instant;
use gateway_base::moment;
use gateway_history::{HistoryError, Reader};
use list::{Fate, LIST, of_name};
use origin::ORIGIN;
use rules::estimators::wear::WearRecord;
use std::path::{Path, PathBuf};

/// The longest file that goes into a backup.
const FILE_MAX: u64 = 8 << 20;
/// Where the files of the data directory stand in an archive.
const DATA: &str = "data/";
/// Where the wear models of the library stand in an archive.
const WEAR_MODELS: &str = "wear_models/";
/// Which of the shipped scripts were delivered, beside the scripts: what a person has deleted stays deleted.
const DELIVERED: &str = ".shipped";

/// The files and directories that a backup is taken from, as the configuration in force names them.
#[derive(Debug, Clone)]
pub struct BackupPaths {
    /// Name of the machine.
    pub machine: String,
    /// Directory of everything the gateway writes; its files stand below `data/` in an archive.
    pub data_dir: PathBuf,
    /// Directory of the `.rhai` files; they stand below `scripts/` in an archive.
    pub scripts: PathBuf,
    /// Path of the database; an archive takes only the wear models from it.
    pub history: PathBuf,
    /// The operations recipe; `None`: none is configured.
    pub operations: Option<PathBuf>,
    /// The model of the machine.
    pub model: Option<PathBuf>,
    /// The law of the thermal error.
    pub thermal_model: Option<PathBuf>,
    /// The file that the configuration was read from; `None`: the built-in one holds.
    pub configuration: Option<PathBuf>,
}

impl BackupPaths {
    /// Those of a configuration that was read from this file.
    #[must_use]
    pub fn from_config(config: &gateway_config::Config, file: Option<&Path>) -> Self {
        Self {
            machine: config.gateway.machine.name.clone(),
            data_dir: config.gateway.data_dir.clone(),
            scripts: config.scripts.directory.clone(),
            history: config.history.path.clone(),
            operations: config.operations.path.clone(),
            model: config.twin.model.clone(),
            thermal_model: config.thermal.model.clone(),
            configuration: file.map(Path::to_owned),
        }
    }
}

/// Name of an archive of this kind that is made at this time, seconds since 1970.
#[must_use]
pub fn archive_name(what: &str, at_s: u64) -> String {
    let at = moment::format_utc(seconds_to_instant(at_s));
    format!("cnc-gateway-{what}-{}.tar.gz", at.replace([':', '.'], "-"))
}

/// The files of a backup.
///
/// # Errors
/// The wear models of the history cannot be read, or the box has no number.
pub fn collect_files(places: &BackupPaths) -> Result<Vec<ArchivedFile>, BackupError> {
    let mut taken = CopiedFiles::default();
    taken.files.push((ORIGIN.to_owned(), BoxOrigin::of_box(&places.machine, &places.data_dir)?.to_json()));
    list_names(&places.scripts).into_iter().filter(|name| is_of_scripts(name)).for_each(|name| {
        taken.add_own_file(&places.scripts.join(&name), format!("scripts/{name}"));
    });
    for name in list_names_below(&places.data_dir) {
        if matches!(of_name(&name), Some(Fate::AtOnce | Fate::AtStart)) {
            taken.add_own_file(&places.data_dir.join(&name), format!("{DATA}{name}"));
        }
    }
    // Without a file every setting has its default, which an empty file says as well.
    let settings = format!("{DATA}{}", gateway_scripts::settings::FILE);
    if !taken.files.iter().any(|(name, _)| *name == settings) {
        taken.files.push((settings, Vec::new()));
    }
    for (name, path) in configured_files(places).into_iter().chain([("configuration.toml", &places.configuration)]) {
        path.iter().for_each(|path| taken.add_file(path, name.to_owned()));
    }
    taken.files.extend(wear_models(&places.history)?);
    let about = describe_archive(&taken.too_long);
    taken.files.push(("about.txt".to_owned(), about.into_bytes()));
    Ok(taken.files)
}

/// The files that the configuration names, by their names in an archive.
fn configured_files(places: &BackupPaths) -> [(&'static str, &Option<PathBuf>); 3] {
    [
        ("operations.toml", &places.operations),
        ("model.toml", &places.model),
        ("thermal_model.json", &places.thermal_model),
    ]
}

/// A script, or the list of those that were delivered.
fn is_of_scripts(name: &str) -> bool {
    let plain = !name.contains(['/', '\\', '\0']) && !name.starts_with('.');
    name == DELIVERED || (plain && name.len() > ".rhai".len() && name.ends_with(".rhai"))
}

#[derive(Default)]
struct CopiedFiles {
    files: Vec<ArchivedFile>,
    too_long: Vec<String>,
}

impl CopiedFiles {
    /// A file of the box itself: a link leads to somebody else's, which is nothing to give away.
    fn add_own_file(&mut self, path: &Path, name: String) {
        if std::fs::symlink_metadata(path).is_ok_and(|file| file.is_file()) {
            self.add_file(path, name);
        }
    }

    fn add_file(&mut self, path: &Path, name: String) {
        match std::fs::metadata(path) {
            Ok(file) if file.is_file() && file.len() > FILE_MAX => self.too_long.push(name),
            Ok(file) if file.is_file() => self.files.extend(std::fs::read(path).ok().map(|content| (name, content))),
            _ => {}
        }
    }
}

/// Names of what is in this folder, in their order.
fn list_names(directory: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(directory) else { return Vec::new() };
    let mut names: Vec<String> = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    names
}

/// Names of what is in this folder and in the folders in it.
fn list_names_below(directory: &Path) -> Vec<String> {
    let deeper = |name: String| {
        let inside = list_names(&directory.join(&name));
        if inside.is_empty() { vec![name] } else { inside.iter().map(|it| format!("{name}/{it}")).collect() }
    };
    list_names(directory).into_iter().flat_map(deeper).collect()
}

/// The models in force, one file for each.
fn wear_models(history: &Path) -> Result<Vec<ArchivedFile>, HistoryError> {
    if !history.exists() {
        return Ok(Vec::new());
    }
    let models = Reader::open(history)?.wear_models::<WearRecord>()?;
    models
        .iter()
        .filter(|model| model.in_force)
        .map(|model| {
            let toml = model.record.to_toml().map_err(HistoryError::Question)?;
            Ok((format!("{WEAR_MODELS}{:04}.toml", model.id), toml.into_bytes()))
        })
        .collect()
}

/// For whoever opens the archive.
fn describe_archive(too_long: &[String]) -> String {
    let mut text = format!(
        "Backup of a box: cnc-gateway {}\n\nPut back with `cnc-gateway restore FILE` or on the page (Audit, Backup and help).\n\
         The configuration is here to be read; it is not put back.\n\nNot in it:\n",
        env!("CARGO_PKG_VERSION")
    );
    for (name, fate) in LIST {
        if let Fate::Left(why) = fate {
            text += &format!("  {name}: {why}\n");
        }
    }
    for name in too_long {
        text += &format!("  {name}: longer than {FILE_MAX} bytes\n");
    }
    text
}

/// A copy of the history that is whole, while a gateway may be writing it. Gives its length in bytes.
///
/// # Errors
/// The history cannot be read, or `to` is there already or cannot be written.
pub fn copy_history(from: &Path, to: &Path) -> Result<u64, HistoryError> {
    let reader = Reader::open(from)?;
    reader.copy_to(to)?;
    Ok(std::fs::metadata(to).map_or(0, |file| file.len()))
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_target;
