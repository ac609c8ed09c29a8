//! `cnc-gateway person`: who may do more than read on the page. Works on the box itself, whether the gateway runs or not; one
//! that runs follows within a second and writes every difference into the audit.

use super::gateway_options::GatewayOptions;
use super::{CannotRun, CommandOutcome, CommandResult, print_json, print_text};
use crate::access::{self, Persons, PersonsError, Role};
use clap::{Args, Subcommand};
use serde_json::{Value, json};
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct PersonArguments {
    #[command(subcommand)]
    what: PersonCommand,
}

/// Who makes the change; stands in the audit.
#[derive(Debug, Args)]
struct ChangedBy {
    /// Who makes the change; stands in the audit.
    #[arg(long, value_name = "NAME", default_value = "at the box")]
    by: String,
    #[command(flatten)]
    at: GatewayOptions,
}

#[derive(Debug, Subcommand)]
enum PersonCommand {
    /// Everybody, with the role.
    List(GatewayOptions),
    /// Somebody new. The token is printed once.
    Add {
        /// 1 to 40 letters, digits, spaces, or any of . - _
        name: String,
        /// What he or she may do.
        #[arg(long, value_enum)]
        role: Role,
        #[command(flatten)]
        by: ChangedBy,
    },
    /// Another role.
    Role {
        /// Whose.
        name: String,
        /// What he or she may do from now on.
        #[arg(value_enum)]
        role: Role,
        #[command(flatten)]
        by: ChangedBy,
    },
    /// A new token in the place of the one before, printed once. Sessions end at once.
    Token {
        /// Whose.
        name: String,
        #[command(flatten)]
        by: ChangedBy,
    },
    /// Remove a person. Sessions end at once.
    Remove {
        /// Who.
        name: String,
        #[command(flatten)]
        by: ChangedBy,
    },
}

/// Does what the arguments say.
pub(super) fn run(arguments: PersonArguments) -> CommandResult {
    match arguments.what {
        PersonCommand::List(at) => list_persons(&at),
        PersonCommand::Add { name, role, by } => change_persons(&by, |persons, by| {
            let token = persons.add(&name, role, by)?;
            Ok((format!("{} is {role}. The token, shown only now: {}", name.trim(), token.text()), Some(token)))
        }),
        PersonCommand::Role { name, role, by } => change_persons(&by, |persons, by| {
            persons.give_role(&name, role, by)?;
            Ok((format!("{name} is {role}"), None))
        }),
        PersonCommand::Token { name, by } => change_persons(&by, |persons, by| {
            let token = persons.give_token(&name, by)?;
            Ok((format!("the new token of {name}, shown only now: {}", token.text()), Some(token)))
        }),
        PersonCommand::Remove { name, by } => change_persons(&by, |persons, _| {
            persons.remove(&name)?;
            Ok((format!("{name} was removed"), None))
        }),
    }
}

fn find_persons_file(at: &GatewayOptions) -> Result<PathBuf, CannotRun> {
    Ok(access::persons_path(&at.data_dir()?))
}

fn list_persons(at: &GatewayOptions) -> CommandResult {
    let path = find_persons_file(at)?;
    let persons = Persons::read(&path).map_err(to_cannot_run)?;
    let Some(persons) = persons else {
        let next = "start the gateway once, or add somebody: cnc-gateway person add NAME --role admin";
        return Err(CannotRun::new(format!("{}: there are no persons yet", path.display()), next));
    };
    if at.json {
        let rows: Vec<Value> =
            persons.list_entries().iter().map(|it| json!({ "name": it.name, "role": it.role, "by": it.by })).collect();
        print_json(&json!({ "schema": "persons/1", "persons": rows }));
    } else {
        persons
            .list_entries()
            .iter()
            .for_each(|it| print_text(&format!("{:8} {} (written by {})\n", it.role.as_word(), it.name, it.by)));
    }
    Ok(CommandOutcome::Fine)
}

type Changed = (String, Option<access::Token>);

fn change_persons(
    by: &ChangedBy,
    change: impl FnOnce(&mut Persons, &str) -> Result<Changed, PersonsError>,
) -> CommandResult {
    let path = find_persons_file(&by.at)?;
    let mut persons = Persons::read(&path).map_err(to_cannot_run)?.unwrap_or_default();
    let (text, token) = match change(&mut persons, &by.by) {
        Ok(changed) => changed,
        Err(error @ (PersonsError::Token(_) | PersonsError::File(..))) => return Err(to_cannot_run(error)),
        Err(error) => {
            print_outcome(by.at.json, false, &error.to_string(), None);
            return Ok(CommandOutcome::No);
        }
    };
    persons.write(&path).map_err(to_cannot_run)?;
    print_outcome(by.at.json, true, &text, token.as_ref());
    Ok(CommandOutcome::Fine)
}

fn print_outcome(json: bool, done: bool, text: &str, token: Option<&access::Token>) {
    match json {
        true => print_json(&json!({
            "schema": "person/1", "done": done, "text": text, "token": token.map(access::Token::text)
        })),
        false => print_text(&format!("{text}\n")),
    }
}

fn to_cannot_run(error: PersonsError) -> CannotRun {
    CannotRun::new(error.to_string(), "run it as the user that the gateway runs as")
}
