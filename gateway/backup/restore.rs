//! A backup comes back: everything in it is checked, what is there now is kept, and then all of it takes its place.

use super::list::{Fate, of_name};
use super::origin::ORIGIN;
use super::put_back::Replacement;
use super::{
    BackupPaths, BoxOrigin, DATA, DELIVERED, RestoreError, WEAR_MODELS, configured_files, handover, is_of_scripts,
    list_names,
};
use crate::archive::ArchivedFile;
use adapter_core::clock::TimeNs;
use gateway_base::files::keep_last;
use gateway_history::{Reader, store_wear_models};
use gateway_scripts::reload::read_directory;
use gateway_scripts::settings;
use rules::estimators::thermal::ThermalModel;
use rules::estimators::wear::WearRecord;
use rules::script::{ScriptFile, SettingValues, prepare_with};
use std::path::{Path, PathBuf};

/// Archives of what was replaced that are kept.
const BEFORE_MAX: usize = 5;

/// Who restores, when, and the archive of what is there now with its name.
#[derive(Debug, Clone, Copy)]
pub struct RestoreRequest<'a> {
    /// Name of the person who restores.
    pub by: &'a str,
    /// When, ns since 1970.
    pub at_ns: TimeNs,
    /// What is there now, and the name of its archive.
    pub before: (&'a [u8], &'a str),
    /// Whoever restores has said that the archive may be of another box.
    pub from_another_box: bool,
}

/// What an archive holds that this box has a place for.
#[derive(Default)]
struct Found {
    scripts: Vec<ScriptFile>,
    delivered: Option<String>,
    settings: Option<String>,
    /// Files that take their place now.
    now: Vec<(PathBuf, String)>,
    /// Files that wait for the next start, by name.
    later: Vec<(String, String)>,
    wear: Vec<WearRecord>,
}

/// Puts everything in place. Gives what was done, in words.
///
/// # Errors
/// What is wrong with the backup, before anything was changed; or a file that cannot be written.
pub fn restore_backup(
    places: &BackupPaths,
    files: &[ArchivedFile],
    ask: RestoreRequest<'_>,
) -> Result<String, RestoreError> {
    let found = Found::from_archive(places, files)?;
    if found.is_empty() {
        return Err(RestoreError::Empty);
    }
    if !ask.from_another_box {
        check_origin(places, files)?;
    }
    found.check_contents(places)?;
    let wear = find_new_models(&places.history, &found.wear)?;
    let (texts, surplus) = found.plan_places(places, ask.by);
    let replacement = Replacement::prepare(&places.data_dir, &texts, surplus)?;
    keep_before(&places.data_dir, ask.before)?;
    let models = replacement.put_all(|| match wear.is_empty() {
        true => Ok(0),
        false => Ok(store_wear_models(&places.history, ask.at_ns, &wear).map(|()| wear.len())?),
    })?;
    Ok(found.describe_restore(models, ask.before.1))
}

impl Found {
    fn from_archive(places: &BackupPaths, files: &[ArchivedFile]) -> Result<Self, RestoreError> {
        let mut found = Self::default();
        for (name, content) in files {
            let text = || String::from_utf8(content.clone()).map_err(|_| RestoreError::NoText { name: name.clone() });
            if let Some(file) = name.strip_prefix("scripts/") {
                if !is_of_scripts(file) {
                    return Err(RestoreError::NoScript { name: name.clone() });
                }
                match file {
                    DELIVERED => found.delivered = Some(text()?),
                    _ => found.scripts.push(ScriptFile { name: file.to_owned(), text: text()? }),
                }
            } else if let Some(file) = name.strip_prefix(DATA) {
                match of_name(file) {
                    Some(Fate::AtOnce) if file == settings::FILE => found.settings = Some(text()?),
                    Some(Fate::AtOnce) => found.now.push((places.data_dir.join(file), text()?)),
                    Some(Fate::AtStart) => found.later.push((file.to_owned(), text()?)),
                    _ => return Err(RestoreError::NotOfBackup { name: name.clone() }),
                }
            } else if name.starts_with(WEAR_MODELS) {
                let wrong = |what: String| RestoreError::WearModel { name: name.clone(), what };
                found.wear.push(WearRecord::parse(&text()?).map_err(wrong)?);
            } else if let Some(path) =
                configured_files(places).into_iter().find(|it| it.0 == name).and_then(|it| it.1.as_ref())
            {
                found.now.push((path.clone(), text()?));
            }
        }
        Ok(found)
    }

    fn is_empty(&self) -> bool {
        self.scripts.is_empty() && self.now.is_empty() && self.later.is_empty() && self.wear.is_empty()
    }

