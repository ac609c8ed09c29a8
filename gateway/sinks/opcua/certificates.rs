//! The directory of the certificates: `own`, `trusted`, `rejected`.

use super::SinkError;
use super::server::server_error;
use opcua::crypto::{CertificateStore, X509Data};
use opcua::types::{ApplicationDescription, ApplicationType, LocalizedText, UAString};
use std::fs::Permissions;
use std::os::unix::fs::{DirBuilderExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// The box's own certificate and its key, in the directory.
pub(super) const OWN: &str = "own/cert.der";
/// The private key that belongs to [`OWN`].
pub(super) const KEY: &str = "own/private.pem";
/// Certificates of strangers that are kept for a person to look at: anybody may show as many as he likes.
const REJECTED_MAX: usize = 32;
/// The box's own certificate is valid for ten years: clients trust it by name, and nobody is there to renew it.
const VALID_DAYS: u32 = 3650;

/// Makes the directory, and at the first start the box's own certificate for an application of this URI on this host.
pub(super) fn prepare_directory(directory: &Path, uri: &str, host: &str) -> Result<(), SinkError> {
    // The private key lies in it.
    let made = std::fs::DirBuilder::new().recursive(true).mode(0o700).create(directory.join("own"));
    made.map_err(|error| server_error(format!("{} cannot be made: {error}", directory.display())))?;
    let application = ApplicationDescription {
        application_uri: UAString::from(uri),
        product_uri: UAString::from(super::PRODUCT),
        application_name: LocalizedText::new("", super::APPLICATION),
        application_type: ApplicationType::Server,
        ..ApplicationDescription::default()
    };
    let mut described = X509Data::from((application, Some(vec![host.to_owned()])));
    described.certificate_duration_days = VALID_DAYS;
    let (own, key) = (directory.join(OWN), directory.join(KEY));
    let (_, certificate, private) = CertificateStore::new_with_x509_data(
        directory,
        true,
        Some(Path::new(OWN)),
        Some(Path::new(KEY)),
        Some(described),
    );
    if certificate.is_none() || private.is_none() {
        return Err(server_error(format!("{} and {} can neither be read nor made", own.display(), key.display())));
    }
    let closed = std::fs::set_permissions(&key, Permissions::from_mode(0o600));
    closed.map_err(|error| server_error(format!("{} cannot be closed to others: {error}", key.display())))
}

/// Where the certificates of strangers are.
pub(super) fn rejected_directory(directory: &Path) -> PathBuf {
    directory.join("rejected")
}

/// Leaves the newest certificates of strangers.
pub(super) fn forget_oldest(rejected: &Path) {
    let Ok(entries) = std::fs::read_dir(rejected) else { return };
    let dated = |entry: std::fs::DirEntry| Some((entry.metadata().ok()?.modified().ok()?, entry.path()));
    let mut files: Vec<_> = entries.filter_map(Result::ok).filter_map(dated).collect();
    files.sort();
    let beyond = files.len().saturating_sub(REJECTED_MAX);
    for (_, file) in &files[..beyond] {
        // What cannot be removed is tried again.
        let _gone = std::fs::remove_file(file);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_certificate_is_made_once_and_its_key_is_closed_to_others() {
        let directory = tempfile::tempdir().expect("a directory");
        prepare_directory(directory.path(), "urn:cnc-gateway:box", "127.0.0.1").expect("made");
        let key = directory.path().join(KEY);
        let mode = std::fs::metadata(&key).expect("it is there").permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        let first = std::fs::read(directory.path().join(OWN)).expect("it is there");
        prepare_directory(directory.path(), "urn:cnc-gateway:box", "127.0.0.1").expect("read");
        assert_eq!(std::fs::read(directory.path().join(OWN)).expect("it is there"), first);
    }

    #[test]
    fn a_crowd_of_strangers_fills_no_disk() {
        let directory = tempfile::tempdir().expect("a directory");
        for index in 0..REJECTED_MAX + 5 {
            std::fs::write(directory.path().join(format!("{index}.der")), "x").expect("writable");
        }
        forget_oldest(directory.path());
        assert_eq!(std::fs::read_dir(directory.path()).expect("readable").count(), REJECTED_MAX);
    }
}
