//! The operations recipe of a running box: read at the start, watched, swapped only when the whole file is right.
//!
//! What it fills in, it marks: every sample says in the channel `recipe` which operation and which version of the file
//! were used, and the text of each version is an event of the history.

mod watch;

use adapters::Sample;
use gateway_base::files::Lookout;
use gateway_base::log::{Notice, Severity};
use gateway_status as status;
use rules::operations::{Completion, Lookup};
use rules::script::ScriptProblem;
use std::path::{Path, PathBuf};
use watch::RecipeResult;

pub use watch::{LoadedRecipe, read};

/// Who writes the events.
pub const SOURCE: &str = "operations";

/// The operations recipe in force: read at the start, watched, swapped when the whole file is right.
#[derive(Debug)]
pub struct Operations {
    path: PathBuf,
    completion: Completion,
    active: Option<LoadedRecipe>,
    refused: Vec<ScriptProblem>,
    watcher: Option<Lookout<RecipeResult>>,
    notices: Vec<Notice>,
    /// Name of the operation in force, or why there is none.
    in_force: Option<Result<String, &'static str>>,
}

impl Operations {
    /// Reads the recipe and begins to watch it. A file that cannot be used is told, and the box waits for a better one.
    #[must_use]
    pub fn start_watching(path: &Path) -> Self {
        let mut operations = Self {
            path: path.to_owned(),
            completion: Completion::new(),
            active: None,
            refused: Vec::new(),
            watcher: None,
            notices: Vec::new(),
            in_force: None,
        };
        operations.accept_recipe(read(path));
        match watch::watch_file(path) {
            Ok(watcher) => operations.watcher = Some(watcher),
            Err(error) => {
                let text =
                    format!("a changed recipe will not be noticed ({error}); start the box again after a change");
                operations.notices.push(Notice::new(Severity::Warning, "recipe_not_watched", text));
            }
        }
        operations
    }

    fn accept_recipe(&mut self, found: RecipeResult) {
        match found {
            Ok(loaded) => {
                let (count, version) = (loaded.recipe.operations().len(), loaded.recipe.version());
                let text = format!("{}: {count} operations are in force, version {version}", self.path.display());
                self.notices
                    .push(Notice::new(Severity::Info, "recipe_in_force", text).with_detail(loaded.text.clone()));
                self.refused.clear();
                self.active = Some(loaded);
            }
            Err(problems) => {
                let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
                let lines = lines.join("\n").replace('\n', "\n  ");
                let text = format!("the operations recipe is refused, {}:\n  {lines}", self.describe_consequence());
                self.notices.push(Notice::new(Severity::Warning, "recipe_refused", text));
                self.refused = problems;
            }
        }
    }

    fn describe_consequence(&self) -> String {
        match &self.active {
            Some(loaded) => format!("version {} stays in force", loaded.recipe.version()),
            None => "depth of cut and diameter stay unknown".to_owned(),
        }
    }

    /// Takes what has been found on disk since the last tick, with `reload` looks again at once, and fills in the sample.
    /// Costs a look-up and allocates nothing while the operation stays the same.
    pub fn update_sample(&mut self, sample: &mut Sample, reload: bool, mut tell: impl FnMut(&Notice)) {
        if let Some(watcher) = &self.watcher {
            if reload {
                watcher.request_look();
            }
            if let Some(found) = watcher.take_newest() {
                self.accept_recipe(found);
            }
        }
        self.notices.drain(..).for_each(|notice| tell(&notice));
        if let Some(loaded) = &self.active {
            let lookup = self.completion.apply_recipe(&loaded.recipe, sample);
            note_operation(&mut self.in_force, lookup);
        }
    }

    /// What the page shows.
    #[must_use]
    pub fn status(&self) -> status::OperationsStatus {
        let recipe = self.active.as_ref().map(|loaded| &loaded.recipe);
        let lines: Vec<String> = self.refused.iter().map(ToString::to_string).collect();
        status::OperationsStatus {
            path: self.path.display().to_string(),
            version: recipe.map(|recipe| recipe.version().to_owned()),
            operations: recipe.map_or(0, |recipe| recipe.operations().len()),
            in_force: self.in_force.as_ref().and_then(|found| found.clone().ok()),
            missing: self.in_force.as_ref().and_then(|found| found.clone().err()).map(str::to_owned),
            error: (!lines.is_empty()).then(|| lines.join("\n")),
        }
    }

