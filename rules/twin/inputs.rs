//! Inputs of a model in a recording: which columns its parts read, and in which rows they have a value.

use super::model::{Part, PartFunction};
use physics::{Role, Scene};

/// Longest stretch, in rows, over which a held input still counts as known.
const HELD_ROWS_MAX: usize = 3;

/// The columns that the parts read directly.
#[must_use]
pub fn list_input_columns(scene: &Scene, parts: &[Part]) -> Vec<String> {
    let mut names: Vec<String> = parts.iter().flat_map(|part| list_part_columns(scene, part)).collect();
    names.sort();
    names.dedup();
    names.retain(|name| scene.column(name).is_some());
    names
}

fn list_part_columns(scene: &Scene, part: &Part) -> Vec<String> {
    let role = |role: Role| scene.role_name(role).map(str::to_owned);
    match &part.body {
        PartFunction::Table(_) => role(Role::Speed).into_iter().collect(),
        PartFunction::Effect(effect, _) if effect.doc().kind == "no_load_power" => {
            role(Role::Speed).into_iter().collect()
        }
        PartFunction::Effect(effect, _) if effect.doc().kind == "cutting_power" => {
            ["depth_of_cut_mm", "feed_per_rev_mm", "cutting_speed_m_min"].map(str::to_owned).to_vec()
        }
        _ => part.inputs().into_iter().map(str::to_owned).collect(),
    }
}

/// Rows in which every input of the parts has a value of its own, or held for at most three rows. Inputs of the cut
/// matter only in the cut.
#[must_use]
pub fn mark_rows_with_inputs(scene: &Scene, parts: &[Part]) -> Vec<bool> {
    let mut known = vec![true; scene.rows()];
    let engaged = scene.role_values(Role::Engaged);
    for part in parts {
        for name in list_input_columns(scene, std::slice::from_ref(part)) {
            let Some(absent) = scene.absent_rows(&name) else { continue };
            let mut since = 0;
            for row in 0..scene.rows() {
                since = if absent[row] { since + 1 } else { 0 };
                let idle = part.is_cut() && engaged.is_some_and(|engaged| engaged[row] == 0.0);
                if since > HELD_ROWS_MAX && !idle {
                    known[row] = false;
                }
            }
        }
    }
    known
}

/// Takes rows whose inputs are absent out of the comparison.
pub fn exclude_rows_without_inputs(scene: &mut Scene, parts: &[Part]) {
    let known = mark_rows_with_inputs(scene, parts);
    scene.exclude_rows((0..known.len()).filter(|row| !known[*row]));
}
