//! Who may do what on the page: persons with roles, tokens, sessions, and an account of all of it in the audit.
//!
//! Whoever is at the box itself - who can open its data directory - needs none of this: `cnc-gateway person` makes persons,
//! `cnc-gateway arm` arms. Over the network, and on the page at the box too, whoever changes something signs in.
//!
//! | file | what |
//! |---|---|
//! | `role` | viewer, setter, armer, admin |
//! | `persons` | the file of persons, and the differences between two readings of it |
//! | `token` | made, hashed, known again |
//! | `first_token` | the token that the first start prints: once, within a day |
//! | `sessions` | who is signed in, for how long |
//! | `tries` | wrong tokens, and who has to wait |
//! | `account` | rows of the audit, and how many at most |
//! | `sign_in` | all of these together: from a name and a token to a session, from a request to a person |

mod account;
mod first_token;
mod persons;
mod role;
mod sessions;
mod sign_in;
mod token;
mod tries;

pub use persons::{
    FIRST, NAME_MAX, PERSONS_MAX, PersonDifference, PersonEntry, Persons, PersonsError, find_differences,
    permission_problem, persons_path,
};
pub use role::Role;
pub use sessions::{SessionKey, digest_cookie};
pub use sign_in::{Access, NewSession, Rules, SignInError, Urgency};

pub use token::{FirstToken, Token, TokenError, random_bytes};
pub use tries::{LOCKED_FOR, TRIES_MAX};

/// Somebody who has been recognised.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Person {
    /// Name, as in the file of persons.
    pub name: String,
    /// What he or she may do.
    pub role: Role,
}
