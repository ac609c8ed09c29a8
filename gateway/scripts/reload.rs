//! The scripts on disk: written there on the first start, watched, compiled and tried beside the tick, swapped only when all
//! of them compile and all their trials pass.

use crate::settings;
use adapter_core::channel::find_nearest_name;
use gateway_base::files::compute_digest;
use gateway_base::files::{Lookout, Mark, Rest, advise_on_read_error, read_mark, read_text, replace_file};
use rules::script::{
    Host, ScriptFile, ScriptProblem, ScriptSet, SettingValues, TEXT_MAX, list_shipped_scripts, prepare_scripts,
    prepare_with,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The list of what was delivered, so that a script that the user has deleted stays deleted.
const DELIVERED: &str = ".shipped";

/// What became of the shipped scripts when the directory was looked at.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Furnished {
    /// Written because they had never been there, or were an older version that nobody had edited.
    pub written: Vec<String>,
    /// Written as `NAME.new` because the user has edited NAME.
    pub beside: Vec<String>,
}

/// Writes the scripts that come with the gateway into the directory, which is created if need be. A script that was
/// edited is never touched: the shipped version is written beside it as `NAME.new`. A deleted one stays deleted.
///
/// # Errors
/// The directory or a file in it cannot be written; what is there already can still be read.
pub fn write_shipped_scripts(directory: &Path) -> std::io::Result<Furnished> {
    std::fs::create_dir_all(directory)?;
    let list = directory.join(DELIVERED);
    let mut delivered = read_list(&list);
    let before = delivered.clone();
    let mut furnished = Furnished::default();
    for file in list_shipped_scripts() {
        let (digest, path) = (compute_digest(file.text.as_bytes()), directory.join(&file.name));
        let present = std::fs::read(&path).ok().map(|bytes| compute_digest(&bytes));
        match (delivered.insert(file.name.clone(), digest), present) {
            (Some(old), _) if old == digest => {}
            (_, Some(there)) if there == digest => {}
            (Some(_), None) => {}
            (Some(old), Some(there)) if there == old => write(&path, &file, &mut furnished.written)?,
            (None, None) => write(&path, &file, &mut furnished.written)?,
            (_, Some(_)) => write(&directory.join(format!("{}.new", file.name)), &file, &mut furnished.beside)?,
        }
    }
    if delivered != before {
        let lines: String = delivered.iter().map(|(name, digest)| format!("{name} {digest:016x}\n")).collect();
        std::fs::write(list, lines)?;
    }
    Ok(furnished)
}

fn write(path: &Path, file: &ScriptFile, done: &mut Vec<String>) -> std::io::Result<()> {
    replace_file(path, &file.text)?;
    done.push(path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default());
    Ok(())
}

fn read_list(path: &Path) -> BTreeMap<String, u64> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let line = |line: &str| {
        let (name, digest) = line.split_once(' ')?;
        Some((name.to_owned(), u64::from_str_radix(digest, 16).ok()?))
    };
    text.lines().filter_map(line).collect()
}

/// Every script of the directory, in the order of the names.
///
/// # Errors
/// The directory, or files in it, cannot be read: all of them at once.
pub fn read_directory(directory: &Path) -> Result<Vec<ScriptFile>, Vec<ScriptProblem>> {
    let mut problems = Vec::new();
    let mut files = Vec::new();
    for path in list_paths(directory).map_err(|error| vec![describe_unreadable(directory, &error)])? {
        match stays_in(directory, &path).and_then(|()| read_script(&path)) {
            Ok(file) => files.push(file),
            Err(error) => problems.push(describe_unreadable(&path, &error)),
        }
    }
    if problems.is_empty() { Ok(files) } else { Err(problems) }
}

/// One script file.
///
/// # Errors
/// It cannot be read.
pub fn read_file(path: &Path) -> Result<ScriptFile, ScriptProblem> {
    read_script(path).map_err(|error| describe_unreadable(path, &error))
}

fn list_paths(directory: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if path.extension().is_some_and(|end| end == "rhai") && !hidden && !path.is_dir() {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// Scripts are shown to whoever may read the page: a link must not show a file from elsewhere.
fn stays_in(directory: &Path, path: &Path) -> std::io::Result<()> {
    let (real, within) = (path.canonicalize()?, directory.canonicalize()?);
    let what = "it is a link that leads out of the directory; copy the file there instead";
    if real.starts_with(within) { Ok(()) } else { Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, what)) }
}

