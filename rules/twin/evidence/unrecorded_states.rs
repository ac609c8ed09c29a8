//! States that nobody records, read from what the empty and the leading sets leave over: sequences of on and off, waves of
//! one frequency, levels that begin somewhere. Each goes into the second stage with what it has cost to find it.

use super::families::spindle_tones::{build_spell_columns, list_spells};
use super::gram::Comparison;
use super::hidden_sequence::{self, Sequence};
use super::inputs::RecordingInputs;
use super::noise::NoiseModel;
use super::posterior::NoiseSetting;
use super::search::SetEvidence;
use super::second_stage::SecondStage;
use super::spectral_line::{self, SpectralLine};
use super::step_search::{Step, find_step};
use super::variant_bank::{Drawn, Family, Since};
use numerics::statistics::count_to_f64;
use physics::OutputKind;

/// Shares of the memory of the noise with which hidden sequences are looked for: what switches poses as memory.
const MEMORY_SHARES: [f64; 3] = [1.0, 0.7, 0.4];
/// Share of the rows in which two hidden sequences may agree (or disagree) before they are one.
const SAME_SEQUENCE: f64 = 0.97;
/// Turns per row within which two lines are one.
const SAME_LINE: f64 = 0.008;
/// Nats by which a sequence must beat noise of any memory: a path through two levels has as many choices as rows. Chosen
/// between what a sequence brings in noise alone (19 and 23 over the whole recording) and consumers (37 to 57) on six open
/// recordings; two of noise with a memory of 33 rows still pass. Higher: weak consumers are lost; lower: a wandering meter
/// passes for one.
const SWITCH_NATS: f64 = 30.0;
/// Share of the rows in which it is on that lie in the cut, from which a sequence is an event of the cut and no consumer.
/// A consumer knows nothing of the cut; 3 % are left for flags that are a row early or late. Chosen on recordings with
/// concealed consumers. A wrong value costs the name, not the report.
const OF_THE_CUT: f64 = 0.97;
/// Mean length of being on, in rows, below which it is an event and no consumer: shorter ones are also made by noise with
/// heavy tails. A wrong value costs the name of a consumer that is on briefly.
const EVENT_ROWS: f64 = 4.0;
/// What it costs to call an event a consumer, nats: odds of 400 to 1, so that only a much better fit gives it the name.
const EVENT_AS_CONSUMER: f64 = -6.0;

/// What sets leave over, and where it is looked for.
pub(super) struct Residuals<'a> {
    pub(super) inputs: &'a RecordingInputs<'a>,
    pub(super) comparison: &'a Comparison<'a>,
    pub(super) setting: &'a NoiseSetting,
    /// Noise of each row relative to the ordinary one.
    pub(super) scale: &'a [f64],
}

