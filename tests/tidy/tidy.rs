//! Rules of the code base as an ordinary test: what stands where, how long a file may be, where `unsafe` may stand, which
//! names are refused, what the program may depend on.

#[path = "advisories.rs"]
mod advisories;
#[path = "arrows.rs"]
mod arrows;
#[path = "functions.rs"]
mod functions;
#[path = "habits.rs"]
mod habits;
#[path = "names.rs"]
mod names;
#[path = "participles.rs"]
mod participles;
#[path = "reasons.rs"]
mod reasons;
#[path = "rooms.rs"]
mod rooms;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const LINES_MAX: usize = 400;

/// Files that are still to be split; no other may join them.
const TOO_LONG: [&str; 2] = ["rules/physics/scene/mod.rs", "rules/twin/model_file.rs"];

/// Besides dotfiles, what a build and a run leave behind, and licences.
const TOP_LEVEL: [&str; 6] = ["Cargo.toml", "README.md", "adapters", "gateway", "rules", "tests"];
const LEFT_BEHIND: [&str; 3] = ["Cargo.lock", "target", "cnc-gateway-data"];

const LICENCES: [&str; 11] = [
    "MIT",
    "Apache-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "Zlib",
    "MPL-2.0",
    "Unlicense",
    "CC0-1.0",
    "0BSD",
    "Unicode-3.0",
];

/// Crates that are in the tree in two versions, each with the reason.
const DUPLICATES: [(&str, &str); 10] = [
    ("base64", "the older one comes with the client of PostgreSQL, only in the feature `fleet`"),
    ("bit-vec", "the older one belongs to an optional part of rcgen that is not built"),
    ("fallible-iterator", "the older one comes with the client of PostgreSQL, only in the feature `fleet`"),
    ("getrandom", "rhai's hash, rand 0.9 and the test tools each ask for their own generation"),
    (
        "nom",
        "the older one parses certificates (x509-parser, no release with 8 yet); the newer one parses answers of mail servers (lettre)",
    ),
    ("num-bigint", "the older one belongs to an optional part of rcgen that is not built"),
    ("rand", "0.9 for the seeded distributions; 0.10 only within proptest"),
    ("rand_core", "goes with rand"),
    ("synstructure", "derive macros of two generations; nothing of it is in the program"),
    ("syn", "derive macros of two generations; nothing of it is in the program"),
];

