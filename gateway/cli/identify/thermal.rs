//! `identify thermal`: thermal error from temperatures, which sensors and which law.

use super::{IdentifyFiles, IdentifyOutput, ShownBy};
use crate::cli::{CannotRun, CommandResult};
use crate::diagnosis::write_output;
use crate::identification::{self, THERMAL};
use adapters::Recording;
use clap::Args;
use rules::estimators::regression::{Refusal, RefusalKind};
use rules::estimators::thermal::{
    LeftOut, POINTS_MAX, RHO_USUAL, SelectionSettings, ThermalModel, collect_rows, learn_law,
};
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct ThermalArguments {
    #[command(flatten)]
    reading: IdentifyFiles,
    #[command(flatten)]
    shown_by: ShownBy,
    /// Use these sensors instead of choosing, e.g. bearing_temperature_c,temperature_3_c.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    sensors: Option<Vec<String>>,
    /// Choose at most so many sensors.
    #[arg(long, value_name = "N", default_value_t = SelectionSettings::default().sensors_max)]
    sensors_max: usize,
    /// Greatest variance inflation among chosen sensors.
    #[arg(long, value_name = "FACTOR", default_value_t = SelectionSettings::default().inflation_max)]
    inflation_max: f64,
    /// Write the law as the model that the box runs (thermal/1, JSON; [thermal] model in the configuration).
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Machine that the model is for; without it any.
    #[arg(long, value_name = "NAME", default_value = "")]
    machine: String,
    /// Resolution coefficient of the grey relational grades, above 0 and at most 1.
    #[arg(long, value_name = "RHO", default_value_t = RHO_USUAL)]
    rho: f64,
}

pub(super) fn run(arguments: &ThermalArguments) -> CommandResult {
    let recording = arguments.reading.read()?;
    let learned = identify_law(&recording, arguments).and_then(|(learned, model)| {
        let text = model.to_json_text().map_err(|what| Refusal::new(RefusalKind::NotFinite, what, ""))?;
        Ok((learned, text))
    });
    if let (Some(path), Ok((_, model))) = (&arguments.model, &learned) {
        write_output(path, model).map_err(CannotRun::from_error)?;
    }
    let mut learned = learned.map(|(learned, _)| learned);
    if let Ok(learned) = &mut learned {
        arguments.shown_by.store_answer(THERMAL, learned, None)?;
    }
    arguments.reading.report_result(THERMAL, learned)
}

fn identify_law(
    recording: &Recording,
    arguments: &ThermalArguments,
) -> Result<(IdentifyOutput, ThermalModel), Refusal> {
    let settings = build_settings(arguments)?;
    let collected = collect_rows(recording)?;
    let learned = learn_law(&collected.course, settings, arguments.sensors.as_deref())?;
    let text = format!("{}{learned}", left_out(&collected.left_out));
    let model = ThermalModel::new(arguments.machine.clone(), learned.best_candidate().fit.law.clone());
    let json = identification::of_thermal(&learned, &collected.left_out);
    Ok((IdentifyOutput { text, json, file: Some(learned.format_script()) }, model))
}

fn build_settings(arguments: &ThermalArguments) -> Result<SelectionSettings, Refusal> {
    let given = SelectionSettings {
        sensors_max: arguments.sensors_max,
        inflation_max: arguments.inflation_max,
        rho: arguments.rho,
        ..SelectionSettings::default()
    };
    let refuse = |option: &str, what: String, next: &str| {
        Err(Refusal::new(RefusalKind::OutOfRange, what, next).with_place(option))
    };
    if given.sensors_max == 0 || given.sensors_max > POINTS_MAX {
        let next = format!("choose 1 to {POINTS_MAX}");
        return refuse("--sensors-max", format!("{} sensors", given.sensors_max), &next);
    }
    if !(given.rho > 0.0 && given.rho <= 1.0) {
        return refuse("--rho", format!("{}", given.rho), "give a number above 0 and at most 1");
    }
    if given.inflation_max.is_nan() || given.inflation_max < 1.0 {
        return refuse("--inflation-max", format!("{}", given.inflation_max), "give 1 or more; 10 is usual");
    }
    Ok(given)
}

fn left_out(left_out: &LeftOut) -> String {
    let mut text = String::new();
    if left_out.rows > 0 {
        text.push_str(&format!("{} rows without an error or without every temperature are left out\n", left_out.rows));
    }
    if !left_out.sensors.is_empty() {
        text.push_str(&format!("{} mostly have no value and are left out\n", left_out.sensors.join(", ")));
    }
    text
}
