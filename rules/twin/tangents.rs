//! What each free parameter changes of the output, as a column of every row.

use super::fit::Free;
use super::model::{Part, Simulated, simulate_changed_part, simulate_parts};
use numerics::statistics::rms;
use physics::{Entry, Scene};

/// Share of its value by which a parameter is moved to see what it does.
const DIFFERENCE: f64 = 1e-4;
/// Share of its slope by which an output changes its slope at a kink. A smooth law changes it by about the share of `DIFFERENCE`: a lower
/// share tries the other side in vain, a higher one rests at a kink.
const KINK: f64 = 0.02;

/// From which side a shape is moved to see what it does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Above,
    Below,
}

/// Does the output bend where the shapes stand, so that one side says nothing of the other? A delay of whole rows does: the signal is
/// straight between two rows.
pub(super) fn has_kink(
    scene: &mut Scene,
    parts: &[Part],
    free: &[Free],
    (base, above): (&Simulated, &[Vec<f64>]),
) -> Option<bool> {
    for (free, above) in free.iter().zip(above) {
        if parts[free.part].parameters[free.parameter].entry != Entry::Shape {
            continue;
        }
        let below = compute_difference_quotient(scene, parts, *free, (base, Side::Below))?;
        let apart: Vec<f64> = below.iter().zip(above).map(|(below, above)| below - above).collect();
        if rms(&apart) > KINK * rms(above) {
            return Some(true);
        }
    }
    Some(false)
}

/// Change of the output with each free parameter: its own column where nothing else reads what it does, a difference
/// quotient (exact where it is proportional) elsewhere.
pub(super) fn compute_tangents(
    scene: &mut Scene,
    parts: &[Part],
    free: &[Free],
    base: (&Simulated, Side),
) -> Option<Vec<Vec<f64>>> {
    simulate_parts(parts, scene)?;
    let mut columns: Vec<Option<Vec<f64>>> = vec![None; free.len()];
    for (index, part) in parts.iter().enumerate() {
        let direct = |free: &Free| free.part == index && has_column_derivative(parts, *free);
        if !free.iter().any(direct) {
            continue;
        }
        let known = part.compute_columns(scene)?;
        for (position, free) in free.iter().enumerate().filter(|(_, free)| direct(free)) {
            let name = &part.parameters[free.parameter].name;
            let own = known.iter().find(|(known, _)| known == name).map(|(_, column)| column.clone());
            columns[position] = Some(own.unwrap_or_else(|| vec![0.0; scene.rows()]));
        }
    }
    for (position, free) in free.iter().enumerate() {
        if columns[position].is_none() {
            columns[position] = Some(compute_difference_quotient(scene, parts, *free, base)?);
        }
    }
    columns.into_iter().collect()
}

/// Is the derivative simply the part's own column? Not where other parts read what this one simulates.
fn has_column_derivative(parts: &[Part], free: Free) -> bool {
    let part = &parts[free.part];
    let linear = part.parameters[free.parameter].entry == Entry::Linear;
    let coupled = parts.iter().any(Part::acts_on_output) && !part.acts_on_output();
    linear && !coupled && !parts.iter().any(|other| part.is_read_by(other))
}

fn compute_difference_quotient(
    scene: &mut Scene,
    parts: &[Part],
    free: Free,
    (base, side): (&Simulated, Side),
) -> Option<Vec<f64>> {
    let mut moved = parts.to_vec();
    let parameter = &mut moved[free.part].parameters[free.parameter];
    let mut step = DIFFERENCE * parameter.value.abs().max(if parameter.entry == Entry::Shape { 1e-2 } else { 1e-6 });
    if parameter.value + step > parameter.range.1 || side == Side::Below && parameter.value - step >= parameter.range.0
    {
        step = -step;
    }
    parameter.value += step;
    let ahead = simulate_changed_part(&moved, scene, base, free.part)?;
    simulate_parts(parts, scene)?;
    Some(ahead.iter().zip(&base.total).map(|(ahead, base)| (ahead - base) / step).collect())
}