/// Crates that must not come in, each with the reason.
const BANNED: [(&str, &str); 3] = [
    ("rumqttc", "0.25 pins a rustls-webpki with published advisories"),
    ("rustls-pemfile", "unmaintained"),
    ("openssl-sys", "the box builds with a C compiler alone"),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn collect(directory: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(directory).expect("readable").map(|entry| entry.expect("readable").path()) {
        match entry.is_dir() {
            true => collect(&entry, found),
            false => found.push(entry),
        }
    }
}

/// Every file of the four rooms with one of these endings, with its text.
fn texts(endings: &[&str]) -> Vec<(String, String)> {
    let mut files = Vec::new();
    TOP_LEVEL[2..].iter().for_each(|room| collect(&root().join(room), &mut files));
    files.sort();
    let wanted = |path: &PathBuf| path.extension().is_some_and(|end| endings.iter().any(|wanted| end == *wanted));
    let relative = |path: &PathBuf| path.strip_prefix(root()).expect("below the root").display().to_string();
    files
        .iter()
        .filter(|path| wanted(path))
        .map(|path| (relative(path), fs::read_to_string(path).expect("text")))
        .collect()
}

/// Room, path and text of every file of production code.
fn production_files() -> Vec<(String, String, String)> {
    let room = |path: &str| path.split('/').next().unwrap_or_default().to_owned();
    texts(&["rs"])
        .into_iter()
        .map(|(path, text)| (room(&path), path, text))
        .filter(|(room, path, _)| room != "tests" && !path.ends_with("tests.rs") && !path.contains("/tests/"))
        .collect()
}

fn none(found: Vec<String>, rule: &str) {
    assert!(found.is_empty(), "{rule}:\n  {}", found.join("\n  "));
}

#[test]
fn the_top_level_has_four_rooms() {
    let names = fs::read_dir(root()).expect("readable").map(|entry| entry.expect("readable").file_name());
    let strange = names.map(|name| name.to_string_lossy().into_owned()).filter(|name| {
        let known = TOP_LEVEL.contains(&name.as_str()) || LEFT_BEHIND.contains(&name.as_str());
        !(known || name.starts_with('.') || name.starts_with("LICENSE-"))
    });
    none(strange.collect(), "not part of the top level");
    for name in TOP_LEVEL {
        assert!(root().join(name).exists(), "{name} is missing");
    }
}

#[test]
fn no_file_is_longer_than_four_hundred_lines() {
    let long = texts(&["rs", "js", "css", "html", "rhai", "sql"]).into_iter().filter_map(|(path, text)| {
        let lines = text.lines().count();
        (lines > LINES_MAX && !TOO_LONG.contains(&path.as_str())).then(|| format!("{path}: {lines} lines"))
    });
    none(long.collect(), "longer than 400 lines: split the file by subject");
}

#[test]
fn every_exemption_is_still_needed() {
    let lines: BTreeMap<String, usize> =
        texts(&["rs"]).into_iter().map(|(path, text)| (path, text.lines().count())).collect();
    let idle = TOO_LONG.iter().filter(|path| lines.get(**path).is_none_or(|lines| *lines <= LINES_MAX));
    none(idle.map(|path| (*path).to_owned()).collect(), "no longer too long: take it off the list");
}

/// The files that can hold the declaration of a module that stands in this file.
fn declaring(path: &Path) -> (Vec<PathBuf>, String) {
    let name = path.file_stem().expect("a file").to_string_lossy().into_owned();
    let folder = path.parent().expect("in a room");
    let (folder, name) = match name.as_str() {
        "mod" => {
            (folder.parent().expect("in a room"), folder.file_name().expect("a folder").to_string_lossy().into_owned())
        }
        _ => (folder, name),
    };
    (["mod.rs", "lib.rs", "main.rs"].map(|file| folder.join(file)).into(), name)
}

/// The files that the manifests below the root name as a target.
fn targets_of_members() -> BTreeSet<String> {
    let manifests = texts(&["toml"]).into_iter().filter(|(path, _)| path.ends_with("/Cargo.toml"));
    let files = manifests.flat_map(|(path, text)| {
        let folder = path.trim_end_matches("Cargo.toml").to_owned();
        let named =
            text.lines().filter_map(|line| line.strip_prefix("path = \"")?.strip_suffix('"').map(str::to_owned));
        named.map(|file| format!("{folder}{file}")).collect::<Vec<_>>()
    });
    files.collect()
}

#[test]
fn every_file_of_code_is_compiled() {
    let all: BTreeMap<String, String> = texts(&["rs"]).into_iter().collect();
    let manifest = fs::read_to_string(root().join("Cargo.toml")).expect("text");
    let targets = targets_of_members();
    let dead = all.keys().filter(|path| {
        let is_root = path.ends_with("/lib.rs")
            || path.ends_with("/main.rs")
            || manifest.contains(path.as_str())
            || targets.contains(*path);
        let is_test = path.starts_with("tests/") && path.matches('/').count() == 1;
        let (files, name) = declaring(Path::new(path));
        let declared = |file: &PathBuf| {
            let text = all.get(file.to_string_lossy().as_ref()).map_or("", String::as_str);
            let by_macro = text.contains("mod $")
                && text.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == name);
            by_macro || text.lines().any(|line| line.trim_end().ends_with(&format!("mod {name};")))
        };
        let tail: Vec<&str> = path.rsplitn(3, '/').take(2).collect();
        let tail = [format!("{}/{}\"]", tail[1], tail[0]), format!("path = \"{}\"]", tail[0])];
        let beside = |file: &String| Path::new(file).parent() == Path::new(path).parent();
        let by_bench =
            || all.keys().any(|file| beside(file) && manifest.contains(file.as_str()) && declared(&file.into()));
        let by_path = || all.values().any(|text| tail.iter().any(|tail| text.contains(tail)));
        !(is_root || is_test || files.iter().any(declared) || by_path() || by_bench())
    });
    none(dead.cloned().collect(), "no module declares this file");
}

