//! The cut: what scales with it, changes through a pass, from lot to lot, with speed or with chip thickness.

use super::wear::compute_edge_load;
use crate::evidence::inputs::RecordingInputs;
use crate::evidence::variant_bank::{Family, Since, VariantBank};
use physics::OutputKind;

const CUT: Family =
    Family::from_kind("cutting_power").with_catalogue_forms().with_sign(1.0).with_channels(&["engaged"]);
const LOAD_LOSS: Family = Family::from_kind("load_loss").with_channels(&["load"]);
const EDGE_FORCE: Family = Family::from_kind("edge_force").with_sign(1.0).with_catalogue_forms();
const SOFTENING: Family = Family::from_kind("speed_softening").with_sign(-1.0).with_channels(&["cutting_speed_m_min"]);
const BUILT_UP: Family =
    Family::from_kind("built_up_edge").with_catalogue_forms().with_sign(-1.0).with_channels(&["cutting_speed_m_min"]);
const BATCH: Family = Family::from_kind("hardness_batch").with_channels(&["run", "lot", "tool"]);
const GAIN: Family = Family::from_kind("sensor_gain").with_rarity(-1.0);
const TAPER: Family = Family::from_kind("depth_taper").with_edge_action().with_channels(&[
    "axis_position_mm",
    "z_axis_position_mm",
    "position",
    "pass_progress",
]);
const ENTRY: Family = Family::from_kind("entry_exit").with_catalogue_forms().with_rarity(-0.5).with_edge_action();
const THINNING: Family =
    Family::from_kind("chip_thinning").with_catalogue_forms().with_sign(1.0).with_channels(&["depth_of_cut_mm"]);
const TIMING: Family =
    Family::from_kind("engagement_timing").with_catalogue_forms().with_rarity(-0.7).with_edge_action();
const RECIPE: Family = Family::from_kind("recipe_error").with_catalogue_forms().with_rarity(-0.5);
const CONSUMER: Family = Family::from_kind("auxiliary_switch").with_sign(1.0);
const COOLANT: Family = Family::from_kind("coolant_regime").with_catalogue_forms();
const OVERRIDE: Family = Family::from_kind("override_delay").with_catalogue_forms().with_sign(1.0).with_rarity(-2.0);

/// Runs up to which each may be a lot of its own.
const RUNS_MAX: usize = 30;
/// Steps at a run that are tried at most.
const STEPS_MAX: usize = 40;
/// Rows of a run from which a step may fall within it, and runs up to which such steps are tried.
const LONG_RUN: usize = 400;
const FEW_RUNS: usize = 16;
/// Rows by which the flag of the engagement may be late or early.
const SHIFTS: [usize; 5] = [1, 2, 4, 8, 15];

/// The families of everything in the cut.
pub(super) fn add_variants(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    if inputs.kind == OutputKind::Displacement {
        return;
    }
    add_consumers(inputs, bank);
    if inputs.engaged.is_some() && !inputs.knows_cut {
        bank.begin_variant(CUT, "engaged").add_column(inputs, inputs.build_column(|row| inputs.cut_indicator(row)));
    }
    let Some(cut) = &inputs.cut else { return };
    if inputs.knows_cut {
        let power = |exponent: i32| inputs.build_column(|row| cut[row].powi(exponent));
        bank.begin_variant(LOAD_LOSS, "").add_columns(inputs, [(power(2), 1.0), (power(3), 0.2)]);
    }
    if let Some(edge) = compute_edge_load(inputs) {
        bank.begin_variant(EDGE_FORCE, "").add_column(inputs, edge);
    }
    add_speed_laws(inputs, cut, bank);
    add_steps(inputs, cut, bank);
    add_recipes(inputs, cut, bank);
    if inputs.engaged.is_some() {
        add_pass_laws(inputs, cut, bank);
        add_chip_thinning(inputs, cut, bank);
        add_timing_errors(inputs, cut, bank);
    }
}

fn add_speed_laws(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    let Some(speed) = &inputs.cutting_speed else { return };
    let ln = inputs.build_column(|row| inputs.cut_indicator(row) * speed[row].max(1.0).ln());
    let middle = inputs.compute_mean(&ln, true);
    let spread = inputs.compute_deviation(&ln, true);
    if spread > 0.02 {
        let over = |row: usize| inputs.cut_indicator(row) * (ln[row] - middle);
        let linear = inputs.build_column(|row| cut[row] * over(row));
        let bent =
            inputs.build_column(|row| cut[row] * (over(row).powi(2) - spread * spread) * inputs.cut_indicator(row));
        bank.begin_variant(SOFTENING, "").add_columns(inputs, [(linear, 1.0), (bent, 0.3)]);
    }
    for (centre, width) in [(25.0_f64, 10.0_f64), (35.0, 12.0), (45.0, 15.0), (60.0, 15.0), (80.0, 20.0)] {
        let law = inputs.build_column(|row| cut[row] * (-0.5 * ((speed[row] - centre) / width).powi(2)).exp());
        bank.begin_variant(BUILT_UP, centre).add_column(inputs, law);
    }
}

