//! The cut: what scales with it, changes through a pass, from lot to lot, with speed or with chip thickness.

use super::wear::edge_load;
use crate::evidence::bank::{Family, Since, VariantBank};
use crate::evidence::inputs::RecordingInputs;
use physics::OutputKind;

const CUT: Family = Family::of("cutting_power").beside_catalogue().signed(1.0).through(&["engaged"]);
const LOAD_LOSS: Family = Family::of("load_loss").through(&["load"]);
const EDGE_FORCE: Family = Family::of("edge_force").signed(1.0).beside_catalogue();
const SOFTENING: Family = Family::of("speed_softening").signed(-1.0).through(&["cutting_speed_m_min"]);
const BUILT_UP: Family = Family::of("built_up_edge").beside_catalogue().signed(-1.0).through(&["cutting_speed_m_min"]);
const BATCH: Family = Family::of("hardness_batch").through(&["run", "lot", "tool"]);
const GAIN: Family = Family::of("sensor_gain").rare(-1.0);
const TAPER: Family = Family::of("depth_taper").at_edges().through(&[
    "axis_position_mm",
    "z_axis_position_mm",
    "position",
    "pass_progress",
]);
const ENTRY: Family = Family::of("entry_exit").beside_catalogue().rare(-0.5).at_edges();
const THINNING: Family = Family::of("chip_thinning").beside_catalogue().signed(1.0).through(&["depth_of_cut_mm"]);
const THINNING_WIDTH: Family = Family::of("chip_thinning").beside_catalogue().rare(-0.5);
const TIMING: Family = Family::of("engagement_timing").beside_catalogue().rare(-0.7).at_edges();
const RECIPE: Family = Family::of("recipe_error").beside_catalogue().rare(-0.5);
const CONSUMER: Family = Family::of("auxiliary_switch").signed(1.0);
const COOLANT: Family = Family::of("coolant_regime").beside_catalogue();
const OVERRIDE: Family = Family::of("override_delay").beside_catalogue().signed(1.0).rare(-2.0);

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
pub(super) fn add(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    if inputs.kind == OutputKind::Displacement {
        return;
    }
    consumers(inputs, bank);
    if inputs.engaged.is_some() && !inputs.knows_cut {
        bank.of(CUT, "engaged").column(inputs, inputs.column(|row| inputs.cutting(row)));
    }
    let Some(cut) = &inputs.cut else { return };
    if inputs.knows_cut {
        let power = |exponent: i32| inputs.column(|row| cut[row].powi(exponent));
        bank.of(LOAD_LOSS, "").columns(inputs, [(power(2), 1.0), (power(3), 0.2)]);
    }
    if let Some(edge) = edge_load(inputs) {
        bank.of(EDGE_FORCE, "").column(inputs, edge);
    }
    over_speed(inputs, cut, bank);
    steps(inputs, cut, bank);
    recipes(inputs, cut, bank);
    if inputs.engaged.is_some() {
        through_a_pass(inputs, cut, bank);
        thin_chips(inputs, cut, bank);
        edges_of_the_flag(inputs, cut, bank);
    }
}

fn over_speed(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    let Some(speed) = &inputs.cutting_speed else { return };
    let ln = inputs.column(|row| inputs.cutting(row) * speed[row].max(1.0).ln());
    let middle = inputs.mean_of(&ln, true);
    let spread = inputs.deviation_of(&ln, true);
    if spread > 0.02 {
        let over = |row: usize| inputs.cutting(row) * (ln[row] - middle);
        let linear = inputs.column(|row| cut[row] * over(row));
        let bent = inputs.column(|row| cut[row] * (over(row).powi(2) - spread * spread) * inputs.cutting(row));
        bank.of(SOFTENING, "").columns(inputs, [(linear, 1.0), (bent, 0.3)]);
    }
    for (centre, width) in [(25.0_f64, 10.0_f64), (35.0, 12.0), (45.0, 15.0), (60.0, 15.0), (80.0, 20.0)] {
        let law = inputs.column(|row| cut[row] * (-0.5 * ((speed[row] - centre) / width).powi(2)).exp());
        bank.of(BUILT_UP, centre).column(inputs, law);
    }
}

