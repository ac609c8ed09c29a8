//! `identify load-loss`: the loss that comes with the cut, per gear stage.

use super::{IdentifyFiles, IdentifyOutput};
use crate::cli::CommandResult;
use ::rules::estimators::power_separation::{ReferenceChoice, identify_load_loss};
use clap::Args;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct LoadLossArguments {
    #[command(flatten)]
    reading: IdentifyFiles,
    /// Column of the cutting torque at the spindle, N·m; without it cutting_force_n with diameter_mm serves.
    #[arg(long, value_name = "COLUMN", default_value = "torque_nm")]
    torque: String,
    /// Cutting energy of the material, J/mm3: cuts of known removal then serve where there is neither torque nor force.
    #[arg(long, value_name = "J/mm3", requires = "specific_energy_sd")]
    specific_energy: Option<f64>,
    /// Standard deviation of that energy, J/mm3; it goes into every interval.
    #[arg(long, value_name = "J/mm3", requires = "specific_energy")]
    specific_energy_sd: Option<f64>,
}

pub(super) fn run(arguments: &LoadLossArguments) -> CommandResult {
    let recording = arguments.reading.read()?;
    let choice = ReferenceChoice {
        torque_column: arguments.torque.clone(),
        specific_energy_j_mm3: arguments.specific_energy.zip(arguments.specific_energy_sd),
    };
    let learned = identify_load_loss(&recording, &choice).map(|learned| IdentifyOutput {
        text: learned.to_string(),
        json: json!(learned),
        file: Some(learned.format_script()),
    });
    arguments.reading.report_result("load-loss", learned)
}
