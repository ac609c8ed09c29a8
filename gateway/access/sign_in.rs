//! From a name and a token to a session, and from a request to a person.

use super::account::Account;
use super::persons::{NAME_MAX, Persons, PersonsError, find_differences, read_or_create_persons, read_persons};
use super::sessions::{SessionKey, Sessions, digest_cookie};
use super::token::{FirstToken, Token};
use super::tries::Tries;
use super::{Person, Role};
use gateway_base::files::{Mark, read_mark};
use gateway_base::log::{Notice, Severity};
use gateway_control::OrderSender;
use std::collections::HashMap;
use std::net::IpAddr;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::Semaphore;

/// A token that came with a request is not hashed again for so long.
const BEARER_KEPT: Duration = Duration::from_secs(300);
/// So many such tokens.
const BEARERS_MAX: usize = 64;
/// Whoever waits for a hash for longer is told that the box is busy.
const HASH_WITHIN: Duration = Duration::from_secs(5);

/// What the configuration says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rules {
    /// Reading needs a person too.
    pub tokens_always: bool,
    /// Whoever has signed in is signed out after this time.
    pub session: Duration,
    /// The gate may be armed from the page.
    pub allow_arming: bool,
}

/// May somebody be made to wait?
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Urgency {
    /// Yes, after too many wrong tokens.
    Waits,
    /// No: with the right token a person gives the machine back to its dial, whatever others have tried from there.
    GivesBack,
}

/// Why somebody could not sign in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SignInError {
    /// Name or token is wrong; so many tries are left.
    Wrong(u32),
    /// Too many wrong tokens; so long nothing is tried.
    Wait(Duration),
    /// The box is busy, or has no memory.
    Busy,
    /// The token of the first start has signed in once, its time is over, or it came with a request instead of the form.
    FirstToken,
    /// Who may sign in cannot be read, for this reason.
    Unreadable(String),
}

/// A session that has begun.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewSession {
    /// What the cookie shall hold.
    pub cookie: String,
    /// Whom the cookie stands for, with the role.
    pub person: Person,
}

#[derive(Debug)]
struct CachedPersons {
    mark: Mark,
    persons: Persons,
    /// Why the file cannot be read; `persons` are those who were known before then, after a start nobody.
    trouble: Option<String>,
}

#[derive(Debug)]
struct Bearer {
    name: String,
    token_hash: String,
    until: Instant,
}

