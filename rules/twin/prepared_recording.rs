//! A recording prepared for comparison with a model.

use super::bind::bind_model;
use super::hold_out::{Unit, list_units, select_held_out_units};
use super::model::{Model, Part, simulate_parts};
use super::quality::{Fault, exclude_faulty_rows};
use adapter_core::bilingual::Bilingual;
use physics::Scene;
use recording::Recording;
use std::collections::BTreeSet;

/// A recording prepared for comparison with a model.
pub(super) struct Case<'a> {
    /// The model as given.
    pub(super) model: &'a Model,
    /// The recording as the effects see it.
    pub(super) scene: Scene,
    /// The parts, complete for this recording.
    pub(super) parts: Vec<Part>,
    pub(super) units: Vec<Unit>,
    /// Units that take no part in fitting, choosing or stopping.
    pub(super) held: BTreeSet<usize>,
    /// Faults of the recording.
    pub(super) faults: Vec<Fault>,
}

impl<'a> Case<'a> {
    /// Prepares a recording; `seed` chooses what is held out.
    ///
    /// # Errors
    /// Everything that makes the input unusable, with what to record instead.
    pub(super) fn new(recording: &Recording, model: &'a Model, seed: u64) -> Result<Self, Vec<String>> {
        let mut scene = Scene::new(recording, &model.output, &model.roles).map_err(|error| vec![error.to_string()])?;
        let parts = bind_model(model, &scene)?;
        let Some(nominal) = simulate_parts(&parts, &mut scene) else {
            return Err(vec!["the model cannot be simulated over this recording".to_owned()]);
        };
        let measured = scene.usable_rows().to_vec();
        let filled = super::inputs::exclude_rows_without_inputs(&mut scene, &parts);
        let mut faults = exclude_faulty_rows(&mut scene, &nominal.total, &measured);
        faults.extend(filled);
        let units = list_units(&scene);
        let held = select_held_out_units(&scene, &units, seed);
        Ok(Self { model, scene, parts, units, held, faults })
    }

    /// Rows that are fitted.
    pub(super) fn list_fitted_rows(&self) -> Vec<usize> {
        let of = |(unit, rows): (usize, &Unit)| if self.held.contains(&unit) { 0..0 } else { rows.rows.clone() };
        self.units.iter().enumerate().flat_map(of).filter(|row| self.scene.usable_rows()[*row]).collect()
    }

    /// What is needed, where the fitted rows cannot tell anything.
    pub(super) fn describe_missing_data(&self, least: usize) -> Option<Bilingual> {
        let fitted = self.list_fitted_rows();
        if fitted.len() < least {
            let output = &self.model.output;
            return Some(Bilingual::new(
                format!("at least {least} rows with a value of {output} that are not held out"),
                format!("至少{least}个含{output}且未留出的行"),
            ));
        }
        let first = self.scene.recorded_output()[fitted[0]];
        if fitted.iter().all(|row| self.scene.recorded_output()[*row] == first) {
            let output = &self.model.output;
            return Some(Bilingual::new(
                format!("a recording in which {output} changes"),
                format!("{output}有变化的记录"),
            ));
        }
        None
    }
}
