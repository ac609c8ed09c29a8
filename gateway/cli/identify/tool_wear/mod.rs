//! `identify tool-wear`: a model of the cutting power over wear, speed, feed and depth; the list of cuts to make for it; and
//! the library of models.

mod design;
mod library;

use super::{IdentifyFiles, IdentifyOutput, ShownBy};
use crate::cli::{CommandResult, recipe_from};
use crate::identification::TOOL_WEAR;
use adapters::Recording;
use clap::{Args, ValueEnum};
use rules::estimators::LoadLossLaw;
use rules::estimators::regression::{Refusal, RefusalKind};
use rules::estimators::wear::{
    ConditionFactor, CutColumns, FACTORS, Order, SurfaceOptions, WearOptions, WearRecord, gather_cuts,
    identify_tool_wear,
};
use rules::operations::complete_recording;
use serde_json::json;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct ToolWearArguments {
    /// Recordings or tables (recording/1) with flank_wear_mm, speed, feed, depth and cutting power.
    #[arg(long, value_name = "R.csv", num_args = 1.., required_unless_present_any = ["design", "list"])]
    recording: Vec<String>,
    /// Print JSON (identify/1).
    #[arg(long)]
    json: bool,
    /// Write the model (wear/1, TOML) or the list of cuts (CSV); - is standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    table: TableArguments,
    #[command(flatten)]
    fit: FitArguments,
    #[command(flatten)]
    design: design::DesignArguments,
    #[command(flatten)]
    model_library: library::LibraryArguments,
    #[command(flatten)]
    shown_by: ShownBy,
}

/// Where the numbers stand.
#[derive(Debug, Args)]
struct TableArguments {
    /// Column of a quantity under another name: VB, vc, f, ap or power, as in --column power=pc_w.
    #[arg(long, value_name = "WHAT=COLUMN", value_parser = parse_column_pair)]
    column: Vec<(String, String)>,
    /// Coefficients a0 and a1 (1/W) of the load loss, to separate the cutting power from spindle_power_w and no_load_power_w; with the
    /// spindle speed of a1 where it goes with 1/n^2, as identify load-loss says.
    #[arg(long, num_args = 2..=3, value_names = ["A0", "A1", "RPM"], allow_hyphen_values = true)]
    load_loss: Vec<f64>,
    /// Operations recipe: gives depth of cut and diameter where the recording lacks them.
    #[arg(long, value_name = "FILE")]
    operations: Option<PathBuf>,
    /// Every row is a cut of its own; otherwise consecutive rows of one cut are averaged.
    #[arg(long)]
    each_row: bool,
}

/// How the models are fitted.
#[derive(Debug, Args)]
struct FitArguments {
    /// Flank wear at which an edge is worn.
    #[arg(long, value_name = "MM", default_value_t = 0.3)]
    criterion_mm: f64,
    /// Factors that were held on purpose; the model is for their value alone.
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    held: Vec<String>,
    /// Terms that the surface begins with.
    #[arg(long, value_enum, default_value_t = OrderWord::Second)]
    order: OrderWord,
    /// Terms with a greater p are dropped; 1 keeps all.
    #[arg(long, value_name = "P", default_value_t = 0.05)]
    p_out: f64,
    /// Drop a factor also where a product or square with it stays.
    #[arg(long)]
    no_hierarchy: bool,
    /// Take this form; without it the one that predicts better.
    #[arg(long, value_parser = ["surface", "physical"], value_name = "FORM")]
    form: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum OrderWord {
    Linear,
    Interactions,
    Second,
}

fn parse_column_pair(text: &str) -> Result<(String, String), String> {
    let (what, column) = text.split_once('=').ok_or("write WHAT=COLUMN, for example power=pc_w")?;
    let known = what == "power" || ConditionFactor::find_by_name(what).is_some();
    if known {
        Ok((what.to_owned(), column.to_owned()))
    } else {
        Err("the quantities are VB, vc, f, ap, power".to_owned())
    }
}

pub(super) fn run(arguments: &ToolWearArguments) -> CommandResult {
    if arguments.design.is_wanted() {
        return design::run(arguments);
    }
    if arguments.model_library.list {
        return library::list_models(&arguments.model_library, arguments.json);
    }
    let recording = arguments.to_identify_files().read()?;
    let recording = match &arguments.table.operations {
        Some(path) => complete_recording(recording, &recipe_from(path)?).0,
        None => recording,
    };
    let learned = match learn_model(arguments, &recording) {
        Ok((mut learned, record)) => {
            learned.text += &library::store_model(&arguments.model_library, &record)?.unwrap_or_default();
            arguments.shown_by.store_answer(TOOL_WEAR, &mut learned, arguments.model_library.store.as_deref())?;
            Ok(learned)
        }
        Err(refusal) => Err(refusal),
    };
    arguments.to_identify_files().report_result(TOOL_WEAR, learned)
}

fn learn_model(arguments: &ToolWearArguments, recording: &Recording) -> Result<(IdentifyOutput, WearRecord), Refusal> {
    let gathered = gather_cuts(recording, &arguments.table.cut_columns())?;
    let learned = identify_tool_wear(gathered.cuts, &arguments.fit.wear_options())?;
    let origin = (arguments.recording.join(", "), learned.cuts.len(), learned.r2);
    let record =
        WearRecord::new(arguments.model_library.wear_key(), learned.criterion_mm, origin, learned.model.clone());
    let file = record.to_toml().map_err(|what| Refusal::new(RefusalKind::NotFinite, what, ""))?;
    let text = format!("{} rows used, {} left out; {learned}", gathered.rows, gathered.left_out);
    let mut json = learned.to_json();
    json["rows_used"] = json!(gathered.rows);
    json["rows_left_out"] = json!(gathered.left_out);
    Ok((IdentifyOutput { text, json, file: Some(file) }, record))
}

impl ToolWearArguments {
    fn to_identify_files(&self) -> IdentifyFiles {
        IdentifyFiles { recording: self.recording.clone(), json: self.json, out: self.out.clone() }
    }
}

impl TableArguments {
    fn cut_columns(&self) -> CutColumns {
        let mut columns = CutColumns { each_row: self.each_row, ..CutColumns::default() };
        for (what, column) in &self.column {
            match FACTORS.iter().position(|factor| Some(factor) == ConditionFactor::find_by_name(what)) {
                Some(at) => columns.conditions[at].clone_from(column),
                None => columns.power.clone_from(column),
            }
        }
        if let [linear, quadratic_per_w, ref speed @ ..] = self.load_loss[..] {
            let speed_rpm = speed.first().copied().unwrap_or(0.0);
            columns.load_loss = Some(LoadLossLaw::from_stated_speed(linear, quadratic_per_w, speed_rpm));
        }
        columns
    }
}

impl FitArguments {
    fn wear_options(&self) -> WearOptions {
        let order = match self.order {
            OrderWord::Linear => Order::Linear,
            OrderWord::Interactions => Order::Interactions,
            OrderWord::Second => Order::Second,
        };
        let held = self
            .held
            .iter()
            .map(|name| ConditionFactor::find_by_name(name).map_or(name.as_str(), |it| it.name).to_owned())
            .collect();
        let surface = SurfaceOptions { order, p_out: self.p_out, hierarchical: !self.no_hierarchy, held };
        WearOptions { surface, criterion_mm: self.criterion_mm, form: self.form.clone() }
    }
}