#[test]
fn there_is_no_src_and_no_utils() {
    let strange = texts(&["rs"]).into_iter().filter_map(|(path, _)| {
        let parts: Vec<&str> = path.split(['/', '.']).collect();
        ["src", "utils", "util", "common", "helpers", "misc"].iter().any(|name| parts.contains(name)).then_some(path)
    });
    none(strange.collect(), "a folder or file is about something; name it");
}

#[test]
fn unsafe_stands_only_in_files_named_ffi() {
    let block = concat!("unsafe", " ");
    for (path, text) in texts(&["rs"]) {
        let code = |line: &&str| !line.trim_start().starts_with("//") && !line.contains('"');
        let lines: Vec<&str> = text.lines().collect();
        let places = lines.iter().enumerate().filter(|(_, line)| code(line) && line.contains(block));
        for (index, line) in places {
            let file = Path::new(&path).file_name().expect("a file");
            assert_eq!(file, "ffi.rs", "{path}:{}: {line}", index + 1);
            let reason = lines[index.saturating_sub(4)..=index].iter().any(|line| line.contains("SAFETY"));
            let declares = line.contains("fn ") || line.contains("extern");
            assert!(reason || declares, "{path}:{}: no SAFETY reason above", index + 1);
        }
    }
}

#[test]
fn nothing_unfinished_and_no_bare_unwrap() {
    let unfinished = [concat!("todo", "!("), concat!("unimplemented", "!("), concat!("TO", "DO"), concat!("FIX", "ME")];
    let mut found = Vec::new();
    for (path, text) in texts(&["rs", "js", "rhai"]) {
        let test = path.starts_with("tests/") || path.ends_with("tests.rs");
        let production = text.split("#[cfg(test)]").next().unwrap_or_default();
        for (index, line) in text.lines().enumerate() {
            let here = format!("{path}:{}: {}", index + 1, line.trim());
            let bare = line.contains(".unwrap()") && !line.contains("//");
            let bare = bare && !test && index < production.lines().count();
            if bare || unfinished.iter().any(|word| line.contains(word)) {
                found.push(here);
            }
        }
    }
    none(found, "unfinished, or an unwrap without its reason");
}

#[test]
fn the_project_speaks_of_itself_only() {
    let foreign = [
        concat!("/wo", "rk/"),
        concat!("/ro", "ot/"),
        concat!(".lib", "rary"),
        concat!("crates", ".io"),
        concat!("reg", "istry+"),
    ];
    let found =
        texts(&["rs", "md", "toml", "js", "html", "css", "rhai", "json"]).into_iter().flat_map(|(path, text)| {
            let lines: Vec<String> = text
                .lines()
                .enumerate()
                .filter(|(_, line)| foreign.iter().any(|word| line.contains(word)))
                .map(|(index, line)| format!("{path}:{}: {}", index + 1, line.trim()))
                .collect();
            lines
        });
    none(found.collect(), "a path of one machine, or a host of a registry");
}

struct Package {
    name: String,
    version: String,
    licence: String,
}

/// The platform that the tests run on; crates for others are not looked at.
fn host() -> String {
    let output = Command::new("rustc").arg("-vV").output().expect("rustc runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines().find_map(|line| line.strip_prefix("host: ")).expect("a host").to_owned()
}

/// Every crate that this platform needs, as cargo sees it.
fn packages() -> Vec<Package> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform", &host()])
        .current_dir(root())
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let text = |package: &serde_json::Value, key: &str| package[key].as_str().unwrap_or_default().to_owned();
    let packages = metadata["packages"].as_array().expect("a list");
    let package = |p| Package { name: text(p, "name"), version: text(p, "version"), licence: text(p, "license") };
    packages.iter().map(package).collect()
}

/// Does the expression leave a choice of allowed licences only? `A OR B` needs one of them, `A AND B` both.
fn allowed(expression: &str) -> bool {
    let expression = expression.replace('/', " OR ").replace(['(', ')'], " ");
    let known =
        |name: &str| LICENCES.contains(&name.trim().trim_end_matches(" WITH LLVM-exception").trim_end_matches('+'));
    expression.split(" AND ").all(|part| part.split(" OR ").any(known))
}