    /// What does not work, for the list of problems.
    #[must_use]
    pub fn describe_problem(&self) -> Option<status::StatusProblem> {
        let first = self.refused.first()?;
        let more = self.refused.len() - 1;
        let others = if more > 0 { format!(" (and {more} more)") } else { String::new() };
        let what = format!("the operations recipe is refused, {}: {first}{others}", self.describe_consequence());
        Some(status::StatusProblem { what, next: "correct the file; it is taken within two seconds".to_owned() })
    }
}

/// Notes a change of the operation; a lasting one costs a comparison.
fn note_operation(in_force: &mut Option<Result<String, &'static str>>, lookup: Lookup<'_>) {
    match (lookup, &*in_force) {
        (Lookup::Found(operation), Some(Ok(name))) if **name == *operation.mark => {}
        (Lookup::Found(operation), _) => *in_force = Some(Ok(operation.mark.to_string())),
        (why, _) => *in_force = why.explain_missing().map(Err),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapters::{ChannelId, Slot, Value};
    use std::fs;
    use std::time::{Duration, Instant};

    fn table(depth: &str) -> String {
        format!(
            "schema = \"operations/1\"\n[[operation]]\nprogram = \"O1\"\nname = \"rough\"\ndepth_of_cut_mm = {depth}\n"
        )
    }

    /// The whole file in one step, as an editor that renames does: half a file would be refused for another reason.
    fn write(path: &Path, text: &str) {
        let beside = path.with_extension("new");
        fs::write(&beside, text).expect("written");
        fs::rename(&beside, path).expect("renamed");
    }

    fn sample() -> Sample {
        let mut sample = Sample::new_empty(0);
        let slot = Slot { value: Ok(Value::Text("O1".into())), age_ns: 0 };
        sample.set_slot(ChannelId::from_name("program").expect("in the table"), slot);
        sample
    }

    fn depth(operations: &mut Operations, told: &mut Vec<Notice>) -> Result<f64, adapters::Absence> {
        let mut sample = sample();
        operations.update_sample(&mut sample, true, |notice| told.push(notice.clone()));
        sample.number(ChannelId::from_name("depth_of_cut_mm").expect("in the table"))
    }

    /// Steps until the depth is as expected, or the time is over.
    fn until(operations: &mut Operations, told: &mut Vec<Notice>, done: impl Fn(f64, &[Notice]) -> bool) {
        let began = Instant::now();
        while !depth(operations, told).is_ok_and(|depth| done(depth, told)) {
            assert!(began.elapsed() < Duration::from_secs(20), "not noticed: {told:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    #[test]
    fn a_changed_recipe_is_taken_and_a_broken_one_leaves_the_one_before_in_force() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("operations.toml");
        write(&path, &table("1.5"));
        let (mut operations, mut told) = (Operations::start_watching(&path), Vec::new());
        assert_eq!(depth(&mut operations, &mut told), Ok(1.5));
        write(&path, &table("2.25"));
        until(&mut operations, &mut told, |depth, _| depth == 2.25);
        write(&path, &table("2250"));
        until(&mut operations, &mut told, |_, told| told.iter().any(|notice| notice.code == "recipe_refused"));
        assert_eq!(depth(&mut operations, &mut told), Ok(2.25), "the one before stays");
        let status = operations.status();
        assert!(status.error.is_some_and(|error| error.contains("in micrometres?")));
        assert!(operations.describe_problem().is_some_and(|problem| problem.what.contains("stays in force")));
        write(&path, &table("3"));
        until(&mut operations, &mut told, |depth, _| depth == 3.0);
        assert_eq!((operations.describe_problem(), operations.status().operations), (None, 1));
    }

    #[test]
    fn a_recipe_that_is_not_there_is_told_and_waited_for() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("operations.toml");
        let (mut operations, mut told) = (Operations::start_watching(&path), Vec::new());
        assert!(depth(&mut operations, &mut told).is_err());
        assert!(told.iter().any(|notice| notice.code == "recipe_refused"));
        write(&path, &table("1.5"));
        until(&mut operations, &mut told, |depth, _| depth == 1.5);
    }
}
