//! Faults of a recording that do not bias the comparison: they are noted, and their rows are left out.

use numerics::statistics::{median, robust_deviation};
use physics::Scene;
use physics::explain::Language;

/// One kind of fault found in one column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// What is wrong with the rows.
    pub kind: FaultKind,
    /// The column with the fault.
    pub column: String,
    /// How many rows have it.
    pub rows: usize,
}

/// What is wrong with rows of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultKind {
    /// No value, a value that was held, or a zero where the simulation is far from zero.
    Dropouts,
    /// Single rows far from their neighbours.
    Spikes,
    /// Steps of the recorded value that are coarse beside the noise.
    Quantisation,
    /// Time that stands still or runs backwards.
    DuplicateTime,
    /// Rows that could not be read.
    RefusedRows,
    /// Rows in which an input has no value: one was filled in, and the rows do not count.
    FilledInputs,
}

impl FaultKind {
    /// The word in the contract `diagnosis/1`.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Dropouts => "dropouts",
            Self::Spikes => "spikes",
            Self::Quantisation => "quantisation",
            Self::DuplicateTime => "duplicate_time",
            Self::RefusedRows => "refused_rows",
            // To the contract an input without a value is a dropout of its column.
            Self::FilledInputs => "dropouts",
        }
    }

    /// What a reader of a report is told.
    #[must_use]
    pub fn describe(self, language: Language) -> &'static str {
        let (en, zh) = match self {
            Self::Dropouts => ("values missing, held or zero", "数据缺失、保持或为零"),
            Self::Spikes => ("isolated spikes", "孤立尖峰"),
            Self::Quantisation => ("recorded in coarse steps", "量化步长较粗"),
            Self::DuplicateTime => ("time stands still or runs backwards", "时间停滞或倒退"),
            Self::RefusedRows => ("rows refused while reading", "读取时被拒绝的行"),
            Self::FilledInputs => ("input without a value, not compared", "输入无值，未参与比较"),
        };
        language.select_text(en, zh)
    }
}

/// Neighbours on each side against which a row is judged.
const NEIGHBOURS: usize = 3;
/// Deviations from its neighbours, in robust standard deviations, beyond which a row is a spike.
const SPIKE_DEVIATIONS: f64 = 8.0;
/// Identical values in a row that count as a held dropout, where identical neighbours are rare.
const HELD_ROWS: usize = 4;

/// Notes faults and takes their rows out of the scene. `simulated` is the baseline's output, `measured` the rows with a value of
/// the output: others may have been taken out for their inputs.
pub fn exclude_faulty_rows(scene: &mut Scene, simulated: &[f64], measured: &[bool]) -> Vec<Fault> {
    let mut faults = Vec::new();
    let output = scene.output_name().to_owned();
    let mut note = |kind: FaultKind, column: &str, rows: usize| {
        if rows > 0 {
            faults.push(Fault { kind, column: column.to_owned(), rows });
        }
    };
    note(FaultKind::DuplicateTime, "time_s", count_duplicate_times(scene));
    scene.exclude_rows(find_repeated_rows(scene));
    note(FaultKind::Quantisation, &output, count_quantised_rows(scene));
    let mut dropped: Vec<usize> = (0..scene.rows()).filter(|row| !measured[*row]).collect();
    let held = find_held_rows(scene, &mark_rows_at_limit(scene));
    let zeros = find_zero_rows(scene, simulated);
    dropped.extend(held.iter().chain(&zeros));
    dropped.sort_unstable();
    dropped.dedup();
    scene.exclude_rows(dropped.iter().copied());
    note(FaultKind::Dropouts, &output, dropped.len());
    let spikes = find_spike_rows(scene, simulated);
    scene.exclude_rows(spikes.iter().copied());
    note(FaultKind::Spikes, &output, spikes.len());
    faults
}

/// Rows of the time and the output of the row before them: one measurement that was written twice counts once.
fn find_repeated_rows(scene: &Scene) -> Vec<usize> {
    let (time_s, recorded) = (scene.time_s(), scene.recorded_output());
    let is_repeated = |row: &usize| time_s[*row] == time_s[row - 1] && recorded[*row] == recorded[row - 1];
    scene.runs().iter().flat_map(|run| (run.start + 1..run.end).filter(is_repeated).collect::<Vec<_>>()).collect()
}

fn count_duplicate_times(scene: &Scene) -> usize {
    let time_s = scene.time_s();
    let same =
        |rows: &std::ops::Range<usize>| time_s[rows.clone()].windows(2).filter(|pair| pair[0] >= pair[1]).count();
    scene.runs().iter().map(same).sum()
}

/// Rows in which the output stands at the end of its range again and again: for several rows at a time, more than once,
/// and in few rows of all. Zero is what a meter reads that gives nothing.
fn mark_rows_at_limit(scene: &Scene) -> Vec<bool> {
    let mut stands = vec![false; scene.rows()];
    let recorded = scene.recorded_output();
    let known = || (0..scene.rows()).filter(|row| scene.usable_rows()[*row]);
    let low = known().map(|row| recorded[row]).fold(f64::INFINITY, f64::min);
    let high = known().map(|row| recorded[row]).fold(f64::NEG_INFINITY, f64::max);
    for end in [low, high].into_iter().filter(|end| *end != 0.0) {
        let mut stretches: Vec<std::ops::Range<usize>> = Vec::new();
        for row in known().filter(|row| recorded[*row] == end) {
            match stretches.last_mut() {
                Some(last) if last.end == row => last.end = row + 1,
                _ => stretches.push(row..row + 1),
            }
        }
        stretches.retain(|stretch| stretch.len() >= HELD_ROWS);
        if stretches.len() > 1 {
            stretches.into_iter().flatten().for_each(|row| stands[row] = true);
        }
    }
    stands
}

