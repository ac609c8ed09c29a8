//! From stored columns to samples.

use adapter_core::clock::TimeNs;
use adapter_core::{Absence, ChannelId, Sample, Slot, Value};
use gateway_history::{Cells, Chunk, HistoryError, Reader};

/// The series of a history that are channels; estimates are inferred anew.
pub(super) fn list_channels(reader: &Reader) -> Result<Vec<String>, HistoryError> {
    let series = reader.read_series()?.into_iter().map(|series| series.name.to_string());
    Ok(series.filter(|name| ChannelId::from_name(name).is_some()).collect())
}

/// Goes through chunks; remembers the last row that was handed on.
pub(super) struct ChunkRows {
    every_ns: i64,
    last_ns: Option<TimeNs>,
}

impl ChunkRows {
    /// Rows closer together than `every_ns` are left out.
    pub(super) fn new(every_ns: i64) -> Self {
        Self { every_ns, last_ns: None }
    }

    /// Hands every row on as a sample, in the order of time; a row from before the last one is left out.
    pub(super) fn for_each_sample(&mut self, chunk: &Chunk<'_>, mut take: impl FnMut(&Sample)) {
        let ids: Vec<Option<ChannelId>> =
            chunk.series.iter().map(|series| ChannelId::from_name(&series.name)).collect();
        let mut sample = Sample::new_empty(0);
        for (row, at_ns) in chunk.at_ns.iter().enumerate() {
            // A hundredth of the pace does not make a row wait for the next one.
            let due = |last_ns: TimeNs| *at_ns - last_ns >= (self.every_ns - self.every_ns / 100).max(1);
            if !self.last_ns.is_none_or(due) {
                continue;
            }
            self.last_ns = Some(*at_ns);
            sample.at_ns = *at_ns;
            for (column, id) in ids.iter().enumerate() {
                if let Some(id) = id {
                    sample.set_slot(*id, Slot { value: read_value(chunk, column, row), age_ns: 0 });
                }
            }
            take(&sample);
        }
    }
}

fn read_value(chunk: &Chunk<'_>, column: usize, row: usize) -> Result<Value, Absence> {
    if let Some(word) = chunk.missing_reason(column, row) {
        return Err(Absence::from_word(word).unwrap_or(Absence::NotRecorded));
    }
    match &chunk.columns[column] {
        Cells::Numbers(cells) => Value::from_number(cells.values[row]),
        Cells::Words(cells) => {
            let word = cells.codes.get(row).and_then(|code| cells.words.get(usize::try_from(*code).ok()?));
            word.map(|word| Value::Text(word.clone())).ok_or(Absence::NotRecorded)
        }
    }
}
