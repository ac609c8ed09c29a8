//! Names that the sources declare or hold as a literal, for the test of identifiers.

use super::documents::root;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Words of Rust behind which a name is declared.
const DECLARES: [&str; 9] = ["fn", "struct", "enum", "trait", "const", "static", "type", "mod", "macro_rules!"];
/// Words of Rust behind which a type is declared, or gets its functions.
const OWNS: [&str; 5] = ["struct", "enum", "trait", "impl", "for"];

/// One file below the four rooms.
pub(crate) struct SourceFile {
    /// Path below the root.
    pub(crate) path: String,
    pub(crate) words: BTreeSet<String>,
    declared: BTreeSet<String>,
    owned: BTreeSet<String>,
}

/// Every name of the sources.
pub(crate) struct SourceIndex {
    pub(crate) files: Vec<SourceFile>,
    names: BTreeSet<String>,
}

pub(crate) fn is_word_letter(letter: char) -> bool {
    letter.is_ascii_alphanumeric() || letter == '_'
}

pub(crate) fn split_words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|letter| !is_word_letter(letter)).filter(|word| !word.is_empty())
}

/// Names behind one of these words of Rust.
fn list_names_behind(text: &str, keywords: &[&str]) -> BTreeSet<String> {
    let tokens: Vec<&str> = text.split_whitespace().collect();
    let behind = tokens.windows(2).filter(|pair| keywords.iter().any(|word| is_keyword(pair[0], word)));
    behind.filter_map(|pair| split_words(pair[1]).next().map(str::to_owned)).collect()
}

/// Also `impl<T>`, whose parameters stand without a space.
fn is_keyword(token: &str, keyword: &str) -> bool {
    token == keyword || token.strip_prefix(keyword).is_some_and(|rest| rest.starts_with('<'))
}

/// A line without `pub` and `pub(crate)`.
fn strip_visibility(line: &str) -> &str {
    match line.strip_prefix("pub") {
        Some(rest) if rest.starts_with('(') => rest.split_once(") ").map_or(line, |(_, rest)| rest),
        Some(rest) => rest.trim_start(),
        None => line,
    }
}

/// A field `name: Type` or a variant `Name`, `Name(..)`, `Name {..}` of a line of its own.
fn find_member(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let line = strip_visibility(line);
    let (name, behind) = line.split_at(line.find(|letter| !is_word_letter(letter))?);
    let is_variant = name.starts_with(|first: char| first.is_ascii_uppercase())
        && [",", "(", " {", " ="].iter().any(|mark| behind.starts_with(mark));
    let is_field = behind.starts_with(": ");
    (is_variant || is_field).then_some(name)
}

/// A line without its comment; `//` in a text is no comment.
fn strip_comment(line: &str) -> &str {
    let is_open = |index: usize| line[..index].matches('"').count() % 2 == 1;
    let marks = line.match_indices("//").map(|(index, _)| index);
    marks.filter(|index| !is_open(*index)).map(|index| &line[..index]).next().unwrap_or(line)
}

/// Words of the text literals of Rust.
fn list_literal_words(text: &str) -> BTreeSet<String> {
    let literals = text.lines().flat_map(|line| strip_comment(line).split('"').skip(1).step_by(2));
    literals.flat_map(split_words).map(str::to_owned).collect()
}

fn collect_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in std::fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").path()) {
        match path.is_dir() {
            true => collect_files(&path, found),
            false => found.push(path),
        }
    }
}

/// Chapters are what is looked at, and this test names what is not there.
fn is_left_out(path: &Path) -> bool {
    path.extension().is_some_and(|end| end == "md") || path.ends_with("tests/handbook/identifiers.rs")
}