/// Rows in which the output repeats exactly, where that is unusual and nothing stands at a stop: what a full tank, a
/// limit or a meter at its end holds is no dropout.
fn find_held_rows(scene: &Scene, at_stop: &[bool]) -> Vec<usize> {
    let recorded = scene.recorded_output();
    let equal = (1..scene.rows()).filter(|row| recorded[*row] == recorded[row - 1]).count();
    let mut rows = Vec::new();
    if equal * 10 > scene.rows() {
        return rows;
    }
    let mut start = 0;
    for row in 1..=scene.rows() {
        if row == scene.rows() || recorded[row] != recorded[start] {
            if row - start >= HELD_ROWS && !at_stop[start] {
                // The first of them was measured.
                rows.extend(start + 1..row);
            }
            start = row;
        }
    }
    rows
}

/// Rows that read exactly zero although the simulation says otherwise and few rows do.
fn find_zero_rows(scene: &Scene, simulated: &[f64]) -> Vec<usize> {
    let recorded = scene.recorded_output();
    let sizes: Vec<f64> = recorded.iter().map(|x| x.abs()).collect();
    let typical = median(sizes).unwrap_or(0.0);
    let zero =
        |row: &usize| scene.usable_rows()[*row] && recorded[*row] == 0.0 && simulated[*row].abs() > 0.2 * typical;
    let rows: Vec<usize> = (0..scene.rows()).filter(zero).collect();
    if rows.len() * 10 > scene.rows() { Vec::new() } else { rows }
}

/// Isolated rows far from their neighbours while the simulation is steady.
fn find_spike_rows(scene: &Scene, simulated: &[f64]) -> Vec<usize> {
    let residual: Vec<f64> =
        scene.recorded_output().iter().zip(simulated).map(|(recorded, simulated)| recorded - simulated).collect();
    let jumps: Vec<(usize, f64, f64)> =
        scene.runs().iter().flat_map(|run| measure_jumps(scene, &residual, simulated, run)).collect();
    let Some(spread) = robust_deviation(jumps.iter().map(|(_, jump, _)| *jump)) else {
        return Vec::new();
    };
    let spike = |(_, jump, moved): &&(usize, f64, f64)| jump.abs() > SPIKE_DEVIATIONS * spread && *moved < spread;
    let rows: Vec<usize> = jumps.iter().filter(spike).map(|(row, ..)| *row).collect();
    if rows.len() * 30 > scene.rows() { Vec::new() } else { rows }
}

/// Per row: distance of its residual from the median of its neighbours, and how much the simulation moves around it.
fn measure_jumps(
    scene: &Scene,
    residual: &[f64],
    simulated: &[f64],
    run: &std::ops::Range<usize>,
) -> Vec<(usize, f64, f64)> {
    let usable: Vec<usize> = run.clone().filter(|row| scene.usable_rows()[*row]).collect();
    let judge = |at: usize| {
        let near = &usable[at.saturating_sub(NEIGHBOURS)..(at + NEIGHBOURS + 1).min(usable.len())];
        let row = usable[at];
        let others = near.iter().filter(|other| **other != row).map(|other| residual[*other]).collect();
        let (low, high) = near.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), other| {
            (low.min(simulated[*other]), high.max(simulated[*other]))
        });
        median(others).map(|median| (row, residual[row] - median, high - low))
    };
    (0..usable.len()).filter_map(judge).collect()
}

/// Rows on a coarse comb: the step between distinct values is a noticeable part of the spread between neighbours.
fn count_quantised_rows(scene: &Scene) -> usize {
    let mut values: Vec<f64> = scene
        .recorded_output()
        .iter()
        .zip(scene.usable_rows())
        .filter(|(_, usable)| **usable)
        .map(|(x, _)| *x)
        .collect();
    let rows = values.len();
    values.sort_by(f64::total_cmp);
    values.dedup();
    if rows > 200 && values.len() * 20 < rows { rows } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::read_csv;
    use std::collections::BTreeMap;
    use std::fmt::Write;

    /// A level that rises and falls below a brim; held rows where the meter slept.
    fn scene(brim: f64, asleep: std::ops::Range<u32>) -> Scene {
        let mut text = String::from("time_s,level_v\n");
        let level = |row: u32| (6.0 + 5.0 * (f64::from(row) / 40.0).sin()).min(brim);
        for row in 0..600_u32 {
            let here = if asleep.contains(&row) { asleep.start } else { row };
            writeln!(text, "{row},{:.6}", level(here)).expect("a string takes it");
        }
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        Scene::new(&recording, "level_v", &BTreeMap::new()).expect("recorded")
    }

    fn dropped(brim: f64, asleep: std::ops::Range<u32>) -> usize {
        let mut scene = scene(brim, asleep);
        let (simulated, measured) = (vec![1.0; scene.rows()], scene.usable_rows().to_vec());
        exclude_faulty_rows(&mut scene, &simulated, &measured)
            .iter()
            .filter(|fault| fault.kind == FaultKind::Dropouts)
            .map(|fault| fault.rows)
            .sum()
    }

    #[test]
    fn what_stands_at_a_stop_is_no_dropout() {
        assert_eq!(dropped(10.9, 0..0), 0);
    }

    #[test]
    fn a_meter_that_sleeps_is_one() {
        assert_eq!(dropped(20.0, 100..112), 11);
        assert_eq!(dropped(10.9, 100..112), 11);
    }
}
