//! Who is signed in. A session is a random number in a cookie; the box keeps its digest, so that nobody can read one from its
//! memory file. Time is an argument, so that the end of a session can be tried without waiting for it.

use super::token::{TokenError, random_bytes};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fmt::Write;
use std::time::{Duration, Instant};

/// So many at once; the oldest ends when another one begins.
const SESSIONS_MAX: usize = 128;
/// So many of one person; the oldest ends when another one begins.
const PER_PERSON_MAX: usize = 8;

/// The digest by which a session is found.
pub type SessionKey = [u8; 32];

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Session {
    pub(super) name: String,
    pub(super) since: Instant,
    pub(super) until: Instant,
    /// Hash of the token with which it began: a new token ends it.
    pub(super) token_hash: String,
}

#[derive(Debug, Default)]
pub(super) struct Sessions {
    by_key: HashMap<SessionKey, Session>,
}

/// The digest of what the cookie holds.
#[must_use]
pub fn digest_cookie(cookie: &str) -> SessionKey {
    Sha256::digest(cookie.as_bytes()).into()
}

impl Sessions {
    /// Begins one and gives what the cookie shall hold.
    ///
    /// # Errors
    /// The system gives no random numbers.
    pub(super) fn begin_session(
        &mut self,
        (name, token_hash): (&str, &str),
        lasts: Duration,
        now: Instant,
    ) -> Result<String, TokenError> {
        let cookie = random_bytes::<32>()?.iter().fold(String::with_capacity(64), |mut hex, byte| {
            let _infallible = write!(hex, "{byte:02x}");
            hex
        });
        self.remove_expired(now);
        self.make_room(PER_PERSON_MAX, |session| session.name == name);
        self.make_room(SESSIONS_MAX, |_| true);
        let (name, token_hash, since) = (name.to_owned(), token_hash.to_owned(), now);
        self.by_key.insert(digest_cookie(&cookie), Session { name, since, until: now + lasts, token_hash });
        Ok(cookie)
    }

    /// The session of this key, unless it has ended.
    #[must_use]
    pub(super) fn find_session(&self, key: &SessionKey, now: Instant) -> Option<&Session> {
        self.by_key.get(key).filter(|session| now < session.until)
    }

    pub(super) fn end_session(&mut self, key: &SessionKey) {
        self.by_key.remove(key);
    }

    fn remove_expired(&mut self, now: Instant) {
        self.by_key.retain(|_, session| now < session.until);
    }

    fn make_room(&mut self, most: usize, counts: impl Fn(&Session) -> bool) {
        while self.by_key.values().filter(|session| counts(session)).count() >= most {
            let oldest = self.by_key.iter().filter(|(_, it)| counts(it)).min_by_key(|(_, it)| it.since);
            let Some(oldest) = oldest.map(|(key, _)| *key) else { return };
            self.by_key.remove(&oldest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_ends_by_itself_by_order_and_for_newer_ones() {
        let (mut sessions, now) = (Sessions::default(), Instant::now());
        let hour = Duration::from_secs(3600);
        let cookie = sessions.begin_session(("Li", "hash"), hour, now).expect("random");
        assert_eq!(cookie.len(), 64);
        assert_eq!(sessions.find_session(&digest_cookie(&cookie), now).map(|it| it.name.as_str()), Some("Li"));
        assert!(sessions.find_session(&digest_cookie("another"), now).is_none());
        assert!(sessions.find_session(&digest_cookie(&cookie), now + hour).is_none(), "its time is over");
        sessions.end_session(&digest_cookie(&cookie));
        assert!(sessions.find_session(&digest_cookie(&cookie), now).is_none());
        let later = |n: u32| now + Duration::from_millis(n.into());
        let first = sessions.begin_session(("Li", "hash"), hour, later(1)).expect("random");
        for n in 2..=PER_PERSON_MAX as u32 + 1 {
            sessions.begin_session(("Li", "hash"), hour, later(n)).expect("random");
        }
        assert!(
            sessions.find_session(&digest_cookie(&first), later(99)).is_none(),
            "nine of one person are one too many"
        );
        for n in 0..1000 {
            sessions.begin_session((&format!("p{n}"), "hash"), hour, later(100 + n)).expect("random");
        }
        assert_eq!(sessions.by_key.len(), SESSIONS_MAX);
    }
}
