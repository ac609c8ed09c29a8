//! Which crate may use which: the picture in chapter `inside` of the handbook is what cargo sees.
//!
//! The picture leaves out an arrow that others imply, so it shows every wall and no more lines than needed.

use super::{none, root};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::process::Command;

/// Packages that the gate may need, itself and ours counted: what decides about a machine is small enough to be read.
const PACKAGES_OF_GATE_MAX: usize = 45;
/// What stands between a crate and those it uses.
const ARROW: &str = " -> ";

/// Crates of this workspace, each with those that it uses.
type Arrows = BTreeMap<String, BTreeSet<String>>;

fn run_cargo(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO")).args(arguments).current_dir(root()).output().expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// What production code of each crate uses; tests may use more.
fn read_arrows() -> Arrows {
    let text = run_cargo(&["metadata", "--format-version", "1", "--locked", "--offline", "--no-deps"]);
    let metadata: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let packages = metadata["packages"].as_array().expect("a list");
    // In the code, the package of the command line has the name of its library.
    let name = |value: &serde_json::Value| value["name"].as_str().unwrap_or_default().replace("cnc-gateway", "gateway");
    let ours: BTreeSet<String> = packages.iter().map(name).collect();
    let list_uses = |package: &serde_json::Value| {
        let dependencies = package["dependencies"].as_array().expect("a list");
        let of_code = dependencies.iter().filter(|it| it["kind"].is_null()).map(name);
        of_code.filter(|used| ours.contains(used)).collect::<BTreeSet<_>>()
    };
    packages.iter().map(|package| (name(package), list_uses(package))).collect()
}

/// Everything that a crate reaches over at least one arrow.
fn reach<'a>(arrows: &'a Arrows, from: &str, found: &mut BTreeSet<&'a str>) {
    for used in &arrows[from] {
        if found.insert(used) {
            reach(arrows, used, found);
        }
    }
}

/// The arrows that no other arrows imply.
fn reduce_arrows(arrows: &Arrows) -> Arrows {
    let reduce = |uses: &BTreeSet<String>| {
        let mut implied = BTreeSet::new();
        uses.iter().for_each(|used| reach(arrows, used, &mut implied));
        uses.iter().filter(|used| !implied.contains(used.as_str())).cloned().collect()
    };
    arrows.iter().map(|(name, uses)| (name.clone(), reduce(uses))).collect()
}

fn draw_line(name: &str, uses: &BTreeSet<String>) -> String {
    let uses: Vec<&str> = uses.iter().map(String::as_str).collect();
    if uses.is_empty() { name.to_owned() } else { format!("{name}{ARROW}{}", uses.join(", ")) }
}

/// Lines of the picture: the block that begins with the crate that uses none.
fn read_picture() -> BTreeSet<String> {
    let chapter = fs::read_to_string(root().join("gateway/handbook/inside.md")).expect("the chapter is there");
    let block = chapter.split("```text\n").find(|block| block.starts_with("adapter_core\n")).expect("the picture");
    block
        .lines()
        .take_while(|line| !line.starts_with("```"))
        .filter(|line| !line.is_empty())
        .map(str::to_owned)
        .collect()
}

#[test]
fn crates_use_each_other_as_the_picture_says() {
    let arrows = reduce_arrows(&read_arrows());
    let seen: BTreeSet<String> = arrows.iter().map(|(name, uses)| draw_line(name, uses)).collect();
    let drawn = read_picture();
    none(seen.difference(&drawn).cloned().collect(), "so it is, and not drawn in gateway/handbook/inside.md");
    none(drawn.difference(&seen).cloned().collect(), "drawn in gateway/handbook/inside.md, and not so");
}

#[test]
fn the_gate_needs_few_packages() {
    let arguments = ["tree", "-p", "gateway_gate", "--locked", "--offline", "--prefix", "none", "-e", "normal"];
    let text = run_cargo(&arguments);
    let packages: BTreeSet<&str> = text.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    println!("gateway_gate needs {} packages", packages.len());
    assert!(packages.len() <= PACKAGES_OF_GATE_MAX, "{}: {packages:?}", packages.len());
}

/// `adapters` uses neither `rules` nor `gateway`, and `rules` does not use `gateway`.
#[test]
fn rules_and_adapters_know_nothing_above_them() {
    let arrows = read_arrows();
    let room_of = |name: &str| match name {
        "rules" | "estimators" | "numerics" | "physics" | "script" | "twin" => 1,
        name if name.starts_with("gateway_") || ["gateway", "testkit", "tidy"].contains(&name) => 2,
        _ => 0,
    };
    let upward = arrows.iter().flat_map(|(name, uses)| {
        let above = uses.iter().filter(|used| room_of(used) > room_of(name));
        above.map(|used| format!("{name}{ARROW}{used}")).collect::<Vec<_>>()
    });
    none(upward.collect(), "an arrow from a lower room to a higher one");
}

#[test]
fn an_arrow_that_others_imply_is_left_out() {
    let uses = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>();
    let row = |name: &str, used: &[&str]| (name.to_owned(), uses(used));
    let arrows = Arrows::from([row("a", &[]), row("b", &["a"]), row("c", &["a", "b"])]);
    assert_eq!(reduce_arrows(&arrows)["c"], uses(&["b"]));
    assert_eq!(draw_line("c", &uses(&["b", "d"])), "c -> b, d");
}
