//! Columns of several clocks in one file, brought onto one: that of the slowest series that still is within a tenth of the fastest. Each value is
//! taken at its times: interpolated between neighbours, flags and words held. Nothing is averaged: a mean over a step would look like a slow meter.

use super::note::{Note, NoteKind};
use crate::{Cells, Numbers, Recording, Words};

/// A series with less than this share of the samples of the longest one does not give the clock.
const SLOW_SHARE: usize = 10;
/// A value is not interpolated over more than so many of its usual steps.
const GAP_STEPS: f64 = 2.5;

/// One recording of all of them. `together`: what stands in a row was measured together, whatever the clocks say.
pub(super) fn merge_blocks(mut blocks: Vec<Recording>, together: bool, notes: &mut Vec<Note>) -> Recording {
    if blocks.len() < 2 {
        return blocks.pop().unwrap_or_default();
    }
    let same_clock =
        blocks.windows(2).all(|pair| pair[0].start_ns == pair[1].start_ns && pair[0].time_s == pair[1].time_s);
    let same_rows = blocks.windows(2).all(|pair| pair[0].count_rows() == pair[1].count_rows());
    if same_clock || together && same_rows {
        let mut first = blocks.remove(0);
        for column in blocks.iter().flat_map(|block| block.columns()) {
            first.set_column(&column.name, column.cells.clone());
        }
        return first;
    }
    blocks.retain(|block| block.count_rows() > 0);
    let most = blocks.iter().map(Recording::count_rows).max().unwrap_or(0);
    let axis = (0..blocks.len())
        .filter(|index| SLOW_SHARE * blocks[*index].count_rows() >= most)
        .min_by_key(|index| blocks[*index].count_rows());
    let Some(axis) = axis else { return Recording::default() };
    note_clocks(&blocks, axis, same_rows, notes);
    let mut merged = Recording::new(blocks[axis].source.clone(), blocks[axis].time_s.clone(), blocks[axis].start_ns);
    for (index, block) in blocks.iter().enumerate() {
        let shift_s = shift_s(&blocks[axis], block);
        for column in block.columns() {
            let cells = if index == axis {
                column.cells.clone()
            } else {
                bring_onto(&merged.time_s, block, &column.cells, shift_s)
            };
            merged.set_column(&column.name, cells);
        }
    }
    merged
}

/// What is added to the times of a block so that they count on the clock of the axis.
#[expect(
    clippy::cast_precision_loss,
    reason = "a double counts nanoseconds exactly over 104 days, microseconds beyond"
)]
fn shift_s(axis: &Recording, block: &Recording) -> f64 {
    match (axis.start_ns, block.start_ns) {
        (Some(axis_ns), Some(block_ns)) => (block_ns - axis_ns) as f64 / 1e9,
        _ => 0.0,
    }
}

fn note_clocks(blocks: &[Recording], axis: usize, same_rows: bool, notes: &mut Vec<Note>) {
    let count = blocks.len();
    let name = blocks[axis].columns().first().map_or("", |column| column.name.as_str());
    notes.push(Note::new(
        NoteKind::Assumption,
        format!("{count} clocks in the file: brought onto that of {name}, each value taken at its times"),
        format!("文件中有{count}个时钟：统一到{name}的时钟，各值取该时刻的值"),
    ));
    let length = |block: &Recording| block.time_s.last().unwrap_or(&0.0) - block.time_s.first().unwrap_or(&0.0);
    let (short, long) =
        blocks.iter().map(length).fold((f64::INFINITY, 0.0_f64), |(short, long), x| (short.min(x), long.max(x)));
    if same_rows && short > 0.0 && long / short > 1.001 {
        let percent = 100.0 * (long / short - 1.0);
        notes.push(Note::new(
            NoteKind::Doubt,
            format!(
                "the clocks have as many rows each and differ by {percent:.1} % in length: one of them may run fast. If what stands in a row was measured \
                 together, say so in a map ([time] clocks = \"rows\")"
            ),
            format!("各时钟行数相同而长度相差{percent:.1} %：其中之一可能走快。若同一行为同时测得，请在映射文件中指定（[time] clocks = \"rows\"）"),
        ));
    }
}