fn read_script(path: &Path) -> std::io::Result<ScriptFile> {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(ScriptFile { name, text: read_text(path, TEXT_MAX)? })
}

fn describe_unreadable(path: &Path, error: &std::io::Error) -> ScriptProblem {
    let next = match error.kind() {
        std::io::ErrorKind::NotFound => suggest_directory(path),
        _ => advise_on_read_error(error).to_owned(),
    };
    ScriptProblem {
        file: path.display().to_string(),
        line: None,
        column: None,
        what: format!("cannot be read: {error}"),
        next,
    }
}

/// A directory of nearly this name beside it, if there is one.
fn suggest_directory(path: &Path) -> String {
    let beside = path.parent().and_then(|parent| std::fs::read_dir(parent).ok()).into_iter().flatten().flatten();
    let names: Vec<String> = beside.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    let wanted = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    match find_nearest_name(&wanted, names.iter().map(String::as_str)) {
        Some(near) => format!("did you mean {near:?}?"),
        None => "create it, or name another one as `directory` under [scripts]".to_owned(),
    }
}

/// Notices changes of a directory of scripts. Reads files only when their names, times or lengths have changed.
#[derive(Debug)]
pub struct Watch {
    directory: PathBuf,
    rest: Rest<Vec<Mark>>,
    content: Option<Result<Vec<ScriptFile>, Vec<ScriptProblem>>>,
    /// The file with the values of the settings, and what stood in it at the same look.
    settings: Option<PathBuf>,
    values: Result<String, Vec<ScriptProblem>>,
}

impl Watch {
    /// Nothing has been seen; the first look takes everything.
    #[must_use]
    pub fn new(directory: &Path) -> Self {
        Self {
            directory: directory.to_owned(),
            rest: Rest::new(),
            content: None,
            settings: None,
            values: Ok(String::new()),
        }
    }

    /// The same, and the file with the values of the settings, where there is one.
    #[must_use]
    pub fn with_settings(directory: &Path, settings: Option<&Path>) -> Self {
        Self { settings: settings.map(Path::to_owned), ..Self::new(directory) }
    }

    /// Everything, when it has changed and then stood still since the look before; at the first look, and with `now`,
    /// at once and whether it has changed or not.
    pub fn look_for_changes(&mut self, now: bool) -> Option<&Result<Vec<ScriptFile>, Vec<ScriptProblem>>> {
        let paths = list_paths(&self.directory).unwrap_or_default();
        let marks = paths.iter().chain(&self.settings).map(|path| read_mark(path)).collect();
        if !(self.rest.should_read(marks, now) || now) {
            return None;
        }
        let content = read_directory(&self.directory);
        let values = self.settings.as_deref().map_or_else(|| Ok(String::new()), settings::read_values_text);
        let same = self.content.as_ref() == Some(&content) && self.values == values;
        self.values = values;
        let content = self.content.insert(content);
        (now || !same).then_some(content)
    }

    /// The scripts and the values of the last look, compiled and tried, with the name of whoever wrote the values.
    fn prepare_fresh(&self, files: &[ScriptFile]) -> Result<Fresh, Vec<ScriptProblem>> {
        let text = self.values.as_ref().map_err(Clone::clone)?;
        let values = SettingValues::parse(settings::FILE, text)?;
        Ok(Fresh { set: prepare_with(files, &values)?, by: settings::find_author(text) })
    }
}

/// The newest scripts: ready to run, or what is wrong with them.
pub type LoadedScripts = Result<ScriptSet, Vec<ScriptProblem>>;

/// What a reload found.
struct Fresh {
    set: ScriptSet,
    by: String,
}

/// Scripts that came into charge by a reload.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reloaded {
    /// How many scripts there are.
    pub count: usize,
    /// Who has written the values of the settings.
    pub by: String,
}

/// Watches and compiles on a thread of its own.
pub struct Reloader(Lookout<Result<Fresh, Vec<ScriptProblem>>>);

impl Reloader {
    /// Starts to watch. Without `poll` only [`Reloader::request_look`] makes it look. The first look is not repeated: load the
    /// scripts with [`load_now`] before.
    ///
    /// # Errors
    /// No thread could be started.
    pub fn start(directory: &Path, settings: Option<&Path>, poll: bool) -> std::io::Result<Self> {
        let mut watch = Watch::with_settings(directory, settings);
        watch.look_for_changes(false);
        let look = move |asked| {
            let found = watch.look_for_changes(asked).cloned()?;
            Some(found.and_then(|files| watch.prepare_fresh(&files)))
        };
        Lookout::start("scripts", poll, look).map(Self)
    }

