//! The cut as effects see it.

use super::{OutputKind, Role, Scene};
use adapter_core::channel::quantity::Quantity;
use std::borrow::Cow;
use std::f64::consts::TAU;

/// Tool in the work, 0 to 1; 1 everywhere when no channel tells (then depth and feed must tell).
pub(crate) fn read_engagement(scene: &Scene) -> Vec<f64> {
    scene.role_values(Role::Engaged).map_or_else(|| vec![1.0; scene.rows()], <[f64]>::to_vec)
}

/// How hard the cut is, in the output's unit: the load, or else what the output usually has in the cut beyond what it
/// has out of it, while the tool is in the work. `None` for displacements and without both.
pub(crate) fn estimate_cut_load(scene: &Scene) -> Option<Cow<'_, [f64]>> {
    if scene.output_kind() == OutputKind::Displacement {
        return None;
    }
    let usual =
        || scene.role_values(Role::Engaged).map(|engaged| engaged.iter().map(|x| x * scene.usual_cut()).collect());
    scene.load().map(Cow::Borrowed).or_else(usual)
}

/// Rows in which the tool touches the work, of the share to which it is engaged in each. A pass begins with the first contact: a cutter of
/// some size is engaged by and by. One partial row alone is the mean of a flag that changed within it, and counts as what it is nearest to.
#[must_use]
pub fn mark_contact_rows(engaged: &[f64]) -> Vec<bool> {
    let touches = |row: Option<usize>| row.and_then(|row| engaged.get(row)).is_some_and(|share| *share > 0.0);
    let is_ramp = |row: usize| touches(row.checked_sub(1)) && touches(Some(row)) && touches(Some(row + 1));
    (0..engaged.len()).map(|row| engaged[row] > 0.5 || is_ramp(row)).collect()
}

/// Rows in which the tool cuts for most of the time.
pub(crate) fn mark_cutting_rows(scene: &Scene) -> Vec<bool> {
    match scene.role_values(Role::Engaged) {
        Some(engaged) => engaged.iter().map(|engaged| *engaged > 0.5).collect(),
        None => estimate_cut_load(scene)
            .map_or_else(|| vec![false; scene.rows()], |cut| cut.iter().map(|cut| *cut > 0.0).collect()),
    }
}

/// Cut times a factor of the row.
pub(crate) fn multiply_cut(scene: &Scene, factor: impl Fn(usize) -> f64) -> Option<Vec<f64>> {
    Some(estimate_cut_load(scene)?.iter().enumerate().map(|(row, cut)| cut * factor(row)).collect())
}

/// What a force in the cut means in the output: `area` is in mm2, or mm for a force along an edge.
/// A power takes `area * vc / 60`, a torque `area * D / 2000`, a force `area` itself.
pub(crate) fn convert_to_output(scene: &Scene, area: &[f64]) -> Option<Vec<f64>> {
    let lever: Vec<f64> = match Quantity::from_column_name(scene.output_name()) {
        Quantity::Force => return Some(area.to_vec()),
        Quantity::Torque => scene.column("diameter_mm")?.iter().map(|diameter| diameter / 2000.0).collect(),
        _ => scene.column("cutting_speed_m_min")?.iter().map(|speed| speed / 60.0).collect(),
    };
    Some(area.iter().zip(lever).map(|(area, lever)| area * lever).collect())
}

/// How many teeth of a milling cutter are in the work at once, in the mean of a turn: `z arccos(1 - 2 ae / D) / (2 pi)`, of a
/// cut from the side (Altintas, Manufacturing Automation, 2nd ed., chapter 2). `None` where teeth, width and diameter
/// are not known; zero in rows in which one of them is none.
pub(crate) fn count_teeth_in_cut(scene: &Scene) -> Option<Vec<f64>> {
    let [teeth, width, diameter] = ["teeth", "width_of_cut_mm", "diameter_mm"].map(|name| scene.column(name));
    let (teeth, width, diameter) = (teeth?, width?, diameter?);
    let of = |row: usize| match diameter[row] {
        d if d > 0.0 => teeth[row] * (1.0 - 2.0 * (width[row] / d).clamp(0.0, 1.0)).acos() / TAU,
        _ => 0.0,
    };
    Some((0..scene.rows()).map(of).collect())
}

/// Way since the first of some rows at these feeds, mm.
pub(crate) fn integrate_way_mm(time_s: &[f64], feed_mm_min: &[f64]) -> Vec<f64> {
    let mut way_mm = vec![0.0; time_s.len()];
    for row in 1..time_s.len() {
        let mean_mm_min = 0.5 * (feed_mm_min[row] + feed_mm_min[row - 1]);
        way_mm[row] = way_mm[row - 1] + mean_mm_min / 60.0 * (time_s[row] - time_s[row - 1]).max(0.0);
    }
    way_mm
}

#[cfg(test)]
mod tests {
    use super::mark_contact_rows;

    #[test]
    fn a_cutter_is_in_contact_while_it_is_engaged_by_and_by_and_a_flag_counts_as_what_it_is_nearest_to() {
        let cutter = [0.0, 0.2, 0.4, 0.6, 1.0, 0.6, 0.4, 0.2, 0.0];
        assert_eq!(mark_contact_rows(&cutter), [false, false, true, true, true, true, true, false, false]);
        let mean_of_flag = [0.0, 0.3, 1.0, 1.0, 0.2, 0.0, 0.7, 1.0];
        assert_eq!(mark_contact_rows(&mean_of_flag), [false, false, true, true, false, false, true, true]);
        assert_eq!(mark_contact_rows(&[1.0, 0.3, 1.0]), [true; 3], "a cut that is thin for a moment is one pass");
    }
}
