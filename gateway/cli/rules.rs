//! `cnc-gateway rules`: what scripts can see, call and set.

use super::effects::Lang;
use super::{CommandResult, Outcome, print, print_json};
use ::rules::script;
use clap::{Args, Subcommand};

/// Arguments of `rules`.
#[derive(Debug, Args)]
pub(super) struct RulesArguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Every method, variable, function and setting of scripts, with units.
    Api {
        /// Language of the texts.
        #[arg(long, value_enum, default_value_t = Lang::En)]
        lang: Lang,
        /// Print JSON (rules-api/1), with the texts in both languages.
        #[arg(long)]
        json: bool,
    },
}

/// Prints.
pub(super) fn run(arguments: &RulesArguments) -> CommandResult {
    match arguments.what {
        What::Api { json: true, .. } => print_json(&script::api_json()),
        What::Api { lang, .. } => print(&script::api(lang == Lang::Zh)),
    }
    Ok(Outcome::Fine)
}
