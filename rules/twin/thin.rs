//! Recordings that are longer than a comparison needs: every so many rows of each run are compared. Evidence counts no more than
//! some thousand rows (`evidence/gram.rs`), and each of them takes ten kilobytes while every law stands beside it.

use adapter_core::bilingual::Bilingual;
use recording::{Cells, OF_OTHER_ROWS, Recording, derive_quantity};

/// Rows that are compared, at most: a shift of eight hours at one row in a second. Ten kilobytes each are three hundred megabytes, which the
/// process has that diagnoses a file. Of fewer nothing is left out.
const ROWS_MAX: usize = 30_000;

/// The rows that are compared.
#[derive(Debug)]
pub struct ThinnedRecording {
    /// With the columns that a model or an effect may read.
    pub recording: Recording,
    /// Where each of its rows stands in the whole.
    pub rows: Vec<usize>,
    /// One row of so many.
    pub every: usize,
}

/// The rows of a long recording that are compared; `None` of one that is compared as a whole.
#[must_use]
pub fn thin_recording(whole: &Recording) -> Option<ThinnedRecording> {
    let every = whole.count_rows().div_ceil(ROWS_MAX);
    if every < 2 {
        return None;
    }
    let rows: Vec<usize> = whole.list_runs().into_iter().flat_map(|run| run.rows.step_by(every)).collect();
    let mut recording =
        Recording::new(whole.source.clone(), rows.iter().map(|row| whole.time_s[*row]).collect(), whole.start_ns);
    if !whole.pauses_known() {
        recording.forget_pauses();
    }
    // Why a value is missing is nothing that an effect reads.
    for column in whole.columns().iter().filter(|column| !column.name.ends_with("_missing")) {
        recording.set_column(&column.name, column.cells.take_rows(&rows));
    }
    for name in OF_OTHER_ROWS {
        if whole.find_numbers(name).is_none_or(|numbers| numbers.count_present() == 0)
            && let Some(numbers) = derive_quantity(whole, name)
        {
            recording.set_column(name, Cells::Numbers(numbers).take_rows(&rows));
        }
    }
    Some(ThinnedRecording { recording, rows, every })
}

impl ThinnedRecording {
    /// What a reader of the report has to know.
    #[must_use]
    pub fn describe_thinning(&self, whole: usize) -> Bilingual {
        let (every, kept) = (self.every, self.rows.len());
        Bilingual::new(
            format!("{whole} rows, of each run one in {every} compared ({kept} rows)"),
            format!("共{whole}行，每个批次每{every}行比较一行（{kept}行）"),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::{Numbers, Words};

    #[test]
    fn of_a_long_recording_every_run_is_thinned_and_what_lies_between_is_counted() {
        let rows = 3 * ROWS_MAX;
        let mut whole = Recording::new("t", (0..rows).map(|row| row as f64).collect(), None);
        let run = |row: usize| if row < ROWS_MAX { "a" } else { "b" };
        whole.set_column("run", Cells::Words((0..rows).map(run).collect::<Words>()));
        whole.set_column("engaged", Cells::Numbers(Numbers::from_values(vec![1.0; rows])));
        whole.set_column("spindle_power_w_missing", Cells::Words(Words::default()));
        let thinned = thin_recording(&whole).expect("it is long");
        assert_eq!((thinned.every, thinned.rows.len()), (3, ROWS_MAX));
        assert_eq!(thinned.recording.list_runs().len(), 2);
        assert_eq!(thinned.recording.columns().len(), 3);
        let minutes = thinned.recording.find_numbers("cutting_time_min").and_then(|minutes| minutes.get(10));
        assert!(
            minutes.is_some_and(|it| (it - 0.5).abs() < 1e-9),
            "thirty seconds in the cut at the eleventh row: {minutes:?}"
        );
        assert!(thin_recording(&thinned.recording).is_none());
    }
}