#[test]
fn every_dependency_has_a_permissive_licence() {
    let refused = packages().into_iter().filter(|package| !allowed(&package.licence));
    none(refused.map(|p| format!("{} {}: {:?}", p.name, p.version, p.licence)).collect(), "licence not on the list");
    assert!(allowed("MIT OR GPL-3.0") && !allowed("GPL-3.0") && !allowed("MIT AND GPL-3.0") && !allowed(""));
}

#[test]
fn no_dependency_comes_in_two_versions() {
    let mut versions: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for package in packages() {
        versions.entry(package.name).or_default().insert(package.version);
    }
    let twice: BTreeSet<&str> = versions.iter().filter(|(_, v)| v.len() > 1).map(|(name, _)| name.as_str()).collect();
    let known: BTreeSet<&str> = DUPLICATES.iter().map(|(name, _)| *name).collect();
    let new = twice.difference(&known).map(|name| format!("{name}: {:?}", versions[*name]));
    none(new.collect(), "in two versions; unify them or write the reason down here");
    none(known.difference(&twice).map(ToString::to_string).collect(), "no longer in two versions; strike them off");
}

#[test]
fn nothing_banned_came_in() {
    let names: BTreeSet<String> = packages().into_iter().map(|package| package.name).collect();
    let found = BANNED.iter().filter(|(name, _)| names.contains(*name));
    none(found.map(|(name, reason)| format!("{name}: {reason}")).collect(), "banned");
}

/// A test that is ignored.
struct Ignored {
    path: String,
    name: String,
    reason: String,
}

/// Every ignored test of the four rooms.
fn ignored() -> Vec<Ignored> {
    let mark = concat!("#[ign", "ore");
    let mut found = Vec::new();
    for (path, text) in texts(&["rs"]) {
        let lines: Vec<&str> = text.lines().collect();
        for (index, line) in lines.iter().enumerate().filter(|(_, line)| line.trim_start().starts_with(mark)) {
            let reason = line.split('"').nth(1).unwrap_or_default().to_owned();
            let named = lines[index..].iter().find_map(|line| line.trim_start().strip_prefix("fn "));
            let name = named.and_then(|rest| rest.split('(').next()).unwrap_or_default().to_owned();
            found.push(Ignored { path: path.clone(), name, reason });
        }
    }
    found
}

/// "5 minutes: what it shows", or "part of the test that starts it: what it does".
fn says_how_long_and_what_for(reason: &str) -> bool {
    let Some((takes, shows)) = reason.split_once(": ") else { return false };
    let mut words = takes.split(' ');
    let number = words.next().is_some_and(|word| word.parse::<u32>().is_ok());
    let unit = words.next().is_some_and(|word| ["second", "minute", "hour"].contains(&word.trim_end_matches('s')));
    (takes.starts_with("part of ") || number && unit) && shows.split(' ').count() >= 3
}

#[test]
fn whatever_is_ignored_says_how_long_it_takes_and_what_it_shows() {
    let silent = ignored().into_iter().filter(|test| !says_how_long_and_what_for(&test.reason));
    let told = silent.map(|test| format!("{} {}: {:?}", test.path, test.name, test.reason));
    none(told.collect(), "ignored without a reason such as \"5 minutes: what it shows\"");
    assert!(!says_how_long_and_what_for("slow") && !says_how_long_and_what_for("some minutes: it shows a thing"));
}

#[test]
fn the_test_map_lists_every_ignored_test_and_no_other() {
    let map = fs::read_to_string(root().join("gateway/handbook/tests.md")).expect("the chapter is there");
    let row = |path: &str, name: &str| format!("| `{path}` | `{name}` |");
    let tests: Vec<String> = ignored().iter().map(|test| row(&test.path, &test.name)).collect();
    let unlisted = tests.iter().filter(|row| !map.contains(row.as_str())).cloned();
    none(unlisted.collect(), "ignored, and not in gateway/handbook/tests.md");
    let by_hand = map.split("## What runs by hand").nth(1).expect("the chapter has this part");
    let listed = by_hand.lines().filter(|line| line.contains(".rs` | `"));
    let gone = listed.filter(|line| !tests.iter().any(|row| line.starts_with(row.as_str()))).map(str::to_owned);
    none(gone.collect(), "in gateway/handbook/tests.md, and no longer ignored");
}
