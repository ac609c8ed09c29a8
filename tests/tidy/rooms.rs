//! How many lines of production code a room has: the table in chapter `inside` of the handbook is counted here, and a room may
//! not have more lines than its row says.
//!
//! A line is a line of Rust or JavaScript, with its comments, that is neither in a file of tests nor in a module of tests.

use super::names::production;
use super::{none, root, texts};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A row may be above what is there by so many lines; above that it is lowered.
const SLACK_LINES: usize = 400;
/// The heading under which the table stands.
const HEADING: &str = "## Lines of each room";

/// A row of the table.
#[derive(Debug, PartialEq)]
struct RoomRow {
    name: String,
    /// What the paths of its files begin with.
    folders: Vec<String>,
    /// Lines that it may have.
    most: usize,
}

/// The room, its folders in code marks, lines before, lines that it may have.
fn parse_row(line: &str) -> Option<RoomRow> {
    let cells: Vec<&str> = line.strip_prefix("| ")?.split(" | ").collect();
    let folders: Vec<String> = cells.get(1)?.split('`').skip(1).step_by(2).map(str::to_owned).collect();
    let most = cells.get(3)?.replace(',', "").parse().ok()?;
    (!folders.is_empty()).then(|| RoomRow { name: cells[0].to_owned(), folders, most })
}

fn read_rows() -> Vec<RoomRow> {
    let chapter = fs::read_to_string(root().join("gateway/handbook/inside.md")).expect("the chapter is there");
    let section = chapter.split(HEADING).nth(1).expect("the section is there");
    let section = section.split("\n## ").next().unwrap_or_default();
    section.lines().filter_map(parse_row).collect()
}

/// Name of the module of tests that these two lines declare, in a file of its own.
fn find_test_module<'a>(before: &str, line: &'a str) -> Option<&'a str> {
    let declared =
        line.strip_suffix(';')?.rsplit_once("mod ").filter(|(visibility, _)| !visibility.trim_end().contains(' '))?;
    (before == "#[cfg(test)]").then_some(declared.1)
}

/// Where a module of this name lies that is declared in the file at `path`.
fn list_places(path: &str, module: &str) -> [PathBuf; 2] {
    let file = Path::new(path);
    let folder = file.parent().expect("in a room");
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let inner = if ["mod", "lib", "main"].contains(&&*stem) { folder.to_owned() } else { folder.join(&*stem) };
    [inner.join(format!("{module}.rs")), inner.join(module)]
}

/// Files and folders that hold modules of tests under any name.
fn collect_test_modules(files: &[(String, String)]) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    for (path, text) in files {
        let lines: Vec<&str> = text.lines().collect();
        let modules = lines.windows(2).filter_map(|pair| find_test_module(pair[0], pair[1]));
        found.extend(modules.flat_map(|module| list_places(path, module)));
    }
    found
}

/// Paths and lines of all files of production code.
fn count_files() -> Vec<(String, usize)> {
    let files = texts(&["rs", "js"]);
    let modules = collect_test_modules(&files);
    let is_test = |path: &str| {
        let below = Path::new(path).ancestors().any(|part| modules.contains(part));
        below || path.starts_with("tests/") || path.ends_with("tests.rs") || path.starts_with("gateway/web/vendor/")
    };
    let counted = files.iter().filter(|(path, _)| !is_test(path));
    counted.map(|(path, text)| (path.clone(), production(text).len())).collect()
}

/// `cargo test --test tidy rooms -- --nocapture` prints the figures.
#[test]
fn no_room_has_more_lines_than_its_row_says() {
    let (files, rows) = (count_files(), read_rows());
    let mut problems = Vec::new();
    let mut counted = BTreeSet::new();
    for RoomRow { name, folders, most } in &rows {
        let is_of_room = |path: &str| folders.iter().any(|folder| path.starts_with(folder));
        // A file belongs to the first row that has its folder.
        let own: Vec<&(String, usize)> =
            files.iter().filter(|(path, _)| is_of_room(path) && counted.insert(path.clone())).collect();
        let lines: usize = own.iter().map(|(_, lines)| lines).sum();
        println!("{name}: {lines} lines of at most {most}");
        if lines > *most {
            problems.push(format!("{name}: {lines} lines, {most} in the table; take out what nobody would miss"));
        } else if lines + SLACK_LINES < *most {
            problems.push(format!("{name}: {lines} lines, {most} in the table; lower the number"));
        }
    }
    let left: Vec<&String> = files.iter().map(|(path, _)| path).filter(|path| !counted.contains(*path)).collect();
    problems.extend(left.into_iter().map(|path| format!("{path} is in no row")));
    println!("{} lines in all", files.iter().map(|(_, lines)| lines).sum::<usize>());
    none(problems, "the table under \"Lines of each room\" in gateway/handbook/inside.md");
}

#[test]
fn rows_and_modules_of_tests_are_found() {
    let row = parse_row("| history | `gateway/history/`, `b/` | 12,320 | 12,400 | 9,000 | why |").expect("a row");
    assert_eq!((row.most, row.folders), (12_400, vec!["gateway/history/".to_owned(), "b/".to_owned()]));
    assert_eq!(parse_row("| room | folders | before | at most | aim | why |"), None);
    assert_eq!(find_test_module("#[cfg(test)]", "pub(crate) mod bed;"), Some("bed"));
    assert_eq!(find_test_module("", "mod bed;"), None);
    assert_eq!(list_places("a/mod.rs", "bed")[0], Path::new("a/bed.rs"));
    assert_eq!(list_places("a/b.rs", "bed")[1], Path::new("a/b/bed"));
}
