//! Keys by which an address says who signs in.

use super::keys::Keys;
use std::path::PathBuf;

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
