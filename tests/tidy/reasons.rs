//! Named numbers of the twin say where they come from. Those that do not are counted, and may only become fewer.

use super::names::production;
use super::texts;

/// Named numbers of the twin whose documentation gives no reason. Whoever gives one of them its reason lowers this.
const WITHOUT_REASON_MAX: usize = 156;

/// How a reason shows: a clause behind a colon, a cause, a cost, or a source.
const MARKS: [&str; 9] = [": ", "because", "so that", "otherwise", "cost", "hosen", "measured", "tests/", "GUM"];

/// The types of numbers.
const NUMBERS: [&str; 9] = ["f64", "f32", "usize", "u64", "u32", "u16", "u8", "i64", "i32"];

/// Is this the declaration of a named number, or of several?
fn is_number(line: &str) -> bool {
    let code = line.trim_start();
    let Some(at) = code.find("const ").filter(|at| *at == 0 || code.starts_with("pub")) else { return false };
    let Some((name, rest)) = code[at..].trim_start_matches("const ").split_once(": ") else { return false };
    let upper = |name: &str| name.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_');
    let words = |text: &str| text.split(|c: char| !c.is_alphanumeric()).any(|word| NUMBERS.contains(&word));
    upper(name) && rest.split_once(" = ").is_some_and(|(kind, _)| words(kind))
}

/// Every named number of these lines, and whether its documentation gives a reason.
fn reasons(text: &str) -> Vec<bool> {
    let (mut doc, mut found) = (String::new(), Vec::new());
    for line in production(text) {
        let code = line.trim_start();
        if let Some(words) = code.strip_prefix("///") {
            doc += words;
        } else if !code.starts_with("#[") {
            if is_number(line) {
                found.push(MARKS.iter().any(|mark| doc.contains(mark)));
            }
            doc.clear();
        }
    }
    found
}

/// `cargo test --test tidy named_numbers -- --nocapture` prints the count.
#[test]
fn named_numbers_of_the_twin_without_a_reason_become_fewer() {
    let of_twin = |path: &String| path.starts_with("rules/twin/") && !path.ends_with("tests.rs");
    let all: Vec<bool> =
        texts(&["rs"]).iter().filter(|(path, _)| of_twin(path)).flat_map(|(_, text)| reasons(text)).collect();
    let without = all.iter().filter(|reason| !**reason).count();
    println!("{} named numbers in rules/twin, {without} of them without a reason", all.len());
    assert!(
        without <= WITHOUT_REASON_MAX,
        "{without}: say where a new number comes from and what it costs to be wrong"
    );
    assert!(without + 20 > WITHOUT_REASON_MAX, "{without}: lower WITHOUT_REASON_MAX");
    let example = "/// Rows: too few tell nothing.\nconst ROWS_MIN: usize = 8;\n/// Rows.\npub(super) const SIZES: [f64; 1] = [1.0];\n";
    assert_eq!(reasons(example), [true, false]);
}
