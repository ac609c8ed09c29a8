//! The persons who may do more than read: a file in the data directory, readable by the user of the gateway alone.
//!
//! The file is the one truth. Whoever changes it - the page, `cnc-gateway person`, an editor - is followed within a second by
//! the running gateway, which writes every difference into the audit; see [`find_differences`].

use super::role::Role;
use super::token::{FirstToken, Token, TokenError};
use gateway_base::clock::now_ns;
use gateway_base::convert::instant_to_seconds;
use gateway_base::files;
use gateway_base::problem::StatusProblem;
use serde::{Deserialize, Serialize};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// Name of the file in the data directory.
const FILE: &str = "persons.json";
/// So many persons; more are a mistake.
pub const PERSONS_MAX: usize = 200;
/// The longest name, characters.
pub const NAME_MAX: usize = 40;
/// The longest file that is read, bytes.
const BYTES_MAX: usize = 256 * 1024;
/// Name of the person that the first start makes.
pub const FIRST: &str = "admin";

/// Somebody who is known.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PersonEntry {
    /// Name, as it stands in the audit.
    pub name: String,
    /// What he or she may do.
    pub role: Role,
    /// Hash of the token, see [`Token::hash`].
    pub token_hash: String,
    /// Who wrote the entry.
    pub by: String,
    /// The token is the one that the first start has printed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first: Option<FirstToken>,
}

/// Everybody who is known.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Persons {
    schema: String,
    persons: Vec<PersonEntry>,
}

/// Why the persons could not be read or changed.
#[derive(Debug, thiserror::Error)]
pub enum PersonsError {
    /// The file cannot be read or written.
    #[error("{0}: {1}; look at the permissions and at the room on the disk")]
    File(PathBuf, io::Error),
    /// The file holds something else.
    #[error("{0}: {1}; restore it from a backup, or remove it: the next start makes a new administrator")]
    Content(PathBuf, String),
    /// A name that cannot be used.
    #[error("{0:?} is no usable name: write 1 to 40 letters, digits, spaces, or any of . - _")]
    Name(String),
    /// The name is taken.
    #[error("there is a person named {0:?} already; choose another name, or give that one a new token")]
    Taken(String),
    /// Nobody has this name.
    #[error("there is nobody named {0:?}; `cnc-gateway person list` names everybody")]
    Nobody(String),
    /// Somebody has to be able to manage the persons.
    #[error("{0:?} is the last administrator; make another one first")]
    LastAdmin(String),
    /// The greatest number of persons is reached.
    #[error("there are {PERSONS_MAX} persons already; remove one first")]
    Full,
    /// A new token cannot be made.
    #[error(transparent)]
    Token(#[from] TokenError),
}

/// Where the persons of this data directory are kept.
#[must_use]
pub fn persons_path(data_dir: &Path) -> PathBuf {
    data_dir.join(FILE)
}

/// What is wrong with the permissions of the file of persons.
#[must_use]
pub fn permission_problem(data_dir: &Path) -> Option<StatusProblem> {
    let file = persons_path(data_dir);
    if let Err(error) = Persons::read(&file) {
        let next = format!(
            "`sudo chown --reference={} {}` where it belongs to another user; until then `cnc-gateway disarm` at the box and `POST /api/v1/disarm` give the machine back",
            data_dir.display(),
            file.display()
        );
        return Some(StatusProblem { what: format!("who may sign in cannot be read: {error}"), next });
    }
    let mode = std::fs::metadata(&file).ok()?.permissions().mode();
    let what = match mode {
        _ if mode & 0o022 != 0 => "others can change who may do what here",
        _ if mode & 0o077 != 0 => "others can read who may do what here",
        _ => return None,
    };
    let what = format!("{}: {what} (mode {:03o})", file.display(), mode & 0o777);
    let next =
        format!("`chmod 600 {}`, and compare `cnc-gateway person list` with who should be there", file.display());
    Some(StatusProblem { what, next })
}

/// The name without blanks around it, if it can be used.
///
/// # Errors
/// It cannot.
pub(super) fn usable_name(name: &str) -> Result<&str, PersonsError> {
    let name = name.trim();
    let good = |sign: char| sign.is_alphanumeric() || " .-_".contains(sign);
    match !name.is_empty() && name.chars().count() <= NAME_MAX && name.chars().all(good) {
        true => Ok(name),
        false => Err(PersonsError::Name(name.chars().take(2 * NAME_MAX).collect())),
    }
}

impl Default for Persons {
    fn default() -> Self {
        Self { schema: "persons/1".to_owned(), persons: Vec::new() }
    }
}

impl Persons {
    /// Reads the file; `None` where there is none.
    ///
    /// # Errors
    /// It cannot be read, or holds something else.
    pub fn read(path: &Path) -> Result<Option<Self>, PersonsError> {
        let text = match files::read_text(path, BYTES_MAX) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(PersonsError::File(path.to_owned(), error)),
        };
        let bad = |what: String| PersonsError::Content(path.to_owned(), what);
        let read: Self = serde_json::from_str(&text).map_err(|error| bad(error.to_string()))?;
        if read.schema != "persons/1" || read.persons.len() > PERSONS_MAX {
            return Err(bad("it is no persons/1".to_owned()));
        }
        Ok(Some(read))
    }