/// Levels of the cut, or of the whole output, that begin with a run or within a long one.
fn steps(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    if let Some(lots) = inputs.scene.text_column("lot")
        && (2..=12).contains(&lots.words().len())
    {
        let codes: Vec<usize> =
            (0..inputs.rows).map(|row| lots.find_code(row).map_or(usize::MAX, |code| code as usize)).collect();
        let (_, columns) = inputs.of_members(&codes, cut);
        bank.of(BATCH, "lot").columns(inputs, columns.into_iter().map(|column| (column, 1.0)));
    }
    let (known, columns) = inputs.of_members(&inputs.run, cut);
    if (3..=RUNS_MAX).contains(&known) {
        bank.of(BATCH, "runs").prior(-0.5).columns(inputs, columns.into_iter().map(|column| (column, 1.0)));
    }
    let runs = inputs.scene.runs();
    let is_fitted = |run: &usize| runs[*run].clone().any(|row| inputs.fitted[row]);
    let mut first: Vec<usize> = (1..runs.len()).filter(is_fitted).collect();
    let size = first.len();
    if size > STEPS_MAX {
        first = (0..STEPS_MAX).map(|k| first[k * (size - 1) / (STEPS_MAX - 1)]).collect();
    }
    let from = |values: &[f64], start: usize| inputs.column(|row| if row >= start { values[row] } else { 0.0 });
    for run in first {
        let start = runs[run].start;
        let since = Since::Run(run);
        bank.of(BATCH, format!("run {run}")).up_to(0.35).since(since).column(inputs, from(cut, start));
        let gain = from(&inputs.simulated, start);
        bank.of(GAIN, format!("run {run}")).prior(-1.5).up_to(0.2).since(since).column(inputs, gain);
    }
    if inputs.rows / runs.len().max(1) <= LONG_RUN || runs.len() > FEW_RUNS {
        return;
    }
    for run in runs.iter().filter(|run| (run.start..run.end).any(|row| inputs.fitted[row])) {
        for start in [1, 2, 3].map(|quarter| run.start + run.len() * quarter / 4) {
            let since = Since::Row(start);
            let label = format!("row {start}");
            bank.of(BATCH, &label).prior(-0.5).up_to(0.35).since(since).column(inputs, from(cut, start));
            let gain = from(&inputs.simulated, start);
            bank.of(GAIN, &label).prior(-1.0).up_to(0.2).since(since).column(inputs, gain);
        }
    }
}

/// Legendre polynomials of the first to the third order over 0 to 1.
fn legendre(u: f64) -> [f64; 3] {
    [2.0 * u - 1.0, 6.0 * u * u - 6.0 * u + 1.0, 20.0 * u.powi(3) - 30.0 * u * u + 12.0 * u - 1.0]
}

fn through_a_pass(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    let order =
        |u: &dyn Fn(usize) -> f64, k: usize| inputs.column(|row| cut[row] * inputs.cutting(row) * legendre(u(row))[k]);
    let along = |row: usize| inputs.progress[row];
    let columns = [(order(&along, 0), 1.0), (order(&along, 1), 0.5), (order(&along, 2), 0.35)];
    bank.of(TAPER, "progress").columns(inputs, columns);
    if let Some(position) = &inputs.position {
        let known = inputs.sorted(position, true);
        if let (Some(low), Some(high)) = (known.first(), known.last())
            && high > low
        {
            let at = |row: usize| ((position[row] - low) / (high - low)).clamp(0.0, 1.0);
            let columns = [(order(&at, 0), 1.0), (order(&at, 1), 0.6), (order(&at, 2), 0.4)];
            bank.of(TAPER, "position").columns(inputs, columns);
        }
    }
    for tau_s in [0.5, 1.0, 2.0, 4.0].into_iter().filter(|tau_s| *tau_s >= 0.5 * inputs.period_s) {
        let fading = |since: &[f64]| {
            inputs.column(|row| cut[row] * inputs.cutting(row) * (-(since[row] + 0.5 * inputs.period_s) / tau_s).exp())
        };
        let columns = [(fading(&inputs.since_s), 1.0), (fading(&inputs.to_end_s), 1.0)];
        bank.of(ENTRY, tau_s).columns(inputs, columns);
    }
}

