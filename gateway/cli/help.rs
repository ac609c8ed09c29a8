//! `cnc-gateway help`: the chapters of the handbook, and what a command takes.

use super::{Arguments, CannotRun, CommandResult, Outcome, print};
use crate::handbook::{chapter, contents, nearest_topic};
use clap::{Args, CommandFactory};

/// Arguments of `help`.
#[derive(Debug, Args)]
pub(super) struct HelpArguments {
    /// Topic of a chapter, or name of a command; without one the chapters are listed.
    topic: Option<String>,
}

/// Prints the list of chapters, a chapter, or what a command takes. A chapter goes before a command of the same name.
pub(super) fn help(arguments: &HelpArguments) -> CommandResult {
    let text = match arguments.topic.as_deref() {
        None => list(),
        Some(topic) => match chapter(topic) {
            Some(chapter) => chapter.text.to_owned(),
            None => of_command(topic).ok_or_else(|| unknown(topic))?,
        },
    };
    print(&text);
    Ok(Outcome::Fine)
}

fn list() -> String {
    format!(
        "Chapters of the handbook (cnc-gateway help TOPIC):\n\n{}\nWhat a command takes: cnc-gateway COMMAND --help\n",
        contents()
    )
}

fn of_command(name: &str) -> Option<String> {
    let mut arguments = Arguments::command();
    // The usage of a command then begins with the name of the program.
    arguments.build();
    let command = arguments.find_subcommand_mut(name).filter(|command| !command.is_hide_set())?;
    Some(command.render_long_help().to_string())
}

fn unknown(topic: &str) -> CannotRun {
    let guess = nearest_topic(topic).map(|near| format!("did you mean {near}? ")).unwrap_or_default();
    CannotRun::new(
        format!("the handbook has no chapter {topic}"),
        format!("{guess}cnc-gateway help lists every chapter"),
    )
}