    /// Writes the file, durably and in one step, readable by this user alone.
    ///
    /// # Errors
    /// It cannot be written; what was there before stays.
    pub fn write(&self, path: &Path) -> Result<(), PersonsError> {
        let trouble = |error| PersonsError::File(path.to_owned(), error);
        let text = serde_json::to_string_pretty(self).map_err(|error| trouble(error.into()))?;
        files::replace_privately(path, &(text + "\n")).map_err(trouble)
    }

    /// Everybody, in the order of the file.
    #[must_use]
    pub fn list_entries(&self) -> &[PersonEntry] {
        &self.persons
    }

    /// The one of this name.
    #[must_use]
    pub fn find_by_name(&self, name: &str) -> Option<&PersonEntry> {
        self.persons.iter().find(|entry| entry.name == name)
    }

    /// Somebody new, with a new token. `by` wrote the entry.
    ///
    /// # Errors
    /// An unusable or taken name, too many persons, no token.
    pub fn add(&mut self, name: &str, role: Role, by: &str) -> Result<Token, PersonsError> {
        let name = usable_name(name)?;
        // Whoever reads the audit must not take one for the other.
        let alike = |entry: &PersonEntry| entry.name.to_lowercase() == name.to_lowercase();
        if let Some(other) = self.persons.iter().find(|entry| alike(entry)) {
            return Err(PersonsError::Taken(other.name.clone()));
        }
        if self.persons.len() >= PERSONS_MAX {
            return Err(PersonsError::Full);
        }
        let token = Token::from_random_bytes()?;
        let (name, token_hash, by) = (name.to_owned(), token.hash()?, by.to_owned());
        self.persons.push(PersonEntry { name, role, token_hash, by, first: None });
        Ok(token)
    }

    /// The administrator whom the first start makes, at this time, seconds since 1970.
    ///
    /// # Errors
    /// No token.
    pub fn add_first(&mut self, now_s: u64) -> Result<Token, PersonsError> {
        let token = self.add(FIRST, Role::Admin, "the first start")?;
        self.find_entry_mut(FIRST)?.first =
            Some(FirstToken { until_s: now_s.saturating_add(FirstToken::LASTS_S), has_signed_in: false });
        Ok(token)
    }

    /// An administrator of this name, in the place of whom the first start has made, where nobody has taken that one over. Gives the token, and
    /// whether there was such a one.
    ///
    /// # Errors
    /// As for [`Persons::add`].
    pub fn replace_first(&mut self, name: &str, by: &str) -> Result<(Token, bool), PersonsError> {
        let mut fresh = self.clone();
        fresh.persons.retain(|entry| entry.first.is_none());
        let revoked = fresh.persons.len() != self.persons.len();
        let token = fresh.add(name, Role::Admin, by)?;
        *self = fresh;
        Ok((token, revoked))
    }

    /// The token of the first start signs in; false where it has done so already.
    pub(super) fn mark_first_used(&mut self, name: &str) -> bool {
        match self.find_entry_mut(name) {
            Ok(PersonEntry { first: Some(first), .. }) => !std::mem::replace(&mut first.has_signed_in, true),
            _ => true,
        }
    }

    /// Another role.
    ///
    /// # Errors
    /// Nobody has this name, or nobody would be left who manages persons.
    pub fn give_role(&mut self, name: &str, role: Role, by: &str) -> Result<(), PersonsError> {
        self.keep_an_admin(name, role != Role::Admin)?;
        let entry = self.find_entry_mut(name)?;
        (entry.role, entry.by) = (role, by.to_owned());
        Ok(())
    }

    /// A new token in the place of the one before, which is worth nothing from now on.
    ///
    /// # Errors
    /// Nobody has this name, or there is no token.
    pub fn give_token(&mut self, name: &str, by: &str) -> Result<Token, PersonsError> {
        let token = Token::from_random_bytes()?;
        let hash = token.hash()?;
        let entry = self.find_entry_mut(name)?;
        (entry.token_hash, entry.by, entry.first) = (hash, by.to_owned(), None);
        Ok(token)
    }

    /// Without this one.
    ///
    /// # Errors
    /// Nobody has this name, or nobody would be left who manages persons.
    pub fn remove(&mut self, name: &str) -> Result<(), PersonsError> {
        self.keep_an_admin(name, true)?;
        self.find_entry_mut(name)?;
        self.persons.retain(|entry| entry.name != name);
        Ok(())
    }

    fn find_entry_mut(&mut self, name: &str) -> Result<&mut PersonEntry, PersonsError> {
        let found = self.persons.iter_mut().find(|entry| entry.name == name);
        found.ok_or_else(|| PersonsError::Nobody(name.to_owned()))
    }

    fn keep_an_admin(&self, name: &str, goes: bool) -> Result<(), PersonsError> {
        let another = self.persons.iter().any(|entry| entry.role == Role::Admin && entry.name != name);
        let is_one = self.find_by_name(name).is_some_and(|entry| entry.role == Role::Admin);
        if goes && is_one && !another { Err(PersonsError::LastAdmin(name.to_owned())) } else { Ok(()) }
    }
}

