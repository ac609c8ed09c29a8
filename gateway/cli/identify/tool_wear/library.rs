//! The library: models stored in a history by machine, tool, work material and operation.

use crate::cli::{CannotRun, CommandOutcome, CommandResult, print_json, print_text};
use crate::clock;
use crate::history::{Reader, StoredWearModel, store_wear_model};
use clap::Args;
use rules::estimators::wear::{WearKey, WearRecord};
use serde_json::json;
use std::path::PathBuf;

/// Which model it is, and where it goes.
#[derive(Debug, Args)]
pub(super) struct LibraryArguments {
    /// Store the model in this history; the newest model of machine, tool, material and operation is in force.
    #[arg(long, value_name = "DB")]
    pub(super) store: Option<PathBuf>,
    /// List the models of the history given with --history.
    #[arg(long, conflicts_with_all = ["recording", "design", "store"])]
    pub(super) list: bool,
    /// History whose models are listed.
    #[arg(long, value_name = "DB", default_value = "cnc-gateway-data/history.db", requires = "list")]
    history: PathBuf,
    /// Machine that the model is for, as [gateway] name says it; without it any.
    #[arg(long, value_name = "NAME", default_value = "")]
    machine: String,
    /// Tool that the model is for; without it any.
    #[arg(long, value_name = "NAME", default_value = "")]
    tool: String,
    /// Work material that the model is for; without it any.
    #[arg(long, value_name = "NAME", default_value = "")]
    work_material: String,
    /// Operation that the model is for; without it any.
    #[arg(long, value_name = "NAME", default_value = "")]
    operation: String,
}

impl LibraryArguments {
    /// What the model is for.
    pub(super) fn wear_key(&self) -> WearKey {
        let Self { machine, tool, work_material, operation, .. } = self;
        WearKey {
            machine: machine.clone(),
            tool: tool.clone(),
            work_material: work_material.clone(),
            operation: operation.clone(),
        }
    }
}

/// Stores the model where that was asked for; a line that says so.
pub(super) fn store_model(arguments: &LibraryArguments, record: &WearRecord) -> Result<Option<String>, CannotRun> {
    let Some(path) = &arguments.store else { return Ok(None) };
    let id = store_wear_model(path, clock::now_ns(), record).map_err(CannotRun::from_error)?;
    Ok(Some(format!("\nstored as model {id} in {}: {}\n", path.display(), format_key(&record.key))))
}

fn format_key(key: &WearKey) -> String {
    let texts = [
        ("machine", &key.machine),
        ("tool", &key.tool),
        ("material", &key.work_material),
        ("operation", &key.operation),
    ];
    texts.map(|(what, text)| if text.is_empty() { format!("any {what}") } else { format!("{what} {text}") }).join(", ")
}

/// Prints every model of the library.
pub(super) fn list_models(arguments: &LibraryArguments, as_json: bool) -> CommandResult {
    let reader = Reader::open(&arguments.history).map_err(CannotRun::from_error)?;
    let models = reader.wear_models().map_err(CannotRun::from_error)?;
    if as_json {
        let each: Vec<_> = models.iter().map(model_to_json).collect();
        print_json(&json!({ "schema": "wear-models/1", "models": each }));
    } else if models.is_empty() {
        print_text(&format!(
            "{}: no wear model yet; identify tool-wear --store writes one\n",
            arguments.history.display()
        ));
    } else {
        models.iter().for_each(|model| print_text(&format_model(model)));
    }
    Ok(CommandOutcome::Fine)
}

fn model_to_json(model: &StoredWearModel<WearRecord>) -> serde_json::Value {
    json!({ "id": model.id, "at_ns": model.at_ns, "in_force": model.in_force, "record": model.record })
}

fn format_model(model: &StoredWearModel<WearRecord>) -> String {
    let record = &model.record;
    let force = if model.in_force { "in force" } else { "replaced" };
    format!(
        "{:>4} {force:<9} {:<9} criterion {} mm, {} cuts, R2 {:.2} %: {} (from {})\n",
        model.id,
        record.model.form(),
        record.criterion_mm,
        record.cuts,
        100.0 * record.r2,
        format_key(&record.key),
        record.origin
    )
}
