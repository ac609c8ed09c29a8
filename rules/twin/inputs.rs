//! Inputs of a model in a recording: which columns its parts read, and in which rows they have a value.

use super::model::{Part, PartFunction};
use super::quality::{Fault, FaultKind};
use physics::{Role, Scene};
use recording::DERIVABLE;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Longest stretch, in rows, over which a held input still counts as known.
const HELD_ROWS_MAX: usize = 3;
/// Gaps of a column are rare where at most one row in so many is one: more are how it is recorded.
const RARE: usize = 20;

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
        PartFunction::Table(table) => {
            let stage = table.gear_stage.map(|_| "gear_stage".to_owned());
            role(Role::Speed).into_iter().chain(stage).collect()
        }
        PartFunction::Effect(effect, _) => {
            let needs = effect.doc().needs.iter().flat_map(|need| need.split('|')).map(str::trim);
            let needs = needs.filter_map(|need| Role::from_name(need).map_or_else(|| Some(need.to_owned()), role));
            // Whatever happens in the cut is multiplied by the engagement, where one is recorded.
            let engagement = (part.is_cut() || effect.acts_in_cut()).then(|| role(Role::Engaged)).flatten();
            needs.chain(engagement).collect()
        }
        _ => part.inputs().into_iter().map(str::to_owned).collect(),
    }
}

/// Rows in which every input of the parts has a value of its own, or held for at most three rows. Inputs of the cut
/// matter only in the cut.
#[must_use]
pub fn mark_rows_with_inputs(scene: &Scene, parts: &[Part]) -> Vec<bool> {
    let mut known = vec![true; scene.rows()];
    let is_idle = mark_idle_rows(scene);
    for part in parts {
        for name in list_input_columns(scene, std::slice::from_ref(part)) {
            let Some(absent) = scene.absent_rows(&name) else { continue };
            let mut since = 0;
            for row in 0..scene.rows() {
                since = if absent[row] { since + 1 } else { 0 };
                if since > HELD_ROWS_MAX && !(part.is_cut() && is_idle[row]) {
                    known[row] = false;
                }
            }
        }
    }
    known
}

/// Rows in which the tool is known to be out of the work. An engagement that is held over a gap says nothing of it.
fn mark_idle_rows(scene: &Scene) -> Vec<bool> {
    let Some(engaged) = scene.role_values(Role::Engaged) else { return vec![false; scene.rows()] };
    let absent = scene.role_name(Role::Engaged).and_then(|name| scene.absent_rows(name));
    (0..scene.rows()).map(|row| engaged[row] == 0.0 && !absent.is_some_and(|absent| absent[row])).collect()
}

/// Takes rows whose inputs are absent or filled in out of the comparison: what is not recorded is no evidence. Tells them by
/// column.
pub fn exclude_rows_without_inputs(scene: &mut Scene, parts: &[Part]) -> Vec<Fault> {
    let known = mark_rows_with_inputs(scene, parts);
    let mut faults = Vec::new();
    let mut excluded: Vec<usize> = (0..known.len()).filter(|row| !known[*row]).collect();
    let mut filled = list_filled_rows(scene, parts);
    // A product is told only where none of what it follows from has told the row.
    filled.sort_by_key(|(column, _)| DERIVABLE.contains(&column.as_str()));
    let mut told = BTreeSet::new();
    for (column, rows) in filled {
        let own = rows.iter().filter(|row| told.insert(**row)).count();
        let is_product = DERIVABLE.contains(&column.as_str());
        let rows_of_column = if is_product { own } else { rows.len() };
        if rows_of_column > 0 {
            faults.push(Fault { kind: FaultKind::FilledInputs, column, rows: rows_of_column });
        }
        excluded.extend(rows);
    }
    scene.exclude_rows(excluded);
    faults
}

/// The rows of each column whose value was filled in: of an input of the model every one in which it matters, of any other column
/// those of short gaps where gaps are rare. A column that is empty again and again, such as a depth outside the cut or a temperature
/// that is measured once a minute, has no value to miss there.
fn list_filled_rows(scene: &Scene, parts: &[Part]) -> Vec<(String, Vec<usize>)> {
    let is_idle = mark_idle_rows(scene);
    let mut of_column: BTreeMap<String, BTreeSet<usize>> = BTreeMap::new();
    for part in parts {
        for name in list_input_columns(scene, std::slice::from_ref(part)) {
            let all = if has_usual_gaps(scene, &name) { &[] } else { scene.filled_rows(&name) };
            of_column
                .entry(name)
                .or_default()
                .extend(all.iter().copied().filter(|row| !(part.is_cut() && is_idle[*row])));
        }
    }
    for name in scene.column_names().chain(scene.text_column_names()).filter(|name| *name != scene.output_name()) {
        let filled = scene.filled_rows(name);
        if filled.len() * RARE <= scene.rows() {
            let rows = select_gaps(filled, 1..HELD_ROWS_MAX + 1);
            of_column.entry(name.to_owned()).or_default().extend(rows);
        }
    }
    let some = of_column.into_iter().filter(|(_, rows)| !rows.is_empty());
    some.map(|(name, rows)| (name, rows.into_iter().collect())).collect()
}

/// Rows of the gaps that are so long.
fn select_gaps(filled: &[usize], lengths: Range<usize>) -> Vec<usize> {
    let gaps = filled.chunk_by(|row, next| row + 1 == *next);
    gaps.filter(|gap| lengths.contains(&gap.len())).flatten().copied().collect()
}

/// Is it usual that rows lie between one recorded value of a column and the next?
fn has_usual_gaps(scene: &Scene, name: &str) -> bool {
    let Some(absent) = scene.absent_rows(name) else { return false };
    let recorded: Vec<usize> = (0..scene.rows()).filter(|row| !absent[*row]).collect();
    let adjacent = recorded.windows(2).filter(|pair| pair[0] + 1 == pair[1]).count();
    2 * adjacent < recorded.len().saturating_sub(1)
}
