//! Tokens: what a person types to sign in. Made by the box, never chosen, so that none can be guessed; kept as an argon2 hash
//! alone, so that nobody can read one from the disk.

use argon2::password_hash::phc::PasswordHash;
use argon2::password_hash::{PasswordHasher, PasswordVerifier};
use argon2::{Algorithm, Argon2, Params, Version};
use std::fmt;

/// No letter or digit that can be taken for another: 32 signs, 5 bits each.
const SIGNS: &[u8; 32] = b"abcdefghjkmnpqrstuvwxyz023456789";
/// 20 signs are 100 bits: at a million tries a second a search takes longer than the sun will last.
const LENGTH: usize = 20;
/// Signs in a row before a hyphen, for whoever copies it from paper.
const GROUP: usize = 4;
/// Memory of one hash, KiB; with [`PASSES`] the least that OWASP's password storage cheat sheet (2023) names for argon2id.
const MEMORY_KIB: u32 = 19_456;
const PASSES: u32 = 2;

/// Why there is no token.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TokenError {
    /// The system gives no random numbers.
    #[error("the operating system gives no random numbers, so no token can be made")]
    NoRandomness,
    /// There is no memory for the hash, or what was to be hashed is no text.
    #[error("the token could not be hashed: there is too little memory")]
    NoHash,
}

/// A token in clear. It is shown once, and never stored.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// A new one.
    ///
    /// # Errors
    /// The system gives no random numbers.
    pub fn make() -> Result<Self, TokenError> {
        let bytes: [u8; LENGTH] = random()?;
        let signs: Vec<u8> = bytes.iter().map(|byte| SIGNS[usize::from(byte % 32)]).collect();
        let groups: Vec<&str> = signs.chunks(GROUP).filter_map(|group| std::str::from_utf8(group).ok()).collect();
        Ok(Self(groups.join("-")))
    }

    /// As somebody typed it: capitals, spaces and hyphens do not matter.
    #[must_use]
    pub fn typed(text: &str) -> Self {
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

    /// Its hash in the form of the PHC (`$argon2id$v=19$m=...`).
    ///
    /// # Errors
    /// Too little memory.
    pub fn hash(&self) -> Result<String, TokenError> {
        let hash: PasswordHash = argon2()?.hash_password(self.0.as_bytes()).map_err(|_| TokenError::NoHash)?;
        Ok(hash.to_string())
    }

    /// Is it the one that was hashed? Takes the time of a hash in any case.
    #[must_use]
    pub fn is(&self, hash: &str) -> bool {
        let Ok(parsed) = PasswordHash::new(hash) else { return false };
        // The cost is that of the hash; a hand-written one must not take all memory of the box.
        let modest =
            Params::try_from(&parsed).is_ok_and(|cost| cost.m_cost() <= 16 * MEMORY_KIB && cost.t_cost() <= 16);
        modest && argon2().is_ok_and(|argon2| argon2.verify_password(self.0.as_bytes(), &parsed).is_ok())
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(..)")
    }
}

fn argon2() -> Result<Argon2<'static>, TokenError> {
    let params = Params::new(MEMORY_KIB, PASSES, 1, None).map_err(|_| TokenError::NoHash)?;
    Ok(Argon2::new(Algorithm::Argon2id, Version::V0x13, params))
}

/// Bytes that nobody can foresee.
///
/// # Errors
/// The system gives none.
pub(crate) fn random<const N: usize>() -> Result<[u8; N], TokenError> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).map_err(|_| TokenError::NoRandomness)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_known_by_its_hash_however_it_is_typed() {
        let token = Token::make().expect("random");
        assert_eq!(token.text().len(), LENGTH + LENGTH / GROUP - 1);
        let hash = token.hash().expect("hashed");
        assert!(hash.starts_with("$argon2id$v=19$m=19456,t=2,p=1$") && !hash.contains(token.text()), "{hash}");
        let typed = token.text().to_uppercase().replace('-', " ");
        assert!(Token::typed(&typed).is(&hash));
        assert_ne!(Token::make().expect("random").text(), token.text());
        let mut wrong = token.text().to_owned();
        wrong.replace_range(0..1, if wrong.starts_with('a') { "b" } else { "a" });
        assert!(!Token::typed(&wrong).is(&hash));
        for no_hash in ["", "$argon2id$", "plain", "$argon2id$v=19$m=4000000,t=2,p=1$c29tZXNhbHQ$AAAA"] {
            assert!(!token.is(no_hash), "{no_hash}");
        }
        assert_eq!(format!("{token:?}"), "Token(..)");
    }
}