/// Levels of the cut, or of the whole output, that begin with a run or within a long one.
fn add_steps(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    if let Some(lots) = inputs.scene.text_column("lot")
        && (2..=12).contains(&lots.words().len())
    {
        let codes: Vec<usize> =
            (0..inputs.rows).map(|row| lots.find_code(row).map_or(usize::MAX, |code| code as usize)).collect();
        let (_, columns) = inputs.build_member_columns(&codes, cut);
        bank.begin_variant(BATCH, "lot").add_columns(inputs, columns.into_iter().map(|column| (column, 1.0)));
    }
    let (known, columns) = inputs.build_member_columns(&inputs.run, cut);
    if (3..=RUNS_MAX).contains(&known) {
        bank.begin_variant(BATCH, "runs")
            .with_ln_prior(-0.5)
            .add_columns(inputs, columns.into_iter().map(|column| (column, 1.0)));
    }
    let runs = inputs.scene.runs();
    let is_fitted = |run: &usize| runs[*run].clone().any(|row| inputs.fitted[row]);
    let mut first: Vec<usize> = (1..runs.len()).filter(is_fitted).collect();
    let size = first.len();
    if size > STEPS_MAX {
        first = (0..STEPS_MAX).map(|k| first[k * (size - 1) / (STEPS_MAX - 1)]).collect();
    }
    let from = |values: &[f64], start: usize| inputs.build_column(|row| if row >= start { values[row] } else { 0.0 });
    for run in first {
        let start = runs[run].start;
        let since = Since::Run(run);
        bank.begin_variant(BATCH, format!("run {run}"))
            .with_largest_size(0.35)
            .with_onset(since)
            .add_column(inputs, from(cut, start));
        let gain = from(&inputs.simulated, start);
        bank.begin_variant(GAIN, format!("run {run}"))
            .with_ln_prior(-1.5)
            .with_largest_size(0.2)
            .with_onset(since)
            .add_column(inputs, gain);
    }
    if inputs.rows / runs.len().max(1) <= LONG_RUN || runs.len() > FEW_RUNS {
        return;
    }
    for run in runs.iter().filter(|run| (run.start..run.end).any(|row| inputs.fitted[row])) {
        for start in [1, 2, 3].map(|quarter| run.start + run.len() * quarter / 4) {
            let since = Since::Row(start);
            let label = format!("row {start}");
            bank.begin_variant(BATCH, &label)
                .with_ln_prior(-0.5)
                .with_largest_size(0.35)
                .with_onset(since)
                .add_column(inputs, from(cut, start));
            let gain = from(&inputs.simulated, start);
            bank.begin_variant(GAIN, &label)
                .with_ln_prior(-1.0)
                .with_largest_size(0.2)
                .with_onset(since)
                .add_column(inputs, gain);
        }
    }
}

/// Legendre polynomials of the first to the third order over 0 to 1.
fn evaluate_legendre(u: f64) -> [f64; 3] {
    [2.0 * u - 1.0, 6.0 * u * u - 6.0 * u + 1.0, 20.0 * u.powi(3) - 30.0 * u * u + 12.0 * u - 1.0]
}

fn add_pass_laws(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    let order = |u: &dyn Fn(usize) -> f64, k: usize| {
        inputs.build_column(|row| cut[row] * inputs.cut_indicator(row) * evaluate_legendre(u(row))[k])
    };
    let along = |row: usize| inputs.progress[row];
    let columns = [(order(&along, 0), 1.0), (order(&along, 1), 0.5), (order(&along, 2), 0.35)];
    bank.begin_variant(TAPER, "progress").add_columns(inputs, columns);
    if let Some(position) = &inputs.position {
        let known = inputs.sort_fitted_values(position, true);
        if let (Some(low), Some(high)) = (known.first(), known.last())
            && high > low
        {
            let at = |row: usize| ((position[row] - low) / (high - low)).clamp(0.0, 1.0);
            let columns = [(order(&at, 0), 1.0), (order(&at, 1), 0.6), (order(&at, 2), 0.4)];
            bank.begin_variant(TAPER, "position").add_columns(inputs, columns);
        }
    }
    for tau_s in [0.5, 1.0, 2.0, 4.0].into_iter().filter(|tau_s| *tau_s >= 0.5 * inputs.period_s) {
        let fading = |since: &[f64]| {
            inputs.build_column(|row| {
                cut[row] * inputs.cut_indicator(row) * (-(since[row] + 0.5 * inputs.period_s) / tau_s).exp()
            })
        };
        let columns = [(fading(&inputs.since_s), 1.0), (fading(&inputs.to_end_s), 1.0)];
        bank.begin_variant(ENTRY, tau_s).add_columns(inputs, columns);
    }
}

