//! The columns of a scene: gaps are filled first, and products of inputs are formed of what is complete.

use super::Scene;
use recording::{Cells, DERIVABLE, Numbers, OF_OTHER_ROWS, Recording, Words, derive_quantity};
use std::ops::Range;

/// Rows without a word, one after the other, beyond which the word is not known any more.
const WORD_GAP_MAX: usize = 3;
/// What they follow from.
const SOURCES: [&str; 9] = [
    "run",
    "tool",
    "engaged",
    "spindle_speed_rpm",
    "feed_mm_min",
    "depth_of_cut_mm",
    "width_of_cut_mm",
    "diameter_mm",
    "teeth",
];

impl Scene {
    pub(super) fn read_columns(&mut self, recording: &Recording) {
        // What products follow from: as recorded, and without its gaps.
        let mut recorded = Recording::new("", recording.time_s.clone(), recording.start_ns);
        let mut complete = recorded.clone();
        for column in recording.columns().iter().filter(|column| SOURCES.contains(&column.name.as_str())) {
            recorded.set_column(&column.name, column.cells.clone());
        }
        for column in recording.columns() {
            match &column.cells {
                Cells::Numbers(numbers) if numbers.count_present() > 0 => {
                    let values = fill_by_holding(numbers, &self.runs);
                    if !DERIVABLE.contains(&column.name.as_str()) {
                        self.keep_column(&column.name, &values, numbers, |_| true);
                    }
                    complete.set_column(&column.name, Cells::Numbers(Numbers::from_values(values)));
                }
                Cells::Words(words) if !words.words().is_empty() => {
                    let filled = fill_short_gaps(words, &self.runs);
                    self.filled_rows.insert(column.name.clone(), filled.gaps);
                    complete.set_column(&column.name, Cells::Words(filled.words.clone()));
                    self.words.insert(column.name.clone(), filled.words);
                }
                _ => {}
            }
        }
        for name in DERIVABLE {
            self.read_derivable_column(name, recording.find_numbers(name), &mut recorded, &mut complete);
        }
    }

    /// A quantity that follows from others: as recorded, and where it was not from the inputs without their gaps.
    fn read_derivable_column(
        &mut self,
        name: &str,
        given: Option<&Numbers>,
        recorded: &mut Recording,
        complete: &mut Recording,
    ) {
        let given = given.filter(|numbers| numbers.count_present() > 0);
        let follows = derive_quantity(complete, name);
        let (cells, told) = match (given, &follows) {
            (None, None) => return,
            (None, Some(follows)) => (follows.clone(), derive_quantity(recorded, name).unwrap_or_default()),
            (Some(given), Some(follows)) if !OF_OTHER_ROWS.contains(&name) => {
                let cells = (0..self.rows).map(|row| given.get(row).or_else(|| follows.get(row))).collect();
                (cells, given.clone())
            }
            (Some(given), _) => (given.clone(), given.clone()),
        };
        // Without a single value there is no such column: a spindle that stands all the time has no feed per turn.
        if cells.count_present() == 0 {
            return;
        }
        // What no input can tell, such as a feed per turn at standstill, is no filled value.
        let is_defined = |row: usize| follows.as_ref().is_none_or(|follows| follows.get(row).is_some());
        self.keep_column(name, &fill_by_holding(&cells, &self.runs), &told, is_defined);
        recorded.set_column(name, Cells::Numbers(told));
        complete.set_column(name, Cells::Numbers(cells));
    }

    /// Keeps a column without gaps, and which rows of it `told` does not hold.
    fn keep_column(&mut self, name: &str, values: &[f64], told: &Numbers, is_defined: impl Fn(usize) -> bool) {
        let absent: Vec<bool> = (0..self.rows).map(|row| told.get(row).is_none()).collect();
        let filled = (0..self.rows).filter(|row| absent[*row] && is_defined(*row)).collect();
        self.filled_rows.insert(name.to_owned(), filled);
        self.absent.insert(name.to_owned(), absent);
        self.columns.insert(name.to_owned(), values.to_vec());
    }
}

fn fill_by_holding(values: &Numbers, runs: &[Range<usize>]) -> Vec<f64> {
    let mut filled = vec![0.0; values.len()];
    for run in runs {
        let mut last = run.clone().find_map(|row| values.get(row)).unwrap_or(0.0);
        for row in run.clone() {
            last = values.get(row).unwrap_or(last);
            filled[row] = last;
        }
    }
    filled
}

/// A column of words without its short gaps.
struct FilledWords {
    words: Words,
    /// The rows that were filled.
    gaps: Vec<usize>,
}

/// A word that is missing for a few rows of a run is the one before them, at the head of a run the one after.
fn fill_short_gaps(words: &Words, runs: &[Range<usize>]) -> FilledWords {
    let mut sources: Vec<usize> = (0..words.len()).collect();
    let mut gaps = Vec::new();
    for run in runs {
        let mut row = run.start;
        while row < run.end {
            let end = (row..run.end).find(|row| words.find_code(*row).is_some()).unwrap_or(run.end);
            if (1..=WORD_GAP_MAX).contains(&(end - row)) && end - row < run.len() {
                let from = if row > run.start { row - 1 } else { end };
                sources[row..end].fill(from);
                gaps.extend(row..end);
            }
            row = end + 1;
        }
    }
    let words = words.at_rows(sources.into_iter());
    FilledWords { words, gaps }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::read_csv;
    use std::collections::BTreeMap;

    #[test]
    fn a_product_across_a_gap_is_that_of_the_row_and_is_marked() {
        let text = "time_s,spindle_power_w,spindle_speed_rpm,feed_mm_min,depth_of_cut_mm,diameter_mm,tool\n\
                    0,1,1000,12000,2,50,T1\n1,1,1000,200,,50,\n2,1,1000,200,2,50,T1\n3,1,0,0,2,50,T1\n";
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        let scene = Scene::new(&recording, "spindle_power_w", &BTreeMap::new()).expect("recorded");
        let rate = scene.column("removal_rate_cm3_min").expect("derived");
        assert!((rate[1] - rate[2]).abs() < 1e-12 && rate[0] > 50.0 * rate[1], "{rate:?}");
        assert_eq!(scene.filled_rows("depth_of_cut_mm"), [1]);
        assert_eq!(scene.filled_rows("removal_rate_cm3_min"), [1]);
        assert_eq!(scene.filled_rows("feed_per_rev_mm"), [0_usize; 0], "at standstill there is none");
        assert_eq!(
            (scene.text_column("tool").and_then(|tool| tool.get(1)), scene.filled_rows("tool")),
            (Some("T1"), &[1][..])
        );
    }
}
