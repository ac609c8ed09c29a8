//! Every mistake is told, with its line and what to do.

use super::super::Lookup;
use super::*;

fn format_table(entries: &str) -> String {
    format!("schema = \"operations/1\"\n{entries}")
}

fn format_entry(more: &str) -> String {
    format!("[[operation]]\nprogram = \"O1\"\nname = \"rough\"\ndepth_of_cut_mm = 1.0\n{more}\n")
}

fn format_entries(more: &[&str]) -> String {
    format_table(&more.iter().map(|more| format_entry(more)).collect::<String>())
}

fn list_problems(text: &str) -> Vec<String> {
    parse("operations.toml", text).err().unwrap_or_default().iter().map(ToString::to_string).collect()
}

#[test]
fn a_table_is_read_and_looked_up() {
    let text = format_entries(&["blocks = [10, 120]", "blocks = [\"N130\", \"N200\"]", "tool = \"T1\""]);
    let recipe = parse("operations.toml", &text).expect("a table");
    let found = |block| match recipe.find_operation(Some("O1"), block) {
        Lookup::Found(operation) => operation.line,
        other => panic!("{other}"),
    };
    assert_eq!((found(Some("N10")), found(Some("200")), found(Some("125")), found(None)), (2, 7, 12, 12));
    assert_eq!(recipe.find_operation(None, Some("N10")), Lookup::ProgramUnknown);
    assert_eq!(recipe.version().len(), 8);
    assert_ne!(parse("f", &(text.clone() + "\n")).expect("a table").version(), recipe.version());
}

#[test]
fn every_mistake_is_told_at_once_with_its_line() {
    let text = "schema = \"operations/2\"\nmachine = 1\n\
                [[operation]]\nprogram = \"O1\"\nname = \"\"\nap = 1.5\n\
                [[operation]]\nname = \"finish\"\ndepth_of_cut_mm = 1500\nblocks = [50, 10]\nteeth = 2.5\n\
                [[operation]]\nprogram = \"O2\"\nname = \"x\"\ndepth_of_cut_um = 800\nmaterial = \"steel\"\n";
    let told = list_problems(text);
    for part in [
        "operations.toml:1:10: this schema is not known",
        "operations.toml:2:1: there is no `machine` here",
        "operations.toml:5:8: `name` must have 1 to 100",
        "operations.toml:6:1: an operation has no `ap`\n    write depth_of_cut_mm = ..., in millimetres",
        "operations.toml:7:1: the operation names no program",
        "operations.toml:9:19: depth_of_cut_mm = 1500 cannot be\n    in micrometres? then write depth_of_cut_mm = 1.5",
        "operations.toml:10:10: the blocks run backwards: 50 to 10",
        "operations.toml:11:9: teeth = 2.5 cannot be",
        "operations.toml:15:1: an operation has no `depth_of_cut_um`\n    write depth_of_cut_mm = 0.8",
        "operations.toml:16:1: an operation has no `material`\n    write work_material = ...",
    ] {
        assert!(told.iter().any(|problem| problem.starts_with(part)), "{part}\n---\n{}", told.join("\n"));
    }
    assert_eq!(told.len(), 10, "{}", told.join("\n"));
}

#[test]
fn two_operations_may_not_claim_a_block() {
    let told = list_problems(&format_entries(&["blocks = [10, 120]", "blocks = [120, 130]"]));
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains(":7: \"rough\" and \"rough\" both claim blocks of O1") && told[0].contains("line 2"));
    assert_eq!(list_problems(&format_entries(&["", ""])).len(), 1, "two of the whole program");
    assert!(list_problems(&format_entries(&["", "blocks = [1, 2]"])).is_empty(), "the rest of the program");
}

#[test]
fn numbers_that_cannot_be_together_are_refused() {
    let turned = list_problems(&format_table(
        "[[operation]]\nprogram = \"O1\"\nname = \"a\"\ndepth_of_cut_mm = 8\ndiameter_mm = 10\n",
    ));
    assert!(turned.len() == 1 && turned[0].contains("beyond the centre"), "{turned:?}");
    let milled = list_problems(&format_table(
        "[[operation]]\nprogram = \"O1\"\nname = \"a\"\ndepth_of_cut_mm = 8\nwidth_of_cut_mm = 12\ndiameter_mm = 10\n",
    ));
    assert!(milled.len() == 1 && milled[0].contains("wider than the tool"), "{milled:?}");
}

#[test]
fn what_is_no_table_is_told_and_nothing_panics() {
    for text in
        ["", "a", "operation = 3", "[[operation]]", "schema = \"operations/1\"\noperation = [1]", "\u{0}", "[[", "机"]
    {
        assert!(!list_problems(text).is_empty(), "{text:?}");
    }
    let long = "#".repeat(TEXT_MAX + 1);
    assert!(list_problems(&long)[0].contains("longer than"));
    assert!(!list_problems(&format_table(&format_entry("diameter_mm = nan"))).is_empty());
    assert!(!list_problems(&format_table(&format_entry("diameter_mm = \"79\""))).is_empty());
    assert!(
        !list_problems(&format_table("[[operation]]\nprogram = \"O1\"\nname = \"a\"\ntool = \"T1\"")).is_empty(),
        "no cut"
    );
}
