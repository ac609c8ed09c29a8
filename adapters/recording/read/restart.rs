//! Time that begins again in the middle of a file: several tests one after the other, of which each becomes a run.

use super::note::{Note, NoteKind};
use crate::Words;

pub(super) fn note_restarts(count: usize, notes: &mut Vec<Note>) {
    if count > 0 {
        notes.push(Note::new(
            NoteKind::Assumption,
            format!("time begins again {count} times; a new run begins there, as the map says"),
            format!("时间重新开始{count}次；按映射文件，每次为新的一次运行（run）"),
        ));
    }
}

/// The stretches, divided at these rows.
pub(super) fn divide_at(stretches: Vec<std::ops::Range<usize>>, rows: &[usize]) -> Vec<std::ops::Range<usize>> {
    let mut found = Vec::new();
    for stretch in stretches {
        let mut start = stretch.start;
        for row in rows.iter().copied().filter(|row| stretch.contains(row) && *row > stretch.start) {
            found.push(start..row);
            start = row;
        }
        found.push(start..stretch.end);
    }
    found
}

/// The runs where a new one begins with each restart of the clock: numbered, behind the name that the file gives them.
pub(super) fn name_runs(named: Option<&Words>, restarts: &[usize], kept: &[bool]) -> Words {
    let (mut runs, mut place, mut number) = (Words::default(), 0, 1);
    for (row, is_kept) in kept.iter().enumerate() {
        number += usize::from(restarts.binary_search(&row).is_ok());
        if !is_kept {
            continue;
        }
        match named.and_then(|named| named.get(place)) {
            Some(name) => runs.push(&format!("{name}.{number}")),
            None => runs.push(&number.to_string()),
        }
        place += 1;
    }
    runs
}