    /// Every file with its place, and the files that go: a script that is not in the backup would still decide.
    fn plan_places(&self, places: &BackupPaths, by: &str) -> (Vec<(PathBuf, String)>, Vec<PathBuf>) {
        let (later, mut surplus) = handover::plan_waiting(&places.data_dir, &self.later);
        let mut texts: Vec<(PathBuf, String)> = self.now.iter().cloned().chain(later).collect();
        if let Some(body) = &self.settings {
            texts.push((settings::values_path(&places.data_dir), settings::sign_text(body, by)));
        }
        if self.scripts.is_empty() {
            return (texts, surplus);
        }
        texts.extend(self.scripts.iter().map(|file| (places.scripts.join(&file.name), file.text.clone())));
        texts.extend(self.delivered.iter().map(|list| (places.scripts.join(DELIVERED), list.clone())));
        let is_in_backup = |name: &String| self.scripts.iter().any(|file| file.name == *name);
        let others = list_names(&places.scripts).into_iter().filter(|name| name.ends_with(".rhai"));
        surplus.extend(others.filter(|name| !is_in_backup(name)).map(|name| places.scripts.join(name)));
        (texts, surplus)
    }

    /// Everything as the box will read it.
    fn check_contents(&self, places: &BackupPaths) -> Result<(), RestoreError> {
        let of = |path: &Option<PathBuf>| {
            let path = path.as_ref()?;
            self.now.iter().find(|(it, _)| it == path).map(|(_, text)| text.as_str())
        };
        if let Some(recipe) = of(&places.operations) {
            rules::operations::parse("operations.toml", recipe).map_err(join_lines)?;
        }
        if let Some(model) = of(&places.model) {
            rules::twin::parse_model(model).map_err(join_lines)?;
        }
        if let Some(model) = of(&places.thermal_model) {
            ThermalModel::read(model, &places.machine).map_err(RestoreError::ThermalModel)?;
        }
        for (name, text) in self.later.iter().filter(|(name, _)| name.ends_with(".json")) {
            if gateway_base::state_file::state_of(text).is_none() {
                return Err(RestoreError::Changed { name: name.clone() });
            }
        }
        self.check_scripts(places)
    }

    /// The scripts with the settings that will be in force, those that are there where the archive has none.
    fn check_scripts(&self, places: &BackupPaths) -> Result<(), RestoreError> {
        if self.scripts.is_empty() && self.settings.is_none() {
            return Ok(());
        }
        let there;
        let scripts = if self.scripts.is_empty() {
            there = read_directory(&places.scripts).map_err(join_lines)?;
            &there
        } else {
            &self.scripts
        };
        let values = match &self.settings {
            Some(text) => SettingValues::parse(settings::FILE, text).map_err(join_lines)?,
            None => settings::read(&settings::values_path(&places.data_dir)).map_err(join_lines)?,
        };
        prepare_with(scripts, &values).map(drop).map_err(join_lines)
    }

    fn describe_restore(&self, models: usize, before: &str) -> String {
        let files = self.now.len();
        let what = [
            (!self.scripts.is_empty()).then(|| format!("{} scripts", self.scripts.len())),
            self.settings.is_some().then(|| "the settings".to_owned()),
            (files > 0).then(|| format!("{files} files (recipe, models, annotations, drafts, versions)")),
            (models > 0).then(|| format!("{models} wear models")),
        ];
        let what: Vec<String> = what.into_iter().flatten().collect();
        let mut words = if what.is_empty() { String::new() } else { format!("{} restored; ", what.join(", ")) };
        if !self.later.is_empty() {
            let names: Vec<&str> = self.later.iter().map(|(name, _)| name.as_str()).collect();
            words += &format!(
                "what was learned ({}) waits for the next start of the box, within a day; until then the box goes on with what it has; ",
                names.join(", ")
            );
        }
        words += &format!("what was there before is kept as {before} in the data directory");
        words
    }
}

/// Every problem on a line of its own.
fn join_lines<P: std::fmt::Display>(all: Vec<P>) -> RestoreError {
    RestoreError::Refused(all.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
}

/// Is the archive of this box?
fn check_origin(places: &BackupPaths, files: &[ArchivedFile]) -> Result<(), RestoreError> {
    let here =
        BoxOrigin::of_box(&places.machine, &places.data_dir).map_err(|error| RestoreError::Origin(Box::new(error)))?;
    let of = files.iter().find(|(name, _)| name == ORIGIN).and_then(|(_, json)| BoxOrigin::parse(json));
    let name = |it: &BoxOrigin| format!("that of {} (number {})", it.machine, it.number);
    match of {
        Some(of) if of.number == here.number => Ok(()),
        of => Err(RestoreError::OtherBox {
            of: of.as_ref().map_or("of an older version, which did not say of which box".to_owned(), name),
            here: name(&here),
        }),
    }
}

/// The models that are not in force yet.
fn find_new_models<'a>(history: &Path, wanted: &'a [WearRecord]) -> Result<Vec<&'a WearRecord>, RestoreError> {
    let there = match wanted.is_empty() || !history.exists() {
        true => Vec::new(),
        false => Reader::open(history).and_then(|reader| reader.wear_models::<WearRecord>())?,
    };
    Ok(wanted.iter().filter(|record| !there.iter().any(|it| it.in_force && it.record == **record)).collect())
}

fn keep_before(data_dir: &Path, (archive, name): (&[u8], &str)) -> Result<(), RestoreError> {
    let is_kept = |name: &str| name.contains("-before-restore-") && name.ends_with(".tar.gz");
    std::fs::create_dir_all(data_dir)
        .and_then(|()| std::fs::write(data_dir.join(name), archive))
        .and_then(|()| keep_last(data_dir, BEFORE_MAX, is_kept))
        .map_err(RestoreError::NotKept)
}