    /// Looks now, and compiles even when nothing has changed. Returns at once.
    pub fn request_look(&self) {
        self.0.request_look();
    }

    /// Puts newly found scripts in charge, or lets the host say why they are refused. Tells what happened, if anything.
    pub fn apply_found_scripts(&self, host: &mut Host) -> Option<Result<Reloaded, Vec<ScriptProblem>>> {
        let (loaded, by) = match self.0.take_newest()? {
            Ok(Fresh { set, by }) => (Ok(set), by),
            Err(problems) => (Err(problems), String::new()),
        };
        Some(put_in_charge(loaded, host).map(|count| Reloaded { count, by }))
    }
}

/// Reads, compiles and puts in charge at once, as at the start. Tells how many scripts there are.
///
/// # Errors
/// Everything that is wrong; the host says so too, and whatever was in charge stays.
pub fn load_now(directory: &Path, settings: Option<&Path>, host: &mut Host) -> Result<usize, Vec<ScriptProblem>> {
    put_in_charge(read_directory(directory).and_then(|files| prepare_with_settings(&files, settings)), host)
}

/// These scripts with the values of this file, compiled and tried.
///
/// # Errors
/// Everything that is wrong with the scripts or with the values.
pub fn prepare_with_settings(files: &[ScriptFile], settings: Option<&Path>) -> LoadedScripts {
    let values = settings.map_or_else(|| Ok(SettingValues::default()), settings::read)?;
    prepare_with(files, &values)
}

/// What is in charge after a start at which something was wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Fallback {
    /// The scripts that were in charge before the box was stopped, so many.
    Last(usize),
    /// All files but those with problems, so many.
    Others(usize),
    /// The shipped scripts, from memory.
    Shipped,
}

/// At the start: puts in charge the set that was in charge before, where there is one; or every file that is right by itself;
/// or the shipped scripts, so that the box is never without its alarms. The host goes on saying what is wrong.
pub fn load_rest(
    (directory, settings): (&Path, Option<&Path>),
    last: Option<ScriptSet>,
    problems: &[ScriptProblem],
    host: &mut Host,
) -> Fallback {
    if let Some(set) = last.filter(|set| !set.is_empty()) {
        let count = set.len();
        host.install_set(set);
        host.record_refusal(problems.to_vec());
        return Fallback::Last(count);
    }
    let fallback = match prepare_usable_scripts(directory, settings, problems) {
        Ok(set) if !set.is_empty() => {
            let count = set.len();
            host.install_set(set);
            Fallback::Others(count)
        }
        _ => {
            // The shipped scripts compile, which is tested; if they did not, the box would go on without any.
            let _none_in_charge = host.load_scripts(&list_shipped_scripts());
            Fallback::Shipped
        }
    };
    host.record_refusal(problems.to_vec());
    fallback
}

/// The scripts that can be read and have no problems. Where a file could not be read, nobody has looked at the others yet:
/// those that are not right by themselves are left out too.
fn prepare_usable_scripts(directory: &Path, settings: Option<&Path>, problems: &[ScriptProblem]) -> LoadedScripts {
    // Values that cannot be used leave every setting at its default.
    let prepare = |files: &[ScriptFile]| prepare_with_settings(files, settings).or_else(|_| prepare_scripts(files));
    let bad = |file: &ScriptFile| problems.iter().any(|problem| problem.file == file.name);
    let readable = list_paths(directory).unwrap_or_default().into_iter().filter_map(|path| read_script(&path).ok());
    let mut files: Vec<ScriptFile> = readable.filter(|file| !bad(file)).collect();
    prepare(&files).or_else(|_| {
        files.retain(|file| prepare(std::slice::from_ref(file)).is_ok());
        prepare(&files)
    })
}

fn put_in_charge(loaded: LoadedScripts, host: &mut Host) -> Result<usize, Vec<ScriptProblem>> {
    match loaded {
        Ok(set) => {
            let count = set.len();
            host.install_set(set);
            Ok(count)
        }
        Err(problems) => {
            host.record_refusal(problems.clone());
            Err(problems)
        }
    }
}
