//! The help of the command line in Chinese: one table, English text and Chinese text on a line, laid over the commands as they are declared. A
//! test finds every text that the table lacks.

use clap::Command;
use clap::builder::StyledStr;
use std::collections::HashMap;
use std::sync::LazyLock;

/// Each line holds an English text of the help, a tab, and the same text in Chinese.
const TABLE: &str = include_str!("help_zh.tsv");

static WORDS: LazyLock<HashMap<String, &'static str>> = LazyLock::new(|| {
    TABLE.lines().filter_map(|line| line.split_once('\t')).map(|(en, zh)| (normalize_text(en), zh)).collect()
});

/// What both writings of a text have in common: lines may be broken anywhere, and a short help has no full stop.
fn normalize_text(text: &str) -> String {
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    text.trim_end_matches('.').to_owned()
}

fn find_translation(text: &StyledStr) -> Option<&'static str> {
    WORDS.get(&normalize_text(&text.to_string())).copied()
}

/// Every text of the command and of those below it in Chinese, where the table has it.
pub(super) fn translate_command(command: Command) -> Command {
    let about = command.get_about().and_then(find_translation);
    let command = match about {
        Some(text) => command.about(text),
        None => command,
    };
    let names: Vec<String> = command.get_subcommands().map(|sub| sub.get_name().to_owned()).collect();
    let command = names.into_iter().fold(command, |command, name| command.mut_subcommand(name, translate_command));
    command.mut_args(|arg| {
        let text = arg.get_help().and_then(find_translation);
        let long = arg.get_long_help().and_then(find_translation).or(text);
        let arg = match text {
            Some(text) => arg.help(text),
            None => arg,
        };
        match long {
            Some(text) => arg.long_help(text),
            None => arg,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Arguments, lang};
    use clap::CommandFactory;

    fn collect(command: &Command, lacking: &mut Vec<String>) {
        let own = |name: &str| ["help", "version"].contains(&name);
        let mut check = |text: Option<&StyledStr>| {
            if let Some(text) = text.filter(|text| find_translation(text).is_none()) {
                lacking.push(normalize_text(&text.to_string()));
            }
        };
        check(command.get_about());
        command.get_arguments().filter(|arg| !own(arg.get_id().as_str())).for_each(|arg| check(arg.get_help()));
        command.get_subcommands().filter(|sub| !sub.is_hide_set()).for_each(|sub| collect(sub, lacking));
    }

    #[test]
    fn every_text_of_the_help_has_its_chinese() {
        let mut lacking = Vec::new();
        collect(&Arguments::command(), &mut lacking);
        lacking.sort();
        lacking.dedup();
        assert!(lacking.is_empty(), "without Chinese in help_zh.tsv:\n{}", lacking.join("\n"));
    }

    #[test]
    fn a_translated_command_takes_the_same_arguments() {
        let command = translate_command(Arguments::command());
        let typed = ["cnc-gateway", "--lang", "zh", "diagnose", "--model", "m.toml", "--recording", "r.csv"];
        let found = command.try_get_matches_from(lang::move_behind_command(typed.map(Into::into).to_vec()));
        assert!(found.is_ok(), "{found:?}");
    }
}
