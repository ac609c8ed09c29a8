//! Updating the program of a box, and going back by itself when the new one is not well.
//!
//! Versions lie side by side, each in a folder of its own, and one symbolic link says which of them runs:
//!
//! ```text
//! /usr/lib/cnc-gateway/versions/package/cnc-gateway     what the package brought
//! /usr/lib/cnc-gateway/versions/0.3.0/cnc-gateway       what an update brought
//! /usr/lib/cnc-gateway/current -> versions/0.3.0
//! /usr/lib/cnc-gateway/trial                            "package 0.3.0 0": before, on trial
//! /usr/lib/cnc-gateway/starts-left/1, 2, 3              one file for each start that is left to the version on trial
//! /usr/lib/cnc-gateway/way-back -> versions/package     takes the place of `current` when the trial fails
//! /usr/lib/cnc-gateway/update-key                       the key that updates are verified with
//! ```
//!
//! An update verifies the signature before it unpacks anything, writes the new version beside the old one, asks it whether it
//! accepts the configuration, notes the trial and lays the way back ready, and only then moves the link, in one step. A power cut at
//! any point leaves either the old version, or the new one on trial. What an update goes back to is always a version that was
//! confirmed, or that of the package: one that is on trial when the next update comes is put back first. The service itself confirms a version after [`WELL_FOR`] of good health
//! ([`crate`] writes the file `confirmed` in the data directory). The script `guard` of the package runs as root before every start: at the
//! fourth start of a version that nobody has confirmed it moves the link back. It only renames and removes what was laid ready, so that it
//! works on a full disk too. So a version that crashes, that hangs (the
//! watchdog ends it), or that cannot even be executed does not stay.
//!
//! | file | what |
//! |---|---|
//! | `bundle.rs` | the archive of an update: its signature, its content |
//! | `key.rs` | the key that this box verifies updates with |
//! | `slots.rs` | the versions on the disk, which one the link names, the trial |
//! | `look.rs` | which version runs and whether its page answers, as it is seen |
//! | `trial.rs` | waiting until the service has confirmed the new version, and going back otherwise |

mod bundle;
mod key;
mod look;
mod slots;
mod trial;

pub use bundle::{Bundle, read_bundle};
pub use key::{PublicKeySource, UpdateKey};
pub use look::{BoxState, PageAnswer, ServiceControl, ServiceState, SystemdService, ask_page, look_until_runs};
pub use slots::{PACKAGE_SLOT, Trial, UpdateLock, VersionSlots};
pub use trial::{CONFIRM_WITHIN, TrialOutcome, WELL_FOR, confirm_running_version, run_trial};

use std::path::PathBuf;
use thiserror::Error;

/// Where a package keeps its versions.
pub const HOME: &str = "/usr/lib/cnc-gateway";

/// Why an update was not made. What runs then is seen by [`look_until_runs`].
#[derive(Debug, Error)]
pub enum UpdateError {
    /// A file cannot be read or written.
    #[error("{path}: {error}", path = path.display())]
    File {
        /// The file that cannot be read or written.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// The public key cannot be used.
    #[error("{0} is no public key of minisign; it has the form of the file minisign.pub, or is its second line")]
    Key(String),
    /// There is no signature, or it is none.
    #[error("{path}: {reason}; whoever made the update signs it with minisign -S", path = path.display())]
    Signature {
        /// Where it was looked for.
        path: PathBuf,
        /// What is wrong with the signature.
        reason: String,
    },
    /// The signature does not belong to this file and key.
    #[error("the signature does not fit: the file was changed, or somebody else has signed it. Nothing was unpacked")]
    Refused,
    /// The archive is not one of this program.
    #[error("{path} is no update of this program: {reason}", path = path.display())]
    Content {
        /// Path of the archive as it was given.
        path: PathBuf,
        /// What is wrong with the archive.
        reason: String,
    },
    /// The new program runs on another kind of processor, or does not run at all.
    #[error("the new program does not run here: {0}")]
    DoesNotRun(String),
    /// The new program refuses the configuration in force.
    #[error("the new program does not accept the configuration: {0}")]
    Configuration(String),
    /// The version is not newer.
    #[error(
        "{new} is not newer than {confirmed}, the confirmed version of this box; --allow-older installs it all the same"
    )]
    Older {
        /// Version of the update.
        new: String,
        /// Version of the program that was confirmed last.
        confirmed: String,
    },
    /// The version is the one that an update would go back to.
    #[error("{slot} is the confirmed version of this box already, and an update goes back to it: it is not replaced")]
    InPlace {
        /// Name of the slot that holds the version.
        slot: String,
    },
    /// Another update is under way.
    #[error("another update of this box is under way; `cnc-gateway update` says of which version")]
    Busy,
    /// No key is known.
    #[error(
        "an update is installed only when its signature is verified, and this box has no key yet: --verify minisign.pub, the public key of whoever signs updates"
    )]
    NoKey,
    /// The key is not that of the first update.
    #[error(
        "updates of this box are verified with the key {kept}, not with {given}. Where whoever signs them has a new key: cnc-gateway update --change-key minisign.pub"
    )]
    OtherKey {
        /// The key that was given.
        given: String,
        /// The key that is kept.
        kept: String,
    },
    /// The box was not installed from a package.
    #[error(
        "{path} is not there: this program was not installed from a package, so it cannot exchange itself. Stop it and put the new program in its place",
        path = path.display()
    )]
    NotInstalled {
        /// The folder of versions.
        path: PathBuf,
    },
    /// The service manager does not do what it is asked.
    #[error("{0}")]
    Service(String),
}

impl UpdateError {
    fn file_error(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |error| Self::File { path, error }
    }
}
