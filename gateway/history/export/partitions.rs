//! Days as files for a data lake: `ROOT/samples/machine=M/date=D/BOX.parquet`, and beside it
//! `ROOT/diagnoses/machine=M/date=D/BOX.parquet`.
//!
//! The layout is that of Hive, which `DuckDB`, `ClickHouse`, Spark and pandas read as two further columns. Days are those of
//! UTC. The file has the name of the box: two boxes whose machines have the same name do not overwrite each other. It appears whole or
//! not at all: it is written under another name first. Units and the name of the machine stand in the metadata of the file as
//! `unit.<column>` and `machine`.

use super::super::error::{HistoryError, add_path};
use super::super::list::RecordSpan;
use super::super::options::DAY_NS;
use super::super::outbox::known_box_id;
use super::super::query::Query;
use super::super::reader::Reader;
use super::parquet;
use adapter_core::clock::TimeNs;
use adapter_core::percent::escape_percent;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// What a day brought.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DayWritten {
    /// Rows in the file of samples.
    pub samples: u64,
    /// Rows in the file of diagnoses.
    pub diagnoses: u64,
}

/// Beginning of the UTC day that holds this time.
#[must_use]
pub fn day_of(at_ns: TimeNs) -> TimeNs {
    at_ns.div_euclid(DAY_NS) * DAY_NS
}

/// Letters, digits, `-`, `_` and `.` stay; every other byte is escaped with `%`, as Hive does.
fn escape_name(name: &str) -> String {
    escape_percent(name, b"-_.")
}

/// The directory of a machine for one kind of rows.
fn machine_directory(root: &Path, kind: &str, machine: &str) -> PathBuf {
    root.join(kind).join(format!("machine={}", escape_name(machine)))
}

/// The file of a box and day below the directory of a machine.
fn day_file(machine: PathBuf, box_id: &str, day_ns: TimeNs) -> PathBuf {
    let date: String = gateway_base::moment::format_utc(day_ns).chars().take(10).collect();
    machine.join(format!("date={date}")).join(format!("{}.parquet", escape_name(box_id)))
}

impl Reader {
    /// The name of the box that keeps this history; `local` where it has none, because it has never sent anything.
    fn box_name(&self) -> Result<String, HistoryError> {
        Ok(known_box_id(&self.db)?.unwrap_or_else(|| "local".to_owned()))
    }

    /// Are the samples of this day in the lake already, under whatever machine? One that was named anew or moved to another place keeps the days
    /// that it had written.
    ///
    /// # Errors
    /// What `SQLite` says, or the directory cannot be read.
    pub fn has_day_file(&self, root: &Path, day_ns: TimeNs) -> Result<bool, HistoryError> {
        let (samples, box_id) = (root.join("samples"), self.box_name()?);
        if !samples.exists() {
            return Ok(false);
        }
        let machines = fs::read_dir(&samples).map_err(add_path(&samples))?.filter_map(Result::ok);
        Ok(machines.into_iter().any(|machine| day_file(machine.path(), &box_id, day_ns).exists()))
    }

    /// Writes the files of the UTC day that begins at `day_ns`; an older file of that day is replaced. Without samples there
    /// is no file of samples, without a diagnosis none of diagnoses.
    ///
    /// # Errors
    /// As [`Reader::export_to_file`].
    pub fn export_day(&self, root: &Path, machine: &str, day_ns: TimeNs) -> Result<DayWritten, HistoryError> {
        let mut written = DayWritten::default();
        let box_id = self.box_name()?;
        let file = |kind: &str| day_file(machine_directory(root, kind, machine), &box_id, day_ns);
        let query = Query::between(day_ns, day_ns + DAY_NS);
        if self.has_samples(&query)? {
            let _view = self.begin_view()?;
            let plan = self.plan_columns(&query)?;
            let about = [("machine".to_owned(), machine.to_owned())];
            written.samples =
                write_whole_file(&file("samples"), |out, path| parquet::write(self, &query, &plan, &about, out, path))?;
        }
        let diagnoses = self.read_diagnoses(RecordSpan { from_ns: day_ns, to_ns: day_ns + DAY_NS, limit: u32::MAX })?;
        if !diagnoses.is_empty() {
            written.diagnoses = write_whole_file(&file("diagnoses"), |out, path| {
                parquet::write_diagnoses(&diagnoses, machine, out, path)
            })?;
        }
        Ok(written)
    }

    fn has_samples(&self, query: &Query) -> Result<bool, HistoryError> {
        let mut found = false;
        let one = self.read_series()?.first().map(|series| series.name.to_string());
        self.for_each_chunk(&Query { series: one.into_iter().collect(), ..query.clone() }, |chunk| {
            found = !chunk.at_ns.is_empty();
            std::ops::ControlFlow::Break(())
        })?;
        Ok(found)
    }
}

/// Writes a file under another name, and gives it its own when it is complete.
fn write_whole_file(
    path: &Path,
    write: impl FnOnce(BufWriter<File>, &Path) -> Result<u64, HistoryError>,
) -> Result<u64, HistoryError> {
    let directory = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(directory).map_err(add_path(directory))?;
    let beside = path.with_extension("part");
    let file = File::create(&beside).map_err(add_path(&beside))?;
    let rows = write(BufWriter::with_capacity(1 << 16, file), &beside)?;
    File::open(&beside).and_then(|file| file.sync_all()).map_err(add_path(&beside))?;
    fs::rename(&beside, path).map_err(add_path(path))?;
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_machines_become_names_of_directories() {
        let machine = machine_directory(Path::new("/lake"), "samples", "Lathe 7/车");
        let file = day_file(machine, "Lathe-7-3fa9c1b2d4", 1_769_847_300_100_000_000);
        let text = file.display().to_string();
        assert_eq!(text, "/lake/samples/machine=Lathe%207%2F%E8%BD%A6/date=2026-01-31/Lathe-7-3fa9c1b2d4.parquet");
        assert_eq!(day_of(1_769_847_300_100_000_000) % DAY_NS, 0);
        assert!(day_of(-1) < 0);
    }
}
