//! What a model says about a recording: the one way from a model to numbers. A diagnosis tells the error of a model after it has
//! sent it through here, as it would stand in a file, so that what is told is what the file does.

use super::bind::bind_model;
use super::inputs::mark_rows_with_inputs;
use super::model::{Model, Part, PartFunction, simulate_parts};
use super::model_file::{parse_model, write_model};
pub use super::speed_table::FormDoubt;
use physics::Scene;
use recording::{Cells, Numbers, Recording};

/// A model over the rows of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedRows {
    /// The output, row by row; `None` where an input is absent.
    pub total: Vec<Option<f64>>,
    /// Label of each part and what it adds, row by row.
    pub parts: Vec<(String, Vec<f64>)>,
    /// Where the law of a no-load table is doubted most: label of the part, and the doubt.
    pub form_doubts: Vec<(String, FormDoubt)>,
    /// The recorded output; `None` where it is absent.
    pub recorded: Vec<Option<f64>>,
}

/// Runs a model over the inputs of a recording; the output need not be recorded. A state that nobody records (a pump) is
/// followed from earlier rows of the recorded output; `blind` does not look at it.
///
/// # Errors
/// Everything the model needs and the recording lacks.
pub fn simulate_recording(recording: &Recording, model: &Model, blind: bool) -> Result<SimulatedRows, Vec<String>> {
    let recorded: Option<Vec<Option<f64>>> =
        recording.find_numbers(&model.output).map(|numbers| numbers.iter().collect());
    let mut complete = recording.clone();
    if recorded.is_none() {
        complete.set_column(&model.output, Cells::Numbers(Numbers::default()));
    }
    let mut scene = Scene::new(&complete, &model.output, &model.roles).map_err(|error| vec![error.to_string()])?;
    if blind {
        scene.exclude_rows(0..scene.rows());
    }
    let parts = bind_model(model, &scene)?;
    let form_doubts = list_form_doubts(&parts, &scene);
    let known = mark_rows_with_inputs(&scene, &parts);
    let Some(simulated) = simulate_parts(&parts, &mut scene) else {
        return Err(vec!["the model cannot be simulated over this recording".to_owned()]);
    };
    let labels = parts.iter().map(|part| part.label().to_owned());
    Ok(SimulatedRows {
        total: simulated.total.into_iter().zip(&known).map(|(x, known)| known.then_some(x)).collect(),
        parts: labels.zip(simulated.contributions).collect(),
        form_doubts,
        recorded: recorded.unwrap_or_else(|| vec![None; recording.count_rows()]),
    })
}

fn list_form_doubts(parts: &[Part], scene: &Scene) -> Vec<(String, FormDoubt)> {
    let of_part = |part: &Part| {
        let PartFunction::Table(table) = &part.body else { return None };
        let powers: Vec<f64> = part.parameters.iter().map(|parameter| parameter.value).collect();
        Some((part.label().to_owned(), table.find_greatest_doubt(scene, &powers)?))
    };
    parts.iter().filter_map(of_part).collect()
}

/// These parts in the place of those of a model, written and read again, over a recording; `None` where the file would be refused.
pub(super) fn simulate_written_parts(recording: &Recording, model: &Model, parts: &[Part]) -> Option<SimulatedRows> {
    let extended = Model { parts: parts.to_vec(), ..model.clone() };
    let read = parse_model(&write_model(&extended)).ok()?;
    simulate_recording(recording, &read, false).ok()
}
