//! `parquet:DIRECTORY`: every night the finished day as files of columns, for a data lake. The machine is its path, where it has one.
//!
//! The outbox only tells that time goes on: when an item of a new UTC day comes, and at every connection, the days before it that
//! have no file yet are written from the history (see [`Reader::export_day`]). So a box that was off, or a directory that was
//! away, is made up for as long as the history holds the days.

use super::target_error::TargetError;
use super::{Batch, Pending, Sink, SinkError};
use adapter_core::address::Keys;
use adapter_core::clock::TimeNs;
use gateway_base::machine_path::MachinePath;
use gateway_history::{DAY_NS, HistoryError, Outbox, Reader, day_of};
use std::path::{Path, PathBuf};

/// The directory of the files, and how far back missing ones are made up for.
#[derive(Debug, Clone, PartialEq)]
pub struct ParquetTarget {
    /// The directory that holds `samples` and `diagnoses`.
    pub root: PathBuf,
    /// How many days back a missing file is made up for.
    pub days: u32,
}

impl ParquetTarget {
    pub(super) fn parse(body: &str, keys: &mut Keys) -> Result<Self, TargetError> {
        let days = keys.take_number("days", 31, 1, 3660);
        let path = body.strip_prefix("//").unwrap_or(body);
        if path.is_empty() {
            return Err(TargetError::NoDirectory);
        }
        Ok(Self { root: PathBuf::from(path), days })
    }

    /// Can the directory be written to, where it is there already? Otherwise what is wrong and what to do.
    #[must_use]
    pub fn find_file_problems(&self) -> Vec<(String, String)> {
        let tried = if self.root.exists() { try_write(&self.root) } else { Ok(()) };
        tried.err().map(|error| describe_unwritable(&self.root, &error)).into_iter().collect()
    }
}

fn try_write(root: &Path) -> std::io::Result<()> {
    let file = root.join(format!(".{}", adapter_core::unique_id::generate_unique_id()));
    std::fs::write(&file, b"").and_then(|()| std::fs::remove_file(&file))
}

fn describe_unwritable(root: &Path, error: &std::io::Error) -> (String, String) {
    let next = "make it writable for the gateway's user, mount what belongs there, or write another directory";
    (format!("the directory {} cannot be written to: {error}", root.display()), next.to_owned())
}

pub(super) struct ParquetSink {
    target: ParquetTarget,
    outbox: Outbox,
    history: PathBuf,
    /// The day that is not finished; the days before it are written.
    today_ns: Option<TimeNs>,
}

impl ParquetSink {
    pub(super) fn new(target: ParquetTarget, outbox: &Outbox, history: &Path) -> Self {
        Self { target, outbox: outbox.clone(), history: history.to_owned(), today_ns: None }
    }

    /// Writes what is missing of the days before `today_ns`.
    async fn finish_days(&mut self, today_ns: TimeNs) -> Result<(), SinkError> {
        let (target, history, machine) = (
            self.target.clone(),
            self.history.clone(),
            self.outbox.path().map_or_else(|| self.outbox.machine().to_owned(), MachinePath::format_topic),
        );
        let root = self.target.root.clone();
        let work = tokio::task::spawn_blocking(move || write_missing(&target, &history, &machine, today_ns));
        let done = work.await.map_err(|error| SinkError::failed_line(format!("writing a day ended: {error}"), ""))?;
        done.map_err(|error| match error {
            HistoryError::Io { error, .. } => {
                let (what, next) = describe_unwritable(&root, &error);
                SinkError::failed_line(what, next)
            }
            other => {
                SinkError::failed_line(format!("a day cannot be read from the history: {other}"), "see `history info`")
            }
        })?;
        self.today_ns = Some(today_ns);
        Ok(())
    }
}

fn write_missing(target: &ParquetTarget, history: &Path, machine: &str, today_ns: TimeNs) -> Result<(), HistoryError> {
    let reader = Reader::open(history)?;
    let Some((first_ns, _)) = reader.read_span()? else { return Ok(()) };
    let mut day_ns = day_of(first_ns).max(today_ns - i64::from(target.days) * DAY_NS);
    while day_ns < today_ns {
        if !reader.has_day_file(&target.root, day_ns)? {
            reader.export_day(&target.root, machine, day_ns)?;
        }
        day_ns += DAY_NS;
    }
    Ok(())
}

impl Sink for ParquetSink {
    fn connect(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async move {
            self.today_ns = None;
            let root = &self.target.root;
            std::fs::create_dir_all(root).and_then(|()| try_write(root)).map_err(|error| {
                let (what, next) = describe_unwritable(root, &error);
                SinkError::failed_line(what, next)
            })
        })
    }

    fn send_batch<'a>(&'a mut self, batch: Batch<'a>) -> Pending<'a, Result<(), SinkError>> {
        Box::pin(async move {
            let newest_ns = batch.items.iter().map(|item| item.at_ns).max().map(day_of);
            match newest_ns.filter(|day_ns| self.today_ns.is_none_or(|today_ns| *day_ns > today_ns)) {
                Some(today_ns) => self.finish_days(today_ns).await,
                None => Ok(()),
            }
        })
    }
}
