//! Flank wear: growth with the time of an edge in the cut, with a rate and a state of its own for every edge.

use crate::evidence::inputs::RecordingInputs;
use crate::evidence::variant_bank::{Family, VariantBank};
use physics::OutputKind;

const WEAR: Family = Family::from_kind("flank_wear").with_sign(1.0).with_channels(&["tool_age"]);

/// Edges beyond which none has a rate of its own.
const EDGES_MAX: usize = 12;
/// Prior deviation of the rate of an edge, and of how worn it was at first, relative to the mean growth.
const RATE: f64 = 0.4;
const STATE: f64 = 0.15;

pub(super) fn add_variants(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let Some(cut) = inputs.cut.as_ref().filter(|_| inputs.engaged.is_some()) else { return };
    if inputs.kind == OutputKind::Displacement {
        return;
    }
    let top = inputs.fitted_rows(false).map(|row| inputs.edge_age_min[row]).fold(1e-6, f64::max);
    if inputs.compute_deviation(&inputs.edge_age_min, false) <= 1e-3 * top {
        return;
    }
    let edge = compute_edge_load(inputs);
    let own = edge.as_ref().unwrap_or(cut);
    add_wear_laws(inputs, bank, "edge", own, top, 0.0);
    if edge.is_some() && inputs.knows_cut {
        add_wear_laws(inputs, bank, "cut", cut, top, -1.5);
    }
}

fn add_wear_laws(inputs: &RecordingInputs<'_>, bank: &mut VariantBank, label: &str, load: &[f64], top: f64, ln: f64) {
    let age = inputs.build_column(|row| (inputs.edge_age_min[row] / top).max(0.0));
    let grown = |exponent: f64| inputs.build_column(|row| load[row] * age[row].powf(exponent));
    let beyond = |exponent: f64, law: &[f64]| {
        let other = grown(exponent);
        inputs.build_column(|row| other[row] - law[row])
    };
    for exponent in [0.6, 1.0, 1.6] {
        let law = grown(exponent);
        let mut columns = vec![(law.clone(), 1.0), (beyond(0.5, &law), 0.25), (beyond(2.0, &law), 0.25)];
        if (2..=EDGES_MAX).contains(&inputs.edges) {
            let of = |edge: usize, values: &[f64]| {
                inputs.build_column(|row| if inputs.edge[row] == edge { values[row] } else { 0.0 })
            };
            columns.extend((0..inputs.edges).map(|edge| (of(edge, &law), RATE)));
            columns.extend((0..inputs.edges).map(|edge| (of(edge, load), STATE)));
        }
        bank.begin_variant(WEAR, format!("{label}, {exponent}"))
            .with_ln_prior(ln)
            .with_law_columns(3)
            .add_columns(inputs, columns);
    }
}

/// Depth times cutting speed in the cut: what the flank of an edge rubs along, in a power; in a torque over the speed.
pub(super) fn compute_edge_load(inputs: &RecordingInputs<'_>) -> Option<Vec<f64>> {
    let (depth, speed) = (inputs.depth.as_ref()?, inputs.cutting_speed.as_ref()?);
    let engaged = inputs.engaged.as_ref();
    let power = inputs.build_column(|row| depth[row] * speed[row] * engaged.map_or(1.0, |engaged| engaged[row]));
    if inputs.kind != OutputKind::Force {
        return Some(power);
    }
    let rpm = inputs.speed.as_ref()?;
    Some(inputs.build_column(|row| power[row] / rpm[row].max(1.0) * inputs.cut_indicator(row)))
}