impl SourceIndex {
    /// Reads the four rooms.
    pub(crate) fn read() -> Self {
        let mut paths = vec![root().join("Cargo.toml"), root().join(".ci/run")];
        ["adapters", "gateway", "rules", "tests"].iter().for_each(|room| collect_files(&root().join(room), &mut paths));
        let mut index = Self { files: Vec::new(), names: BTreeSet::new() };
        for path in paths.iter().filter(|path| !is_left_out(path)) {
            index.add_path(path.strip_prefix(root()).expect("below the root"));
            if let Ok(text) = std::fs::read_to_string(path) {
                index.add_text(path, &text);
            }
        }
        index
    }

    /// Folders and files without their ending: modules, suites, scripts, settings.
    fn add_path(&mut self, path: &Path) {
        let folders = path.parent().into_iter().flat_map(Path::iter).map(|part| part.to_string_lossy().into_owned());
        self.names.extend(folders);
        self.names.extend(path.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
    }

    fn add_text(&mut self, path: &Path, text: &str) {
        let relative = path.strip_prefix(root()).expect("below the root").display().to_string();
        let mut owned = BTreeSet::new();
        let mut declared = BTreeSet::new();
        match path.extension().and_then(|end| end.to_str()) {
            Some("rs") => {
                declared = list_names_behind(text, &DECLARES);
                declared.extend(text.lines().filter_map(find_member).map(str::to_owned));
                owned = list_names_behind(text, &OWNS);
                self.names.extend(list_literal_words(text));
            }
            Some("js") => declared = list_names_behind(text, &["function", "const", "let"]),
            Some("rhai") => {
                declared = text.lines().flat_map(|line| split_words(strip_comment(line))).map(str::to_owned).collect()
            }
            Some("sql" | "toml" | "tsv") | None => declared = split_words(text).map(str::to_owned).collect(),
            Some(_) => {}
        }
        self.names.extend(declared.iter().cloned());
        let words = split_words(text).map(str::to_owned).collect();
        self.files.push(SourceFile { path: relative, words, declared, owned });
    }

    /// A declared name or a word of a literal; `name_` stands for all that begin so, `_name` for all that end so.
    pub(crate) fn has_name(&self, name: &str) -> bool {
        self.names.contains(name)
            || name.ends_with('_') && self.names.iter().any(|whole| whole.starts_with(name))
            || name.starts_with('_') && self.names.iter().any(|whole| whole.ends_with(name))
    }

    /// Whether a file in which the type is declared or gets functions declares this member.
    pub(crate) fn has_member(&self, owner: &str, member: &str) -> bool {
        self.files.iter().any(|file| file.owned.contains(owner) && file.declared.contains(member))
    }

    /// Files of this path, or of a path that ends so; a folder stands for all of it.
    pub(crate) fn find_files(&self, path: &str) -> Vec<&SourceFile> {
        let below = format!("{}/", path.trim_end_matches('/'));
        let inner = format!("/{below}");
        let is_it = |file: &&SourceFile| {
            let whole = format!("/{}", file.path);
            whole.ends_with(&format!("/{path}")) || file.path.starts_with(&below) || whole.contains(&inner)
        };
        self.files.iter().filter(is_it).collect()
    }
}

#[test]
fn names_are_found_in_sources() {
    let text = "pub struct Gate<'a> {\n    pub(crate) mode: Mode,\n}\nimpl Gate<'_> {\n    fn decide(&self) {}\n}\nenum Way {\n    Dial,\n}\n";
    let names: Vec<String> = list_names_behind(text, &DECLARES).into_iter().collect();
    assert_eq!(names, ["Gate", "Way", "decide"]);
    assert_eq!(list_names_behind(text, &OWNS).into_iter().collect::<Vec<_>>(), ["Gate", "Way"]);
    assert_eq!(text.lines().filter_map(find_member).collect::<Vec<_>>(), ["mode", "Dial"]);
    let words: Vec<String> =
        list_literal_words("f(\"stale_s\", \"tool_worn_{edge}\"); // \"gone\"").into_iter().collect();
    assert_eq!(words, ["edge", "stale_s", "tool_worn_"]);
    assert_eq!(strip_comment("let url = \"nats://host\"; // where"), "let url = \"nats://host\"; ");
}