/// Who may do what: persons, sessions and tries, shared by all requests.
#[derive(Debug)]
pub struct Access {
    rules: Rules,
    file: PathBuf,
    known: Mutex<CachedPersons>,
    sessions: Mutex<Sessions>,
    tries: Mutex<Tries>,
    bearers: Mutex<HashMap<SessionKey, Bearer>>,
    /// One change of the file at a time.
    changing: tokio::sync::Mutex<()>,
    /// One slow hash of an older version at a time: it takes 19 MB and some hundredths of a second. Whoever gives the machine
    /// back does not wait for others.
    hashing: [Semaphore; 2],
    account: Account,
    /// What a name that nobody has is compared with, so that it takes as long as one that somebody has.
    nobody: String,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What is behind these locks is complete whenever they are free.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Access {
    /// Reads the persons of `file`; where there is none the first administrator is made, and the token is given to be shown
    /// once.
    #[must_use]
    pub fn open(file: PathBuf, rules: Rules, orders: OrderSender) -> (Self, Option<Token>) {
        let (persons, first, trouble) = match read_or_create_persons(&file) {
            Ok((persons, first)) => (persons, first, None),
            Err(error) => {
                let text = format!("nobody can sign in on the page: {error}");
                Notice::new(Severity::Error, "no_persons", text).write_to_logs();
                (Persons::default(), None, Some(error.to_string()))
            }
        };
        let nobody = persons.list_entries().first().map(|entry| entry.token_hash.clone()).unwrap_or_default();
        let known = Mutex::new(CachedPersons { mark: read_mark(&file), persons, trouble });
        let access = Self {
            rules,
            file,
            known,
            sessions: Mutex::default(),
            tries: Mutex::default(),
            bearers: Mutex::default(),
            changing: tokio::sync::Mutex::default(),
            hashing: [Semaphore::new(1), Semaphore::new(1)],
            account: Account::new(orders),
            nobody,
        };
        (access, first)
    }

    /// What the configuration says.
    #[must_use]
    pub fn rules(&self) -> &Rules {
        &self.rules
    }

    /// Everybody, as last read.
    #[must_use]
    pub fn persons(&self) -> Persons {
        lock(&self.known).persons.clone()
    }

    /// Why the file of persons cannot be read, where that is so.
    #[must_use]
    pub fn trouble(&self) -> Option<String> {
        lock(&self.known).trouble.clone()
    }

    /// Who gives the machine back while the file of persons cannot be read: nobody can be recognised then, and that must not keep an override
    /// in force. `None` where the file can be read.
    #[must_use]
    pub fn find_stand_in(&self, name: &str) -> Option<Person> {
        self.trouble()?;
        let name: String = name.trim().chars().filter(|sign| !sign.is_control()).take(NAME_MAX).collect();
        let name = if name.is_empty() { "somebody".to_owned() } else { name };
        Some(Person { name: format!("{name} (not verified: the persons cannot be read)"), role: Role::Viewer })
    }

    /// Is there still a person of this name?
    #[must_use]
    pub fn has_person(&self, name: &str) -> bool {
        lock(&self.known).persons.find_by_name(name).is_some()
    }

    /// Writes into the audit who the persons are, for whoever compares it with the last end.
    pub async fn tell_persons(&self) {
        let persons = self.persons();
        let words: Vec<String> = persons.list_entries().iter().map(|it| format!("{}: {}", it.name, it.role)).collect();
        self.account.append_row("persons", "known", &words.join(", "), "").await;
    }

    /// Reads the file again if it has changed, and accounts for every difference.
    pub async fn reload_if_changed(&self) {
        let now = read_mark(&self.file);
        {
            let known = lock(&self.known);
            // Permissions change no mark: a file that could not be read is tried again.
            if known.mark == now && known.trouble.is_none() {
                return;
            }
        }
        let read = match read_persons(&self.file) {
            Ok(read) => read,
            Err(error) => {
                let trouble = Some(error.to_string());
                let mut known = lock(&self.known);
                known.mark = now;
                if std::mem::replace(&mut known.trouble, trouble.clone()) == trouble {
                    return;
                }
                let text = format!("{error}. Those who were known before still are");
                return Notice::new(Severity::Error, "persons_refused", text).write_to_logs();
            }
        };
        let before = {
            let mut known = lock(&self.known);
            known.mark = now;
            known.trouble = None;
            std::mem::replace(&mut known.persons, read.clone())
        };
        for difference in find_differences(&before, &read) {
            self.account.append_row("persons", difference.outcome, &difference.text, &difference.by).await;
        }
    }

    /// Changes the file, then follows it.
    ///
    /// # Errors
    /// What `change` says, or the file cannot be read or written.
    pub async fn change_persons<T>(
        &self,
        change: impl FnOnce(&mut Persons) -> Result<T, PersonsError>,
    ) -> Result<T, PersonsError> {
        let _alone = self.changing.lock().await;
        let mut persons = read_persons(&self.file)?;
        let given = change(&mut persons)?;
        persons.write(&self.file)?;
        self.reload_if_changed().await;
        Ok(given)
    }

    /// Begins a session.
    ///
    /// # Errors
    /// Wrong name or token, too many tries, a busy box.
    pub async fn sign_in(&self, name: &str, token: &Token, from: IpAddr) -> Result<NewSession, SignInError> {
        self.reload_if_changed().await;
        let person = self.check_token(name, token, from, "login", Urgency::Waits).await?;
        self.check_first_token(&person.name, from, true)?;
        self.spend_first_token(&person.name).await?;
        let hash = self.hash_of(&person.name).unwrap_or_default();
        let begun = lock(&self.sessions).begin_session((&person.name, &hash), self.rules.session, Instant::now());
        let cookie = begun.map_err(|_| SignInError::Busy)?;
        self.account.append_row("login", "done", &format!("{} from {from}", person.role), &person.name).await;
        Ok(NewSession { cookie, person })
    }

    /// Is this the token of this name? Wrong ones are counted and accounted for as `kind`. Too many of them make an address wait,
    /// unless it is urgent.
    ///
    /// # Errors
    /// Wrong name or token, too many tries, a busy box.
    pub async fn check_token(
        &self,
        name: &str,
        token: &Token,
        from: IpAddr,
        kind: &str,
        urgency: Urgency,
    ) -> Result<Person, SignInError> {
        let name = name.trim();
        let wait = lock(&self.tries).remaining_wait(from, name, Instant::now()).filter(|_| urgency == Urgency::Waits);
        if let Some(wait) = wait {
            self.account.record_refusal(
                kind,
                &format!("from {from}: waits after too many wrong tokens"),
                name,
                Instant::now(),
            );
            return Err(SignInError::Wait(wait));
        }
        let entry = lock(&self.known).persons.find_by_name(name).cloned();
        let hash = entry.as_ref().map_or(&self.nobody, |entry| &entry.token_hash).clone();
        let right = self.compare_hash(token, hash, urgency).await?;
        match entry.filter(|_| right) {
            Some(entry) => {
                lock(&self.tries).clear_failures(from, name);
                Ok(Person { name: entry.name, role: entry.role })
            }
            None => {
                if let Some(trouble) = self.trouble() {
                    self.account.record_refusal(kind, &format!("from {from}: {trouble}"), name, Instant::now());
                    let person = self.find_stand_in(name).filter(|_| urgency == Urgency::GivesBack);
                    return person.ok_or(SignInError::Unreadable(trouble));
                }
                let left = lock(&self.tries).record_failure(from, name, Instant::now());
                let wait = if left == 0 { "; it has to wait now" } else { "" };
                let text = format!("from {from}: wrong name or token{wait}");
                self.account.record_refusal(kind, &text, name, Instant::now());
                Err(SignInError::Wrong(left))
            }
        }
    }

    /// What is told of the token of this person, where it is that of the first start.
    pub(super) fn first_token_of(&self, name: &str) -> Option<FirstToken> {
        lock(&self.known).persons.find_by_name(name).and_then(|entry| entry.first)
    }

    /// Is it the token of this hash? Only a hash of an older version takes time.
    async fn compare_hash(&self, token: &Token, hash: String, urgency: Urgency) -> Result<bool, SignInError> {
        if !Token::is_slow(&hash) {
            return Ok(token.matches_hash(&hash));
        }
        let lane = &self.hashing[usize::from(urgency == Urgency::GivesBack)];
        let place = tokio::time::timeout(HASH_WITHIN, lane.acquire()).await;
        let Ok(Ok(_place)) = place else { return Err(SignInError::Busy) };
        let token = token.clone();
        tokio::task::spawn_blocking(move || token.matches_hash(&hash)).await.map_err(|_| SignInError::Busy)
    }

    /// Who holds this cookie.
    #[must_use]
    pub fn of_cookie(&self, cookie: &str) -> Option<(Person, Instant)> {
        self.of_key(&digest_cookie(cookie))
    }

    /// The same by its digest: what a stream keeps to see when its session has ended.
    #[must_use]
    pub fn of_key(&self, key: &SessionKey) -> Option<(Person, Instant)> {
        let sessions = lock(&self.sessions);
        let session = sessions.find_session(key, Instant::now())?;
        let known = lock(&self.known);
        let entry = known.persons.find_by_name(&session.name).filter(|entry| entry.token_hash == session.token_hash)?;
        Some((Person { name: entry.name.clone(), role: entry.role }, session.until))
    }

    /// Who gave name and token with the request itself, as `NAME:TOKEN`.
    ///
    /// # Errors
    /// Wrong name or token, too many tries, a busy box.
    pub async fn of_bearer(&self, given: &str, from: IpAddr, urgency: Urgency) -> Result<Person, SignInError> {
        let digest = digest_cookie(given);
        if let Some(person) = self.kept_bearer(&digest) {
            return Ok(person);
        }
        let (name, token) = given.split_once(':').unwrap_or((given, ""));
        self.reload_if_changed().await;
        let person = self.check_token(name, &Token::from_typed_text(token), from, "login", urgency).await?;
        // Whoever gives the machine back needs no more than the right token.
        if urgency == Urgency::Waits {
            self.check_first_token(&person.name, from, false)?;
        }
        // Neither the token of the first start nor somebody who was not verified is remembered.
        let lasting = self.hash_of(&person.name).filter(|_| self.first_token_of(&person.name).is_none());
        let Some(token_hash) = lasting else { return Ok(person) };
        let (name, until) = (person.name.clone(), Instant::now() + BEARER_KEPT);
        let mut bearers = lock(&self.bearers);
        bearers.retain(|_, bearer| Instant::now() < bearer.until);
        if bearers.len() < BEARERS_MAX {
            bearers.insert(digest, Bearer { name, token_hash, until });
        }
        Ok(person)
    }

    fn kept_bearer(&self, digest: &SessionKey) -> Option<Person> {
        let bearers = lock(&self.bearers);
        let bearer = bearers.get(digest).filter(|bearer| Instant::now() < bearer.until)?;
        let known = lock(&self.known);
        let entry = known.persons.find_by_name(&bearer.name).filter(|entry| entry.token_hash == bearer.token_hash)?;
        Some(Person { name: entry.name.clone(), role: entry.role })
    }

    fn hash_of(&self, name: &str) -> Option<String> {
        lock(&self.known).persons.find_by_name(name).map(|entry| entry.token_hash.clone())
    }

    /// Ends the session of this cookie and writes a row of the audit; an unknown cookie changes nothing.
    pub async fn sign_out(&self, cookie: &str, from: IpAddr) {
        if let Some((person, _)) = self.of_cookie(cookie) {
            lock(&self.sessions).end_session(&digest_cookie(cookie));
            self.account.append_row("logout", "done", &format!("from {from}"), &person.name).await;
        }
    }

    pub(super) fn record_refusal_of(&self, kind: &str, reason: &str, name: &str) {
        self.account.record_refusal(kind, reason, name, Instant::now());
    }

    /// A request was refused.
    pub fn record_refusal(&self, reason: &str, person: Option<&Person>) {
        self.record_refusal_of("request_refused", reason, person.map_or("", |person| &person.name));
    }

    /// A request that changes something was answered; false when that will not be stored.
    pub async fn record_change(&self, outcome: &str, reason: &str, person: &Person) -> bool {
        self.account.append_row("change", outcome, reason, &person.name).await
    }
}
