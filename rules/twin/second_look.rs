//! A second look where nothing was found in the units that were fitted, but those that were held out are strange.

use super::diagnose::Case;
use super::diagnosis::Diagnosis;
use super::frame::{FOLDS, group_size, held_out};
use super::linear::dot;
use crate::statistics::count;

/// Error of held-out units over that of fitted ones from which something shows in them only.
const STRANGE: f64 = 1.25;

impl Case<'_> {
    /// The same with other units held out, where nothing was found but those that were held out agree much less with the
    /// model than those that were fitted: what shows in them only, such as a speed or a load that is rarely reached, must
    /// be fitted to be seen. Held out are those that agree best.
    pub(super) fn with_the_strange_fitted(&self, first: &Diagnosis) -> Option<Self> {
        let quality = first.fit.as_ref()?.before;
        let strange = quality.held_out_rmse? > STRANGE * quality.rmse;
        if !first.verdict.is_silent() || !strange {
            return None;
        }
        let left =
            |row: usize| first.rows.simulated_before[row].map(|simulated| self.scene.recorded()[row] - simulated);
        let squares = |fold: &usize| {
            let rows = held_out(&self.units, *fold).into_iter().flat_map(|unit| self.units[unit].rows.clone());
            let left: Vec<f64> = rows.filter(|row| first.rows.compared[*row]).filter_map(left).collect();
            (!left.is_empty()).then(|| dot(&left, &left) / count(left.len()))
        };
        let folds = (0..FOLDS).filter_map(|fold| Some((fold, squares(&fold)?)));
        let (fold, _) = folds.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let held = held_out(&self.units, fold);
        let (scene, parts) = (self.scene.clone(), self.parts.clone());
        let size = group_size(&scene);
        Some(Self::of(self.model, scene, parts, self.units.clone(), held, size, self.faults.clone()))
    }
}

#[cfg(test)]
mod tests {
    use crate::twin::overflowing_tank;

    /// Of a tank in twelve runs; in every fourth of them, which are held out first, it is fuller, and spills.
    fn verdict(spills: f64) -> (&'static str, Vec<String>) {
        let full = |row: u32| if row / 150 % 4 == 3 { 3.0 } else { 0.0 };
        let level = |row: u32| 5.0 + full(row) + 2.0 * (f64::from(row) / 61.0).sin();
        let (_, found) = overflowing_tank::diagnosed(1800, level, |level| spills * (level - 7.5).max(0.0));
        (found.verdict.word(), found.fit.expect("fitted").held_out_runs)
    }

    #[test]
    fn what_shows_in_held_out_runs_only_is_fitted_in_a_second_look() {
        let (verdict, held_out) = verdict(2.0);
        assert_eq!(verdict, "unexplained");
        assert!(!held_out.contains(&"3".to_owned()) && held_out.len() == 3, "{held_out:?}");
    }

    #[test]
    fn where_they_agree_with_the_model_there_is_none() {
        assert_eq!(verdict(0.0), ("no_mismatch", ["3", "7", "11"].map(str::to_owned).to_vec()));
    }
}
