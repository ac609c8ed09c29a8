//! The recipe on disk, read and checked beside the tick.

use gateway_base::files::{Lookout, Rest, advise_on_read_error, read_mark, read_text};
use rules::operations::{Recipe, TEXT_MAX, parse};
use rules::script::ScriptProblem;
use std::path::Path;

/// A recipe and the text it was read from.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadedRecipe {
    /// The operations as they are looked up.
    pub recipe: Recipe,
    /// The whole text of the file.
    pub text: String,
}

/// The recipe in a file.
///
/// # Errors
/// The file cannot be read, or everything that is wrong in it.
pub fn read(path: &Path) -> Result<LoadedRecipe, Vec<ScriptProblem>> {
    let name = path.display().to_string();
    let text = read_text(path, TEXT_MAX).map_err(|error| vec![describe_read_error(&name, &error)])?;
    Ok(LoadedRecipe { recipe: parse(&name, &text)?, text })
}

fn describe_read_error(name: &str, error: &std::io::Error) -> ScriptProblem {
    let next = match error.kind() {
        std::io::ErrorKind::NotFound => "`path` under [operations] names it; create it, or leave the section out",
        _ => advise_on_read_error(error),
    };
    let what = format!("the operations recipe cannot be read: {error}");
    ScriptProblem { file: name.to_owned(), line: None, column: None, what, next: next.to_owned() }
}

/// The recipe, or what is wrong with it.
pub(super) type RecipeResult = Result<LoadedRecipe, Vec<ScriptProblem>>;

/// Watches one file; what is there now is known already. Asked, it takes a change without waiting for it to stand still.
///
/// # Errors
/// No thread could be started.
pub(super) fn watch_file(path: &Path) -> std::io::Result<Lookout<RecipeResult>> {
    let mut rest = Rest::from_known_mark(read_mark(path));
    let path = path.to_owned();
    Lookout::start("operations", true, move |asked| rest.should_read(read_mark(&path), asked).then(|| read(&path)))
}
