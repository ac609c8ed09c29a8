//! Keeping the file in order: the size it may have, a full disk, compaction and ages.

use super::error::{Doing, HistoryError};
use super::lock::append_suffix;
use super::options::Retention;
use super::retention::{AgeLimits, remove_aged, remove_oldest, used_bytes};
use super::space::{Reserve, disk_room};
use super::{compact, seal};
use adapter_core::clock::TimeNs;
use rusqlite::Connection;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How often the free room on disk is looked at.
const LOOK_EVERY: Duration = Duration::from_secs(5);
/// Steps of deleting in one go; each is a transaction of a few milliseconds.
const STEPS_MAX: usize = 8;
/// Bytes of a page, `SQLite`'s default.
const PAGE_BYTES: u64 = 4_096;
/// Pages in the write-ahead log before it is copied back: 4 MB, fewer where the reserve is smaller.
const LOG_PAGES_MAX: u64 = 1_000;
const LOG_PAGES_MIN: u64 = 8;
/// Free pages are given back to the disk in steps of this many.
const VACUUM_PAGES: u32 = 256;

/// The housekeeper of one history.
#[derive(Debug)]
pub(crate) struct Maintenance {
    path: PathBuf,
    retention: Retention,
    reserve: Reserve,
    /// While the disk is short of room: the size at which that was noticed.
    ceiling: Option<u64>,
    looked: Option<Instant>,
    task: Option<MaintenanceStage>,
    /// Raw samples removed since opening.
    pub(crate) retired: u64,
    /// Bytes of the log beside the file, when it was last looked at.
    pub(crate) log_bytes: u64,
}

/// The stages of maintenance.
#[derive(Debug, Clone, PartialEq, Eq)]
enum MaintenanceStage {
    /// Joins blocks; then what is too old at this time goes, where the clock is confirmed.
    Compact(Option<TimeNs>),
    Age(AgeLimits),
    /// Gives blocks of an older version their checksums: so many are left for this run.
    Seal(usize),
    Shrink,
}

impl Maintenance {
    pub(crate) fn new(path: &Path, retention: Retention, reserve_bytes: u64) -> Self {
        let mut reserve = Reserve::new_beside(path, reserve_bytes);
        reserve.claim_space();
        Self {
            path: path.to_owned(),
            retention,
            reserve,
            ceiling: None,
            looked: None,
            task: None,
            retired: 0,
            log_bytes: 0,
        }
    }

    /// Keeps the log so short that the reserve has room for all of it when it must be copied back on a full disk.
    pub(crate) fn bound_log(&self, db: &Connection) -> Result<(), HistoryError> {
        let pages = (self.reserve.bytes() / 2 / PAGE_BYTES).clamp(LOG_PAGES_MIN, LOG_PAGES_MAX);
        db.pragma_update(None, "wal_autocheckpoint", pages as i64).with_activity("bounding the write-ahead log")?;
        // What a reader made it grow beyond that is given back to the disk.
        let bytes = 2 * pages * PAGE_BYTES;
        db.query_row(&format!("PRAGMA journal_size_limit = {bytes}"), [], |_| Ok(()))
            .with_activity("bounding the write-ahead log")
    }

    /// After a commit: looks at the disk now and then, and keeps the file below what it may have. Returns its size.
    pub(crate) fn after_commit(&mut self, db: &mut Connection) -> Result<u64, HistoryError> {
        let mut used = used_bytes(db)?;
        if self.looked.is_none_or(|looked| looked.elapsed() >= LOOK_EVERY) {
            self.looked = Some(Instant::now());
            self.update_ceiling(used);
            self.log_bytes = std::fs::metadata(append_suffix(&self.path, "-wal")).map_or(0, |file| file.len());
        }
        let because = if self.ceiling.is_some() { "the disk is full" } else { "the size limit" };
        for _ in 0..STEPS_MAX {
            if used <= self.limit_bytes() || !self.remove(db, because)? {
                break;
            }
            used = used_bytes(db)?;
        }
        Ok(used)
    }

    /// Is the disk short of room, so that the file may not grow?
    pub(crate) fn is_short(&self) -> bool {
        self.ceiling.is_some()
    }

    fn limit_bytes(&self) -> u64 {
        self.ceiling.unwrap_or(u64::MAX).min(self.retention.max_bytes)
    }