impl Residuals<'_> {
    /// Adds the states that the empty and the two leading sets leave; sequences beside noise of at most this memory.
    pub(super) fn add_states(&self, found: &SetEvidence, slow: NoiseModel, second: &mut SecondStage) {
        let mut sets: Vec<(&Vec<(usize, usize)>, f64)> = found.iter().map(|(members, ln)| (members, *ln)).collect();
        sets.sort_by(|a, b| b.1.total_cmp(&a.1));
        let empty = Vec::new();
        let slow = self.comparison.convert_noise_to_rows(slow);
        let leading = sets.iter().map(|(members, _)| *members).filter(|members| !members.is_empty()).take(2);
        let (mut known, mut lines, mut steps) = (Vec::new(), Vec::new(), Vec::new());
        for members in std::iter::once(&empty).chain(leading) {
            let left = self.comparison.compute_residual(self.setting, members);
            self.add_waves(&left, &mut lines, second);
            self.add_steps(&left, &mut steps, second);
            for share in MEMORY_SHARES {
                self.add_sequences(&left, share * slow.share * slow.phi, &mut known, second);
            }
        }
    }

    fn add_waves(&self, left: &[f64], lines: &mut Vec<SpectralLine>, second: &mut SecondStage) {
        let Some(line) = spectral_line::find_spectral_line(self.comparison, left, self.setting.gram.noise) else {
            return;
        };
        if !lines.iter().any(|known| (known.frequency - line.frequency).abs() < SAME_LINE) {
            lines.push(line);
            add_wave(self.inputs, line, second);
        }
    }

    /// Levels of the cut and of the whole output that begin somewhere.
    fn add_steps(&self, left: &[f64], steps: &mut Vec<(&'static str, usize)>, second: &mut SecondStage) {
        let inputs = self.inputs;
        if inputs.kind == OutputKind::Displacement {
            return;
        }
        let cut = inputs.cut.as_ref().map(|cut| ("hardness_batch", cut, 0.35));
        for (kind, carrier, largest) in cut.into_iter().chain([("sensor_gain", &inputs.simulated, 0.2)]) {
            let Some(Step { row, ln_choices }) = find_step(self.comparison, left, carrier, self.setting.gram.noise)
            else {
                continue;
            };
            if steps.contains(&(kind, row)) {
                continue;
            }
            steps.push((kind, row));
            let column = inputs.build_column(|at| if at >= row { carrier[at] } else { 0.0 });
            second.add_variant(-ln_choices, |bank| {
                let step = bank.begin_variant(Family::from_kind(kind), format!("row {row}, found"));
                step.with_largest_size(largest).with_onset(Since::Row(row)).add_column(inputs, column);
            });
        }
    }

    fn add_sequences(&self, left: &[f64], memory: f64, known: &mut Vec<Vec<f64>>, second: &mut SecondStage) {
        let Some(sequence) = hidden_sequence::find_hidden_sequence(self.inputs, left, self.scale, memory) else {
            return;
        };
        if !self.exceeds_slow_noise(left, &sequence) {
            return;
        }
        if !known.iter().any(|other| is_same_sequence(self.inputs, other, &sequence.on)) {
            known.push(sequence.on.clone());
            add_sequence(self.inputs, second, sequence, known.len());
        }
    }

    /// Is a sequence likelier than noise that may be as slow as it likes? What switches has edges, slow noise has none; the
    /// memory of the noise is bounded everywhere else, so that levels stay levels, and a wandering meter would pass for one.
    fn exceeds_slow_noise(&self, left: &[f64], sequence: &Sequence) -> bool {
        let grid = NoiseModel::build_grid(f64::INFINITY, self.inputs.period_s * count_to_f64(self.comparison.group));
        let (mut slow, mut switching) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        for noise in grid {
            slow = slow.max(self.comparison.compute_ln_likelihood(left, noise));
            let (x, y) =
                (self.comparison.whiten_column(&sequence.on, noise), self.comparison.whiten_column(left, noise));
            let square: f64 = x.iter().map(|x| x * x).sum();
            let step = x.iter().zip(&y).map(|(x, y)| x * y).sum::<f64>() / square.max(f64::MIN_POSITIVE);
            let less = self.inputs.build_column(|row| left[row] - step * sequence.on[row]);
            switching = switching.max(self.comparison.compute_ln_likelihood(&less, noise));
        }
        switching - slow > SWITCH_NATS
    }
}

/// Is the output what a meter in the supply shows? Consumers are nowhere else, and not in the current of a feed drive.
fn shows_consumers(inputs: &RecordingInputs<'_>) -> bool {
    !inputs.is_axis && (inputs.kind == OutputKind::Power || inputs.scene.output_name().ends_with("_a"))
}

/// A wave of one frequency: the ripple of the mains where the output is electric, and without a name where it is not.
fn add_wave(inputs: &RecordingInputs<'_>, line: SpectralLine, second: &mut SecondStage) {
    let angle = spectral_line::compute_line_angle(inputs, line);
    let spells = list_spells(inputs, false);
    let all: Vec<&std::ops::Range<usize>> = spells.iter().collect();
    let columns = build_spell_columns(inputs, &all, &angle, &vec![1.0; inputs.rows]);
    let label = format!("{:.4} turns per row", line.frequency);
    let is_electric = inputs.kind == OutputKind::Power || inputs.scene.output_name().ends_with("_a");
    second.add_variant(-line.ln_choices, |bank| {
        if is_electric {
            bank.begin_variant(Family::from_kind("ripple_alias").without_widening(), label)
                .add_columns(inputs, columns);
        } else {
            let drawn = Drawn { over: "time".to_owned(), times: "1", shape: "wave" };
            bank.begin_nameless_curve(drawn).add_columns(inputs, columns);
        }
    });
}

