//! Rows that share a stamp because the file rounds its times.

use super::merge::usual_step;
use super::note::{Note, NoteKind};
use std::ops::Range;

/// Repeated stamps are spread when at least this share of the rows stands in such groups.
const REPEATED_SHARE: f64 = 0.6;

/// Stamps rounded to whole seconds with several rows each: the rows are spread evenly between one stamp and the next.
pub(super) fn spread_stamps(times: &mut [f64], notes: &mut Vec<Note>) {
    #[expect(clippy::float_cmp, reason = "the same stamp")]
    let stands_again = |row: &usize| {
        *row > 0 && times[*row] == times[*row - 1] || times.get(*row + 1).is_some_and(|next| *next == times[*row])
    };
    let repeated = (0..times.len()).filter(stands_again).count();
    #[expect(clippy::cast_precision_loss, reason = "numbers of rows are far below 2^53")]
    if (repeated as f64) < REPEATED_SHARE * times.len() as f64 {
        return;
    }
    let mut groups: Vec<Range<usize>> = Vec::new();
    for row in 0..times.len() {
        match groups.last_mut() {
            #[expect(clippy::float_cmp, reason = "the same stamp")]
            Some(group) if times[group.start] == times[row] => group.end = row + 1,
            _ => groups.push(row..row + 1),
        }
    }
    if groups.len() < 3 {
        return;
    }
    let mut sizes: Vec<usize> = groups.iter().map(Range::len).collect();
    sizes.sort_unstable();
    let usual = sizes[sizes.len() / 2];
    let step = usual_step(times);
    let inner = &groups[1..groups.len() - 1];
    let is_even = inner.iter().all(|group| group.len().abs_diff(usual) <= 1 + usual / 10);
    let stamps: Vec<f64> = groups.iter().map(|group| times[group.start]).collect();
    let goes_on = stamps.windows(2).all(|pair| pair[1] > pair[0]);
    if !is_even || !goes_on || step <= 0.0 {
        return;
    }
    #[expect(clippy::cast_precision_loss, reason = "some rows of one stamp")]
    for (index, group) in groups.iter().enumerate() {
        let size = group.len() as f64;
        // The first group may have begun before the file did.
        let missing = if index == 0 && group.len() < usual { usual as f64 - size } else { 0.0 };
        let part = step / if index == 0 || index + 1 == groups.len() { size.max(usual as f64) } else { size };
        for (place, row) in group.clone().enumerate() {
            times[row] = stamps[index] + (missing + place as f64) * part;
        }
    }
    notes.push(Note::new(
        NoteKind::Assumption,
        format!("{usual} rows have the same stamp: they are spread evenly until the next one, {step} s later"),
        format!("每个时间戳有{usual}行：在到下一时间戳的{step} s内均匀分布"),
    ));
}