    fn update_ceiling(&mut self, used: u64) {
        let Some(room) = disk_room(&self.path) else { return };
        let keep = self.retention.bytes_kept_free(room);
        if room.free < keep {
            self.ceiling.get_or_insert(used);
        } else if room.free > keep + keep / 4 {
            self.ceiling = None;
            self.reserve.claim_space();
        }
    }

    fn remove(&mut self, db: &mut Connection, because: &str) -> Result<bool, HistoryError> {
        let removed = remove_oldest(db, because)?;
        self.retired += removed.samples;
        Ok(removed.any)
    }

    /// The disk took nothing any more: gives the reserve back, copies the log into the file, and makes room in it.
    pub(crate) fn make_room(&mut self, db: &mut Connection, wanted: u64) -> Result<(), HistoryError> {
        self.reserve.release_space();
        checkpoint_log(db)?;
        let used = used_bytes(db)?;
        let target = used.saturating_sub(wanted.max(used / 50));
        self.ceiling = Some(used);
        for _ in 0..STEPS_MAX {
            if used_bytes(db)? <= target || !self.remove(db, "the disk is full")? {
                break;
            }
        }
        checkpoint_log(db)
    }

    /// Begins maintenance; what is too old at `now_ns` goes, where that is known.
    pub(crate) fn begin_run(&mut self, now_ns: Option<TimeNs>) {
        self.task = Some(MaintenanceStage::Compact(now_ns));
    }

    /// Does a bounded piece of maintenance; false when there is none left.
    pub(crate) fn run_step(&mut self, db: &mut Connection) -> Result<bool, HistoryError> {
        let Some(task) = &self.task else { return Ok(false) };
        let next = match task {
            MaintenanceStage::Compact(now_ns) => match (compact::compact_next(db)?, now_ns) {
                (true, _) => return Ok(true),
                (false, Some(now_ns)) => {
                    Some(MaintenanceStage::Age(AgeLimits::from_retention(db, &self.retention, *now_ns)?))
                }
                (false, None) => Some(MaintenanceStage::Seal(seal::BLOCKS_PER_RUN)),
            },
            MaintenanceStage::Age(limits) => {
                let removed = remove_aged(db, limits)?;
                self.retired += removed.samples;
                match removed.any {
                    true => return Ok(true),
                    false => Some(MaintenanceStage::Seal(seal::BLOCKS_PER_RUN)),
                }
            }
            MaintenanceStage::Seal(left) => {
                match left.checked_sub(seal::seal_next_blocks(db)?).filter(|next| next < left) {
                    Some(left) => Some(MaintenanceStage::Seal(left)),
                    None => Some(MaintenanceStage::Shrink),
                }
            }
            MaintenanceStage::Shrink => shrink_file(db)?.then_some(MaintenanceStage::Shrink),
        };
        self.task = next;
        Ok(self.task.is_some())
    }

    /// Gives maintenance up until it is asked for again.
    pub(crate) fn abandon_run(&mut self) {
        self.task = None;
    }

    pub(crate) fn is_busy(&self) -> bool {
        self.task.is_some()
    }
}

fn checkpoint_log(db: &Connection) -> Result<(), HistoryError> {
    // Without TRUNCATE the log keeps its room on disk, which is what the next deletion writes into.
    db.query_row("PRAGMA wal_checkpoint(RESTART)", [], |_| Ok(())).with_activity("copying the log into the database")
}

/// Gives free pages beyond an eighth of the file back to the disk; false when there are none.
fn shrink_file(db: &Connection) -> Result<bool, HistoryError> {
    let pragma = |name: &str| {
        db.query_row(&format!("PRAGMA {name}"), [], |row| row.get::<_, u32>(0)).with_activity("measuring the database")
    };
    let (pages, free) = (pragma("page_count")?, pragma("freelist_count")?);
    if free <= pages / 8 {
        return Ok(false);
    }
    let mut statement =
        db.prepare(&format!("PRAGMA incremental_vacuum({VACUUM_PAGES})")).with_activity("shrinking the database")?;
    let mut rows = statement.query([]).with_activity("shrinking the database")?;
    while rows.next().with_activity("shrinking the database")?.is_some() {}
    Ok(pragma("freelist_count")? < free)
}
