//! The cuts to make: a design of experiments as a work list.

use super::ToolWearArguments;
use crate::cli::{CannotRun, CommandOutcome, CommandResult, print_json, print_text};
use crate::diagnosis::write_output;
use clap::Args;
use rules::estimators::wear::{Array, ConditionFactor, ExperimentDesign, FACTORS, FactorLevels, plan_experiment};
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::fmt::Write as _;

#[derive(Debug, Args)]
pub(super) struct DesignArguments {
    /// Print the cuts to make instead: L4, L8, L9, L12, L16, L18 or L27.
    #[arg(long, value_name = "ARRAY", value_parser = parse_array, conflicts_with = "recording")]
    design: Option<Array>,
    /// Levels of one factor, as in --levels VB=0.065,0.195,0.325 --levels vc=90,120,150 --levels f=0.1,0.15,0.2.
    #[arg(long, value_name = "FACTOR=A,B,C", value_parser = parse_levels, requires = "design")]
    levels: Vec<FactorLevels>,
    /// Diameter of the work: adds the spindle speed of each cut.
    #[arg(long, value_name = "MM", requires = "design")]
    diameter_mm: Option<f64>,
    /// Seed of the random order.
    #[arg(long, default_value_t = 1, requires = "design")]
    seed: u64,
}

fn parse_array(text: &str) -> Result<Array, String> {
    let names = || Array::ALL.map(Array::name).join(", ");
    Array::from_name(text).ok_or_else(|| format!("the arrays are {}", names()))
}

fn parse_levels(text: &str) -> Result<FactorLevels, String> {
    let (name, values) = text.split_once('=').ok_or("write FACTOR=A,B,C, for example vc=90,120,150")?;
    let factor = ConditionFactor::find_by_name(name.trim()).ok_or_else(|| {
        let known = FACTORS.map(|factor| format!("{} ({}, {})", factor.symbol, factor.name, factor.en));
        format!("the factors are {}", known.join(", "))
    })?;
    let values: Result<Vec<f64>, _> = values.split(',').map(|value| value.trim().parse::<f64>()).collect();
    let values = values.map_err(|_| format!("{name}: write numbers with a point, separated by commas"))?;
    Ok(FactorLevels { factor, values })
}

impl DesignArguments {
    /// Is a list of cuts wanted?
    pub(super) fn is_wanted(&self) -> bool {
        self.design.is_some()
    }

    fn speed_rpm(&self, design: &ExperimentDesign, values: &[f64]) -> Option<f64> {
        let diameter_mm = self.diameter_mm.filter(|diameter_mm| *diameter_mm > 0.0 && diameter_mm.is_finite())?;
        let at = design.factors.iter().position(|it| it.factor.symbol == "vc")?;
        Some(1000.0 * values[at] / (PI * diameter_mm))
    }
}

pub(super) fn run(arguments: &ToolWearArguments) -> CommandResult {
    let own = &arguments.design;
    let Some(array) = own.design else { return Ok(CommandOutcome::Fine) };
    let design = plan_experiment(array, &own.levels, own.seed)
        .map_err(|problems| CannotRun::new(format!("this design cannot be made:\n  {}", problems.join("\n  ")), ""))?;
    if let Some(path) = &arguments.out {
        write_output(path, &format_csv(own, &design)).map_err(CannotRun::from_error)?;
    }
    if arguments.json {
        print_json(&design_to_json(own, &design));
    } else {
        print_text(&format_design(own, &design));
    }
    Ok(CommandOutcome::Fine)
}

/// A table that comes back filled in: the columns that `identify tool-wear` reads, with the power still empty.
fn format_csv(own: &DesignArguments, design: &ExperimentDesign) -> String {
    let names: Vec<&str> = design.factors.iter().map(|it| it.factor.name).collect();
    let rpm = if own.diameter_mm.is_some() { ",spindle_programmed_rpm" } else { "" };
    let mut csv = format!("time_s,run,{}{rpm},cutting_power_w\n", names.join(","));
    for (index, cut) in design.cuts.iter().enumerate() {
        let values: Vec<String> = cut.values.iter().map(ToString::to_string).collect();
        let rpm = own.speed_rpm(design, &cut.values).map(|rpm| format!(",{rpm:.1}")).unwrap_or_default();
        let _written = writeln!(csv, "{index},{}-{},{}{rpm},", design.array, cut.row, values.join(","));
    }
    csv
}

fn design_to_json(own: &DesignArguments, design: &ExperimentDesign) -> Value {
    let cuts: Vec<Value> = design
        .cuts
        .iter()
        .enumerate()
        .map(|(index, cut)| {
            let values: serde_json::Map<String, Value> = design
                .factors
                .iter()
                .zip(&cut.values)
                .map(|(it, value)| (it.factor.name.to_owned(), json!(value)))
                .collect();
            json!({ "order": index + 1, "row": cut.row, "levels": cut.levels, "values": values,
                    "spindle_speed_rpm": own.speed_rpm(design, &cut.values) })
        })
        .collect();
    let aliases: Vec<Value> = design
        .aliases
        .iter()
        .map(|alias| json!({ "one": alias.one, "other": alias.other, "correlation": alias.correlation }))
        .collect();
    json!({ "schema": "design/1", "array": design.array.name(), "columns": design.columns, "seed": own.seed,
            "cuts": cuts, "aliases": aliases, "warnings": design.warnings })
}

fn format_design(own: &DesignArguments, design: &ExperimentDesign) -> String {
    let columns: Vec<String> = design.columns.iter().map(ToString::to_string).collect();
    let mut text = format!("{}: {} cuts, columns {}\n\n", design.array, design.cuts.len(), columns.join(", "));
    let heads: Vec<String> =
        design.factors.iter().map(|it| format!("{:>14}", format!("{} {}", it.factor.symbol, it.factor.unit))).collect();
    let rpm = if own.diameter_mm.is_some() { "     n rpm" } else { "" };
    let _written = writeln!(text, "order  row {}{rpm}   power W", heads.concat());
    for (index, cut) in design.cuts.iter().enumerate() {
        let values: String = cut.values.iter().map(|value| format!("{value:>14}")).collect();
        let rpm = own.speed_rpm(design, &cut.values).map(|rpm| format!("{rpm:>10.0}")).unwrap_or_default();
        let _written = writeln!(text, "{:>5} {:>4} {values}{rpm}   .......", index + 1, cut.row);
    }
    if !design.warnings.is_empty() {
        text += "\nto know before cutting:\n";
        design.warnings.iter().for_each(|warning| text += &format!("  - {warning}\n"));
    }
    text
}
