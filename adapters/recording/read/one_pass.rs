//! The quick way through a table. Its first rows say what its columns probably are; one pass then takes all rows under that plan and counts every
//! cell beside it. What the columns are is decided afterwards, with all of the file known: where that is another plan than the guess, what
//! was taken is thrown away. So a guess costs time and never changes a result.

use super::assemble::{Assembled, Assembler};
use super::error::RecordingError;
use super::head::Head;
use super::mapping::Mapping;
use super::plan::BlockPlan;
use super::row_class::{RowClass, classify_row};
use super::survey::{Survey, survey_table};
use super::table::{Table, VisitStep};
use super::understand::build_plan;

/// Rows of data that make a guess.
const GUESS_ROWS: usize = 400;

/// A whole table, counted.
pub(super) struct CountedTable {
    pub(super) survey: Survey,
    pub(super) rows: Option<TakenRows>,
}

/// The rows of a table under a guess.
pub(super) struct TakenRows {
    guess: Vec<BlockPlan>,
    recordings: Assembled,
}

impl TakenRows {
    /// The rows, where the plan is the one that was guessed.
    pub(super) fn take_under(self, blocks: &[BlockPlan]) -> Option<Assembled> {
        (self.guess == blocks).then_some(self.recordings)
    }
}

/// Counts every cell, and takes the rows with it where the first ones say what the table is.
pub(super) fn count_cells(
    table: &dyn Table,
    head: &Head,
    mapping: &Mapping,
    file: &str,
) -> Result<CountedTable, RecordingError> {
    let guess = guess_blocks(table, head, mapping, file);
    match guess.and_then(|guess| read_under_guess(table, head, guess, mapping, file)) {
        Some(counted) => Ok(counted),
        None => Ok(CountedTable { survey: survey_table(table, head)?, rows: None }),
    }
}

/// `None` where the rows come to an error, as they may under a wrong guess.
fn read_under_guess(
    table: &dyn Table,
    head: &Head,
    guess: Vec<BlockPlan>,
    mapping: &Mapping,
    file: &str,
) -> Option<CountedTable> {
    let mut survey = Survey::new(head);
    let mut assembler = Assembler::new(&guess, head, file);
    let short = table.may_be_short() || head.short;
    let mut plain = Vec::with_capacity(head.names.len());
    let visited = table.visit_rows(&mut |row| {
        let class = classify_row(row, head, short);
        if let RowClass::Data(cells) = class {
            survey.record_row(row.line, cells, &mut plain);
        }
        assembler.take_row(row, class, &plain)?;
        Ok(VisitStep::Next)
    });
    visited.ok()?;
    let recordings = assembler.finish_recordings(mapping);
    Some(CountedTable { survey, rows: Some(TakenRows { guess, recordings }) })
}

/// What the first rows say of the columns.
fn guess_blocks(table: &dyn Table, head: &Head, mapping: &Mapping, file: &str) -> Option<Vec<BlockPlan>> {
    let first = survey_first_rows(table, head).ok()?;
    build_plan(head, &first, mapping, file).ok().map(|plan| plan.blocks)
}

fn survey_first_rows(table: &dyn Table, head: &Head) -> Result<Survey, RecordingError> {
    let mut survey = Survey::new(head);
    let short = table.may_be_short() || head.short;
    let (mut plain, mut rows) = (Vec::new(), 0);
    table.visit_rows(&mut |row| {
        if let RowClass::Data(cells) = classify_row(row, head, short) {
            survey.record_row(row.line, cells, &mut plain);
            rows += 1;
        }
        Ok(if rows < GUESS_ROWS { VisitStep::Next } else { VisitStep::Enough })
    })?;
    Ok(survey)
}
