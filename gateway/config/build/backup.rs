//! `[backup]`: backups that the box takes by itself.

use super::{find_flag, find_number, find_text};
use crate::BackupConfig;
use crate::read::{ConfigInput, Origin};
use std::path::Path;
use std::time::Duration;

const SECTION: &str = "backup";

/// `Some(None)` without a directory; `None` where a value is missing.
#[expect(
    clippy::option_option,
    reason = "the outer one is a value that is wrong, the inner one is a section that is not used"
)]
pub(super) fn read_backup(reading: &ConfigInput<'_>, base: &Path) -> Option<Option<BackupConfig>> {
    let (every_h, keep) = (find_number(reading, SECTION, "every_h")?, find_number(reading, SECTION, "keep")?);
    let history = find_flag(reading, SECTION, "history")?;
    let Some(directory) = find_text(reading, SECTION, "directory") else { return Some(None) };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the table holds its range")]
    let keep = keep as usize;
    Some(Some(BackupConfig {
        directory: base.join(directory),
        every: Duration::from_secs_f64(every_h * 3600.0),
        keep,
        history,
    }))
}

pub(super) fn check_backup(reading: &mut ConfigInput<'_>) {
    let Some(keep) = find_number(reading, SECTION, "keep").filter(|keep| keep.fract() != 0.0) else { return };
    let origin = reading.get(SECTION, "keep").map_or(Origin::Default, |found| found.origin.clone());
    reading.add_problem(&origin, format!("`keep = {keep}` is no whole number"), "write 7, 14, ...");
}