fn add_chip_thinning(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    if let Some(depth) = &inputs.depth {
        for radius in [0.4, 0.8, 1.2] {
            let below = inputs.fitted_rows(true).filter(|row| depth[*row] < radius).count();
            if below > 20 && inputs.fitted_rows(true).count() > below + 20 {
                let law = inputs.build_column(|row| cut[row] * (1.0 - depth[row] / radius).max(0.0));
                bank.begin_variant(THINNING, radius).add_column(inputs, law);
            }
        }
    }
}

/// The cut where a flag that is so many rows late or early would have it, less what is simulated.
fn add_timing_errors(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    for shift in SHIFTS {
        for late in [true, false] {
            let at = |row: usize| {
                let other = if late { row.checked_sub(shift) } else { Some(row + shift).filter(|r| *r < inputs.rows) };
                other.filter(|other| inputs.run[*other] == inputs.run[row]).unwrap_or(row)
            };
            let held = hold_last_cut(inputs, cut, late);
            let law = |row: usize| match (inputs.in_cut[at(row)], inputs.in_cut[row]) {
                (true, false) => held[row],
                (false, true) => -cut[row],
                _ => 0.0,
            };
            let label = format!("{shift} rows {}", if late { "late" } else { "early" });
            bank.begin_variant(TIMING, label).add_column(inputs, inputs.build_column(law));
        }
    }
}

/// The cut, outside of it as it was at its end (or will be at its start), twenty rows at most.
fn hold_last_cut(inputs: &RecordingInputs<'_>, cut: &[f64], behind: bool) -> Vec<f64> {
    let mut held = vec![0.0; inputs.rows];
    let (mut last, mut since) = (0.0, usize::MAX);
    let mut take = |row: usize| {
        if cut[row] > 0.0 {
            (last, since) = (cut[row], 0);
        } else {
            since = since.saturating_add(1);
        }
        held[row] = if since <= 20 { last } else { 0.0 };
    };
    if behind {
        (0..inputs.rows).for_each(&mut take);
    } else {
        (0..inputs.rows).rev().for_each(&mut take);
    }
    held
}

/// Whatever is told by a word of the recording: an operation whose recipe is wrong, or that runs a consumer.
fn add_recipes(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    for column in ["operation", "program"] {
        let Some(words) = inputs.scene.text_column(column).filter(|words| (3..=25).contains(&words.words().len()))
        else {
            continue;
        };
        for (code, word) in words.words().iter().enumerate() {
            let here = |row: usize| f64::from(u8::from(words.find_code(row).is_some_and(|at| at as usize == code)));
            let law = inputs.build_column(|row| cut[row] * inputs.cut_indicator(row) * here(row));
            bank.begin_variant(RECIPE, format!("{column} {word}")).with_largest_size(0.5).add_column(inputs, law);
        }
    }
    if let Some(coolant) = inputs.scene.column("coolant_on")
        && has_dry_cutting(inputs, cut, coolant)
    {
        bank.begin_variant(COOLANT, "recorded").add_column(inputs, inputs.build_column(|row| cut[row] * coolant[row]));
    }
    if inputs.scene.column("feed_mm_min").is_some() && inputs.engaged.is_some() && inputs.knows_cut {
        for rows in [1, 2, 4] {
            let late = inputs.delay_values(cut, f64::from(rows) * inputs.period_s);
            let law = |row: usize| {
                let before = row.checked_sub(rows as usize).is_some_and(|before| inputs.in_cut[before]);
                if inputs.in_cut[row] && before { late[row] - cut[row] } else { 0.0 }
            };
            bank.begin_variant(OVERRIDE, rows).add_column(inputs, inputs.build_column(law));
        }
    }
}

/// Share of the square of the cut that must be dry: less is a few rows at the edges of the cuts, and coolant that is on in every
/// cut is a name for any factor of the whole cut.
const DRY_MIN: f64 = 0.01;

/// Is there cutting without coolant, so that its factor can be told from one of every cut?
fn has_dry_cutting(inputs: &RecordingInputs<'_>, cut: &[f64], coolant: &[f64]) -> bool {
    let known = inputs.fitted_rows(false).filter(|row| coolant[*row].is_finite());
    let (dry, whole) = known.fold((0.0, 0.0), |(dry, whole), row| {
        (dry + (cut[row] * (1.0 - coolant[row])).powi(2), whole + cut[row].powi(2))
    });
    dry > DRY_MIN * whole
}

/// Consumers that a flag of the recording tells; what a word of an operation tells has a level without a name.
fn add_consumers(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    for column in ["coolant_on", "hydraulics_on"] {
        if let Some(flag) = inputs.scene.column(column)
            && inputs.compute_deviation(flag, false) > 0.0
        {
            bank.begin_variant(CONSUMER, column).add_column(inputs, flag.to_vec());
        }
    }
}
