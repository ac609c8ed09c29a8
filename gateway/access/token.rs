//! Tokens: what a person types to sign in. Made by the box, never chosen, so that none can be guessed; kept as a hash alone, so
//! that nobody can read one from the disk.
//!
//! The hash is a salted SHA-256. A slow hash protects words that people choose; 100 random bits need none, and a slow one is what a
//! flood of wrong tokens would keep the box busy with while somebody wants the machine back. Older versions wrote argon2 hashes:
//! they are still known.

use argon2::password_hash::PasswordVerifier;
use argon2::password_hash::phc::PasswordHash;
use argon2::{Algorithm, Argon2, Params, Version};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt::{self, Write};

/// No letter or digit that can be taken for another: 32 signs, 5 bits each.
const SIGNS: &[u8; 32] = b"abcdefghjkmnpqrstuvwxyz023456789";
/// 20 signs are 100 bits: at a million tries a second a search takes longer than the sun will last.
const LENGTH: usize = 20;
/// Signs in a row before a hyphen, for whoever copies it from paper.
const GROUP: usize = 4;
/// What a hash of today begins with.
const SALTED: &str = "sha256$";
/// Bytes of the salt: two hashes of one token are not alike.
const SALT: usize = 16;
/// Memory of one hash of an older version, KiB; with [`PASSES`] the least that OWASP's password storage cheat sheet (2023) names for argon2id.
const MEMORY_KIB: u32 = 19_456;
const PASSES: u32 = 2;

/// Why there is no token.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TokenError {
    /// The system gives no random numbers.
    #[error("the operating system gives no random numbers, so no token can be made")]
    NoRandomness,
}

/// A token in clear. It is shown once, and never stored.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// A new one.
    ///
    /// # Errors
    /// The system gives no random numbers.
    pub fn from_random_bytes() -> Result<Self, TokenError> {
        let bytes: [u8; LENGTH] = random_bytes()?;
        let signs: Vec<u8> = bytes.iter().map(|byte| SIGNS[usize::from(byte % 32)]).collect();
        let groups: Vec<&str> = signs.chunks(GROUP).filter_map(|group| std::str::from_utf8(group).ok()).collect();
        Ok(Self(groups.join("-")))
    }

    /// As somebody typed it: capitals, spaces and hyphens do not matter.
    #[must_use]
    pub fn from_typed_text(text: &str) -> Self {
        let meant = text.chars().filter(|sign| sign.is_ascii_alphanumeric()).take(4 * LENGTH);
        let signs: String = meant.map(|sign| sign.to_ascii_lowercase()).collect();
        let groups: Vec<&str> =
            signs.as_bytes().chunks(GROUP).filter_map(|group| std::str::from_utf8(group).ok()).collect();
        Self(groups.join("-"))
    }

    /// The text to show.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.0
    }

    /// Its hash: `sha256$SALT$DIGEST`, both in hexadecimal digits.
    ///
    /// # Errors
    /// The system gives no random numbers.
    pub fn hash(&self) -> Result<String, TokenError> {
        let salt = to_hex(&random_bytes::<SALT>()?);
        Ok(format!("{SALTED}{salt}${}", self.digest_with_salt(&salt)))
    }

    fn digest_with_salt(&self, salt: &str) -> String {
        to_hex(&Sha256::digest(format!("{salt}:{}", self.0)))
    }

    /// Is it the one that was hashed? Takes the time of a hash in any case.
    #[must_use]
    pub fn matches_hash(&self, hash: &str) -> bool {
        match hash.strip_prefix(SALTED).and_then(|rest| rest.split_once('$')) {
            Some((salt, digest)) => equals_constant_time(self.digest_with_salt(salt).as_bytes(), digest.as_bytes()),
            None => self.is_argon2(hash),
        }
    }

    /// Does a look at this hash take some hundredths of a second and 19 MB?
    #[must_use]
    pub fn is_slow(hash: &str) -> bool {
        !hash.starts_with(SALTED)
    }

    fn is_argon2(&self, hash: &str) -> bool {
        let Ok(parsed) = PasswordHash::new(hash) else { return false };
        // The cost is that of the hash; a hand-written one must not take all memory of the box.
        let modest =
            Params::try_from(&parsed).is_ok_and(|cost| cost.m_cost() <= 16 * MEMORY_KIB && cost.t_cost() <= 16);
        let params = Params::new(MEMORY_KIB, PASSES, 1, None);
        let argon2 = params.map(|params| Argon2::new(Algorithm::Argon2id, Version::V0x13, params));
        modest && argon2.is_ok_and(|argon2| argon2.verify_password(self.0.as_bytes(), &parsed).is_ok())
    }
}

/// Takes the same time wherever they differ.
fn equals_constant_time(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
}

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut hex, byte| {
        let _infallible = write!(hex, "{byte:02x}");
        hex
    })
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(..)")
    }
}

/// Bytes that nobody can foresee.
///
/// # Errors
/// The system gives none.
pub fn random_bytes<const N: usize>() -> Result<[u8; N], TokenError> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).map_err(|_| TokenError::NoRandomness)?;
    Ok(bytes)
}

/// What the entry of a person tells of such a token.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FirstToken {
    /// Until when it signs in, seconds since 1970.
    pub until_s: u64,
    /// It has signed in.
    #[serde(rename = "used")]
    pub has_signed_in: bool,
}

impl FirstToken {
    /// How long it signs in, s: a day, in which whoever sets the box up comes to it.
    pub const LASTS_S: u64 = 24 * 3600;

    /// May it sign in at this time, seconds since 1970?
    #[must_use]
    pub fn is_valid_at(&self, now_s: u64) -> bool {
        !self.has_signed_in && now_s < self.until_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_known_by_its_hash_however_it_is_typed() {
        let token = Token::from_random_bytes().expect("random");
        assert_eq!(token.text().len(), LENGTH + LENGTH / GROUP - 1);
        let hash = token.hash().expect("hashed");
        assert!(hash.starts_with("sha256$") && !hash.contains(token.text()), "{hash}");
        assert_ne!(token.hash().expect("hashed"), hash, "salted");
        let typed = token.text().to_uppercase().replace('-', " ");
        assert!(Token::from_typed_text(&typed).matches_hash(&hash));
        assert_ne!(Token::from_random_bytes().expect("random").text(), token.text());
        let mut wrong = token.text().to_owned();
        wrong.replace_range(0..1, if wrong.starts_with('a') { "b" } else { "a" });
        assert!(!Token::from_typed_text(&wrong).matches_hash(&hash));
        for no_hash in [
            "",
            "sha256$",
            "sha256$$",
            "sha256$00$00",
            "$argon2id$",
            "plain",
            "$argon2id$v=19$m=4000000,t=2,p=1$c29tZXNhbHQ$AAAA",
        ] {
            assert!(!token.matches_hash(no_hash), "{no_hash}");
        }
        assert_eq!(format!("{token:?}"), "Token(..)");
    }

    #[test]
    fn a_hash_of_an_older_version_is_known() {
        // Made by argon2-cffi 25.1.0 (the reference implementation in C) of the token abcd-efgh.
        let hash = "$argon2id$v=19$m=19456,t=2,p=1$c29tZXNhbHQxMjM0NTY3OA$8zgA40/nOzw1xtkEHG+t19TEmu860DE8kzLy9TXt254";
        assert!(
            Token::is_slow(hash)
                && Token::from_typed_text("ABCD EFGH").matches_hash(hash)
                && !Token::from_typed_text("abcd-efgi").matches_hash(hash)
        );
    }
}