/// The persons of the file. That there is none any more is no reason to know nobody.
pub(super) fn read_persons(file: &Path) -> Result<Persons, PersonsError> {
    let gone = || PersonsError::File(file.to_owned(), std::io::ErrorKind::NotFound.into());
    Persons::read(file)?.ok_or_else(gone)
}

/// One difference between two readings of the file, for the audit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PersonDifference {
    /// `added`, `removed`, `role` or `token`.
    pub outcome: &'static str,
    /// One English sentence that names the person and what is different.
    pub text: String,
    /// Who wrote the entry; empty when nobody can be named.
    pub by: String,
}

/// Everything in which `now` differs from `before`.
#[must_use]
pub fn find_differences(before: &Persons, now: &Persons) -> Vec<PersonDifference> {
    let told = |outcome, text, entry: &PersonEntry| PersonDifference { outcome, text, by: entry.by.clone() };
    let changed = now.persons.iter().flat_map(|entry| {
        let Some(old) = before.find_by_name(&entry.name) else {
            return vec![told("added", format!("{} is {}", entry.name, entry.role), entry)];
        };
        let role = (old.role != entry.role)
            .then(|| told("role", format!("{} was {} and is {}", entry.name, old.role, entry.role), entry));
        let token = (old.token_hash != entry.token_hash)
            .then(|| told("token", format!("{} has a new token", entry.name), entry));
        role.into_iter().chain(token).collect()
    });
    let gone = before.persons.iter().filter(|old| now.find_by_name(&old.name).is_none()).map(|old| PersonDifference {
        outcome: "removed",
        text: format!("{} was {}", old.name, old.role),
        by: String::new(),
    });
    changed.chain(gone).collect()
}

/// The persons of the file. Where there is none the first administrator is made.
pub(super) fn read_or_create_persons(file: &Path) -> Result<(Persons, Option<Token>), PersonsError> {
    if let Some(persons) = Persons::read(file)? {
        return Ok((persons, None));
    }
    let mut persons = Persons::default();
    let token = persons.add_first(instant_to_seconds(now_ns()))?;
    persons.write(file)?;
    Ok((persons, Some(token)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_holds_hashes_and_belongs_to_one_user() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = persons_path(directory.path());
        assert!(Persons::read(&path).expect("readable").is_none());
        let mut persons = Persons::default();
        let token = persons.add(" 李伟 ", Role::Admin, "test").expect("added");
        persons.write(&path).expect("written");
        let text = std::fs::read_to_string(&path).expect("there");
        assert!(text.contains("李伟") && !text.contains(token.text()), "{text}");
        assert_eq!(std::fs::metadata(&path).expect("there").permissions().mode() & 0o777, 0o600);
        assert_eq!(permission_problem(directory.path()), None);
        for (mode, part) in [(0o666, "change"), (0o620, "change"), (0o644, "read"), (0o601, "read")] {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).expect("set");
            let problem = permission_problem(directory.path()).expect("told");
            assert!(problem.what.contains(part) && problem.next.contains("chmod 600"), "{problem:?}");
        }
        let read = Persons::read(&path).expect("readable").expect("there");
        assert!(token.matches_hash(&read.find_by_name("李伟").expect("known").token_hash));
        std::fs::write(&path, "{\"schema\":\"persons/1\",\"persons\":[{\"name\":\"x\"}]}").expect("written");
        assert!(Persons::read(&path).is_err_and(|error| error.to_string().contains("role")));
    }

    #[test]
    fn the_last_administrator_stays_and_every_difference_is_told() {
        let mut persons = Persons::default();
        persons.add("admin", Role::Admin, "a").expect("added");
        let before = persons.clone();
        assert!(matches!(persons.remove("admin"), Err(PersonsError::LastAdmin(_))));
        assert!(matches!(persons.give_role("admin", Role::Viewer, "a"), Err(PersonsError::LastAdmin(_))));
        for alike in ["admin", "ADMIN", " Admin "] {
            assert!(matches!(persons.add(alike, Role::Viewer, "a"), Err(PersonsError::Taken(_))), "{alike}");
        }
        assert!(matches!(persons.give_token("nobody", "a"), Err(PersonsError::Nobody(_))));
        for wrong in ["", "  ", "a:b", "a\nb", "<b>", &"x".repeat(41)] {
            assert!(matches!(persons.add(wrong, Role::Viewer, "a"), Err(PersonsError::Name(_))), "{wrong:?}");
        }
        persons.add("Li", Role::Setter, "admin").expect("added");
        persons.give_token("admin", "admin").expect("given");
        let words: Vec<&str> = find_differences(&before, &persons).iter().map(|it| it.outcome).collect();
        assert_eq!(words, ["token", "added"]);
        let added = persons.clone();
        persons.give_role("Li", Role::Viewer, "admin").expect("given");
        assert_eq!(find_differences(&added, &persons)[0].text, "Li was setter and is viewer");
        persons.remove("Li").expect("removed");
        assert_eq!(find_differences(&added, &persons)[0].outcome, "removed");
    }
}
