//! Why there is no backup, and why one does not come back.

use gateway_history::HistoryError;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why there is no backup.
#[derive(Debug, Error)]
pub enum BackupError {
    /// The directory is not there: a stick that was taken out, a share that is not mounted.
    #[error("{} is not there; put the stick in, mount the share, or change `directory` under [backup]", .0.display())]
    Directory(PathBuf),
    /// A file cannot be written or read.
    #[error("{}: {error}", path.display())]
    File {
        /// The file or directory that was written or read.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// What was written does not come back.
    #[error("the backup was written and could not be restored into a scratch folder: {0}")]
    NotRestorable(RestoreError),
    /// What was written cannot be unpacked.
    #[error("the backup was written and could not be restored into a scratch folder: {0}")]
    NotUnpacked(std::io::Error),
    /// The target neither takes the backup nor refuses it.
    #[error(
        "{} has not answered for {after_s} s: it hangs. Unmount it (umount -l) and mount it again, or start the box anew without it",
        directory.display()
    )]
    Hangs {
        /// The directory that backups go to.
        directory: PathBuf,
        /// How long it was waited for, s.
        after_s: u64,
    },
    /// The thread that takes the backup has ended without a word.
    #[error("the backup to {} broke off; a report lies in `crashes` of the data directory", .0.display())]
    BrokeOff(PathBuf),
    /// The history cannot be copied, or its wear models cannot be read.
    #[error("the history cannot be copied: {0}")]
    History(#[from] HistoryError),
}

/// What became of the files that had taken their places when a later one could not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PutBack {
    /// So many, and all of them are as they were before.
    All(usize),
    /// These are still as the backup has them.
    AllBut(Vec<PathBuf>),
}

impl std::fmt::Display for PutBack {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::All(0) => f.write_str("nothing was changed"),
            Self::All(count) => write!(f, "{count} files that had been replaced were put back: all is as it was"),
            Self::AllBut(paths) => {
                let names: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
                write!(f, "these could not be put back and are now as the backup has them: {}", names.join(", "))
            }
        }
    }
}

/// Why a backup does not come back.
#[derive(Debug, Error)]
pub enum RestoreError {
    /// There is nothing in it that this box has a place for.
    #[error(
        "the archive holds nothing that this box has a place for: no script, recipe, model or file of a data directory"
    )]
    Empty,
    /// A file that must be text.
    #[error("{name} is no text")]
    NoText {
        /// Its name in the archive.
        name: String,
    },
    /// A name that would lead elsewhere than to the scripts.
    #[error("{name:?} is no name of a script")]
    NoScript {
        /// The name in the archive.
        name: String,
    },
    /// A file of the data directory that no backup holds.
    #[error("{name:?} is no file of a backup")]
    NotOfBackup {
        /// The name in the archive.
        name: String,
    },
    /// A wear model that is none.
    #[error("{name}: {what}")]
    WearModel {
        /// Its name in the archive.
        name: String,
        /// What is wrong with it.
        what: String,
    },
    /// The law of the thermal error is none, or that of another machine.
    #[error("the thermal model {0}")]
    ThermalModel(String),
    /// What was learned has been changed since it was written.
    #[error("{name} is not as it was written: no JSON, or another checksum")]
    Changed {
        /// Its name in the archive.
        name: String,
    },
    /// Scripts, settings, recipe or model that this version does not take; every problem on a line of its own.
    #[error("{0}")]
    Refused(String),
    /// What is there now could not be kept. Nothing was changed.
    #[error("what is there now could not be kept: {0}")]
    NotKept(std::io::Error),
    /// A file could not be written.
    #[error("{}: {error}", path.display())]
    File {
        /// Which, or the directory that it is in.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// The wear models could not be read or stored.
    #[error("the wear models: {0}")]
    WearModels(#[from] HistoryError),
    /// The number of this box cannot be read.
    #[error("{0}")]
    Origin(Box<BackupError>),
    /// The archive is of another box, and nobody has said that this is meant.
    #[error(
        "the archive is {of}, and this box is {here}: scripts, settings and what was learned there would come into force here"
    )]
    OtherBox {
        /// Which box the archive is of, in words.
        of: String,
        /// This box, in words.
        here: String,
    },
    /// It broke off while files took their places.
    #[error("{error}; {put_back}")]
    BrokeOff {
        /// What could not be done.
        error: Box<RestoreError>,
        /// What is there now.
        put_back: PutBack,
    },
}

impl RestoreError {
    /// Adds the path to what the system says.
    pub(super) fn of_file(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        move |error| Self::File { path: path.to_owned(), error }
    }

    /// What is so after it: only what broke off half-way can have changed something, and says so itself.
    #[must_use]
    pub fn describe_state(&self) -> &'static str {
        match self {
            Self::BrokeOff { .. } => "",
            Self::OtherBox { .. } => "nothing was changed; where that is meant, say so: --from-another-box",
            _ => "nothing was changed",
        }
    }
}
