//! Files and fields that are named by a participle alone (`told`, `kept`) say what happened to a thing and not what it is.
//! They are counted by room, and may only become fewer.

use super::functions::NO_PARTICIPLES;
use super::names::production;
use super::production_files;
use std::collections::BTreeMap;

/// Participles without `-ed` that stood for things. Those that are a term of the field or of the language (`set`, `cut`,
/// `known`, `given`, `left`) are not among them.
const IRREGULAR: [&str; 14] = [
    "brought", "drawn", "found", "heard", "held", "kept", "lost", "made", "said", "seen", "sent", "shown", "told",
    "written",
];

/// Files of production code: there is none.
const FILES_MAX: [(&str, usize); 3] = [("adapters", 0), ("gateway", 0), ("rules", 0)];

/// Fields of structures: what is there today.
const FIELDS_MAX: [(&str, usize); 3] = [("adapters", 82), ("gateway", 193), ("rules", 92)];

fn is_participle(name: &str) -> bool {
    let regular = name.ends_with("ed") && !NO_PARTICIPLES.contains(&name);
    !name.contains('_') && (regular || IRREGULAR.contains(&name))
}

/// Names of the fields that the structures of a file declare, in lines of their own.
fn fields<'a>(lines: &[&'a str]) -> Vec<&'a str> {
    let (mut found, mut inside) = (Vec::new(), false);
    for line in lines {
        let code = line.trim_start();
        let declares = code.starts_with("struct ") || code.contains(" struct ");
        inside |= declares && line.ends_with('{') && !code.starts_with("//");
        inside &= code != "}";
        let name = code.split_once(": ").map(|(before, _)| before.rsplit(' ').next().unwrap_or_default());
        let plain = |name: &&str| !name.is_empty() && name.chars().all(|c| c.is_ascii_lowercase() || c == '_');
        if let Some(name) = name.filter(plain).filter(|_| inside && !declares && !code.starts_with("//")) {
            found.push(name);
        }
    }
    found
}

/// Files and fields of a room.
#[derive(Debug, Default)]
struct Participles {
    files: Vec<String>,
    fields: usize,
    all_fields: usize,
}

fn count_participles() -> BTreeMap<String, Participles> {
    let mut rooms: BTreeMap<String, Participles> = BTreeMap::new();
    for (room, path, text) in production_files() {
        let count = rooms.entry(room).or_default();
        let stem = path.rsplit('/').next().unwrap_or_default().trim_end_matches(".rs");
        if is_participle(stem) {
            count.files.push(path.clone());
        }
        let names = fields(&production(&text));
        count.all_fields += names.len();
        count.fields += names.into_iter().filter(|name| is_participle(name)).count();
    }
    rooms
}

/// `cargo test --test tidy participles -- --nocapture` prints the figures.
#[test]
fn files_and_fields_named_by_participles_become_fewer() {
    let rooms = count_participles();
    for (room, count) in &rooms {
        println!("{room}: files {:?}; {} of {} fields", count.files, count.fields, count.all_fields);
    }
    for (room, most) in FILES_MAX {
        let found = &rooms[room].files;
        assert!(found.len() <= most, "{room}: say what the file holds:\n  {}", found.join("\n  "));
        assert!(found.len() + 5 > most, "{room}: {}; lower FILES_MAX", found.len());
    }
    for (room, most) in FIELDS_MAX {
        let found = rooms[room].fields;
        assert!(found <= most, "{room}: {found} fields are a participle; say what they hold");
        assert!(found + 15 > most, "{room}: {found}; lower FIELDS_MAX");
    }
}

#[test]
fn fields_are_found() {
    let lines =
        ["struct A {", "    /// Doc: text.", "    pub told: u8,", "    pub(crate) at_ns: i64,", "}", "    seen: 1,"];
    assert_eq!(fields(&lines), ["told", "at_ns"]);
    assert!(
        is_participle("told") && is_participle("stored") && !is_participle("speed") && !is_participle("stored_rows")
    );
}
