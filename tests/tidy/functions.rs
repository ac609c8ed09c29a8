//! A function is a verb and a noun. Constructors and the names that the standard library gives are apart; what is left of
//! one word is counted, and may only become less.

use super::names::production;
use super::production_files;
use std::collections::BTreeMap;

/// Names that the standard library and its conventions give, which every reader knows.
const CONVENTIONS: [&str; 41] = [
    "add", "borrow", "clear", "clone", "cmp", "contains", "default", "deref", "div", "drop", "eq", "extend", "flush",
    "fmt", "from", "get", "hash", "index", "insert", "into", "iter", "len", "main", "map", "mul", "neg", "new", "next",
    "parse", "poll", "pop", "push", "read", "remove", "seek", "source", "sub", "sum", "try_from", "with", "write",
];

/// Greatest share of function names of one word among all that are no convention, by room: what is there today, rounded up.
/// Whoever names functions better lowers it.
const ONE_WORD_SHARE_MAX: [(&str, f64); 3] = [("adapters", 0.10), ("gateway", 0.08), ("rules", 0.08)];

/// Names of functions that are a participle alone, by room. They do not say what is done or what is asked.
const PARTICIPLES_MAX: [(&str, usize); 3] = [("adapters", 3), ("gateway", 1), ("rules", 0)];

/// English words in `-ed` that are no participles, and nouns.
pub(super) const NO_PARTICIPLES: [&str; 7] = ["bed", "feed", "need", "seed", "shed", "speed", "exceed"];

/// The name of the function that a line declares.
fn declared(line: &str) -> Option<&str> {
    let mut code = line.trim_start();
    if let Some(rest) = code.strip_prefix("pub") {
        code = match rest.strip_prefix('(') {
            Some(rest) => rest.split_once(')').map_or("", |(_, rest)| rest),
            None => rest,
        };
    }
    let mut words = code.split(' ').filter(|word| !word.is_empty());
    let is_modifier = |word: &str| ["const", "async", "unsafe", "extern", "\"C\""].contains(&word);
    let name = match words.find(|word| !is_modifier(word)) {
        Some("fn") => words.next()?,
        _ => return None,
    };
    let end = name.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(name.len());
    (end > 0).then(|| &name[..end])
}

/// Functions of a room.
#[derive(Debug, Default)]
struct Count {
    all: usize,
    one_word: usize,
    participles: usize,
    letters: usize,
}

impl Count {
    fn add(&mut self, name: &str) {
        if CONVENTIONS.contains(&name) {
            return;
        }
        self.all += 1;
        self.letters += name.len();
        if !name.trim_matches('_').contains('_') {
            self.one_word += 1;
            self.participles += usize::from(name.ends_with("ed") && !NO_PARTICIPLES.contains(&name));
        }
    }

    fn one_word_share(&self) -> f64 {
        self.one_word as f64 / self.all.max(1) as f64
    }
}

fn count_functions() -> BTreeMap<String, Count> {
    let mut rooms: BTreeMap<String, Count> = BTreeMap::new();
    for (room, _, text) in production_files() {
        let count = rooms.entry(room).or_default();
        production(&text).into_iter().filter_map(declared).for_each(|name| count.add(name));
    }
    rooms
}

/// `cargo test --test tidy function_names -- --nocapture` prints the figures.
#[test]
fn function_names_of_one_word_become_fewer() {
    let rooms = count_functions();
    for (room, count) in &rooms {
        let (share, letters) = (count.one_word_share(), count.letters as f64 / count.all.max(1) as f64);
        println!(
            "{room}: {} functions, {:.0} % of one word, {} participles, {letters:.1} letters",
            count.all,
            100.0 * share,
            count.participles
        );
    }
    for (room, most) in ONE_WORD_SHARE_MAX {
        let share = rooms[room].one_word_share();
        assert!(share <= most, "{room}: {share:.3} of the names are one word; a function is a verb and a noun");
        assert!(share + 0.05 > most, "{room}: {share:.3}; lower ONE_WORD_SHARE_MAX");
    }
    for (room, most) in PARTICIPLES_MAX {
        let found = rooms[room].participles;
        assert!(found <= most, "{room}: {found} participles as names; say what is done or what is asked");
        assert!(found + 15 > most, "{room}: {found}; lower PARTICIPLES_MAX");
    }
}

#[test]
fn declarations_of_functions_are_found() {
    assert_eq!(declared("    pub(in crate::a) const fn wait_for(&self) -> u8 {"), Some("wait_for"));
    assert_eq!(declared("pub async fn told<T>(x: T) {"), Some("told"));
    assert_eq!(declared("unsafe extern \"C\" fn close("), Some("close"));
    assert_eq!(declared("let fnord = 1;"), None);
    assert_eq!(declared("/// fn documented()"), None);
}
