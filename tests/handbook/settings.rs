//! TOML blocks: a configuration, or a part of one, passes the check of configurations; a model, a recipe passes its own.

use crate::documents::{Block, documents};
use std::path::Path;

const SOURCE: &str = "\n[[source]]\naddress = \"simulated://lathe\"\n";

/// Everything that is wrong with the block, in words.
fn problems(text: &str) -> Vec<String> {
    let Ok(table) = text.parse::<toml::Table>() else { return vec!["no TOML".to_owned()] };
    match table.get("schema").or_else(|| table.get("format")).and_then(toml::Value::as_str) {
        Some("model/1") => told(rules::twin::model_file::parse_model(text)),
        Some("operations/1") => told(rules::operations::parse("operations.toml", text)),
        Some(_) => Vec::new(),
        None if of_a_configuration(&table) => of_configuration(text, &table),
        None => Vec::new(),
    }
}

/// Is every part of it one of the configuration's sections? Other TOML, such as a profile of a meter, is not looked into.
fn of_a_configuration(table: &toml::Table) -> bool {
    let example: toml::Table = gateway::config::keys::format_example().parse().expect("the example is TOML");
    !table.is_empty() && table.iter().all(|(name, value)| !value.is_str() && example.contains_key(name))
}

fn of_configuration(text: &str, table: &toml::Table) -> Vec<String> {
    let whole = if table.contains_key("source") { text.to_owned() } else { format!("{text}{SOURCE}") };
    told(gateway::config::parse("cnc-gateway.toml", &whole, Path::new(""), Vec::new()))
}

fn told<T, P: std::fmt::Display>(result: Result<T, Vec<P>>) -> Vec<String> {
    result.err().into_iter().flatten().map(|problem| problem.to_string()).collect()
}

/// A TOML block says so, or is indented and begins with a section.
fn is_toml(block: &Block) -> bool {
    let first = block.lines.first().map_or("", |line| line.trim());
    block.language == "toml" || (block.language.is_empty() && first.starts_with('[') && first.ends_with(']'))
}

#[test]
fn every_toml_block_passes_its_check() {
    let (mut wrong, mut seen) = (Vec::new(), 0);
    for document in documents() {
        for block in document.blocks().into_iter().filter(is_toml) {
            seen += 1;
            let found = problems(&block.lines.join("\n"));
            wrong.extend(found.iter().map(|problem| format!("{}:{}: {problem}", document.name, block.line)));
        }
    }
    assert!(wrong.is_empty(), "refused:\n  {}", wrong.join("\n  "));
    assert!(seen >= 4, "only {seen} TOML blocks were found");
}

#[test]
fn a_wrong_block_is_refused() {
    assert_eq!(problems("[gate]\nmode = \"shadow\""), Vec::<String>::new());
    assert!(!problems("[gate]\nmode = \"sometimes\"").is_empty());
    assert!(!problems("[gate]\nmoed = \"off\"").is_empty());
    assert!(
        !problems("schema = \"model/1\"\nname = \"x\"\noutput = \"force_n\"\n[[effect]]\nkind = \"nothing\"")
            .is_empty()
    );
}

#[test]
fn every_section_of_the_configuration_is_explained_in_its_chapter() {
    let chapter = gateway::handbook::find_chapter("configuration").expect("the chapter");
    let name = |section: &gateway::config::keys::Section| match section.repeated {
        true => format!("[[{}]]", section.name),
        false => format!("[{}]", section.name),
    };
    let untold: Vec<String> =
        gateway::config::keys::SECTIONS.iter().map(name).filter(|name| !chapter.text.contains(name)).collect();
    assert!(untold.is_empty(), "sections that gateway/handbook/configuration.md does not name: {untold:?}");
}