fn thin_chips(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    if let Some(depth) = &inputs.depth {
        for radius in [0.4, 0.8, 1.2] {
            let below = inputs.taken(true).filter(|row| depth[*row] < radius).count();
            if below > 20 && inputs.taken(true).count() > below + 20 {
                let law = inputs.column(|row| cut[row] * (1.0 - depth[row] / radius).max(0.0));
                bank.of(THINNING, radius).column(inputs, law);
            }
        }
    }
    if let (Some(width), Some(diameter)) = (&inputs.width, &inputs.diameter) {
        let thin = |row: usize| {
            let q = (width[row] / diameter[row].max(0.1)).clamp(0.0, 1.0);
            if q < 0.5 { 1.0 - 2.0 * (q * (1.0 - q)).max(0.0).sqrt() } else { 0.0 }
        };
        bank.of(THINNING_WIDTH, "width").column(inputs, inputs.column(|row| cut[row] * thin(row)));
    }
}

/// The cut where a flag that is so many rows late or early would have it, less what is simulated.
fn edges_of_the_flag(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    for shift in SHIFTS {
        for late in [true, false] {
            let at = |row: usize| {
                let other = if late { row.checked_sub(shift) } else { Some(row + shift).filter(|r| *r < inputs.rows) };
                other.filter(|other| inputs.run[*other] == inputs.run[row]).unwrap_or(row)
            };
            let held = last_in_cut(inputs, cut, late);
            let law = |row: usize| match (inputs.in_cut[at(row)], inputs.in_cut[row]) {
                (true, false) => held[row],
                (false, true) => -cut[row],
                _ => 0.0,
            };
            let label = format!("{shift} rows {}", if late { "late" } else { "early" });
            bank.of(TIMING, label).column(inputs, inputs.column(law));
        }
    }
}

/// The cut, outside of it as it was at its end (or will be at its start), twenty rows at most.
fn last_in_cut(inputs: &RecordingInputs<'_>, cut: &[f64], behind: bool) -> Vec<f64> {
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
fn recipes(inputs: &RecordingInputs<'_>, cut: &[f64], bank: &mut VariantBank) {
    for column in ["operation", "program"] {
        let Some(words) = inputs.scene.text_column(column).filter(|words| (3..=25).contains(&words.words().len()))
        else {
            continue;
        };
        for (code, word) in words.words().iter().enumerate() {
            let here = |row: usize| f64::from(u8::from(words.find_code(row).is_some_and(|at| at as usize == code)));
            let law = inputs.column(|row| cut[row] * inputs.cutting(row) * here(row));
            bank.of(RECIPE, format!("{column} {word}")).up_to(0.5).column(inputs, law);
        }
    }
    if let Some(coolant) = inputs.scene.column("coolant_on")
        && cuts_dry(inputs, cut, coolant)
    {
        bank.of(COOLANT, "recorded").column(inputs, inputs.column(|row| cut[row] * coolant[row]));
    }
    if inputs.scene.column("feed_mm_min").is_some() && inputs.engaged.is_some() && inputs.knows_cut {
        for rows in [1, 2, 4] {
            let late = inputs.lagged(cut, f64::from(rows) * inputs.period_s);
            let law = |row: usize| {
                let before = row.checked_sub(rows as usize).is_some_and(|before| inputs.in_cut[before]);
                if inputs.in_cut[row] && before { late[row] - cut[row] } else { 0.0 }
            };
            bank.of(OVERRIDE, rows).column(inputs, inputs.column(law));
        }
    }
}

/// Share of the square of the cut that must be dry: less is a few rows at the edges of the cuts, and coolant that is on in every
/// cut is a name for any factor of the whole cut.
const DRY_MIN: f64 = 0.01;

/// Is there cutting without coolant, so that its factor can be told from one of every cut?
fn cuts_dry(inputs: &RecordingInputs<'_>, cut: &[f64], coolant: &[f64]) -> bool {
    let known = inputs.taken(false).filter(|row| coolant[*row].is_finite());
    let (dry, whole) = known.fold((0.0, 0.0), |(dry, whole), row| {
        (dry + (cut[row] * (1.0 - coolant[row])).powi(2), whole + cut[row].powi(2))
    });
    dry > DRY_MIN * whole
}

/// Consumers that a flag of the recording tells; what a word of an operation tells has a level without a name.
fn consumers(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    for column in ["coolant_on", "hydraulics_on"] {
        if let Some(flag) = inputs.scene.column(column)
            && inputs.deviation_of(flag, false) > 0.0
        {
            bank.of(CONSUMER, column).column(inputs, flag.to_vec());
        }
    }
}