fn is_same_sequence(inputs: &RecordingInputs<'_>, a: &[f64], b: &[f64]) -> bool {
    let rows: Vec<usize> = inputs.fitted_rows(false).collect();
    let equal = rows.iter().filter(|row| (a[**row] - b[**row]).abs() < 0.5).count();
    let share = count_to_f64(equal) / count_to_f64(rows.len().max(1));
    !(1.0 - SAME_SEQUENCE..=SAME_SEQUENCE).contains(&share)
}

/// Nats per spell by which being in the cut with one probability tells against another (Kullback and Leibler): a consumer
/// is on in the cut as often as the machine cuts.
fn compute_kl_divergence(seen: f64, usual: f64) -> f64 {
    let of = |p: f64, q: f64| if p > 0.0 { p * (p / q.max(1e-3)).ln() } else { 0.0 };
    (of(seen, usual) + of(1.0 - seen, 1.0 - usual)).max(0.0)
}

/// A sequence as a consumer, as an event in the cut, and as a regime of the coolant.
fn add_sequence(inputs: &RecordingInputs<'_>, second: &mut SecondStage, sequence: Sequence, number: usize) {
    let label = format!("hidden, {} changes, {:.0} nats", sequence.changes, sequence.ln);
    let all = count_to_f64(inputs.fitted_rows(false).count().max(1));
    let over = |of: &dyn Fn(usize) -> f64| inputs.fitted_rows(false).map(of).sum::<f64>();
    let on = over(&|row| sequence.on[row]).max(1.0);
    let in_cut = over(&|row| inputs.cut_indicator(row));
    let cuts = inputs.engaged.is_some() && in_cut > 0.0 && in_cut < all;
    let in_cut_only = cuts && over(&|row| sequence.on[row] * inputs.cut_indicator(row)) > OF_THE_CUT * on;
    let short = on < EVENT_ROWS * 0.5 * count_to_f64(sequence.changes);
    let by_chance = count_to_f64(sequence.changes)
        * 0.5
        * compute_kl_divergence(over(&|row| sequence.on[row] * inputs.cut_indicator(row)) / on, in_cut / all);
    let consumer = sequence.ln - by_chance + if in_cut_only || short { EVENT_AS_CONSUMER } else { 0.0 };
    let metered = shows_consumers(inputs) && !hidden_sequence::follows_inputs(inputs, &sequence.on);
    if metered {
        let family = Family::from_kind("auxiliary_switch").without_widening();
        second.add_variant(consumer, |bank| {
            bank.begin_variant(family, &label).with_given_size().add_column(inputs, sequence.on.clone())
        });
    }
    if cuts || short || !metered {
        let event = inputs.build_column(|row| sequence.on[row] * if cuts { inputs.cut_indicator(row) } else { 1.0 });
        let drawn = Drawn { over: format!("event {number}"), times: "engaged", shape: "event" };
        second.add_variant(sequence.ln, |bank| {
            bank.begin_nameless_curve(drawn).with_given_size().add_column(inputs, event)
        });
    }
    if let Some(cut) = inputs.cut.as_ref().filter(|_| inputs.knows_cut) {
        let top = inputs.fitted_rows(false).map(|row| cut[row].abs()).fold(1e-12, f64::max);
        let regime = inputs.build_column(|row| sequence.on[row] * cut[row] / top);
        let family = Family::from_kind("coolant_regime").without_widening();
        second.add_variant(sequence.ln - 1.0, |bank| {
            bank.begin_variant(family, &label).with_given_size().add_column(inputs, regime)
        });
    }
}
