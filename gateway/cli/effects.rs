//! `cnc-gateway effects`: the catalogue of physical effects, listed and explained.

use super::lang::language;
use super::{CannotRun, CommandOutcome, CommandResult};
use clap::{Args, Subcommand};
use rules::physics::explain;

#[derive(Debug, Args)]
pub(super) struct EffectsArguments {
    #[command(subcommand)]
    what: EffectsCommand,
}

#[derive(Debug, Subcommand)]
enum EffectsCommand {
    /// Every effect with one sentence.
    List(Printing),
    /// Law, parameters, needs, what its absence looks like and the experiment that tells it apart.
    Show {
        /// Name of the effect, such as flank_wear.
        kind: String,
        #[command(flatten)]
        printing: Printing,
    },
}

#[derive(Debug, Args)]
struct Printing {
    /// Print JSON, with the texts in both languages.
    #[arg(long)]
    json: bool,
}

/// Prints the catalogue or one effect.
pub(super) fn print_effects(arguments: EffectsArguments) -> CommandResult {
    let text = match arguments.what {
        EffectsCommand::List(printing) if printing.json => format!("{:#}\n", explain::list_json()),
        EffectsCommand::List(_) => explain::format_effect_list(language()),
        EffectsCommand::Show { kind, printing } => explain_effect(&kind, &printing)?,
    };
    super::print_text(&text);
    Ok(CommandOutcome::Fine)
}

fn explain_effect(kind: &str, printing: &Printing) -> Result<String, CannotRun> {
    let text = if printing.json {
        explain::explain_json(kind).map(|json| format!("{json:#}\n"))
    } else {
        explain::explain_effect(kind, language())
    };
    text.map_err(|unknown| CannotRun::new(format!("there is no effect {}", unknown.kind), unknown.hint))
}
