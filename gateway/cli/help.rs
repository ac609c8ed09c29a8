//! `cnc-gateway help`: the chapters of the handbook, and what a command takes.

use super::lang::language;
use super::{CannotRun, CommandOutcome, CommandResult, print_text};
use crate::handbook::{find_chapter, list_contents, nearest_topic};
use ::rules::physics::explain::Language;
use ::rules::script::{RECIPES, find_recipe};
use adapters::channel::find_nearest_name;
use clap::Args;

#[derive(Debug, Args)]
pub(super) struct HelpArguments {
    /// Topic of a chapter, name of a recipe or of a command; without one the chapters are listed.
    topic: Option<String>,
    /// Of a recipe only the script, to write it into a file.
    #[arg(long, requires = "topic")]
    script: bool,
}

/// Prints the list of chapters, a chapter, or what a command takes. A chapter goes before a command of the same name.
pub(super) fn print_help(arguments: &HelpArguments) -> CommandResult {
    let text = match arguments.topic.as_deref() {
        None => list_chapters(),
        Some(topic) => match (find_chapter(topic), find_recipe(topic)) {
            (_, Some(recipe)) if arguments.script => recipe.text.to_owned(),
            (Some(chapter), _) if chapter.topic == "rules" => {
                format!("{}\n{}", chapter.text_in(language()), list_recipes())
            }
            (Some(chapter), _) => chapter.text_in(language()).to_owned(),
            (None, Some(recipe)) => recipe.format_page(),
            (None, None) => of_command(topic).ok_or_else(|| unknown_topic(topic))?,
        },
    };
    print_text(&text);
    Ok(CommandOutcome::Fine)
}

fn list_chapters() -> String {
    let contents = list_contents(language());
    match language() {
        Language::En => format!(
            "Chapters of the handbook (cnc-gateway help TOPIC):\n\n{contents}\nWhat a command takes: cnc-gateway COMMAND --help\n"
        ),
        Language::Zh => {
            format!("手册章节（cnc-gateway help 主题）：\n\n{contents}\n命令的参数：cnc-gateway 命令 --help\n")
        }
    }
}

/// One line for each recipe.
fn list_recipes() -> String {
    let width = RECIPES.iter().map(|recipe| recipe.name.len()).max().unwrap_or(0);
    let lines: String =
        RECIPES.iter().map(|recipe| format!("  {:width$}  {}\n", recipe.name, recipe.title())).collect();
    format!("Recipes (cnc-gateway help NAME) 配方:\n\n{lines}")
}

fn of_command(name: &str) -> Option<String> {
    let mut arguments = super::build_command(language());
    // The usage of a command then begins with the name of the program.
    arguments.build();
    let command = arguments.find_subcommand_mut(name).filter(|command| !command.is_hide_set())?;
    Some(command.render_long_help().to_string())
}

fn unknown_topic(topic: &str) -> CannotRun {
    let near = nearest_topic(topic).or_else(|| find_nearest_name(topic, RECIPES.iter().map(|recipe| recipe.name)));
    let guess = near.map(|near| format!("did you mean {near}? ")).unwrap_or_default();
    CannotRun::new(
        format!("the handbook has no chapter {topic}"),
        format!("{guess}cnc-gateway help lists every chapter"),
    )
}
