//! Keys that every address of a broker has: user, and the files of TLS.

use super::keys::Keys;
use crate::tls::TlsFiles;
use std::path::{Path, PathBuf};

/// User and password at a broker.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Login {
    /// The user; `None` where the broker wants none.
    pub user: Option<String>,
    /// The file whose first line is the password.
    pub password_file: Option<PathBuf>,
}

impl Login {
    /// The keys `user` and `password_file`.
    pub fn from_keys(keys: &mut Keys) -> Self {
        let login =
            Self { user: keys.take_text("user"), password_file: keys.take_text("password_file").map(PathBuf::from) };
        if login.user.is_none() && login.password_file.is_some() {
            keys.add_problem("password_file counts only with user=".to_owned());
        }
        login
    }

    /// User and password, read from the file now.
    ///
    /// # Errors
    /// The file cannot be read: which, and why.
    pub fn read(&self) -> Result<Option<(String, String)>, (PathBuf, std::io::Error)> {
        let Some(user) = &self.user else { return Ok(None) };
        let password = match &self.password_file {
            Some(file) => std::fs::read_to_string(file).map_err(|error| (file.clone(), error))?,
            None => String::new(),
        };
        Ok(Some((user.clone(), password.trim_end_matches(['\r', '\n']).to_owned())))
    }
}

/// The keys `ca`, `cert` and `key`, where the address is one of TLS; otherwise they are refused as unknown.
pub fn tls_files(keys: &mut Keys, secured: bool) -> Option<TlsFiles> {
    if !secured {
        return None;
    }
    let mut path = |key| keys.take_text(key).map(PathBuf::from);
    let files = TlsFiles { ca: path("ca"), certificate: path("cert"), key: path("key") };
    match (&files.certificate, &files.key) {
        (Some(certificate), None) => keys.add_problem(describe_missing_file("cert", certificate, "key")),
        (None, Some(key)) => keys.add_problem(describe_missing_file("key", key, "cert")),
        _ => {}
    }
    Some(files)
}

fn describe_missing_file(given: &str, file: &Path, missing: &str) -> String {
    format!("{given}={} needs {missing}=FILE beside it", file.display())
}
