//! Habits that are given up step by step: each is counted by room, and may only become rarer.
//!
//! | habit | why it is given up |
//! |---|---|
//! | a number out of range is replaced (`try_from(..).unwrap_or(..)`) | an impossible value is stored instead of caught |
//! | an error is a text (`Result<_, String>`) | the caller cannot decide by it |
//! | a doc comment has at most three words | it repeats the name |

use super::names::production;
use super::production_files;
use std::collections::BTreeMap;

/// One habit in one room: what is there today. Whoever gives up more of it lowers the number.
const HABITS_MAX: [(&str, Habit, usize); 9] = [
    ("adapters", Habit::Saturation, 7),
    ("gateway", Habit::Saturation, 10),
    ("rules", Habit::Saturation, 3),
    ("adapters", Habit::TextError, 23),
    ("gateway", Habit::TextError, 16),
    ("rules", Habit::TextError, 23),
    ("adapters", Habit::ShortDoc, 35),
    ("gateway", Habit::ShortDoc, 29),
    ("rules", Habit::ShortDoc, 4),
];

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Habit {
    Saturation,
    TextError,
    ShortDoc,
}

fn is_doc(line: &str) -> bool {
    line.trim_start().starts_with("///")
}

/// The habit that a line shows; `before` and `after` are its neighbours.
fn find_habit(before: &str, line: &str, after: &str) -> Option<Habit> {
    let code = line.trim_start();
    if let Some(words) = code.strip_prefix("/// ") {
        let alone = !is_doc(before) && !is_doc(after);
        return (alone && words.split_whitespace().count() <= 3).then_some(Habit::ShortDoc);
    }
    if code.starts_with("//") {
        return None;
    }
    if code.contains("try_from(") && code.contains(").unwrap_or(") {
        return Some(Habit::Saturation);
    }
    (code.contains("Result<") && code.contains(", String>")).then_some(Habit::TextError)
}

fn count_habits() -> BTreeMap<(String, Habit), usize> {
    let mut counts = BTreeMap::new();
    for (room, _, text) in production_files() {
        let lines = production(&text);
        for (index, line) in lines.iter().enumerate() {
            let before = index.checked_sub(1).map_or("", |index| lines[index]);
            let after = lines.get(index + 1).copied().unwrap_or_default();
            if let Some(habit) = find_habit(before, line, after) {
                *counts.entry((room.clone(), habit)).or_default() += 1;
            }
        }
    }
    counts
}

/// `cargo test --test tidy habits -- --nocapture` prints the figures.
#[test]
fn habits_become_rarer() {
    let counts = count_habits();
    let found = |room: &str, habit| counts.get(&(room.to_owned(), habit)).copied().unwrap_or_default();
    for (room, habit, _) in HABITS_MAX {
        println!("{room}: {habit:?} {}", found(room, habit));
    }
    for (room, habit, most) in HABITS_MAX {
        let found = found(room, habit);
        assert!(found <= most, "{room}: {habit:?} {found} times; the head of this file says why fewer are wanted");
        assert!(found + 15 > most, "{room}: {habit:?} {found} times; lower HABITS_MAX");
    }
}

#[test]
fn habits_are_found() {
    assert_eq!(find_habit("", "    /// The file.", "    pub file: PathBuf,"), Some(Habit::ShortDoc));
    assert_eq!(find_habit("", "    /// The file.", "    /// It is read once."), None);
    assert_eq!(find_habit("", "u16::try_from(x).unwrap_or(u16::MAX)", ""), Some(Habit::Saturation));
    assert_eq!(find_habit("", "fn parse(x: &str) -> Result<u8, String> {", ""), Some(Habit::TextError));
    assert_eq!(find_habit("", "let x: BTreeMap<u8, String> = y;", ""), None);
}
