//! The table of routes: one row per method and path, with what a request needs before it is answered.
//!
//! The router, the description of the API and the tests are all made from these rows, so that none of them can know a route
//! that the others do not. There is no way to write a row that changes something and needs no role: [`Route::post`],
//! [`Route::put`] and [`Route::delete`] ask for one, and the guard answers a row of [`Route::read`] to `GET` and `HEAD`
//! alone, whatever handler it was given.

use super::ServerState;
use axum::http::Method;
use axum::routing::MethodRouter;
use gateway_access::{Role, Urgency};

/// The method of a route.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Verb {
    /// `GET`: reads and changes nothing.
    Get,
    /// `POST`: does something once for each request.
    Post,
    /// Puts something in the place of what was there.
    Put,
    /// `DELETE`: removes what is at the path.
    Delete,
}

impl Verb {
    /// The word on the wire.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Get => "GET",
            Self::Post => "POST",
            Self::Put => "PUT",
            Self::Delete => "DELETE",
        }
    }

    /// Is this the method of the request? `HEAD` is a `GET` without its body.
    #[must_use]
    pub fn matches_method(self, method: &Method) -> bool {
        method.as_str() == self.word() || (self == Self::Get && *method == Method::HEAD)
    }
}

/// What a request needs before it is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needs {
    /// Nothing: the files of the page, the health of the box, signing in.
    Nothing,
    /// Nothing where `tokens = "changes"`; a person of any role where `tokens = "always"`.
    Reading,
    /// A person of at least this role.
    Role(Role),
}

/// Where the body of a request is when its handler is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BodyPlace {
    /// In the request.
    Memory,
    /// In a file of the folder of files, which stands in the extensions of the request.
    File,
}

/// What answers at a path.
type Answers = fn() -> MethodRouter<ServerState>;

/// A row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Route {
    verb: Verb,
    path: &'static str,
    needs: Needs,
    body_max: usize,
    body_place: BodyPlace,
    answers: Answers,
    urgency: Urgency,
}

impl Route {
    const fn new(verb: Verb, path: &'static str, needs: Needs, body_max: usize, answers: Answers) -> Self {
        Self { verb, path, needs, body_max, body_place: BodyPlace::Memory, answers, urgency: Urgency::Waits }
    }

    /// `GET` that shows something of the machine or the box.
    #[must_use]
    pub const fn read(path: &'static str, answers: Answers) -> Self {
        Self::new(Verb::Get, path, Needs::Reading, 0, answers)
    }

    /// `GET` that shows something to persons of this role only.
    #[must_use]
    pub const fn read_by(role: Role, path: &'static str, answers: Answers) -> Self {
        Self::new(Verb::Get, path, Needs::Role(role), 0, answers)
    }

    /// `GET` of something that says nothing of the machine: a file of the page, the health of the box.
    #[must_use]
    pub const fn for_file(path: &'static str, answers: Answers) -> Self {
        Self::new(Verb::Get, path, Needs::Nothing, 0, answers)
    }

    /// `POST` by a person of at least this role, with a body of at most so many bytes.
    #[must_use]
    pub const fn post(role: Role, path: &'static str, body_max: usize, answers: Answers) -> Self {
        Self::new(Verb::Post, path, Needs::Role(role), body_max, answers)
    }

    /// `PUT` by a person of at least this role, with a body of at most so many bytes.
    #[must_use]
    pub const fn put(role: Role, path: &'static str, body_max: usize, answers: Answers) -> Self {
        Self::new(Verb::Put, path, Needs::Role(role), body_max, answers)
    }

    /// `DELETE` by a person of at least this role, with a body of at most so many bytes.
    #[must_use]
    pub const fn delete(role: Role, path: &'static str, body_max: usize, answers: Answers) -> Self {
        Self::new(Verb::Delete, path, Needs::Role(role), body_max, answers)
    }

    /// The one `POST` that nobody can be signed in for: signing in itself.
    pub(super) const fn sign_in(path: &'static str, body_max: usize, answers: Answers) -> Self {
        Self::new(Verb::Post, path, Needs::Nothing, body_max, answers)
    }

    /// The same for whoever gives the machine back to its dial: nobody is made to wait.
    #[must_use]
    pub const fn gives_back(self) -> Self {
        Self { urgency: Urgency::GivesBack, ..self }
    }

    /// The same with a body that is too long for the memory.
    pub(super) const fn with_body_in_file(self) -> Self {
        Self { body_place: BodyPlace::File, ..self }
    }

    /// Where its handler finds the body.
    pub(super) const fn body_place(&self) -> BodyPlace {
        self.body_place
    }

    /// May whoever asks be made to wait?
    #[must_use]
    pub const fn urgency(&self) -> Urgency {
        self.urgency
    }

    /// Method of the requests that it answers.
    #[must_use]
    pub const fn verb(&self) -> Verb {
        self.verb
    }

    /// The path, with `{name}` for a part that varies.
    #[must_use]
    pub const fn path(&self) -> &'static str {
        self.path
    }

    /// What a request needs.
    #[must_use]
    pub const fn needs(&self) -> Needs {
        self.needs
    }

    /// The longest body that is read, bytes.
    #[must_use]
    pub const fn body_max(&self) -> usize {
        self.body_max
    }

    /// Does it change something?
    #[must_use]
    pub const fn changes_state(&self) -> bool {
        !matches!(self.verb, Verb::Get)
    }

    pub(super) fn method_router(&self) -> MethodRouter<ServerState> {
        (self.answers)()
    }
}