fn bring_onto(axis: &[f64], block: &Recording, cells: &Cells, shift_s: f64) -> Cells {
    let times: Vec<f64> = block.time_s.iter().map(|time_s| time_s + shift_s).collect();
    match cells {
        Cells::Words(words) => {
            let mut held = Words::default();
            axis.iter()
                .for_each(|at_s| held.push(last_before(&times, *at_s).and_then(|row| words.get(row)).unwrap_or("")));
            Cells::Words(held)
        }
        Cells::Numbers(numbers) => Cells::Numbers(resample_numbers(axis, &times, numbers)),
    }
}

fn last_before(times: &[f64], at_s: f64) -> Option<usize> {
    times.partition_point(|time_s| *time_s <= at_s + 1e-9).checked_sub(1)
}

/// Middle step of time that goes forward.
pub(super) fn usual_step(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

fn resample_numbers(axis: &[f64], times: &[f64], numbers: &Numbers) -> Numbers {
    let present: Vec<usize> = (0..times.len()).filter(|row| numbers.get(*row).is_some()).collect();
    let own: Vec<f64> = present.iter().map(|row| times[*row]).collect();
    let values: Vec<f64> = present.iter().filter_map(|row| numbers.get(*row)).collect();
    let step = usual_step(&own);
    let is_flag = values.iter().all(|value| *value == 0.0 || *value == 1.0);
    axis.iter()
        .map(|at_s| {
            if is_flag {
                last_before(&own, *at_s).map(|row| values[row])
            } else {
                interpolate_at(&own, &values, *at_s, GAP_STEPS * step)
            }
        })
        .collect()
}

fn interpolate_at(times: &[f64], values: &[f64], at_s: f64, gap_s: f64) -> Option<f64> {
    let after = times.partition_point(|time_s| *time_s < at_s - 1e-9);
    if times.get(after).is_some_and(|time_s| (time_s - at_s).abs() < 1e-9) {
        return Some(values[after]);
    }
    let before = after.checked_sub(1)?;
    let length = times.get(after)? - times[before];
    (length <= gap_s).then(|| values[before] + (values[after] - values[before]) * (at_s - times[before]) / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(times: &[f64], name: &str, values: &[f64]) -> Recording {
        let mut recording = Recording::new("t", times.to_vec(), None);
        recording.set_column(name, Cells::Numbers(Numbers::from_values(values.to_vec())));
        recording
    }

    #[test]
    fn the_slower_clock_is_kept_and_the_faster_values_are_taken_at_its_times() {
        let slow = block(&[0.0, 1.0, 2.0], "slow", &[1.0, 2.0, 3.0]);
        let fast = block(
            &[0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0],
            "fast",
            &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0],
        );
        let mut notes = Vec::new();
        let merged = merge_blocks(vec![fast, slow], false, &mut notes);
        assert_eq!(merged.time_s, [0.0, 1.0, 2.0]);
        let fast: Vec<_> = merged.find_numbers("fast").expect("kept").iter().flatten().collect();
        assert_eq!(fast, [0.0, 4.0, 8.0]);
        assert!(notes[0].text.en.contains("2 clocks"));
    }

    #[test]
    fn equal_clocks_are_one() {
        let a = block(&[0.0, 1.0], "a", &[1.0, 2.0]);
        let b = block(&[0.0, 1.0], "b", &[3.0, 4.0]);
        let mut notes = Vec::new();
        assert_eq!(merge_blocks(vec![a, b], false, &mut notes).columns().len(), 2);
        assert!(notes.is_empty());
        let a = block(&[0.0, 1.0], "a", &[1.0, 2.0]);
        let late = block(&[0.0, 1.1], "b", &[3.0, 4.0]);
        assert_eq!(merge_blocks(vec![a, late], true, &mut notes).find_numbers("b").and_then(|b| b.get(1)), Some(4.0));
    }
}
