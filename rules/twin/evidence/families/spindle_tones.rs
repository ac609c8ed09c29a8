//! Tones in step with the spindle, whose phase nobody records: where in its turn each cut begins, and how far a recorded
//! speed miscounts the turns. So each spell of some rows has a size and a phase of its own, two numbers that all spells draw
//! from one bell (random effects: Laird and Ware, Biometrics 38, 1982).

use crate::evidence::inputs::RecordingInputs;
use crate::evidence::variant_bank::{Drawn, Family, VariantBank};
use physics::drive::RAD_PER_S_OF_RPM;
use std::ops::Range;

const RUNOUT: Family = Family::from_kind("runout").without_widening();

/// Rows of a spell, over which a recorded speed keeps count of the turns; and spells at most.
const SPELL_ROWS: usize = 48;
const SPELLS_MAX: usize = 48;
/// Rows from which a spell tells two numbers, and turns as they show in the rows.
const SPELL_ROWS_MIN: usize = 6;
const TURNS_MIN: f64 = 1.5;

/// Tones of the spindle in the cut, and of other frequencies that rival them.
pub(super) fn add_variants(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let (Some(speed), Some(cut)) = (&inputs.speed, inputs.cut.as_ref().filter(|_| inputs.engaged.is_some())) else {
        return;
    };
    let turn = compute_spindle_angle(inputs, speed);
    let spells = list_spells(inputs, true);
    let told: Vec<&Range<usize>> =
        spells.iter().filter(|spell| count_aliased_turns(&turn, spell) > TURNS_MIN).collect();
    if told.len() < 4 {
        return;
    }
    bank.begin_variant(RUNOUT, "each spell").add_columns(inputs, build_spell_columns(inputs, &told, &turn, cut));
    // Noise that grows with the cut swells at every frequency: what is no tone of the spindle does so at these as well.
    for off in [0.05, -0.05] {
        let other = inputs
            .build_column(|row| turn[row] + std::f64::consts::TAU * off * numerics::statistics::count_to_f64(row));
        let drawn = Drawn { over: "time".to_owned(), times: "cut", shape: "wave" };
        bank.begin_nameless_curve(drawn).add_columns(inputs, build_spell_columns(inputs, &told, &other, cut));
    }
}

/// Angle of the spindle since the start of the block, rad.
fn compute_spindle_angle(inputs: &RecordingInputs<'_>, speed: &[f64]) -> Vec<f64> {
    let mut turn = vec![0.0; inputs.rows];
    for block in inputs.list_block_ranges() {
        for row in block.start + 1..block.end {
            let step_s = inputs.clock_s[row] - inputs.clock_s[row - 1];
            turn[row] = turn[row - 1] + 0.5 * (speed[row] + speed[row - 1]) * RAD_PER_S_OF_RPM * step_s;
        }
    }
    turn
}

/// Turns of a spell as the sampling shows them: folded to half a turn per row at most.
fn count_aliased_turns(turn: &[f64], spell: &Range<usize>) -> f64 {
    let per_row =
        (turn[spell.end - 1] - turn[spell.start]) / numerics::statistics::count_to_f64(spell.len().max(2) - 1);
    let folded = per_row / std::f64::consts::TAU;
    (folded - folded.round()).abs() * numerics::statistics::count_to_f64(spell.len())
}

/// Stretches of a block (in the cut), none longer than a spell.
pub(in crate::evidence) fn list_spells(inputs: &RecordingInputs<'_>, in_cut: bool) -> Vec<Range<usize>> {
    let longest = SPELL_ROWS.max(inputs.rows.div_ceil(SPELLS_MAX));
    let mut all: Vec<Range<usize>> = Vec::new();
    for row in 0..inputs.rows {
        if in_cut && !inputs.in_cut[row] {
            continue;
        }
        match all.last_mut() {
            Some(last) if last.end == row && inputs.block[row] == inputs.block[row - 1] && last.len() < longest => {
                last.end = row + 1;
            }
            _ => all.push(row..row + 1),
        }
    }
    all.retain(|spell| spell.len() >= SPELL_ROWS_MIN);
    all
}

/// Cosine and sine of an angle times a carrier in each spell, those with fitted rows first.
pub(in crate::evidence) fn build_spell_columns(
    inputs: &RecordingInputs<'_>,
    spells: &[&Range<usize>],
    angle: &[f64],
    carrier: &[f64],
) -> Vec<(Vec<f64>, f64)> {
    let fitted = |spell: &&&Range<usize>| (***spell).clone().any(|row| inputs.fitted[row]);
    let ordered = spells.iter().filter(|spell| fitted(spell)).chain(spells.iter().filter(|spell| !fitted(spell)));
    let mut columns = Vec::new();
    for spell in ordered {
        for wave in [f64::cos, f64::sin] {
            let mut column = vec![0.0; inputs.rows];
            (**spell).clone().for_each(|row| column[row] = carrier[row] * wave(angle[row]));
            columns.push((column, 1.0));
        }
    }
    columns
}
